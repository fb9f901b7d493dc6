"""Between the measured surface and the air: analytic responses; nodes with Simpson's area."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import simpson, trapezoid

from airtruth.physics.terms import SurfaceTerm
from airtruth.tracing.model.records import FINE, nodes
from airtruth.tracing.model.surface import through

DT = 1.0 / 800.0
T = np.arange(1601) * DT


def one(kind, value, x, dt=DT):
    return through((SurfaceTerm(kind, value),), x, dt)


@pytest.mark.parametrize("delay", [0.0, 0.3 * DT, 4.0 * DT, 0.0437])
def test_delay_of_a_ramp_is_the_ramp_later(delay):
    """Linear between points, so that a ramp with its corner on a point is exact; the past is the first value."""
    np.testing.assert_allclose(
        one("delay", delay, 0.2 + 3.0 * T), 0.2 + 3.0 * np.maximum(T - delay, 0.0), rtol=1e-13, atol=1e-13
    )


def test_delay_by_whole_points_is_a_shift():
    x = np.sin(7.0 * T)
    np.testing.assert_array_equal(one("delay", 8 * DT, x)[8:], x[:-8])


@given(st.floats(1e-4, 0.5), st.floats(-2.0, 2.0), st.floats(-5.0, 5.0))
@settings(deadline=None, max_examples=50)
def test_lag_of_a_ramp(tau, start, slope):
    """tau y' = x - y from equilibrium: y = start + slope (t - tau (1 - exp(-t/tau)))."""
    expected = start + slope * (T + tau * np.expm1(-T / tau))
    np.testing.assert_allclose(one("lag", tau, start + slope * T), expected, rtol=1e-11, atol=1e-11)


def test_lag_of_a_trapezoid_is_a_sum_of_ramps():
    """Corners on points: linear in between, so exact."""
    tau, corners, slopes = 0.03, (0.25, 0.3, 1.0, 1.1), (2.0, -2.0, -1.0, 1.0)
    x, expected = np.zeros_like(T), np.zeros_like(T)
    for at, slope in zip(corners, slopes, strict=True):
        after = np.maximum(T - at, 0.0)
        x += slope * after
        expected += slope * (after + tau * np.expm1(-after / tau))
    np.testing.assert_allclose(one("lag", tau, x), expected, atol=1e-12)


def test_rate_limit_of_a_step():
    """A step of 0.1 rad at 0.5 rad/s takes 0.2 s."""
    step = np.where(T > 0.0, 0.1, 0.0)
    np.testing.assert_allclose(one("rate_limit", 0.5, step), np.minimum(0.5 * T, 0.1), atol=1e-14)
    np.testing.assert_allclose(one("rate_limit", 0.5, -step), -np.minimum(0.5 * T, 0.1), atol=1e-14)


def test_rate_limit_lets_slower_motion_pass():
    """0.05 sin(8 t) reaches 0.4 rad/s; limited to 0.3 it is a triangle wave once it follows no more."""
    x = 0.05 * np.sin(8.0 * T)
    np.testing.assert_allclose(one("rate_limit", 0.4001, x), x, atol=1e-15)
    limited = one("rate_limit", 0.3, x)
    assert np.abs(np.diff(limited)).max() == pytest.approx(0.3 * DT, rel=1e-12)


def test_backlash_of_a_sine():
    """Amplitude 1, half width b: 0 until x = b, x - b up, 1 - b until x = 1 - 2 b, x + b down, held, and so on."""
    b, t = 0.2, np.arange(4001) * (1.5 * math.pi) / 4000
    x = np.sin(t)
    up = x - b
    expected = np.where(
        t <= math.asin(b),
        0.0,
        np.where(t <= 0.5 * math.pi, up, np.where(t <= math.pi - math.asin(1.0 - 2.0 * b), 1.0 - b, x + b)),
    )
    np.testing.assert_allclose(one("backlash", 2.0 * b, x), expected, atol=1e-6)  # peak between points


@given(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=60), st.floats(1e-3, 0.5))
@settings(deadline=None)
def test_invariants(values, amount):
    x = np.array(values)
    slack = one("backlash", amount, x)
    assert np.abs(slack - x).max() <= 0.5 * amount + 1e-15
    assert slack[0] == x[0]
    np.testing.assert_array_equal(one("backlash", amount, x), one("backlash", amount, x))
    limited = one("rate_limit", amount / DT, x)
    assert np.abs(np.diff(limited)).max() <= amount * (1.0 + 1e-12) + 1e-15
    np.testing.assert_allclose(one("rate_limit", amount / DT, limited), limited, atol=1e-15)
    for kind in ("delay", "lag"):
        out = one(kind, amount, x)
        assert x.min() - 1e-12 <= out.min()
        assert out.max() <= x.max() + 1e-12
        np.testing.assert_allclose(one(kind, amount, 2.0 * x - 1.0), 2.0 * out - 1.0, atol=1e-12)


@pytest.mark.parametrize(
    "term",
    [
        SurfaceTerm("delay", 0.0),
        SurfaceTerm("lag", 0.0),
        SurfaceTerm("rate_limit", math.inf),
        SurfaceTerm("backlash", 0.0),
    ],
)
def test_neutral_terms_change_no_bit(term):
    x = np.sin(5.0 * T)
    np.testing.assert_array_equal(through((term,), x, DT), x)


def test_terms_act_in_the_order_given():
    x = np.minimum(4.0 * T, 0.1)
    limit, lag = SurfaceTerm("rate_limit", 1.0), SurfaceTerm("lag", 0.05)
    limited_first = through((limit, lag), x, DT)
    np.testing.assert_array_equal(limited_first, one("lag", 0.05, one("rate_limit", 1.0, x)))
    # the lag of 4 rad/s onto 0.1 rad peaks at 1.6 rad/s, so that a limit of 1 rad/s bites on either side of it
    assert np.abs(limited_first - through((lag, limit), x, DT)).max() > 1e-3


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_nodes_keep_ends_and_area(steps, seed):
    """Per step of 2 FINE cells, Simpson's rule over its three nodes has the trapezoidal area of the fine points."""
    cells = 2 * FINE
    fine = np.random.default_rng(seed).standard_normal(steps * cells + 1)
    out = nodes(fine)
    assert out.size == 2 * steps + 1
    np.testing.assert_array_equal(out[::2], fine[::cells])
    for k in range(steps):
        area = trapezoid(fine[k * cells : (k + 1) * cells + 1], dx=1.0 / cells)
        assert simpson(out[2 * k : 2 * k + 3], dx=0.5) == pytest.approx(area, abs=1e-13)


def test_nodes_of_a_line_are_on_it():
    line = 0.3 - 0.7 * np.arange(4 * FINE + 1) / FINE
    np.testing.assert_allclose(nodes(line), line[::FINE], atol=1e-15)
