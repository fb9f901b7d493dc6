"""The tangent linear model, and surfaces uncertain between their samples, of the lateral-directional motion."""

from dataclasses import replace

import lateral_records as lr
import numpy as np
import pytest
from added_signals import Added, flown_with

from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import Change, SensorTerm
from airtruth.tracing.model.corners import input_columns, spread_of
from airtruth.tracing.model.linearise import linearise
from airtruth.tracing.model.response import filter_inputs, respond_to
from airtruth.tracing.model.tangent import POINTS, flown_of, propagated, tangent_of
from airtruth.units import DEG

SAMPLES = 60


def aileron(t):
    return 3.0 * DEG * np.sin(5.0 * t)


def rudder(t):
    return 2.0 * DEG * np.sin(4.0 * t + 1.0)


def noisy(seed=1):
    rng = np.random.default_rng(seed)
    still = lr.record(np.zeros((SAMPLES, 5)), aileron, rudder, sub=4)
    y = lr.free(still, own=lr.per_record((0.01, 0.1, 0.0, 0.05))) + lr.NOISE * rng.standard_normal(
        (SAMPLES, 5)
    )
    return lr.record(y, aileron, rudder, sub=4)


CHANGES = {
    "plain": Change(),
    "late sensors": Change(
        sensors=(SensorTerm("ay_m_s2", "lag", 0.03), SensorTerm("beta_rad", "delay", 0.03))
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_increments_are_those_of_two_flights(name):
    """Central differences of flights with the gains held."""
    given = filter_inputs(noisy(), CHANGES[name])
    common, own = lr.common(rotary=0.5), lr.per_record((0.01, 0.1, 0.0, 0.05), level=0.5)
    tangent = tangent_of(given, lr.SETTINGS, common, own)
    base = respond_to(given, lr.SETTINGS, common, own)
    rng = np.random.default_rng(2)
    points = given.grid.side.size
    lines, output = rng.normal(size=(3, points)), rng.normal(size=(SAMPLES, 5))
    lines[:, 0] = 0.0  # a late sensor is settled with them
    at = np.arange((points - 1) // 2)[:, None] * 2 + np.arange(POINTS)
    for number in range(4):
        shown = np.eye(4)[number]
        force = np.moveaxis(lines[:, at] * shown[:3, None, None], 0, 2)
        found = propagated(tangent, force[..., None], (shown[3] * output)[..., None])[0]
        h = 1e-6
        ends = [
            flown_with(
                Added(sign * h * shown[:3, None] * lines, sign * h * shown[3] * output),
                *(given, lr.SETTINGS, common, own),
                steady=base.steady,
            )
            for sign in (1.0, -1.0)
        ]
        expected = (ends[0] - ends[1]) / (2.0 * h)
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max(), err_msg=str(number))


def test_signals_along_the_flight():
    given = filter_inputs(noisy(), Change())
    tangent = tangent_of(given, lr.SETTINGS, lr.common(), lr.per_record(level=0.5))
    names = flown_of(LATERAL)
    assert names[-2:] == ("body_phat", "body_rhat")
    series = tangent.matrices.flown
    assert series.shape[2] == len(names)
    for name, column in (("aileron", given.grid.aileron_rad), ("rudder", given.grid.rudder_rad)):
        own = series[:, :, names.index(name)]
        assert (own == np.stack([column[:-2:2], column[1::2], column[2::2]], axis=1)).all()
        assert tangent.start[1 + ("aileron", "rudder").index(name)] == column[0]
    # without a share of the rotary gusts the air's rates are the body's
    assert (series[:, :, names.index("phat")] == series[:, :, names.index("body_phat")]).all()


def test_surfaces_that_are_uncertain_in_a_cell():
    """One exact update later the covariance has what each surface adds; the innovation that follows is scaled by it."""
    base = noisy()
    variance = np.zeros((2, SAMPLES))
    variance[0, 20], variance[1, 40] = DEG**2, (2.0 * DEG) ** 2
    uncertain = replace(base, signals=replace(base.signals, corner_rad2=variance))
    plain, shaken = (lr.responded(r, own=lr.per_record(level=0.5)) for r in (base, uncertain))
    assert shaken.more_logdet > 0.0
    assert (plain.e[:20] == shaken.e[:20]).all()
    given, kernel = lr.kernel(uncertain, own=lr.per_record(level=0.5))
    n = kernel.model.states.size
    a, c, x = np.empty((n, n)), np.empty((5, n)), np.zeros(n)
    x[0] = given.reference_flow_rad
    linearise(x, given.reference, kernel.model, a, c)
    columns = input_columns(x, given.reference, kernel.model, 2)
    corners, steady = shaken.steady.corners, shaken.steady
    for number in range(2):
        spread = spread_of(a, columns[number], lr.DT)
        np.testing.assert_allclose(corners.spread[0, number], spread, rtol=1e-9, atol=1e-18)
    # the first uncertain sample has the innovation of the steady filter; the late output follows another update, which bends
    grown = steady.covariance + DEG**2 * c @ corners.spread[0, 0] @ c.T
    white = np.linalg.solve(np.linalg.cholesky(grown), plain.e[20])
    scaled = np.linalg.solve(np.linalg.cholesky(steady.covariance), shaken.e[20])
    assert np.abs(scaled) == pytest.approx(np.abs(white), rel=1e-4)
