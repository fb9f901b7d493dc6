"""The random walk in white noise against dense linear algebra."""

import numpy as np
import pytest
from scipy.fft import dct
from scipy.optimize import minimize_scalar

from airtruth.numerics.local_level import error_variances, smoothed, walk_to_noise


def walk_in_noise(seed, count, step, noise):
    rng = np.random.default_rng(seed)
    return np.cumsum(step * rng.standard_normal(count)) + noise * rng.standard_normal(count)


def differences(count):
    return np.diff(np.eye(count), axis=0)


@pytest.mark.parametrize("ratio", [1e-6, 0.01, 1.0, 30.0])
def test_the_smoother_solves_its_normal_equations(ratio):
    """(I + D'D/ratio) x = y, with the matrix D of the differences."""
    y = walk_in_noise(1, 60, 0.3, 1.0)
    d = differences(60)
    expected = np.linalg.solve(np.eye(60) + d.T @ d / ratio, y)
    np.testing.assert_allclose(smoothed(y, ratio), expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("step", [0.2, 0.4, 3.0])
def test_the_ratio_maximises_the_dense_likelihood(step):
    """The differences are normal with the covariance ratio I + D D', times a variance that is free."""
    y = walk_in_noise(2, 80, step, 1.0)
    d = differences(80)

    def deviance(log_ratio):
        covariance = np.exp(log_ratio) * np.eye(79) + d @ d.T
        change = d @ y
        variance = change @ np.linalg.solve(covariance, change) / 79
        return 79 * np.log(variance) + np.linalg.slogdet(covariance)[1]

    expected = np.exp(minimize_scalar(deviance, bounds=(-15.0, 8.0), method="bounded").x)
    assert walk_to_noise(y) == pytest.approx(expected, rel=1e-3)


def test_the_ratio_of_many_samples_is_that_of_the_draws():
    """A ratio of 0.01; its standard error over 20000 samples is about 5 %."""
    assert walk_to_noise(walk_in_noise(3, 20000, 0.1, 1.0)) == pytest.approx(0.01, rel=0.2)


def test_noise_alone_has_no_walk():
    y = walk_in_noise(4, 500, 0.0, 1.0)
    assert walk_to_noise(y) < 1e-4
    assert np.ptp(smoothed(y, 1e-10)) < 1e-3


def test_the_smoother_is_nearer_to_the_walk_than_the_samples_are():
    """Steady variance of the smoother: sqrt(q r)/2 for q far below r (Harvey, section 4.6.2): 0.05 of r here."""
    rng = np.random.default_rng(5)
    walk = np.cumsum(0.1 * rng.standard_normal(20000))
    error = smoothed(walk + rng.standard_normal(20000), 0.01) - walk
    assert float((error**2).mean()) == pytest.approx(0.05, rel=0.05)


def test_errors_of_the_cosines_are_those_of_the_posterior():
    """The posterior covariance is (I/r + D'D/q)^-1 with the differences D; here r = 1 and q = 0.03."""
    count, ratio = 12, 0.03
    d = differences(count)
    covariance = np.linalg.inv(np.eye(count) + d.T @ d / ratio)
    cosines = dct(np.eye(count), axis=0, norm="ortho")
    assert np.diag(error_variances(count, ratio)) == pytest.approx(
        cosines @ covariance @ cosines.T, abs=1e-12
    )
