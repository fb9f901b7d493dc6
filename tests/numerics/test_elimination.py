"""Gaussian elimination of the kernels against LAPACK."""

import numpy as np
import pytest
from numba import njit

from airtruth.numerics.discretise import eliminate


@njit
def solved(matrix, right):
    """`eliminate`, which only kernels call."""
    eliminate(matrix, right)


@pytest.mark.grid
@pytest.mark.parametrize("size", [1, 2, 5, 16])
def test_equals_lapack(size):
    rng = np.random.default_rng(size)
    matrix, right = rng.normal(size=(size, size)), rng.normal(size=(size, 3))
    x = right.copy()
    solved(matrix.copy(), x)
    np.testing.assert_allclose(x, np.linalg.solve(matrix, right), rtol=1e-10, atol=1e-12)


def test_a_zero_on_the_diagonal_is_exchanged():
    """By hand: [[0, 2], [3, 0]] x = [4, 9] has x = [3, 2]."""
    x = np.array([[4.0], [9.0]])
    solved(np.array([[0.0, 2.0], [3.0, 0.0]]), x)
    np.testing.assert_array_equal(x, [[3.0], [2.0]])


def test_a_singular_matrix_gives_values_that_are_not_finite():
    x = np.array([[1.0], [2.0]])
    solved(np.ones((2, 2)), x)
    assert not np.isfinite(x).any()
