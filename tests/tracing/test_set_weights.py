"""Weights of the sets that a search leaves, on rounds whose costs are stated."""

import math
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import pytest

from airtruth.effects.increment import Shape, increment
from airtruth.effects.registry import EFFECTS
from airtruth.tracing.selection.learn import chosen
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.rounds import Rival
from airtruth.tracing.selection.weights import alike_in_rivals, rival_of, weights, with_rival


def null(*names, spread=None, z=100.0):
    """What a weight reads of a fit; each size is ``z`` standard deviations."""
    effects = [SimpleNamespace(name=name, label=name, key=name) for name in names]
    return SimpleNamespace(
        hypothesis=SimpleNamespace(spread=spread, effects=effects, span=lambda key: slice(0, 1)),
        point=SimpleNamespace(sizes=[z] * len(names) or [z]),
        size_std=lambda number: 1.0,
        cost=0.0,
    )


NO_SCORES = SimpleNamespace(scores=())


def candidate(name, gain, *reasons, converged=True):
    return SimpleNamespace(
        score=SimpleNamespace(effect=SimpleNamespace(name=name, label=name, key=name)),
        fit=SimpleNamespace(converged=converged, shortfall=1.0),
        gain=gain,
        reasons=reasons,
    )


def tied(z=100.0, outdone=(), **gains):
    """A round that accepted the first of these effects; the others tied with it."""
    leading = [candidate(name, gain) for name, gain in gains.items()]
    return SimpleNamespace(
        candidates=[*leading, *outdone],
        tied=leading,
        release=None,
        rival=None,
        null=null(z=z),
        sets=(),
        exchanged=(),
        table=NO_SCORES,
    )


def released(rival=None, carried=(), spread=None, **costs):
    """A round whose released derivatives have these explanations, the first that of the answer."""
    sets = [SimpleNamespace(effects=(name,), cost=cost) for name, cost in costs.items()]
    return SimpleNamespace(
        candidates=[],
        tied=[],
        release=SimpleNamespace(sets=sets, cost=sets[0].cost),
        rival=rival,
        null=null(*carried, spread=spread),
        sets=(),
        exchanged=(),
        table=NO_SCORES,
    )


def test_ties_weigh_by_half_their_difference_in_2_log_l():
    found = weights([tied(vane_arm=60.0, vane_lag=58.0), tied(gyro_lag=40.0)])
    assert found == pytest.approx(
        {
            ("gyro_lag", "vane_arm"): 1.0,
            ("gyro_lag", "vane_lag"): math.exp(-1.0),
            ("vane_arm",): math.exp(5.0 - 20.0),
            ("gyro_lag",): math.exp(5.0 - 30.0),
        },
        rel=1e-12,
        abs=0.0,
    )


def test_an_outdone_effect_has_the_weight_of_its_gain():
    """8 behind in 2 log L; not so where it fails a test, has not converged, or is within the ties that are listed already."""
    outdone = (
        candidate("accelerometer_delay", 52.0, Refusal.OUTDONE),
        candidate("gyro_lag", 52.0, Refusal.OUTDONE, Refusal.IMMATERIAL),
        candidate("gyro_scale", 52.0, Refusal.OUTDONE, converged=False),
        candidate("vane_scale", 56.0, Refusal.OUTDONE),
    )
    found = weights([tied(accelerometer_lag=60.0, outdone=outdone)])
    assert found == pytest.approx(
        {("accelerometer_lag",): 1.0, ("accelerometer_delay",): math.exp(-4.0)}, rel=1e-12
    )


def test_an_effect_that_a_later_round_accepts_is_no_rival_of_an_earlier_one():
    """It was outdone by 7 in 2 log L and then accepted beside the leader; neither explains the records alone."""
    found = weights(
        [tied(vane_arm=60.0, outdone=[candidate("gyro_lag", 53.0, Refusal.OUTDONE)]), tied(gyro_lag=50.0)]
    )
    assert found == pytest.approx(
        {
            ("gyro_lag", "vane_arm"): 1.0,
            ("vane_arm",): math.exp(5.0 - 25.0),
            ("gyro_lag",): math.exp(5.0 - 30.0),
        },
        rel=1e-12,
    )


def test_an_increment_is_absent_by_its_evidence_and_not_by_its_first_bend():
    """Its lowest bend is 0.3 standard deviations."""
    effect = increment(Shape("Cm", "alpha", 0.0, 0.2, 4, 0.05))
    learned = tied(z=0.3, increment=80.0)
    learned.tied[0].score.effect = effect
    found = weights([tied(vane_arm=60.0), learned])
    assert found[("vane_arm",)] == pytest.approx(math.exp(5.0 - 40.0))


def test_an_effect_of_little_evidence_may_be_absent():
    """Prior odds of 3 and Occam's factor of 2 in log L stand against half the square of a size of four standard deviations.

    The gain of 30 in 2 log L of its own round says no more.
    """
    found = weights([tied(vane_arm=60.0), tied(gyro_lag=30.0, z=4.0)])
    assert found[("vane_arm",)] == pytest.approx(math.exp(5.0 - 8.0))
    assert () not in weights([tied(gyro_lag=30.0, z=4.0)])


def test_beside_an_effect_the_declared_derivatives_may_be_right():
    """The null costs 12 against 5 for the best explanation, whose cost contains one for its parameter."""
    one = released(inertia_error=5.0)
    one.null.cost = 12.0
    found = weights([tied(gyro_lag=40.0), one])
    assert found[("gyro_lag", "inertia_error")] == pytest.approx(1.0)
    assert found[("gyro_lag",)] == pytest.approx(math.exp(4.0 - 7.0))


def test_explanations_weigh_by_their_cost():
    found = weights([released(derivatives=5.0, icing=6.5)])
    assert found == pytest.approx({("derivatives",): 1.0, ("icing",): math.exp(-1.5)})


def test_a_branch_that_lost_keeps_every_set_that_it_leaves():
    """Released derivatives win by 2; the branch that lost has a leader and an effect that tied with it, 3 behind in 2 log L."""
    lost = [tied(cl_alpha_nonlinear=30.0, airspeed_scale=27.0)]
    rounds = [released(rival_of(lost, 2.0), derivatives=5.0, icing=5.5)]
    found = weights(rounds)
    assert found[("cl_alpha_nonlinear",)] == pytest.approx(math.exp(-2.0))
    assert found[("airspeed_scale",)] == pytest.approx(math.exp(-3.5))
    # within 6 in 2 log L
    assert alike_in_rivals(rounds, "derivatives", ["derivatives"]) == {"cl_alpha_nonlinear"}
    assert alike_in_rivals(rounds, "derivatives", ["derivatives", "gyro_lag"]) == set()


def test_a_branch_of_less_cost_and_more_effects_weighs_no_more_than_the_answer():
    rounds = [released(rival_of([tied(vane_lag=9.0), tied(vane_scale=8.0)], -1.0), derivatives=5.0)]
    assert weights(rounds)[("vane_lag", "vane_scale")] == pytest.approx(1.0)
    assert alike_in_rivals(rounds, "derivatives", ["derivatives", "vane_lag"]) == {"vane_scale"}


def test_effects_that_explained_an_earlier_release_are_in_every_set():
    """A changed loading, and beside it derivatives whose declaration is wrong as well."""
    carried = ("cg_shift", "mass_error")
    found = weights([released(carried=carried, spread=1.0, derivatives=5.0, icing=6.0)])
    assert found == pytest.approx(
        {("cg_shift", "derivatives", "mass_error"): 1.0, ("cg_shift", "icing", "mass_error"): math.exp(-1.0)}
    )


def test_effects_of_an_earlier_release_are_in_every_set_of_a_later_one():
    """The last derivatives that were released are explained beside a changed loading, and refitted under the declaration."""
    end = tied(z=100.0)
    end.tied, end.null = [], null("cg_shift", "inertia_error")
    later = released(carried=("cg_shift", "elevator_effectiveness"), inertia_error=5.0, icing=6.0)
    assert weights([released(cg_shift=5.0), later, end]) == pytest.approx(
        {("cg_shift", "inertia_error"): 1.0, ("cg_shift", "icing"): math.exp(-1.0)}
    )


def exchanged(cost, *names, converged=True):
    """A fit that the search has tried in place of the last one, which costs 0 and 1 for each size."""
    fit = null(*names)
    fit.cost, fit.converged = cost, converged
    return fit


def test_sets_that_the_search_has_tried_weigh_by_their_cost():
    """3 behind the last set of two effects; a set that other rounds list, or that has not converged, is not listed again."""
    end = tied()
    end.tied, end.null = [], null("gyro_lag", "cg_shift")
    end.exchanged = (
        exchanged(3.0, "gyro_lag", "inertia_error"),
        exchanged(1.0, "gyro_lag", "cg_shift"),
        exchanged(1.0, "gyro_lag", "mass_error", converged=False),
        exchanged(-7.0, "gyro_lag", "cg_shift", "vane_lag"),
    )
    found = weights([tied(gyro_lag=80.0), released(cg_shift=5.0), end])
    assert found[("gyro_lag", "inertia_error")] == pytest.approx(math.exp(-3.0))
    assert found[("cg_shift", "gyro_lag")] == pytest.approx(1.0)
    assert ("gyro_lag", "mass_error") not in found
    # 1 for the parameter, 4 for prior odds and Occam's factor of a third effect; the search has refused what is left
    assert found[("cg_shift", "gyro_lag", "vane_lag")] == pytest.approx(0.5)


def test_one_effect_more_weighs_by_its_score():
    """A score of 2.9 gains 8.4 in 2 log L; prior odds and Occam's factor cost 4, the parameter 1. A score of 1 points to nothing.

    The search refused a score of 6, so that its set weighs half as much as the answer; the fourth score is not listed.
    """
    end = tied()
    end.tied, end.null = [], null("gyro_lag")
    end.table = SimpleNamespace(
        scores=[
            SimpleNamespace(effect=SimpleNamespace(name=name, label=name, parameters=("size",)), z=z)
            for name, z in (
                ("vane_lag", -2.9),
                ("vane_scale", 1.0),
                ("backlash", 6.0),
                ("gyro_scale", 2.8),
                ("vane_arm", 2.7),
            )
        ]
    )
    found = weights([tied(gyro_lag=80.0), end])
    assert found == pytest.approx(
        {
            ("gyro_lag",): 1.0,
            ("backlash", "gyro_lag"): 0.5,
            ("gyro_lag", "vane_lag"): math.exp(0.5 * 2.9**2 - 5.0),
            ("gyro_lag", "gyro_scale"): math.exp(0.5 * 2.8**2 - 5.0),
        }
    )


@dataclass(frozen=True)
class Round:
    """What the choice between names and increments reads of a round."""

    tied: tuple[SimpleNamespace, ...]
    rival: Rival | None = None


CURVE = increment(Shape("Cm", "alpha", 0.0, 0.2, 8, 0.06))
VANE = increment(Shape("alpha_rad", "alpha", 0.0, 0.2, 8, 0.06))


def learned_round(effect):
    return Round((SimpleNamespace(score=SimpleNamespace(effect=effect)),))


NAMED = (Round(()),)


@pytest.mark.parametrize(
    ("beside", "alone", "lead", "expected"),
    [
        ((), CURVE, 5.1, {("cm_alpha_nonlinear",): -5.1}),
        ((), VANE, 2.0, {("increment",): 2.0}),
        ((), CURVE, -2.0, None),
        ((), CURVE, 2.0, {("increment",): 2.0}),
        ((VANE,), CURVE, 2.0, {("increment",): 2.0}),
        ((), None, 2.0, None),
    ],
    ids=[
        "in place of the name",
        "acts elsewhere",
        "acts where the name does, with less evidence",
        "with more",
        "beside an increment",
        "none",
    ],
)
def test_increments_alone_take_the_place_of_names_or_are_their_rival(beside, alone, lead, expected):
    """Names keep their place up to a lead of 5."""
    grown = (*(learned_round(e) for e in beside), *NAMED)
    rounds = NAMED if alone is None else (learned_round(alone), Round(()))
    found = chosen(grown, rounds, lead, (EFFECTS["cm_alpha_nonlinear:quadratic"],), ())
    assert (found[0].tied == rounds[0].tied) == (lead > 5.0 or alone is None)
    assert (None if found[0].rival is None else found[0].rival.sets) == expected


@dataclass(frozen=True)
class Ended:
    """What the sets of a finished search read of its only round."""

    null: SimpleNamespace
    tied: tuple[SimpleNamespace, ...] = ()
    candidates: tuple[SimpleNamespace, ...] = ()
    rival: Rival | None = None
    release: None = None
    sets: tuple[()] = ()
    exchanged: tuple[()] = ()
    table: SimpleNamespace = field(default_factory=lambda: NO_SCORES)


def ended(cost, *names, rival=None):
    """A search that ended with this cost after it accepted each of these effects for a gain of 100."""
    rounds = [Ended(replaced(cost, *names), (candidate(name, 100.0),)) for name in names]
    rounds = rounds or [Ended(replaced(cost))]
    return (replace(rounds[0], rival=rival), *rounds[1:])


def replaced(cost, *names):
    own = null(*names)
    own.cost = cost
    return own


def above(sets, least):
    """Names of the sets that weigh at least so much, with the weight of each."""
    return {names: weight for names, weight in sets.items() if weight >= least}


@pytest.mark.parametrize(
    ("won", "lost", "expected"),
    [
        (
            ended(10.0, "vane_arm"),
            ended(12.0, "vane_lag"),
            {("vane_arm",): 1.0, ("vane_lag",): math.exp(-2.0)},
        ),
        (ended(10.0, "vane_arm"), ended(4.0, "vane_lag"), {("vane_arm",): 1.0, ("vane_lag",): 1.0}),
        (ended(10.0, "vane_arm"), ended(12.0, "vane_arm"), {("vane_arm",): 1.0}),
        (ended(10.0, "vane_arm"), ended(10.0), {("vane_arm",): 1.0}),
        (ended(10.0), ended(12.0, "vane_lag"), {(): 1.0}),
        (
            ended(10.0, "vane_arm", rival=Rival({("backlash",): -3.0, ("vane_lag",): -1.0})),
            ended(12.0, "vane_lag"),
            {("vane_arm",): 1.0, ("vane_lag",): math.exp(-1.0), ("backlash",): math.exp(-3.0)},
        ),
    ],
    ids=[
        "behind",
        "gave way to the kinematic check",
        "the same set",
        "names nothing",
        "beside a search that names nothing",
        "beside an earlier rival",
    ],
)
def test_a_search_that_lost_leaves_its_sets(won, lost, expected):
    """Weights by hand: the difference of the costs; what is removed from a set costs a gain of 100."""
    assert above(weights(with_rival(won, lost)), 1e-9) == pytest.approx(expected, rel=1e-12)
