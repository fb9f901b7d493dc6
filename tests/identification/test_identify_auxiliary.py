"""The auxiliary model against an ordinary differential equation solver and against linear algebra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.integrate import solve_ivp

from airtruth.identification.regression.auxiliary import bounded, linear_auxiliary, state_matrices
from airtruth.identification.regression.rows import row_factors
from airtruth.physics.short_period import system
from validation.linear_flight import THETA, gtm_scale


@njit
def matrices(theta, factors):
    """`state_matrices`, which only kernels call."""
    return state_matrices(theta, factors)


def test_state_matrices_are_those_of_the_physics():
    rng = np.random.default_rng(0)
    theta = THETA * rng.uniform(0.5, 1.5, size=(20, 6))
    s = gtm_scale((20,))
    a, b = system(theta, s)
    for r, factors in enumerate(row_factors(s)):
        got = matrices(theta[r], factors)
        assert got == pytest.approx((*a[r].ravel(), *b[r]), rel=1e-14)


def test_equals_an_integration_of_the_equations():
    """DOP853 at 1e-11, restarted at every sample where the input has a corner."""
    dt, samples = 0.05, 40
    rng = np.random.default_rng(3)
    u = np.cumsum(rng.normal(size=(1, samples)), axis=1) * 0.01
    u -= u[:, :1]
    alpha, q = linear_auxiliary(THETA[None], u, dt, gtm_scale((1,)))
    a, b = system(THETA, gtm_scale())
    x = np.zeros(2)
    for k in range(samples - 1):
        slope = (u[0, k + 1] - u[0, k]) / dt

        def f(t, x, k=k, slope=slope):
            return a @ x + b * (u[0, k] + slope * t)

        x = solve_ivp(f, (0.0, dt), x, method="DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
        assert (alpha[0, k + 1], q[0, k + 1]) == pytest.approx(tuple(x), rel=1e-8, abs=1e-11)


@settings(max_examples=60, deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-60.0, 60.0), st.floats(0.5, 20.0))
def test_bounded_is_the_largest_real_part_of_the_eigenvalues(cmalpha, cmq, duration):
    theta = THETA.copy()
    theta[3], theta[4] = cmalpha, cmq
    s = gtm_scale((1,))
    growth = np.linalg.eigvals(system(theta, gtm_scale())[0]).real.max() * duration
    if abs(growth - np.log(1e3)) > 1e-6:
        assert bounded(theta[None], row_factors(s), duration)[0] == (growth < np.log(1e3))
