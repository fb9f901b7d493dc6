"""The gain of the filter in a record whose airspeed changes by much."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr

from airtruth.physics.terms import Change
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.response import filter_inputs, respond_to
from airtruth.tracing.model.schedule import UNSCHEDULED, schedule
from airtruth.units import G0

FAST, SLOW, SAMPLES = 44.0, 22.0, 250
"""Airspeed at the start and at the end [m/s], and samples of a record."""
T = np.arange(SAMPLES) * tr.DT
SPEED = np.interp(T, [0.0, T[-1]], [FAST, SLOW])


def slowing(rng, sigma_w, speed=SPEED):
    """A record in stationary gusts that slows down, its lift held at the weight; the linear motion at each sample's airspeed."""
    systems = [tr.motion(sigma_w=sigma_w, v=v) for v in speed]
    x = np.zeros(8)
    x[2:4] = np.linalg.cholesky(np.array([[1.0, 0.5], [0.5, 0.5]])) @ rng.standard_normal(2)
    x[5:] = x[2]
    x[4] = x @ tr.gust_row(0.5)
    y, pitch = [], []
    for (a, b, c, _), v in zip(systems, speed, strict=True):
        y.append(c @ x)
        pitch.append(x[1])
        values, vectors = np.linalg.eigh(
            tr.noise_step(a, tr.DT, np.array([0.0, 0.0, 2.0 * v / tr.LENGTH_W, *np.zeros(5)]))
        )
        kick = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(8))
        x = tr.discrete(a, b, tr.DT)[0] @ x + kick
    q = np.array(pitch)
    attitude = np.concatenate([[0.0], np.cumsum(0.5 * tr.DT * (q[1:] + q[:-1]))])
    y = np.array(y) + [0.0, 0.0, -G0] + tr.SETTINGS.noise * rng.standard_normal((len(speed), 3))
    made = tr.record(
        y, 0.0, lambda at: np.interp(at, T, attitude), v=lambda at: np.interp(at, T, speed), plant_=tr.plant()
    )
    grid = made.signals.airspeed_m_s
    level = 2.0 * tr.C.mass_kg * G0 / (tr.DENSITY * tr.C.wing_area_m2)
    lift = level * (1.0 / grid**2 - 1.0 / tr.V**2)
    return replace(made, remainder=np.stack([lift, np.zeros(grid.size)]))


def whitened(made, sigma_w, along=None):
    common, own = tr.still()
    own[SHORT_PERIOD.per_record.log_gust] = np.log(sigma_w)
    given = filter_inputs(made, Change())
    given = given if along is None else replace(given, along=along)
    found = respond_to(given, tr.SETTINGS, common, own)
    return found.e @ found.white.T, found


def test_conditions_of_a_record_of_hardly_any_change_are_its_mean():
    made = slowing(np.random.default_rng(1), 0.3, np.linspace(44.0, 36.0, SAMPLES))
    assert filter_inputs(made, Change()).along is UNSCHEDULED


def test_shares_interpolate_the_logarithm_of_the_airspeed():
    """Nodes in equal steps of log V from the least to the largest airspeed."""
    given = filter_inputs(slowing(np.random.default_rng(1), 0.3), Change())
    along = given.along
    nodes = np.linspace(np.log(SLOW), np.log(FAST), len(along.air))
    assert len(along.air) == 5  # a factor of two in steps of at most 1.25
    found = nodes[along.lower] + along.share * (nodes[along.lower + 1] - nodes[along.lower])
    np.testing.assert_allclose(found, np.log(SPEED), rtol=0.0, atol=1e-12)


def test_a_condition_is_the_mean_near_its_airspeed():
    """A constant is kept; airspeeds rise, those at the ends lie within half a step of the range, and the pressure is theirs."""
    grid = filter_inputs(slowing(np.random.default_rng(1), 0.3), Change()).grid
    along = schedule(np.full(SAMPLES, 0.05), grid, 2)
    assert along.flow_rad == pytest.approx([0.05] * 5, rel=1e-12)
    speeds = np.array([air.airspeed_m_s for air in along.air])
    assert (np.diff(speeds) > 0.0).all()
    assert speeds[1:-1] == pytest.approx(np.geomspace(SLOW, FAST, 5)[1:-1], rel=0.01)
    assert SLOW < speeds[0] < SLOW * 2.0**0.125
    assert FAST / 2.0**0.125 < speeds[-1] < FAST
    assert [air.qbar_pa for air in along.air] == pytest.approx(0.5 * tr.DENSITY * speeds**2, rel=1e-9)


def test_a_node_that_the_airspeed_jumps_over_has_the_mean():
    grid = filter_inputs(slowing(np.random.default_rng(1), 0.3), Change()).grid
    v = np.repeat([FAST, SLOW], [300, grid.airspeed_m_s.size - 300])
    alpha = np.where(v[::2] == FAST, 0.05, 0.1)
    along = schedule(alpha, grid._replace(airspeed_m_s=v, qbar_pa=0.5 * tr.DENSITY * v * v), 2)
    assert along.flow_rad == pytest.approx([0.1, *[alpha.mean()] * 3, 0.05], rel=1e-6)


def test_an_airspeed_of_zero_has_the_gain_of_a_quarter_of_the_largest():
    grid = filter_inputs(slowing(np.random.default_rng(1), 0.3), Change()).grid
    v = grid.airspeed_m_s.copy()
    v[-20:] = 0.0
    along = schedule(np.full(SAMPLES, 0.05), grid._replace(airspeed_m_s=v), 2)
    assert along.air[0].airspeed_m_s == pytest.approx(FAST / 4.0, rel=1e-6)
    assert along.lower[-1] == 0
    assert along.share[-1] == 0.0


def test_equal_conditions_are_as_one():
    made = slowing(np.random.default_rng(2), 0.3)
    given = filter_inputs(made, Change())
    equal = given.along._replace(flow_rad=(given.reference_flow_rad,) * 5, air=(given.reference,) * 5)
    r, found = whitened(made, 0.3, equal)
    expected, single = whitened(made, 0.3, UNSCHEDULED)
    np.testing.assert_allclose(r, expected, rtol=0.0, atol=1e-9)
    assert found.logdet == pytest.approx(single.logdet, abs=1e-9)


@pytest.mark.slow
def test_innovations_keep_their_stated_size_while_the_airspeed_halves():
    """15 records in gusts of 1 m/s: mean squares of 0.8 s at either end are 1 within 10 %, and 4 standard deviations more.

    With one gain, alpha's is off by a third at the slow end, where a gust moves alpha twice as far as at the fast one.
    """
    rng = np.random.default_rng(3)
    ends = slice(20, 60), slice(SAMPLES - 40, SAMPLES)
    squares = {True: [], False: []}
    for _ in range(15):
        made = slowing(rng, 1.0)
        for is_scheduled, values in squares.items():
            r, _ = whitened(made, 1.0, None if is_scheduled else UNSCHEDULED)
            values.append([(r[end] ** 2).mean(axis=0) for end in ends])
    scheduled, single = (np.mean(squares[key], axis=0) for key in (True, False))
    assert np.abs(scheduled - 1.0).max() < 0.1 + 4.0 * np.sqrt(2.0 / (15 * 40)), scheduled
    assert single[1, 0] > 1.33, single
    assert single[0, 0] < 0.95, single


def test_the_logarithm_of_the_covariance_follows_the_airspeed():
    """log|S| of each sample is that of a steady filter at its airspeed, to first order: mean over the record."""
    made = slowing(np.random.default_rng(4), 1.0)
    _, found = whitened(made, 1.0)
    at_ends = []
    for v in np.geomspace(SLOW, FAST, 9):
        still = slowing(np.random.default_rng(5), 1.0, np.full(SAMPLES, v))
        at_ends.append(whitened(still, 1.0)[1].logdet)
    expected = np.interp(np.log(SPEED), np.log(np.geomspace(SLOW, FAST, 9)), at_ends).mean()
    assert found.logdet == pytest.approx(expected, abs=0.02)
