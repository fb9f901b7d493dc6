"""Sets of causes of shifted derivatives: evidence, sizes and ranking, against independent values."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from airtruth.effects.effect import Prior
from airtruth.physics.composition import TailGeometry, directions
from airtruth.physics.motion import LATERAL
from airtruth.tracing.inference.causes import Cause, causes_of
from airtruth.tracing.inference.derivative_likelihood import DerivativeLikelihood
from airtruth.tracing.selection.explanation import CauseSet, explain, least_cost, simplest_first, size_of
from airtruth.tracing.selection.release import DeclaredCauses, explained

DECLARED = np.array([4.787, 31.7, 0.480, -1.785, -41.2, -1.787])
"""Derivatives of aircraft/gtm."""
STD = np.abs(DECLARED) * np.array([0.05, 0.30, 0.10, 0.05, 0.15, 0.05])
"""Their declared standard deviations."""
TOLD = np.abs(DECLARED) * np.array([0.004, 0.05, 0.01, 0.004, 0.01, 0.004])
"""Standard deviations of the records alone."""
DIRECTIONS = directions(DECLARED, TailGeometry(7.9))


def likelihood(shift, told=TOLD):
    information = np.diag(told**-2.0)
    return DerivativeLikelihood(
        information, information @ shift, 0.5 * float(shift @ information @ shift), np.diag(STD**2)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shift", "effects"),
    [
        (-0.5 * DIRECTIONS["tail"], ("tail_effectiveness",)),
        (-0.4 * DIRECTIONS["elevator"], ("elevator_effectiveness",)),
        (0.08 * DIRECTIONS["cg"], ("cg_shift",)),
        (2.5 * DIRECTIONS["icing"], ("icing",)),
        (DECLARED * [0.4, 0.0, -0.5, 0.4, -0.9, 0.0], ("derivatives",)),
    ],
)
def test_the_cause_of_a_shift_leads(shift, effects):
    """Far beyond the declared uncertainty, with shapes as in the library."""
    assert explain(likelihood(shift), causes_of(DIRECTIONS))[0].effects == effects


def test_declared_derivatives_lead_where_nothing_is_wrong():
    """Beside the constant that makes a single cause comparable with the refit of an effect."""
    none, *others = sorted(
        explain(likelihood(0.3 * STD), causes_of(DIRECTIONS)), key=lambda s: bool(s.effects)
    )
    assert none.effects == ()
    assert all(s.cost + 4.0 > none.cost for s in others)


def test_the_evidence_is_that_of_a_normal_prior():
    """Two sets compared: the ratio of the densities of the estimate under both, by scipy's normal."""
    shift = np.array([0.1, 3.0, -0.05, 0.25, 4.0, 0.1])
    cause = Cause("cg_shift", DIRECTIONS["cg"], Prior(0.05, -np.inf, np.inf, shape=0.0))
    by_effects = {s.effects: s for s in explain(likelihood(shift), [cause], wrong_allowed=False)}
    about = np.diag(STD**2 + TOLD**2)
    wide = about + 0.05**2 * np.outer(cause.direction, cause.direction)
    densities = [multivariate_normal(np.zeros(6), c).logpdf(shift) for c in (about, wide)]
    odds = cause.prior.log_odds + 4.0  # the prior odds, and the constant that makes it comparable with refits
    expected = densities[0] - densities[1] - odds
    assert by_effects[("cg_shift",)].cost - by_effects[()].cost == pytest.approx(expected, rel=1e-9)


def test_the_size_is_that_of_weighted_least_squares():
    shift = 0.03 * DIRECTIONS["cg"] + 0.5 * STD
    v, weight = DIRECTIONS["cg"], 1.0 / (STD**2 + TOLD**2)
    size, std = size_of(likelihood(shift), Cause("cg_shift", v, Prior(0.05, -0.15, 0.15)))
    assert size == pytest.approx((v * weight * shift).sum() / (v * weight * v).sum(), rel=1e-9)
    assert std == pytest.approx((v * weight * v).sum() ** -0.5, rel=1e-9)


def test_derivatives_without_information_do_not_matter():
    """A derivative that the records do not show changes no cost but by its prior odds, 1 in e."""
    told = TOLD.copy()
    told[1] = 1e6
    shift = 0.08 * DIRECTIONS["cg"]
    sets = {(s.causes, s.wrong): s.cost for s in explain(likelihood(shift, told), causes_of(DIRECTIONS))}
    alone, with_q = sets[(), ("Cmalpha",)], sets[(), ("CLq", "Cmalpha")]
    assert with_q - alone == pytest.approx(1.0, abs=1e-6)


def test_a_size_beyond_its_range_is_improbable():
    """A tail that becomes more effective, of a sign that is not physical."""
    shift = 0.5 * DIRECTIONS["tail"]
    tail = [c for c in causes_of(DIRECTIONS) if c.key == "tail_effectiveness"]
    costs = [
        {s.effects: s.cost for s in explain(likelihood(shift), causes)}[("tail_effectiveness",)]
        for causes in (tail, [replace(tail[0], prior=replace(tail[0].prior, low=-np.inf, high=np.inf))])
    ]
    assert costs[0] > costs[1] + 5.0


def cause_set(cost, *causes, wrong=()):
    return CauseSet(causes, wrong, (), (), np.zeros((6, 6)), cost)


def test_the_weight_of_wrong_declarations_is_the_sum_over_their_sets():
    """Four sets that are each e^-1 as probable as the best one: 4/e = 1.47 of its weight, so that they lead."""
    best = cause_set(0.0, "mass_error", "inertia_error")
    wrong = [
        cause_set(1.0 + 0.01 * k, wrong=(name,)) for k, name in enumerate(("CLalpha", "CLq", "Cmq", "Cmde"))
    ]
    first, *rest = simplest_first((best, *wrong))
    assert first is wrong[0]
    assert rest == [best, *wrong[1:]]
    assert least_cost((first, *rest)) == 0.0


@pytest.mark.parametrize(
    ("cost", "names"), [(2.30, ("cg_shift",)), (2.31, ("cg_shift", "tail_effectiveness"))]
)
def test_fewer_effects_lead_unless_the_odds_against_them_are_strong(cost, names):
    """exp(-cost) is a tenth at ln 10 = 2.3026."""
    sets = (cause_set(0.0, "cg_shift", "tail_effectiveness"), cause_set(cost, "cg_shift"))
    assert simplest_first(sets)[0].causes == names


@pytest.mark.parametrize(("cost", "names"), [(0.69, ("cg_shift",)), (0.70, ("cg_shift", "inertia_error"))])
def test_a_further_cause_of_a_changed_loading_needs_odds_of_two(cost, names):
    """exp(-cost) is a half at ln 2 = 0.6931; mass, CG and inertia are one event."""
    sets = (
        cause_set(0.0, "cg_shift", "inertia_error"),
        cause_set(cost, "cg_shift"),
        cause_set(2.0, "cg_shift", "tail_effectiveness"),
    )
    assert simplest_first(sets)[0].causes == names


def test_no_set_has_no_order():
    assert simplest_first(()) == ()


def test_a_set_without_a_cause_keeps_the_sizes_of_the_others():
    whole = CauseSet(("mass_error", "cg_shift"), ("Cmq",), (0.1, 0.02), (0.01, 0.005), np.eye(6), 3.0)
    less = whole.without({"mass_error", "inertia_error"})
    assert (less.causes, less.sizes, less.size_std) == (("cg_shift",), (0.02,), (0.005,))
    assert less.effects == ("cg_shift", "derivatives")
    assert (less.wrong, less.cost) == (whole.wrong, whole.cost)


@pytest.mark.slow
def test_what_a_refit_shows_beyond_first_order_is_kept(monkeypatch):
    """Also beside other effects, where the sets are explained again; sets of other causes and wrong declarations keep theirs."""
    monkeypatch.setattr(
        "airtruth.tracing.selection.release.derivative_likelihood",
        lambda problem, free: likelihood(-0.3 * DIRECTIONS["tail"]),
    )
    free = SimpleNamespace(hypothesis=SimpleNamespace(effects=()))
    plain = explained(None, free, DeclaredCauses(causes_of(DIRECTIONS)))
    kept = explained(None, free, DeclaredCauses(causes_of(DIRECTIONS), corrections={("cg_shift",): -200.0}))
    costs = [{(s.effects, s.wrong): s.cost for s in sets} for sets in (plain, kept)]
    assert kept[0].effects == ("cg_shift",) != plain[0].effects
    changed = {key for key in costs[0] if costs[1][key] != costs[0][key]}
    assert changed == {(("cg_shift",), ())}
    assert costs[1][("cg_shift",), ()] == pytest.approx(costs[0][("cg_shift",), ()] - 200.0)


def test_wrong_declarations_of_a_motion_with_many_derivatives_are_found_one_by_one():
    """All 32768 sets of fifteen derivatives would take minutes; two that are wrong lead, beside none that is right."""
    declared = np.array(
        [-1.0, 0.06, 0.86, -0.02, 0.34, -0.14, -0.34, 0.15, -0.072, 0.027, 0.22, -0.05, -0.39, -0.003, -0.17]
    )
    std = np.maximum(0.05 * np.abs(declared), 0.002)
    told = 0.1 * std
    shift = np.zeros(15)
    wrong = [LATERAL.index("Clp"), LATERAL.index("Cndr")]
    shift[wrong] = 8.0 * std[wrong]
    information = np.diag(told**-2.0)
    lateral = DerivativeLikelihood(
        information,
        information @ shift,
        0.5 * float(shift @ information @ shift),
        np.diag(std**2),
        LATERAL,
    )
    causes = causes_of(directions(declared, TailGeometry(7.9), LATERAL))
    best = explain(lateral, causes)[0]
    assert (best.causes, best.wrong) == ((), ("Clp", "Cndr"))
    assert not explain(lateral, causes, wrong_allowed=False)[0].wrong
