"""Dryden gusts: discrete against continuous, simulated against analytic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad

from airtruth.errors import ConfigurationError
from airtruth.physics import dryden
from airtruth.physics.dryden import DiscreteGust, Dryden

Array = NDArray[np.float64]

# GTM, light, 7000 ft, V 42.85 m/s, span 2.0875 m
GTM = Dryden(1.1659, 0.8118, 911.218, 840.419, 42.85)
GTM_ROTARY = Dryden(1.1659, 0.8118, 911.218, 840.419, 42.85, 2.08751)
DT = 0.005

conditions = st.builds(
    Dryden,
    sigma_u_m_s=st.floats(0.1, 10.0),
    sigma_w_m_s=st.floats(0.1, 10.0),
    length_u_m=st.floats(10.0, 1000.0),
    length_w_m=st.floats(3.0, 1000.0),
    airspeed_m_s=st.floats(10.0, 300.0),
    span_m=st.none() | st.floats(0.5, 80.0),
)
steps = st.sampled_from([1e-4, 0.001, 0.005, 0.02, 0.1, 1.0, 10.0])


def discrete_covariance(g: DiscreteGust, lag: int) -> Array:
    """E[y(i + lag) y(i)'] of a stationary discrete model."""
    p = g.start @ g.start.T
    return g.output @ np.linalg.matrix_power(g.phi, lag) @ p @ g.output.T


def relative_error(found: Array, expected: Array, variance: Array) -> float:
    scale = np.sqrt(np.outer(variance, variance))
    return float(np.max(np.abs(found - expected) / scale))


@settings(max_examples=200, deadline=None)
@given(conditions, steps, st.integers(0, 5000))
def test_discrete_covariance_is_the_continuous_one(d: Dryden, dt: float, lag: int) -> None:
    g = dryden.discretise(d, dt)
    expected = dryden.covariance(d, lag * dt)
    variance = np.diagonal(dryden.covariance(d, 0.0))
    assert relative_error(discrete_covariance(g, lag), expected, variance) < 1e-10


@settings(max_examples=200, deadline=None)
@example(Dryden(1.0, 1.0, 10.0, 750.9140625, 106.0, 1.0), 10.0)
@example(Dryden(1.0, 1.0, 10.0, 1000.0, 90.0, 0.5), 10.0)
@given(conditions, steps)
def test_process_noise_keeps_the_covariance(d: Dryden, dt: float) -> None:
    g = dryden.discretise(d, dt)
    p = g.start @ g.start.T
    np.testing.assert_allclose(g.phi @ p @ g.phi.T + g.gamma @ g.gamma.T, p, rtol=0, atol=1e-12)
    assert (np.diagonal(g.gamma) > 0).all()


CASES = pytest.mark.parametrize(
    "d", [GTM_ROTARY, Dryden(2.0, 1.5, 60.0, 12.0, 30.0, 9.0)], ids=["gtm", "low"]
)


@CASES
def test_variance_is_the_integral_of_the_spectrum(d: Dryden) -> None:
    """Independent of the state-space form: the spectra of MIL-F-8785C, integrated over all decades."""
    expected = np.diagonal(dryden.covariance(d, 0.0))
    for i in range(3):
        total = quad(lambda x, i=i: dryden.spectrum(d, np.exp(x))[i] * np.exp(x), -25, 30, limit=400)[0]
        assert total == pytest.approx(expected[i], rel=1e-9)


@CASES
@pytest.mark.parametrize("lag", [0.1, 1.3])
def test_covariance_is_the_transform_of_the_spectrum(d: Dryden, lag: float) -> None:
    v, tau = float(d.airspeed_m_s), 4 * (d.span_m or 0.0) / (np.pi * float(d.airspeed_m_s))
    expected = dryden.covariance(d, lag)
    for i in range(3):
        value = quad(lambda w, i=i: dryden.spectrum(d, w)[i], 0, np.inf, weight="cos", wvar=lag)[0]
        assert value == pytest.approx(expected[i, i], abs=1e-8)

    # q = H w with H = (j omega/V)/(1 + j omega tau): E[w(t + lag) q(t)] has the spectrum conj(H) Phi_w
    def real(w: float) -> float:
        return float(dryden.spectrum(d, w)[1] * (w * w * tau / v) / (1 + (w * tau) ** 2))

    def imaginary(w: float) -> float:
        return float(dryden.spectrum(d, w)[1] * (w / v) / (1 + (w * tau) ** 2))

    even = quad(real, 0, np.inf, weight="cos", wvar=lag)[0]
    odd = quad(imaginary, 0, np.inf, weight="sin", wvar=lag)[0]
    assert even + odd == pytest.approx(expected[1, 2], abs=1e-8)
    assert even - odd == pytest.approx(expected[2, 1], abs=1e-8)
    np.testing.assert_allclose(dryden.covariance(d, -lag), expected.T, rtol=0, atol=1e-15)


def test_variance_is_sigma_squared() -> None:
    c = dryden.covariance(GTM_ROTARY, [0.0])[0]
    assert c[0, 0] == pytest.approx(1.1659**2, rel=1e-14)
    assert c[1, 1] == pytest.approx(0.8118**2, rel=1e-14)
    assert c[0, 1] == c[0, 2] == 0.0


@settings(max_examples=30, deadline=None)
@given(conditions, steps)
def test_simulation_is_the_discrete_model(d: Dryden, dt: float) -> None:
    """Linear in the normals: the responses to unit impulses, squared and summed, are the exact covariance."""
    g = dryden.discretise(d, dt)
    k, samples = g.phi.shape[-1], 12
    impulses = np.eye(samples * k).reshape(samples * k, samples, k)
    variance = np.diagonal(dryden.covariance(d, 0.0))

    y = dryden.simulate(g, impulses)
    for i in range(samples):
        for j in range(samples):
            found = y[:, i].T @ y[:, j]
            assert relative_error(found, dryden.covariance(d, (i - j) * dt), variance) < 1e-10

    rest = dryden.simulate(g, impulses, start="rest")
    assert (rest[:, 0] == 0).all()
    m = samples - 1
    # from rest the variance of u is sigma^2 (1 - exp(-2 t V/Lu))
    t = m * dt * float(d.airspeed_m_s) / float(d.length_u_m)
    assert (rest[:, m, 0] ** 2).sum() == pytest.approx(variance[0] * -np.expm1(-2 * t), rel=1e-10)
    f = np.linalg.matrix_power(g.phi, m)
    lost = g.output @ f @ g.start
    expected = dryden.covariance(d, 0.0) - lost @ lost.T
    assert relative_error(rest[:, m].T @ rest[:, m], expected, variance) < 1e-10


def test_process_noise_by_quadrature() -> None:
    """Covariance of a step of w from rest: the integral of the squared impulse response of H_w."""
    g = dryden.discretise(GTM, DT)
    a = 42.85 / 840.419
    gain = 0.8118 * np.sqrt(3 * a)  # noise of intensity 1: sqrt(3 V/(pi L)) sqrt(pi)

    def impulse(t: float) -> float:
        return gain * (1 + a * (1 / np.sqrt(3) - 1) * t) * np.exp(-a * t)

    expected = quad(lambda t: impulse(t) ** 2, 0, DT, epsabs=0, epsrel=1e-13)[0]
    row = g.output[1] @ g.gamma
    assert row @ row == pytest.approx(expected, rel=1e-11)


def test_stationary_from_the_first_sample() -> None:
    """2000 seeds: the variance at each of several samples within 4 standard errors, sqrt(2/n)."""
    seeds, samples = 2000, 101
    g = dryden.discretise(GTM_ROTARY, DT)
    normals = np.stack([np.random.default_rng(s).standard_normal((samples, 4)) for s in range(seeds)])
    y = dryden.simulate(g, normals)
    variance = np.diagonal(dryden.covariance(GTM_ROTARY, 0.0))
    for i in (0, 1, 10, 100):
        ratio = np.mean(y[:, i] ** 2, axis=0) / variance
        np.testing.assert_allclose(ratio, 1.0, atol=4 * np.sqrt(2 / seeds))
    rest = dryden.simulate(g, normals, start="rest")
    spread = np.mean(rest[:, 100] ** 2, axis=0) / variance
    a = 42.85 / 911.218
    assert spread[0] == pytest.approx(1 - np.exp(-2 * a * 0.5), rel=4 * np.sqrt(2 / seeds))


def test_simulated_spectrum() -> None:
    """Mean tapered periodogram over 3000 runs against its exact expectation from the analytic covariance.

    The expectation is the transform of R(m dt) times the autocorrelation of the taper: it holds aliasing
    and leakage. The mean of k periodograms has the relative standard error 1/sqrt(k) per bin; with a
    Hann taper neighbouring bins correlate by 4/9 and 1/36, so a mean over bins has 1.94 times the
    variance of independent ones.
    """
    runs, n, dt = 3000, 512, 0.02
    d = Dryden(2.0, 1.5, 60.0, 12.0, 40.0, 3.0)
    normals = np.random.default_rng(5).standard_normal((runs, n, 4))
    y = dryden.simulate(dryden.discretise(d, dt), normals)
    taper = np.hanning(n)
    periodogram = np.mean(np.abs(np.fft.rfft(y * taper[:, None], axis=1)) ** 2, axis=0)
    overlap = np.correlate(taper, taper, mode="full")[n - 1 :]
    weighted = np.diagonal(dryden.covariance(d, np.arange(n) * dt), axis1=1, axis2=2) * overlap[:, None]
    expected = 2 * np.fft.rfft(weighted, axis=0).real - weighted[0]
    ratio = (periodogram / expected)[2:-2]
    assert np.abs(ratio - 1).max() < 5 / np.sqrt(runs)
    assert np.abs(ratio.mean(axis=0) - 1).max() < 4 * np.sqrt(1.94 / (runs * ratio.shape[0]))
    # between leakage at the low end and aliasing at the high one, it is the continuous spectrum
    bins = np.arange(8, 24)
    continuous = dryden.spectrum(d, 2 * np.pi * bins / (n * dt)) * np.pi / dt * np.sum(taper**2)
    np.testing.assert_allclose(expected[bins, 1] / continuous[:, 1], 1.0, atol=0.03)


def test_many_conditions_equal_single_ones() -> None:
    """A run's gust does not depend on its neighbours in the chunk: bit for bit."""
    lengths, speeds = np.array([20.0, 300.0, 840.0]), np.array([30.0, 42.85, 120.0])
    normals = np.random.default_rng(2).standard_normal((3, 50, 4))
    together = dryden.simulate(dryden.discretise(Dryden(1.0, 0.8, 500.0, lengths, speeds, 2.0), DT), normals)
    for i in range(3):
        one = dryden.discretise(Dryden(1.0, 0.8, 500.0, lengths[i], speeds[i], 2.0), DT)
        np.testing.assert_array_equal(together[i], dryden.simulate(one, normals[i : i + 1])[0])


def test_unknown_start_is_refused() -> None:
    g = dryden.discretise(GTM, DT)
    with pytest.raises(ConfigurationError, match=r"did you mean 'rest'.*allowed: rest, stationary"):
        dryden.simulate(g, np.zeros((1, 2, 3)), start="rests")
