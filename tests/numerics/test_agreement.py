"""R2 and Theil's coefficient: by hand, against independent formulas, and their invariants."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.numerics.agreement import agreement


def test_by_hand():
    """z = 1, 2, 3 and y = 2, 2, 2: e^2 = 2/3, mean z^2 = 14/3, mean y^2 = 4, std z = sqrt(2/3), std y = 0."""
    found = agreement(np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 2.0]))
    assert found.r2 == pytest.approx(0.0, abs=1e-15)
    assert found.theil == pytest.approx(math.sqrt(2 / 3) / (math.sqrt(14 / 3) + 2.0), rel=1e-14)
    assert (found.bias, found.variance, found.covariance) == pytest.approx((0.0, 1.0, 0.0), abs=1e-14)


def test_against_independent_computation():
    """R2 of a least-squares line is the squared correlation (numpy.corrcoef); shares by numpy.cov."""
    rng = np.random.default_rng(5)
    z = rng.normal(size=400)
    y = 0.6 * z + 0.3 + 0.2 * rng.normal(size=400)
    slope, constant = np.polyfit(y, z, 1)
    assert agreement(z, slope * y + constant).r2 == pytest.approx(np.corrcoef(z, y)[0, 1] ** 2, rel=1e-12)
    found = agreement(z, y)
    (vz, c), (_, vy) = np.cov(z, y, bias=True)
    square = vz + vy - 2.0 * c + (z.mean() - y.mean()) ** 2
    assert found.theil == pytest.approx(
        np.linalg.norm(z - y) / (np.linalg.norm(z) + np.linalg.norm(y)), rel=1e-12
    )
    assert found.bias == pytest.approx((z.mean() - y.mean()) ** 2 / square, rel=1e-12)
    assert found.variance == pytest.approx((math.sqrt(vz) - math.sqrt(vy)) ** 2 / square, rel=1e-12)
    r = c / math.sqrt(vz * vy)
    assert found.covariance == pytest.approx(2.0 * (1.0 - r) * math.sqrt(vz * vy) / square, rel=1e-12)


@given(st.integers(0, 10_000), st.floats(-20.0, 20.0))
def test_the_shares_add_up_and_the_coefficient_is_bounded(seed, offset):
    rng = np.random.default_rng(seed)
    z, y = rng.normal(size=(2, 30)) + offset
    found = agreement(z, y)
    assert found.bias + found.variance + found.covariance == pytest.approx(1.0, rel=1e-9)
    assert 0.0 <= found.theil <= 1.0
    centred = agreement(z, y, about=offset)
    assert (centred.r2, centred.bias) == pytest.approx((found.r2, found.bias), rel=1e-9)


def test_a_perfect_and_an_undefined_match():
    z = np.array([1.0, 2.0, 4.0])
    perfect = agreement(z, z)
    assert (perfect.r2, perfect.theil) == (1.0, 0.0)
    assert math.isnan(perfect.bias)
    assert math.isnan(agreement(z, np.full(3, np.nan)).theil)
    assert math.isnan(agreement(np.ones(3), z).r2)
