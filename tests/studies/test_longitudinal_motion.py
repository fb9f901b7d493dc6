"""Nonlinear longitudinal motion against exact solutions, and the auxiliary model made of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from airtruth.physics import short_period
from airtruth.simulation.probe import ForceTables
from airtruth.units import G0
from studies.longitudinal_motion import Longitudinal, auxiliary, simulate

MASS, INERTIA, AIRSPEED = 26.195, 6.314, 42.85  # GTM, facts of aircraft/gtm
# M. Brunot's paper, table 1: true values.
THETA = np.array([4.793, 30.79, 0.480, -1.789, -41.41, -1.787])
SCALE = short_period.scale(0.5483, 0.27898, MASS, INERTIA, np.array([AIRSPEED]), np.array([0.9931]))


def planes(theta=THETA, drift=0.0):
    """Forces linear in alpha, elevator and q about level flight at alpha 0: Z = -m g - lift, X = 0."""
    alpha, elevator, q = np.array([-0.3, 0.3]), np.array([-0.3, 0.3]), np.array([-2.0, 2.0])
    s = SCALE
    a, e, r = np.meshgrid(alpha, elevator, q, indexing="ij")
    h = s.half_chord_time[0]
    lift = theta[0] * a + theta[1] * h * r + theta[2] * e
    moment = theta[3] * a + theta[4] * h * r + theta[5] * e
    values = np.stack([0.0 * a, -MASS * (G0 + s.normal[0] * lift), INERTIA * s.moment[0] * moment], axis=-1)
    tables = ForceTables(AIRSPEED * np.array([0.9, 1.1]), (alpha, elevator, q), np.stack([values, values]))
    return Longitudinal(tables, MASS, INERTIA, G0, AIRSPEED, 0.0, 0.0, 0.0, drift)


def exact(theta, u, dt):
    """Response of eq. (2) of the paper, input linear between samples, by the matrix exponential."""
    a, b = short_period.system(theta, SCALE)
    big = np.zeros((4, 4))
    big[:2, :2], big[:2, 2], big[2, 3] = a[0], b[0], 1.0
    step = expm(big * dt)
    x, out = np.zeros(2), []
    for now, then in zip(u, np.append(u[1:], u[-1]), strict=True):
        out.append(x)
        x = (step @ np.array([*x, now, (then - now) / dt]))[:2]
    return np.array(out).T


def doublet(samples=251):
    t = np.arange(samples) * 0.02
    return 1.0 * (t >= 1.0) - 2.0 * (t >= 1.5) + 1.0 * (t >= 2.0)


@pytest.mark.slow
def test_small_motion_is_the_linear_short_period():
    u = 1e-6 * doublet()
    motion = simulate(planes(), u[None], 0.02)
    alpha, q = exact(THETA, u, 0.02)
    # Runge-Kutta at 50 Hz: (wn dt)^5/120 = 3e-7 a step; cos(alpha) differs from 1 by 1e-12
    np.testing.assert_allclose(motion.alpha_rad[0], alpha, atol=5e-6 * np.ptp(alpha))
    np.testing.assert_allclose(motion.q_rad_s[0], q, atol=5e-6 * np.ptp(q))
    lift = THETA[0] * alpha + THETA[1] * SCALE.half_chord_time[0] * q + THETA[2] * u
    az = -G0 - SCALE.normal[0] * lift
    np.testing.assert_allclose(motion.az_m_s2[0], az, atol=5e-6 * np.ptp(az))
    assert (motion.airspeed_m_s == AIRSPEED).all()  # drift = 0


def test_small_motion_about_a_climb_with_a_deflected_elevator():
    """Elevator and flight path of the trim are neither zero nor equal. The thrust that holds the climb turns the path with
    alpha, as a larger CLalpha would."""
    level, elevator, gamma = planes(), -0.02, 0.03
    values = level.tables.values.copy()
    values[..., 0] += MASS * G0 * np.sin(gamma)
    values[..., 1] += MASS * G0 * (1.0 - np.cos(gamma))
    alpha, surface, q = level.tables.axes
    tables = replace(level.tables, axes=(alpha, surface + elevator, q), values=values)
    u = 1e-6 * doublet()
    climb = replace(level, tables=tables, elevator_rad=elevator, gamma_rad=gamma)
    motion = simulate(climb, elevator + u[None], 0.02)
    theta = THETA.copy()
    theta[0] += G0 * np.sin(gamma) / (AIRSPEED * SCALE.lift[0])
    alpha, q = exact(theta, u, 0.02)
    np.testing.assert_allclose(motion.alpha_rad[0], alpha, atol=5e-6 * np.ptp(alpha))
    np.testing.assert_allclose(motion.q_rad_s[0], q, atol=5e-6 * np.ptp(q))


def test_runge_kutta_is_of_fourth_order():
    def end(every):
        t = np.arange(0, 129, every) / 64.0
        motion = simulate(planes(drift=1.0), np.full((1, t.size), 0.02), every / 64.0)
        return motion.q_rad_s[0, -1]

    reference = end(1)
    errors = [abs(end(every) - reference) for every in (16, 8, 4)]
    assert errors[0] > 12.0 * errors[1] > 144.0 * errors[2]  # 16 in the limit


@pytest.mark.slow
def test_phugoid_has_lanchester_s_period():
    """Lift ~ V^2 along the wind's normal, no drag: period = sqrt(2) pi V/g (Lanchester 1908; Etkin and Reid,
    Dynamics of Flight, 3rd ed., eq. 6.3,5)."""
    v = AIRSPEED * (1.0 + 1e-3 * np.arange(-10, 11))
    alpha = np.linspace(-0.1, 0.1, 41)
    lift = MASS * G0 * (v / AIRSPEED) ** 2
    values = np.zeros((v.size, alpha.size, 2, 2, 3))
    values[..., 0] = (lift[:, None] * np.sin(alpha))[..., None, None]
    values[..., 1] = -(lift[:, None] * np.cos(alpha))[..., None, None]
    kick = np.array([0.0, 1.0])
    values[:, :, 1, :, 1] *= 1.05  # the elevator adds lift, for one second
    tables = ForceTables(v, (alpha, kick, np.array([-1.0, 1.0])), values)
    model = Longitudinal(tables, MASS, INERTIA, G0, AIRSPEED, 0.0, 0.0, 0.0)
    dt = 0.05
    elevator = np.where(np.arange(1200) * dt < 1.0, 0.1, 0.0)
    speed = simulate(model, elevator[None], dt).airspeed_m_s[0] - AIRSPEED
    up = np.flatnonzero((speed[40:-1] < 0.0) & (speed[41:] >= 0.0)) + 40
    crossings = (up + speed[up] / (speed[up] - speed[up + 1])) * dt
    # the tables are linear over 0.1 % of airspeed, and the amplitude is 0.2 %
    assert np.diff(crossings).mean() == pytest.approx(np.sqrt(2.0) * np.pi * AIRSPEED / G0, rel=2e-3)


def test_tables_hold_their_end_values():
    model = planes()
    edge, outside = simulate(model, np.array([[0.3, 0.3], [0.9, 0.9]]), 0.02).az_m_s2[:, 0]
    assert edge == outside


def test_auxiliary_at_the_declared_values_is_the_tables_alone():
    model, u = planes(drift=1.0), 0.03 * doublet()[None]
    alpha, q = auxiliary(model, THETA)(THETA[None], u, 0.02, SCALE)
    motion = simulate(model, u, 0.02)
    np.testing.assert_array_equal(alpha, motion.alpha_rad)
    np.testing.assert_array_equal(q, motion.q_rad_s)


def test_auxiliary_moves_the_derivatives_to_the_estimate():
    theta, u = THETA * np.array([0.9, 1.3, 0.5, 0.8, 1.2, 1.1]), 1e-6 * doublet()
    alpha, q = auxiliary(planes(), THETA)(theta[None], u[None], 0.02, SCALE)
    expected = exact(theta, u, 0.02)
    np.testing.assert_allclose(alpha[0], expected[0], atol=5e-6 * np.ptp(expected[0]))
    np.testing.assert_allclose(q[0], expected[1], atol=5e-6 * np.ptp(expected[1]))


def test_a_run_does_not_depend_on_its_neighbours():
    model, u = planes(drift=1.0), np.stack([0.03 * doublet(), -0.01 * doublet()])
    together = simulate(model, u, 0.02)
    alone = simulate(model, u[1:], 0.02)
    np.testing.assert_array_equal(together.q_rad_s[1:], alone.q_rad_s)
