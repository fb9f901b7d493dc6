"""The first-order hold against scipy's matrix exponential of the augmented system."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.linalg import expm

from airtruth.numerics.hold import first_order_hold


def augmented(a, b, dt):
    """x' = A x + b u, u' = s, s' = 0: exp gives the response to the start and the slope of u.

    A rotation beside it keeps the matrix from being triangular. For a triangular one scipy divides differences of exponentials,
    and its result has the wrong sign where two diagonal elements differ by 1e-20.
    """
    big = np.zeros((6, 6))
    big[:2, :2], big[:2, 2], big[2, 3] = a * dt, b * dt, 1.0
    big[4, 5], big[5, 4] = 1.0, -1.0
    e = expm(big)
    return e[:2, :2], e[:2, 2] - e[:2, 3], e[:2, 3]


@njit
def hold(a00, a01, a10, a11, b0, b1, dt):
    """`first_order_hold`, which only kernels call."""
    return first_order_hold(a00, a01, a10, a11, b0, b1, dt)


entry = st.floats(-60.0, 60.0)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.tuples(entry, entry, entry, entry), st.tuples(entry, entry), st.sampled_from([0.005, 0.02, 0.1]))
def test_equals_the_matrix_exponential(a, b, dt):
    matrix, column = np.array(a).reshape(2, 2), np.array(b)
    e, g, h = hold(*a, *b, dt)
    reference = augmented(matrix, column, dt)
    size = np.abs(reference[0]).max() * (1.0 + np.abs(matrix).max()) * (1.0 + np.abs(column).max())
    np.testing.assert_allclose(np.reshape(e, (2, 2)), reference[0], rtol=0, atol=1e-13 * size)
    np.testing.assert_allclose(g, reference[1], rtol=0, atol=1e-13 * size)
    np.testing.assert_allclose(h, reference[2], rtol=0, atol=1e-13 * size)


def test_a_pole_next_to_zero_by_hand():
    """A = [[43, 0], [0, 6e-277]], b = [0, 1]: the second state gains dt/2 of the start and dt/2 of the end of a ramp."""
    _, g, h = hold(43.0, 0.0, 0.0, 6e-277, 0.0, 1.0, 0.1)
    np.testing.assert_allclose(g, [0.0, 0.05], rtol=1e-14)
    np.testing.assert_allclose(h, [0.0, 0.05], rtol=1e-14)


def test_double_integrator_by_hand():
    """A = [[0, 1], [0, 0]], b = [0, 1]: x0 gains dt^2/2 of a constant, dt^2/6 of the late half."""
    dt = 0.5
    e, g, h = hold(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, dt)
    assert e == pytest.approx((1.0, dt, 0.0, 1.0), abs=1e-15)
    assert h == pytest.approx((dt**2 / 6.0, dt / 2.0), abs=1e-15)
    assert g == pytest.approx((dt**2 / 3.0, dt / 2.0), abs=1e-15)
