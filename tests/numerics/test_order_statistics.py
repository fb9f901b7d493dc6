"""Quantiles of columns in blocks, against those that numpy computes of the whole column."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airtruth.numerics import order_statistics
from airtruth.numerics.order_statistics import medians, quantiles

PROBABILITIES = (0.0, 0.025, 0.25, 0.5, 0.975, 1.0)


def in_blocks(x, rows):
    return lambda: (x[first : first + rows] for first in range(0, len(x), rows))


def columns():
    """Columns that are hard for a search by bits: narrow, wide, of both signs, of few values, constant."""
    rng = np.random.default_rng(5)
    n = 30_001
    narrow = -41.0 + 1e-9 * rng.standard_normal(n)
    wide = rng.standard_normal(n) * 10.0 ** rng.integers(-300, 300, n)
    few = rng.integers(-2, 3, n).astype(float)
    two = np.where(np.arange(n) % 2 == 0, -1e300, 1e300)
    return np.stack([rng.standard_normal(n), narrow, wide, few, two, np.full(n, 0.1)], axis=1)


@pytest.mark.parametrize("kept", [1, 100, 16_384, 100_000])
@pytest.mark.parametrize("rows", [977, 40_000])
def test_quantiles_in_blocks_are_those_of_numpy(monkeypatch, kept, rows):
    monkeypatch.setattr(order_statistics, "KEPT", kept)
    x = columns()
    with np.errstate(over="ignore", invalid="ignore"):
        np.testing.assert_allclose(
            quantiles(in_blocks(x, rows), PROBABILITIES)[:, [0, 1, 2, 3, 5]],
            np.quantile(x, PROBABILITIES, axis=0)[:, [0, 1, 2, 3, 5]],
            rtol=1e-15,
        )
    np.testing.assert_array_equal(medians(in_blocks(x, rows)), np.median(x, axis=0))


def test_values_that_are_not_finite_do_not_count():
    x = np.array([[1.0, np.nan], [np.nan, np.nan], [np.inf, np.nan], [3.0, np.nan]])
    np.testing.assert_array_equal(medians(in_blocks(x, 3)), [2.0, np.nan])


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=40), st.integers(1, 40))
def test_medians_of_any_numbers(values, rows):
    x = np.array(values)[:, None]
    finite = x[np.isfinite(x)]
    kept, order_statistics.KEPT = order_statistics.KEPT, 3
    try:
        found = medians(in_blocks(x, rows))[0]
    finally:
        order_statistics.KEPT = kept
    if not finite.size:
        assert np.isnan(found)
        return
    # the order statistics themselves: halves are added, so that the sum of two large values does not overflow
    ordered = np.sort(finite)
    low, high = ordered[(finite.size - 1) // 2], ordered[finite.size // 2]
    assert found == 0.5 * low + 0.5 * high or (low == high == found)
