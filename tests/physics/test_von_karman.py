"""The vertical von Karman spectrum: its variance, its inertial range, and its zero-frequency value."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import beta

from airtruth.physics import von_karman

V = 42.9


@pytest.mark.parametrize(("sigma", "length"), [(1.0, 533.0), (1.6, 840.0)])
def test_it_integrates_to_the_variance(sigma, length):
    # the published constant is rounded: the form integrates to 1 - 1.1e-5 of the variance
    exact = (beta(0.5, 4.0 / 3.0) + 8.0 / 3.0 * beta(1.5, 1.0 / 3.0)) / (2.0 * 1.339 * np.pi)
    # in the logarithm of omega; above e^20 the -5/3 slope leaves 1e-6
    power = quad(
        lambda s: np.exp(s) * von_karman.vertical(sigma, length, V, np.exp(s)), -20.0, 20.0, limit=500
    )[0]
    assert power == pytest.approx(exact * sigma**2, rel=3e-6)
    assert exact == pytest.approx(1.0, abs=2e-5)


def test_the_inertial_range_is_isotropic():
    """Slope -5/3, and 4/3 of the longitudinal spectrum sigma^2 (2 L/(pi V)) (1.339 L omega/V)^(-5/3)."""
    omega = np.array([1e3, 2e3])
    found = von_karman.vertical(1.2, 900.0, V, omega)
    assert np.log2(found[1] / found[0]) == pytest.approx(-5.0 / 3.0, abs=1e-6)
    along = 1.2**2 * 2.0 * 900.0 / (np.pi * V) * (1.339 * 900.0 * omega / V) ** (-5.0 / 3.0)
    np.testing.assert_allclose(found, 4.0 / 3.0 * along, rtol=1e-6)


def test_at_rest_it_is_the_scale_length():
    """sigma^2 L/(pi V), as Dryden's."""
    assert float(von_karman.vertical(2.0, 500.0, V, 0.0)) == pytest.approx(4.0 * 500.0 / (np.pi * V))
