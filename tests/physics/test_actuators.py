"""The servo against analytic responses and an adaptive integrator."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from airtruth.physics.actuators import respond
from airtruth.units import DEG

Array = NDArray[np.float64]
DT = 0.005
T = np.arange(400) * DT
W = 2 * np.pi * 5.0  # the GTM's 5 Hz servo


def one(command: Array, **options: float) -> Array:
    return respond(command[None, :], DT, 5.0, **options)[0]


def test_ramp() -> None:
    """c = s t from rest: y = s (t - (1 - exp(-w t))/w)."""
    np.testing.assert_allclose(one(0.3 * T), 0.3 * (T + np.expm1(-W * T) / W), rtol=0, atol=1e-14)


def test_step_within_one_sample() -> None:
    """A step written as a ramp over one sample: the ramp's response, then exponential approach."""
    c = np.where(T > 0, 0.035, 0.0)
    first = 0.035 / DT * (DT + np.expm1(-W * DT) / W)
    expected = np.where(T > 0, 0.035 + (first - 0.035) * np.exp(-W * (T - DT)), 0.0)
    np.testing.assert_allclose(one(c), expected, rtol=0, atol=1e-15)


def test_bandwidth_is_the_half_power_frequency() -> None:
    t = np.arange(20000) * 1e-4
    y = respond(np.sin(W * t)[None], 1e-4, 5.0)[0]
    late = t > 1.0
    basis = np.stack([np.sin(W * t[late]), np.cos(W * t[late])], axis=1)
    a, b = np.linalg.lstsq(basis, y[late], rcond=None)[0]
    assert np.hypot(a, b) == pytest.approx(np.sqrt(0.5), rel=2e-6)
    assert np.arctan2(b, a) == pytest.approx(-np.pi / 4, abs=2e-6)


def test_rate_limited_step() -> None:
    """Beyond the band R/w the surface moves at the limit R; then it closes in exponentially."""
    step, rate = 20 * DEG, 100 * DEG
    c = np.full(T.size, step)
    c[0] = 0.0
    y = one(c, rate_limit_rad_s=rate)
    # the command's own ramp (4000 deg/s) passes the band after t0 with y0 behind, error e = s t - y
    s = step / DT
    t0 = -np.log(1 - rate / s) / W  # error (s/w)(1 - exp(-w t)) reaches R/w
    y0 = s * t0 - rate / W
    t1 = t0 + (step - rate / W - y0) / rate
    expected = np.where(t0 > T, 0.0, y0 + rate * (T - t0))
    expected = np.where(t1 < T, step - rate / W * np.exp(-W * (T - t1)), expected)
    np.testing.assert_allclose(y[1:], expected[1:], rtol=0, atol=1e-13)
    assert np.abs(np.diff(y)).max() <= rate * DT * (1 + 1e-12)


def reference(command: Array, rate: float, low: float, high: float, delay: float) -> Array:
    """The same law by DOP853, restarted at every knot of the (delayed) command."""

    def c(t: float) -> float:
        return float(np.interp(t - delay, T, command))

    def slope(t: float, y: Array) -> Array:
        v = np.clip(W * (c(t) - y[0]), -rate, rate)
        if (y[0] >= high and v > 0) or (y[0] <= low and v < 0):
            v = 0.0
        return np.array([v])

    knots = np.unique(np.concatenate([T, T + delay]))
    y = np.clip(command[0], low, high)
    values = {0.0: y}
    for a, b in pairwise(knots):
        y = solve_ivp(slope, (a, b), [y], "DOP853", rtol=1e-10, atol=1e-13, max_step=DT / 5).y[0, -1]
        y = float(np.clip(y, low, high))
        values[b] = y
    return np.array([values[t] for t in T])


@pytest.mark.grid
@pytest.mark.parametrize(
    ("rate", "low", "high", "delay"),
    [
        (60 * DEG, -np.inf, np.inf, 0.0),
        (60 * DEG, -np.inf, np.inf, 0.0123),
        (80 * DEG, -4 * DEG, 3 * DEG, 0.015),
    ],
    ids=["rate", "rate-delay", "rate-stops-delay"],
)
def test_against_an_adaptive_integrator(rate: float, low: float, high: float, delay: float) -> None:
    command = 6 * DEG * np.sin(2 * np.pi * 3.0 * T) * np.exp(-T) + 4 * DEG * np.sign(
        np.sin(2 * np.pi * 1.3 * T)
    )
    y = one(command, rate_limit_rad_s=rate, minimum_rad=low, maximum_rad=high, delay_s=delay)
    expected = reference(command, rate, low, high, delay)
    free = one(command, delay_s=delay)
    assert np.abs(y - free).max() > 1 * DEG  # the limits are active
    # 1e-7 rad where a switch falls inside one of the integrator's steps; a stop is met within one
    np.testing.assert_allclose(y, expected, rtol=0, atol=2e-7 if np.isinf(high) else 5e-6)


def test_stops() -> None:
    c = np.interp(T, [0, 0.5, 1.0, 2.0], [0.0, 0.3, 0.3, -0.4])
    y = one(c, minimum_rad=-0.1, maximum_rad=0.2)
    assert y.max() == 0.2
    assert y.min() == -0.1
    free = one(c)
    rising = T <= 0.5
    np.testing.assert_allclose(y[rising], np.minimum(free, 0.2)[rising], rtol=0, atol=1e-14)
    # the command comes back below 0.2 at t* = 1 + 0.1/0.7: a ramp response starts there
    start, s = 1.0 + 0.1 / 0.7, -0.7
    after = (start < T) & (T < 1.4)
    tau = T[after] - start
    np.testing.assert_allclose(y[after], 0.2 + s * (tau + np.expm1(-W * tau) / W), rtol=0, atol=1e-13)


def test_starts_in_equilibrium_inside_the_stops() -> None:
    np.testing.assert_array_equal(one(np.full(50, 0.1)), np.full(50, 0.1))
    np.testing.assert_array_equal(one(np.full(50, 0.9), maximum_rad=0.2), np.full(50, 0.2))


def test_delay_of_whole_samples_shifts() -> None:
    c = np.cumsum(np.random.default_rng(0).standard_normal(100)) * 0.01
    y = one(c)
    for whole in (1, 3, 99, 150):
        late = one(c, delay_s=whole * DT)
        np.testing.assert_array_equal(late[whole:], y[: max(100 - whole, 0)])
        np.testing.assert_array_equal(late[:whole], np.full(min(whole, 100), y[0]))


def test_fractional_delay_is_exact() -> None:
    np.testing.assert_allclose(
        one(0.3 * T, delay_s=0.0123),
        np.where(T > 0.0123, 0.3 * ((T - 0.0123) + np.expm1(-W * (T - 0.0123)) / W), 0.0),
        rtol=0,
        atol=1e-14,
    )


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.floats(-0.6, 0.6), min_size=2, max_size=40),
    st.floats(0.05, 20.0),
    st.floats(0.1, 20.0),
    st.floats(0.0, 0.05),
)
def test_limits_hold(levels: list[float], rate: float, bandwidth: float, delay: float) -> None:
    y = respond(np.array([levels]), DT, bandwidth, rate, -0.3, 0.4, delay)
    assert np.abs(np.diff(y)).max() <= rate * DT * (1 + 1e-9) + 1e-15
    assert y.min() >= -0.3
    assert y.max() <= 0.4
    wide = respond(np.array([levels]), DT, bandwidth, 1e9, -10.0, 10.0, delay)
    np.testing.assert_allclose(
        wide, respond(np.array([levels]), DT, bandwidth, delay_s=delay), rtol=0, atol=1e-12
    )


def test_runs_are_independent() -> None:
    c = np.random.default_rng(1).standard_normal((5, 60)) * 0.2
    together = respond(c, DT, 5.0, 3.0, -0.3, 0.3, 0.015)
    for i in range(5):
        np.testing.assert_array_equal(together[i], respond(c[i : i + 1], DT, 5.0, 3.0, -0.3, 0.3, 0.015)[0])


@pytest.mark.parametrize("slope", [0.5, -0.5])
def test_a_command_that_moves_exactly_at_the_rate_limit(slope: float) -> None:
    """The error tends to the edge of the band and never leaves it: y = s (t - (1 - exp(-w t))/w), as without a limit.

    dt = 1/4 s and s = 1/2 rad/s are exact in binary, so that the command's slope equals the limit to the last bit.
    """
    t = np.arange(20) * 0.25
    y = respond(slope * t[None], 0.25, 0.2, rate_limit_rad_s=0.5)[0]
    w = 2.0 * np.pi * 0.2
    np.testing.assert_allclose(y, slope * (t + np.expm1(-w * t) / w), rtol=0, atol=1e-12)
