"""Sets one exchange away from the one that a search has reached, on records whose sensors' scales are known."""

from types import SimpleNamespace

import numpy as np
import pytest
import trace_records as tr
from scaled_records import ACCELEROMETER, GYRO, VANE, fitted, scaled_problem

from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.selection import ranking
from airtruth.tracing.selection.acceptance import predicts_records_left_out, untested
from airtruth.tracing.selection.exchange import better_set, other_kinds
from airtruth.tracing.selection.refit import Refit
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.rounds import scored_round
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import MISFIT_FAMILY_LEVEL, significant_gain

LIBRARY = tuple(e for e in EFFECTS.values() if not e.in_derivatives and e.applies_to(LONGITUDINAL))
LEAST = significant_gain(33, MISFIT_FAMILY_LEVEL)


@pytest.fixture(scope="module")
def problem():
    return scaled_problem()


def reached(problem, first, second, rivals, scored=()):
    """A search that has accepted two effects; ``rivals`` were refitted in its second round, ``scored`` has scores at its end."""

    def candidate(gain, *effects):
        return SimpleNamespace(
            score=SimpleNamespace(effect=effects[-1]), fit=fitted(problem, *effects), gain=gain
        )

    leaders = candidate(60.0, first), candidate(50.0, first, second)
    others = [candidate(40.0, first, rival) for rival in rivals]
    return (
        SimpleNamespace(tied=leaders[:1], candidates=leaders[:1]),
        SimpleNamespace(tied=leaders[1:], candidates=(leaders[1], *others)),
        scored_round(SetTable(problem), leaders[1].fit, scored, 2, 1, lambda step: None),
    )


def better_of(problem, *search):
    rounds = reached(problem, *search)
    return better_set(SetTable(problem), rounds, rounds[-1].null, LIBRARY, LEAST, lambda step: None)


@pytest.mark.slow
def test_a_wrong_member_gives_way_to_its_rival(problem):
    better = better_of(problem, GYRO, ACCELEROMETER, [VANE])
    assert better is not None
    assert {e.key for e in better} == {"vane_scale", "gyro_scale"}


@pytest.mark.slow
def test_the_residual_of_the_other_members_points_to_a_rival(problem):
    """No rival was refitted in the round of the wrong member, and no effect has a score beside both."""
    better = better_of(problem, GYRO, ACCELEROMETER, [])
    assert better is not None
    assert {e.key for e in better} == {"vane_scale", "gyro_scale"}


@pytest.mark.slow
def test_what_explains_most_comes_first(problem):
    better = better_of(problem, GYRO, ACCELEROMETER, [VANE])
    without = {e.key: fitted(problem, *(o for o in better if o is not e)).cost for e in better}
    assert without[better[0].key] > without[better[1].key]


@pytest.mark.slow
def test_a_right_set_stays(problem):
    assert better_of(problem, GYRO, VANE, [ACCELEROMETER]) is None


@pytest.mark.slow
def test_what_remains_points_to_an_effect_that_makes_another_redundant(problem):
    better = better_of(problem, GYRO, ACCELEROMETER, [], [VANE])
    assert better is not None
    assert {e.key for e in better} == {"vane_scale", "gyro_scale"}


@pytest.mark.slow
def test_every_exchange_is_kept_for_the_look_alikes(problem):
    rounds = reached(problem, GYRO, VANE, [ACCELEROMETER])
    sets = SetTable(problem)
    better = better_set(sets, rounds, rounds[-1].null, LIBRARY, LEAST, lambda step: None)
    assert better is None
    assert ["gyro_scale", "accelerometer_scale"] in [
        [e.key for e in f.hypothesis.effects] for f in sets.exchanges(rounds[-1].null)
    ]


def test_late_members_are_late_in_another_way():
    """A gyro that is late twice, a slow surface, and a scale: four other sets, as late in each place as the first."""
    names = ("sensor_delay:q_rad_s", "vane_scale", "gyro_lag", "actuator_lag")
    hypothesis = tr.NOTHING
    for name in names:
        hypothesis = hypothesis.plus(EFFECTS[name])
    last = SimpleNamespace(
        hypothesis=hypothesis, point=SimpleNamespace(sizes=np.array([0.02, 0.1, 0.05, 0.04]))
    )
    found = {tuple(e.key for e in effects): sizes.tolist() for effects, sizes in other_kinds(LIBRARY, last)}
    sensors, surfaces = ("gyro_lag", "sensor_delay:q_rad_s"), ("elevator_delay", "actuator_lag")
    expected = {(q, surface, "vane_scale") for q in sensors for surface in surfaces}
    assert set(found) == expected
    for sizes in found.values():
        assert sizes == pytest.approx([0.07, 0.04, 0.1], abs=1e-15)


def test_one_late_member_has_its_rival_alone():
    hypothesis = tr.NOTHING.plus(EFFECTS["gyro_lag"]).plus(EFFECTS["vane_scale"])
    last = SimpleNamespace(hypothesis=hypothesis, point=SimpleNamespace(sizes=np.array([0.02, 0.1])))
    assert list(other_kinds(LIBRARY, last)) == []


@pytest.mark.slow
def test_records_left_out_do_not_refuse_the_effect_that_leads(problem, monkeypatch):
    """Another effect that the set still lacks may make them worse; the other reasons remain."""
    last = scored_round(
        SetTable(problem), fitted(problem, GYRO), [VANE, ACCELEROMETER], 1, 1, lambda step: None
    )
    refits = [
        Refit(score, fitted(problem, GYRO, score.effect), 0.0)
        for score in sorted(last.table.scores, key=lambda s: -abs(s.z))
    ]
    first = refits[0].score.effect.key

    def refused(problem, score, own, gain, *rest):
        return untested(
            score, own, gain, Refusal.WORSE_LIKELIHOOD, Refusal.WORSE_FREE_RUN, Refusal.UNCONVERGED
        )

    monkeypatch.setattr(ranking, "assess_candidate", refused)
    free, *_ = ranking.rank(problem, last.null, refits, LEAST)
    led, *_ = ranking.rank(problem, last.null, refits, LEAST, leader=first)
    assert free.score.effect.key == led.score.effect.key == first
    assert free.reasons == (Refusal.WORSE_LIKELIHOOD, Refusal.WORSE_FREE_RUN, Refusal.UNCONVERGED)
    assert led.reasons == (Refusal.UNCONVERGED,)


@pytest.mark.slow
def test_a_set_predicts_the_records_left_out_or_does_not(problem):
    """The scales of gyro and vane are in the records."""
    null, right = fitted(problem), fitted(problem, GYRO, VANE)
    assert predicts_records_left_out(problem, null, right)
    assert not predicts_records_left_out(problem, right, null)
