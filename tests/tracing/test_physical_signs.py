"""Sizes, times and damping ratios that no aircraft has are not accepted, and the reason says so."""

import numpy as np
import pytest

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.selection import predictive


def reasons(key, size, span_m=2.0, declared=0.0):
    return set(predictive.size_reasons(EFFECTS[key], size, span_m, declared))


@pytest.mark.parametrize(
    ("key", "real", "reversed_"),
    [("downwash_lag", -20.0, 20.0), ("lift_alpha_dot", 10.0, -10.0), ("lift_lag", 1.0, -1.0)],
)
def test_a_reversed_sign(key, real, reversed_):
    """Etkin and Reid, Dynamics of Flight, ch. 5: the downwash reaches the tail late, lifts it and damps."""
    assert reasons(key, real) == set()
    assert reasons(key, reversed_) == {"its size has a sign that no aircraft has"}


@pytest.mark.parametrize(("key", "declared"), [("downwash_lag", -16.0), ("lift_alpha_dot", 8.0)])
def test_a_sign_that_takes_a_declared_term_away(key, declared):
    """A JSBSim model with too much damping by alpha_dot: what counts is the sign of the sum."""
    assert reasons(key, -declared, declared=declared) == set()
    assert reasons(key, -0.5 * declared, declared=declared) == set()
    assert reasons(key, -1.5 * declared, declared=declared) == {"its size has a sign that no aircraft has"}


@pytest.mark.parametrize(("key", "real", "beyond"), [("vane_arm", 2.5, -3.5), ("thrust_moment", 0.4, -0.99)])
def test_an_arm_beyond_the_aircraft(key, real, beyond):
    """A wing span of 2 m: the GTM's vane may be up to 3 m ahead, its thrust line is within 1 m."""
    assert reasons(key, real) == set()
    span = 2.0 if key == "vane_arm" else 1.0
    assert "its size is beyond the ends of the aircraft" in reasons(key, beyond, span)


def test_every_sign_has_sizes_on_its_side():
    signed = {key: e.parameters[0].sign for key, e in EFFECTS.items() if e.parameters[0].sign}
    assert signed == {"downwash_lag": -1, "lift_alpha_dot": 1, "lift_lag": 1}
    for key, sign in signed.items():
        low, high = EFFECTS[key].parameters[0].reach
        assert max(sign * low, sign * high) > EFFECTS[key].parameters[0].material


def test_a_mode_without_the_damping_of_a_mode():
    """A damping ratio that a refit drives to the end of its range is that of a lag; a frequency within it says nothing."""
    effect = EFFECTS["elastic_mode"]
    end = next(p for p in effect.parameters if p.name == "damping").high

    def given(frequency_hz, damping):
        values = {"dCmalpha": -0.4, "frequency_hz": frequency_hz, "damping": damping}
        sizes = np.array([p.size(values[p.name]) for p in effect.parameters])
        return list(predictive.shape_reasons(effect, sizes))

    assert end <= 0.2
    assert given(3.0, 0.05) == []
    assert given(3.0, end) == ["its damping ratio ends at the limit of the plausible range"]
    assert given(0.5, end) == [
        "its natural frequency ends at the limit of the plausible range",
        "its damping ratio ends at the limit of the plausible range",
    ]


def test_a_break_may_lie_at_the_end_of_the_records():
    effect = EFFECTS["cm_alpha_nonlinear:break"]
    at = effect.parameters[1]
    assert list(predictive.shape_reasons(effect, np.array([0.3, at.size(at.high)]))) == []
