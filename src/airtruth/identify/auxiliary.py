"""The auxiliary model: the linear short period, simulated without noise to make instruments.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", III.B and eq. (2).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify.hold import first_order_hold
from airtruth.identify.rows import row_factors
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Six = tuple[float, float, float, float, float, float]


@njit(cache=True)
def state_matrices(theta: Array, factors: Array) -> Six:
    """a00, a01, a10, a11, b0, b1 of eq. (2), of one run.

    Parameters
    ----------
    theta : (6,) derivatives [-].
    factors : (4,) from `airtruth.identify.rows.row_factors`.
    """
    lift, moment, half = factors[0], factors[1], factors[3]
    return (
        lift * theta[0],
        1.0 + lift * half * theta[1],
        moment * theta[3],
        moment * half * theta[4],
        lift * theta[2],
        moment * theta[5],
    )


@njit(cache=True, fastmath={"contract"})
def respond(system: Six, u: Array, origin: float, dt_s: float, alpha: Array, q: Array) -> None:
    """Response of one run to u - origin from rest, u (samples,) linear between samples."""
    e, g, h = first_order_hold(system[0], system[1], system[2], system[3], system[4], system[5], dt_s)
    x0 = 0.0
    x1 = 0.0
    before = u[0] - origin
    alpha[0] = 0.0
    q[0] = 0.0
    for k in range(1, u.size):
        now = u[k] - origin
        y0 = e[0] * x0 + (e[1] * x1 + (g[0] * before + h[0] * now))
        x1 = e[2] * x0 + (e[3] * x1 + (g[1] * before + h[1] * now))
        x0 = y0
        before = now
        alpha[k] = x0
        q[k] = x1


@njit(cache=True)
def _respond_runs(theta: Array, factors: Array, u: Array, dt_s: float, alpha: Array, q: Array) -> None:
    for r in range(u.shape[0]):
        respond(state_matrices(theta[r], factors[r]), u[r], 0.0, dt_s, alpha[r], q[r])


def linear_auxiliary(theta: Array, u: Array, dt_s: float, scale: Scale) -> tuple[Array, Array]:
    """Noise-free alpha and q of eq. (2), from rest at the trim; the input is linear between samples.

    Parameters
    ----------
    theta : (runs, 6) derivatives [-].
    u : (runs, samples) elevator, deviation from its value at the trim [rad].
    dt_s : sample period [s].
    scale : factors of shape (runs,).

    Returns
    -------
    alpha, q : (runs, samples) deviations from the trim [rad], [rad/s].
    """
    alpha, q = np.empty_like(u), np.empty_like(u)
    _respond_runs(theta, row_factors(scale), u, dt_s, alpha, q)
    return alpha, q


@njit(cache=True)
def _bounded(theta: Array, factors: Array, limit: float, result: Bools) -> None:
    for r in range(theta.shape[0]):
        a00, a01, a10, a11, _, _ = state_matrices(theta[r], factors[r])
        half_trace = 0.5 * (a00 + a11)
        spread = half_trace * half_trace - (a00 * a11 - a01 * a10)
        result[r] = half_trace + np.sqrt(max(spread, 0.0)) < limit


def bounded(theta: Array, factors: Array, duration_s: float, growth: float = 1e3) -> Bools:
    """Whether the motion of each auxiliary model grows by less than ``growth`` over the record, (runs,).

    A statically unstable aircraft is identified all the same as long as its simulation stays of use.
    """
    result = np.empty(theta.shape[0], dtype=np.bool_)
    _bounded(theta, factors, np.log(growth) / duration_s, result)
    return result
