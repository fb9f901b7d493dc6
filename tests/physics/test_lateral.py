"""The linear lateral-directional model against a published aircraft, scipy and differences."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth.physics.lateral import lateral_modes, lateral_scale, lateral_system
from airtruth.physics.motion import LATERAL
from airtruth.units import FT, KT, LB, SLUG

SLUG_FT2 = SLUG * FT**2
GTM = SimpleNamespace(
    wing_area_m2=5.9018 * FT**2,
    span_m=2.08751,
    mass_kg=57.75 * LB,
    inertia_xx_kg_m2=1.221 * SLUG_FT2,
    inertia_yy_kg_m2=4.657 * SLUG_FT2,
    inertia_zz_kg_m2=5.587 * SLUG_FT2,
    inertia_xz_kg_m2=0.274 * SLUG_FT2,
)
"""NASA GTM T-2, GTM_DesignSim."""
THETA = np.array(
    [
        *(-1.0158, 0.063, 0.8565, -0.0157, 0.3406),
        *(-0.1403, -0.3352, 0.1472, -0.0718, 0.0266),
        *(0.2185, -0.0528, -0.3897, -0.0035, -0.1700),
    ]
)
"""Derivatives of the GTM at 75 kt EAS, 7000 ft, from an independent six-degree-of-freedom integration of NASA's tables."""
SPEED = 42.85
DENSITY = 1.225 * (75.0 * KT / SPEED) ** 2
ALPHA = np.radians(5.56)


def gtm_scale(shape=()):
    return lateral_scale(GTM, np.full(shape, SPEED), DENSITY, ALPHA, ALPHA)


def test_modes_are_those_of_the_independent_integration():
    values, _ = lateral_modes(THETA, gtm_scale())
    # derivatives with four decimals leave 2e-4 of the Dutch roll and 1e-4 1/s of the spiral
    np.testing.assert_allclose(values[:3], [5.985, 0.120, -5.434], rtol=1e-3)
    assert values[3] == pytest.approx(-0.0366, abs=2e-4)


def test_slopes_of_the_modes_are_those_of_differences():
    _, slopes = lateral_modes(THETA, gtm_scale())
    step = 1e-6
    moved = THETA + step * np.stack([np.eye(15), -np.eye(15)])
    values, _ = lateral_modes(moved, gtm_scale((2, 15)))
    np.testing.assert_allclose((values[0] - values[1]).T / (2.0 * step), slopes, rtol=1e-6, atol=1e-7)


def full_equations(x, da, dr, scale):
    """Rates of beta, p, r, phi by the nonlinear equations of Klein and Morelli, 3.2, with constant V, alpha, theta."""
    beta, p, r, phi = x
    q_s = scale.force * GTM.mass_kg
    rates = np.array([beta, p * scale.half_span_time, r * scale.half_span_time, da, dr])
    cy, cl, cn = THETA.reshape(3, 5) @ rates
    ixx, izz, ixz = GTM.inertia_xx_kg_m2, GTM.inertia_zz_kg_m2, GTM.inertia_xz_kg_m2
    inertia = np.array([[ixx, -ixz], [-ixz, izz]])
    moments = np.linalg.solve(inertia, q_s * GTM.span_m * np.array([cl, cn]))
    v = scale.airspeed_m_s
    gravity = 9.80665 / v * np.cos(scale.theta_rad) * np.sin(phi)
    beta_dot = (
        q_s * cy / (GTM.mass_kg * v) + p * np.sin(scale.alpha_rad) - r * np.cos(scale.alpha_rad) + gravity
    )
    return np.array(
        [beta_dot, *moments, p + r * np.cos(phi) * np.tan(scale.theta_rad)]
    ), q_s * cy / GTM.mass_kg


def test_linear_model_is_the_tangent_of_the_equations_of_motion():
    scale = gtm_scale()
    linear = lateral_system(THETA, scale)
    step = 1e-5
    for number, (matrix, row) in enumerate([*zip(linear.a.T, linear.c[4], strict=False)]):
        x = step * np.eye(4)[number]
        (up, ay_up), (down, ay_down) = (full_equations(s * x, 0.0, 0.0, scale) for s in (1.0, -1.0))
        np.testing.assert_allclose((up - down) / (2 * step), matrix, rtol=1e-8, atol=1e-9)
        assert (ay_up - ay_down) / (2 * step) == pytest.approx(row, rel=1e-8)
    for number in range(2):
        da, dr = step * np.eye(2)[number]
        rates, ay = full_equations(np.zeros(4), da, dr, scale)
        np.testing.assert_allclose(rates / step, linear.b[:, number], rtol=1e-8, atol=1e-9)
        assert ay / step == pytest.approx(linear.d[4, number], rel=1e-8)
    assert linear.c.shape == (len(LATERAL.outputs), len(LATERAL.states))


def test_small_motion_follows_scipys_integration():
    scale = gtm_scale()
    linear = lateral_system(THETA, scale)
    start = 1e-4 * np.array([1.0, 2.0, -1.0, 3.0])
    end = solve_ivp(
        lambda t, x: full_equations(x, 1e-4, -1e-4, scale)[0], (0.0, 2.0), start, rtol=1e-11, atol=1e-14
    ).y[:, -1]
    by_model = solve_ivp(
        lambda t, x: linear.a @ x + linear.b @ np.array([1e-4, -1e-4]),
        (0.0, 2.0),
        start,
        rtol=1e-11,
        atol=1e-14,
    ).y[:, -1]
    np.testing.assert_allclose(by_model, end, rtol=1e-6)


def test_inertias_of_no_body_are_refused():
    wrong = SimpleNamespace(**{**vars(GTM), "inertia_xz_kg_m2": 10.0})
    with pytest.raises(ValueError, match="inertia_xz"):
        lateral_scale(wrong, SPEED, DENSITY, ALPHA, ALPHA)
