"""Regression between channels: exact relations, and the covariance of noisy ones against repetition."""

import numpy as np
import pytest

from airtruth.checks.spectra import instruments, integral, regress, spectrum

DT = 0.02


def signals(seed, runs=4, samples=400):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.standard_normal((2, runs, samples)), axis=-1)


def test_exact_factors_are_recovered():
    """y = 2 a - 3 b plus a constant and a slope, which the spectrum removes."""
    a, b = signals(1)
    y = 2.0 * a - 3.0 * b + 7.0 + np.linspace(0.0, 5.0, a.shape[1])
    factors = regress(spectrum(y, DT), np.stack([spectrum(a, DT), spectrum(b, DT)], axis=1))
    np.testing.assert_allclose(factors.value, np.tile([2.0, -3.0], (5, 1)), rtol=1e-9)
    np.testing.assert_allclose(factors.share, 1.0, rtol=1e-12)


def test_the_integral_of_a_line_is_exact():
    """The trapezoid is exact for a straight line: the integral of 2 t over [0, 1] is 1."""
    t = np.linspace(0.0, 1.0, 51)
    assert integral(2.0 * t, 0.02)[-1] == pytest.approx(1.0, rel=1e-12)


def test_a_constant_regressor_gives_no_factor():
    a, _ = signals(2)
    factors = regress(spectrum(a, DT), spectrum(np.full_like(a, 3.3), DT)[:, None])
    assert np.isnan(factors.value).all()


@pytest.mark.parametrize("factor", [1e200, 1e-200])
def test_a_regressor_whose_power_overflows_gives_no_factor(factor):
    """A correction of the gate may multiply a channel by any number."""
    a, b = signals(2)
    with np.errstate(all="ignore"):
        factors = regress(spectrum(a, DT), np.stack([spectrum(a, DT), factor * spectrum(b, DT)], axis=1))
    assert np.isnan(factors.value).all()


def test_the_covariance_is_that_of_repeated_noise():
    """Ratio of the stated standard deviation to the spread over 400 repetitions, within 15 %."""
    a, _ = signals(3, runs=1)
    rng = np.random.default_rng(4)
    x = spectrum(a, DT)[:, None]
    drawn = [regress(spectrum(a + 5.0 * rng.standard_normal(a.shape), DT), x) for _ in range(400)]
    spread = np.std([f.value[0, 0] for f in drawn])
    stated = np.mean([np.sqrt(f.covariance[0, 0, 0]) for f in drawn])
    assert stated / spread == pytest.approx(1.0, abs=0.15)


def test_instruments_remove_the_bias_of_a_common_disturbance():
    """y = x + w and x = f(u) + w: least squares is biased towards 2, instruments made from u are not."""
    rng = np.random.default_rng(5)
    u = np.sign(np.sin(np.arange(2000) * DT * 2.0))[None].repeat(20, axis=0)
    w = np.cumsum(rng.standard_normal((20, 2000)), axis=1) * 0.02
    x = integral(u, DT) + w
    lines = spectrum(x, DT)[:, None]
    plain = regress(spectrum(x + w, DT), lines)
    clean = regress(spectrum(x + w, DT), lines, instruments(u, DT))
    assert plain.value[-1, 0] - 1.0 > 0.1
    assert abs(clean.value[-1, 0] - 1.0) < 0.05
    assert clean.strength[-1] > 10.0


def test_a_record_too_short_to_leave_a_residual_gives_no_factor():
    """One line below 4 Hz is two numbers, which two factors fit exactly whatever they are."""
    a, b = signals(5, samples=20)
    y, x = spectrum(a - b, DT), np.stack([spectrum(a, DT), spectrum(b, DT)], axis=1)
    assert y.shape[-1] == 2
    assert np.isnan(regress(y[:1], x[:1]).value).all()
    assert np.isfinite(regress(y, x).value[-1]).all()  # four records together leave a residual
