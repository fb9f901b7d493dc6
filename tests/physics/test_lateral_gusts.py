"""Lateral Dryden gusts: the spectra of MIL-F-8785C written out, closed-form covariances, the discrete model."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad

from airtruth.physics import dryden, lateral_gusts
from airtruth.physics.lateral_gusts import LateralDryden

Array = NDArray[np.float64]

# GTM, light, 7000 ft: sigma_v = sigma_w = .8118 m/s, Lv = Lw
GTM = LateralDryden(0.8118, 0.8118, 840.419, 840.419, 42.85, 2.08751)
LOW = LateralDryden(2.0, 1.5, 60.0, 12.0, 30.0, 9.0)
CASES = pytest.mark.parametrize("gust", [GTM, LOW], ids=["gtm", "low"])

conditions = st.builds(
    LateralDryden,
    sigma_v_m_s=st.floats(0.1, 10.0),
    sigma_w_m_s=st.floats(0.1, 10.0),
    length_v_m=st.floats(3.0, 1000.0),
    length_w_m=st.floats(3.0, 1000.0),
    airspeed_m_s=st.floats(10.0, 300.0),
    span_m=st.none() | st.floats(0.5, 80.0),
)


def specified(gust: LateralDryden, w: float) -> Array:
    """Phi_v, Phi_p, Phi_r of MIL-F-8785C, 3.7.1.2, over omega [rad/s]."""
    v, b = gust.airspeed_m_s, gust.span_m or 0.0
    x = (gust.length_v_m * w / v) ** 2
    phi_v = gust.sigma_v_m_s**2 * gust.length_v_m / (np.pi * v) * (1 + 3 * x) / (1 + x) ** 2
    level = gust.sigma_w_m_s**2 / (v * gust.length_w_m) * 0.8 * np.cbrt(np.pi * gust.length_w_m / (4 * b))
    phi_p = level / (1 + (4 * b * w / (np.pi * v)) ** 2)
    phi_r = (w / v) ** 2 / (1 + (3 * b * w / (np.pi * v)) ** 2) * phi_v
    return np.array([phi_v, phi_p, phi_r])


@CASES
def test_spectra_are_those_of_the_specification(gust: LateralDryden) -> None:
    for w in (0.0, 0.03, 0.7, 20.0, 900.0):
        np.testing.assert_allclose(lateral_gusts.spectrum(gust, w), specified(gust, w), rtol=1e-13)


@CASES
def test_variance_is_the_integral_of_the_specified_spectrum(gust: LateralDryden) -> None:
    found = np.diagonal(lateral_gusts.covariance(gust, 0.0))
    for i in range(3):
        total = quad(lambda x, i=i: specified(gust, np.exp(x))[i] * np.exp(x), -25, 30, limit=400)[0]
        assert total == pytest.approx(found[i], rel=1e-9)


@CASES
@pytest.mark.parametrize("lag", [0.0, 0.1, -1.3])
def test_covariances_of_v_and_p_in_closed_form(gust: LateralDryden, lag: float) -> None:
    """R_v = sigma_v^2 (1 - x/2) exp(-x), x = |lag| V/Lv; R_p = sigma_p^2 exp(-|lag| pi V/(4 b)); p is independent."""
    v, b = gust.airspeed_m_s, gust.span_m or 0.0
    found = lateral_gusts.covariance(gust, lag)
    x = abs(lag) * v / gust.length_v_m
    assert found[0, 0] == pytest.approx(gust.sigma_v_m_s**2 * (1 - x / 2) * np.exp(-x), rel=1e-13)
    sigma_p = lateral_gusts.roll_deviation_rad_s(gust.sigma_w_m_s, gust.length_w_m, b)
    assert found[1, 1] == pytest.approx(
        sigma_p**2 * np.exp(-abs(lag) * np.pi * v / (4 * b)), rel=1e-12, abs=1e-18
    )
    np.testing.assert_array_equal(found[1, [0, 2]], 0.0)
    np.testing.assert_array_equal(found[[0, 2], 1], 0.0)


def test_yaw_gust_leads_the_side_gust_as_its_slope_does() -> None:
    """R_vr(lag) = -(1/V) dR_v/dlag for a short span: E[v(t + lag) dv/dt(t)]/V."""
    gust = LateralDryden(1.0, 1.0, 200.0, 200.0, 40.0, 1e-3)
    lag, a = 0.8, 40.0 / 200.0
    slope = -a * (1.5 - 0.5 * a * lag) * np.exp(-a * lag)  # of (1 - a lag/2) exp(-a lag)
    assert lateral_gusts.covariance(gust, lag)[0, 2] == pytest.approx(-slope / 40.0, rel=1e-4)


@settings(max_examples=150, deadline=None)
@given(conditions, st.sampled_from([1e-4, 0.005, 0.02, 0.1, 10.0]), st.integers(0, 5000))
def test_discrete_covariance_is_the_continuous_one(gust: LateralDryden, dt: float, lag: int) -> None:
    model = lateral_gusts.discretise(gust, dt)
    state = model.start @ model.start.T
    found = model.output @ np.linalg.matrix_power(model.phi, lag) @ state @ model.output.T
    deviation = np.sqrt(np.diagonal(lateral_gusts.covariance(gust, 0.0)))
    error = (found - lateral_gusts.covariance(gust, lag * dt)) / np.outer(deviation, deviation)
    assert np.abs(error).max() < 1e-10
    np.testing.assert_allclose(
        model.phi @ state @ model.phi.T + model.gamma @ model.gamma.T, state, rtol=0, atol=1e-12
    )


def test_simulated_gusts_have_the_standard_deviations() -> None:
    """4000 seeds, one sample each: within 4 standard errors, 1/sqrt(2 n)."""
    seeds = 4000
    model = lateral_gusts.discretise(GTM, 0.005)
    normals = np.random.default_rng(6).standard_normal((seeds, 2, 4))
    y = dryden.simulate(model, normals)
    variance = np.diagonal(lateral_gusts.covariance(GTM, 0.0))
    np.testing.assert_allclose(np.mean(y[:, 1] ** 2, axis=0) / variance, 1.0, atol=4 * np.sqrt(2 / seeds))


def test_without_a_span_there_is_the_side_gust_alone() -> None:
    gust = LateralDryden(0.8, 0.8, 840.0, 840.0, 42.85)
    assert lateral_gusts.discretise(gust, 0.005).output.shape[0] == 1
    assert lateral_gusts.covariance(gust, [0.0])[0].tolist() == [[pytest.approx(0.64, rel=1e-14)]]
