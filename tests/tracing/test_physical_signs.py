"""Sizes that no aircraft has are not accepted, and the reason says so."""

import pytest

from airtruth.effects.registry import EFFECTS
from airtruth.tracing.selection import acceptance


class _Score:
    def __init__(self, key):
        self.effect = EFFECTS[key]


def reasons(key, size, span_m=2.0):
    return set(acceptance.size_reasons(_Score(key), size, span_m))


@pytest.mark.parametrize(
    ("key", "real", "reversed_"),
    [("downwash_lag", -20.0, 20.0), ("lift_alpha_dot", 10.0, -10.0), ("lift_lag", 1.0, -1.0)],
)
def test_a_reversed_sign(key, real, reversed_):
    """Etkin and Reid, Dynamics of Flight, ch. 5: the downwash reaches the tail late, lifts it and damps."""
    assert reasons(key, real) == set()
    assert reasons(key, reversed_) == {"its size has a sign that no aircraft has"}


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
