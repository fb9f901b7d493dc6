"""Which of several sets of effects an answer states, and causes of shifted derivatives in a quadratic of these alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.effects.registry import EFFECTS
from airtruth.physics.composition import TailGeometry, directions
from airtruth.physics.motion import LATERAL
from airtruth.tracing.inference.causes import causes_of
from airtruth.tracing.inference.derivative_likelihood import DerivativeLikelihood, size_along
from airtruth.tracing.selection.columns import EffectColumn
from airtruth.tracing.selection.evidence import Quadratic
from airtruth.tracing.selection.explanation import ExplainedDerivatives, events, shares, simplest

DECLARED = np.array([4.787, 31.7, 0.480, -1.785, -41.2, -1.787])
"""Derivatives of aircraft/gtm."""
STD = np.abs(DECLARED) * np.array([0.05, 0.30, 0.10, 0.05, 0.15, 0.05])
"""Their declared standard deviations."""
TOLD = np.abs(DECLARED) * np.array([0.004, 0.05, 0.01, 0.004, 0.01, 0.004])
"""Standard deviations of the records alone."""
DIRECTIONS = directions(DECLARED, TailGeometry(7.9))


def quadratic(shift, causes, told=TOLD, std=STD, wrong_allowed=True):
    """The log-likelihood of increments whose estimate is a shift, with causes that move them."""
    along = np.column_stack([np.eye(len(shift)), *(c.direction for c in causes)])
    information = along.T @ np.diag(told**-2.0) @ along
    slope = -along.T @ (shift / told**2)
    offset = 0.5 * float((shift / told) @ (shift / told))
    columns = tuple(EffectColumn(cause=c) for c in causes)
    return Quadratic(
        offset, slope, information, np.diag(std**2), len(shift), columns, wrong_allowed=wrong_allowed
    )


def best(q, most=3):
    return max(q.sets(most), key=lambda w: w.log_evidence)


@pytest.mark.parametrize(
    ("shift", "names"),
    [
        (-0.5 * DIRECTIONS["tail"], ("tail_effectiveness",)),
        (-0.4 * DIRECTIONS["elevator"], ("elevator_effectiveness",)),
        (0.08 * DIRECTIONS["cg"], ("cg_shift",)),
        (2.5 * DIRECTIONS["icing"], ("icing",)),
        (DECLARED * [0.4, 0.0, -0.5, 0.4, -0.9, 0.0], ("derivatives",)),
        (0.3 * STD, ()),
    ],
)
def test_the_cause_of_a_shift_leads(shift, names):
    """Far beyond the declared uncertainty, with shapes as in the library; none within it."""
    q = quadratic(shift, causes_of(DIRECTIONS))
    assert q.names(best(q)) == names


def test_the_size_is_that_of_weighted_least_squares():
    shift = 0.03 * DIRECTIONS["cg"] + 0.5 * STD
    v, weight = DIRECTIONS["cg"], 1.0 / (STD**2 + TOLD**2)
    information = np.diag(TOLD**-2.0)
    likelihood = DerivativeLikelihood(information, information @ shift, 0.0, np.diag(STD**2))
    expected = (v * weight * shift).sum() / (v * weight * v).sum(), (v * weight * v).sum() ** -0.5
    assert size_along(likelihood, v) == pytest.approx(expected, rel=1e-9)
    assert size_along(replace(likelihood, information=np.zeros((6, 6))), v) == (0.0, np.inf)
    causes = [
        replace(c, prior=replace(c.prior, shape=0.0)) for c in causes_of(DIRECTIONS) if c.key == "cg_shift"
    ]
    q = quadratic(shift, causes)
    only = next(w for w in q.sets(1) if w.columns and not w.declaration.wrong)
    sizes, std = q.alone(only)
    assert (sizes[0], std[0]) == pytest.approx(expected, rel=1e-9)


def test_a_size_beyond_its_range_is_improbable():
    """A tail that becomes more effective, of a sign that is not physical."""
    tail = next(c for c in causes_of(DIRECTIONS) if c.key == "tail_effectiveness")
    free = replace(tail, prior=replace(tail.prior, low=-np.inf, high=np.inf))
    logs = []
    for cause in (tail, free):
        q = quadratic(0.5 * DIRECTIONS["tail"], [cause])
        logs.append(max(w.log_evidence for w in q.sets(1) if w.columns and not w.declaration.wrong))
    assert logs[0] < logs[1] - 5.0


def test_wrong_declarations_of_a_motion_with_many_derivatives_are_compared_one_by_one():
    """All 32768 sets of fifteen derivatives would take minutes; two that are wrong lead, beside none that is right."""
    declared = np.array(
        [-1.0, 0.06, 0.86, -0.02, 0.34, -0.14, -0.34, 0.15, -0.072, 0.027, 0.22, -0.05, -0.39, -0.003, -0.17]
    )
    std = np.maximum(0.05 * np.abs(declared), 0.002)
    shift, wrong = np.zeros(15), [LATERAL.index("Clp"), LATERAL.index("Cndr")]
    shift[wrong] = 8.0 * std[wrong]
    causes = causes_of(directions(declared, TailGeometry(7.9), LATERAL))
    leading = best(quadratic(shift, causes, 0.1 * std, std), 1)
    assert (leading.columns, leading.declaration.wrong) == ((), tuple(wrong))
    assert not best(quadratic(shift, causes, 0.1 * std, std, wrong_allowed=False), 1).declaration.wrong


@pytest.mark.parametrize(
    ("weight", "names"), [(0.301, ("cg_shift",)), (0.299, ("cg_shift", "tail_effectiveness"))]
)
def test_fewer_effects_lead_unless_the_odds_against_them_are_substantial(weight, names):
    assert simplest({("cg_shift", "tail_effectiveness"): 1.0, ("cg_shift",): weight}) == names


@pytest.mark.parametrize(("weight", "names"), [(0.51, ("cg_shift",)), (0.49, ("cg_shift", "inertia_error"))])
def test_a_further_cause_of_a_changed_loading_needs_odds_of_two(weight, names):
    """Mass, CG and inertia are one event."""
    sets = {
        ("cg_shift", "inertia_error"): 1.0,
        ("cg_shift",): weight,
        ("cg_shift", "tail_effectiveness"): 0.2,
    }
    assert simplest(sets) == names
    assert events(("cg_shift", "inertia_error", "gyro_lag")) == 2


@given(st.dictionaries(st.tuples(st.text(max_size=2)), st.floats(1e-6, 1e3), min_size=1))
def test_shares_add_up_to_one_and_keep_their_ratios(weights):
    found = shares(weights)
    assert sum(found.values()) == pytest.approx(1.0)
    first = next(iter(weights))
    for names, weight in weights.items():
        assert found[names] * weights[first] == pytest.approx(found[first] * weight)


def test_an_explanation_names_its_causes_and_wrong_declarations():
    assert ExplainedDerivatives(("icing",), ("Cmq",), (1.0,), (0.1,)).effects == ("icing", "derivatives")
    assert ExplainedDerivatives(("icing",), (), (1.0,), (0.1,)).effects == ("icing",)


def test_what_other_records_tell_of_a_size_is_a_likelihood():
    """A CG told as 0.03 +- 0.02 elsewhere: the integral of prior and both likelihoods over the size, without that at no size."""
    plain = EFFECTS["cg_shift"]
    first = replace(plain.parameters[0], prior_mean=0.03, prior_std=0.02)
    v, seen = DIRECTIONS["cg"], 0.01 * DIRECTIONS["cg"]
    logs = []
    for effect in (plain, replace(plain, parameters=(first,))):
        q = quadratic(seen, [c for c in causes_of(DIRECTIONS) if c.key == "cg_shift"])
        q = replace(q, columns=(EffectColumn(effect),))
        logs.append(max(w.log_evidence for w in q.sets(1) if w.columns and not w.declaration.wrong))
    own = float((v / (STD**2 + TOLD**2) * v).sum())
    x = np.linspace(-0.3, 0.3, 60001)
    density = np.exp(-0.5 * own * (x - 0.01) ** 2 - 0.5 * (x / plain.prior.std) ** 2)
    told = np.exp(-0.5 * (x / 0.02) ** 2 + 0.03 * x / 0.02**2)
    expected = np.log(np.sum(density * told) / np.sum(density))
    assert logs[1] - logs[0] == pytest.approx(expected, abs=1e-3)
