"""The auxiliary model: the linear short period, simulated without noise to give the instruments.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", III.B and eq. (2).
"""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.regression.rows import HALF_CHORD, LIFT, MOMENT, row_factors
from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import inner
from airtruth.numerics.hold import first_order_hold
from airtruth.physics.short_period import CL_ALPHA, CL_DE, CL_Q, CM_ALPHA, CM_DE, CM_Q, Scale

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Six = tuple[float, float, float, float, float, float]

GROWTH: Final = 1e3
"""Largest growth of the auxiliary motion over a record that gives usable instruments [-]; judgement: a
larger one accepts more of the unstable models that an iteration passes through, with worse instruments."""


@inner
def state_matrices(theta: Array, factors: Array) -> Six:
    """a00, a01, a10, a11, b0, b1 of eq. (2), of one run.

    Parameters
    ----------
    theta : (6,) derivatives [-].
    factors : (4,) from `airtruth.identification.regression.rows.row_factors`.
    """
    lift, moment, half = factors[LIFT], factors[MOMENT], factors[HALF_CHORD]
    return (
        lift * theta[CL_ALPHA],
        1.0 + lift * half * theta[CL_Q],
        moment * theta[CM_ALPHA],
        moment * half * theta[CM_Q],
        lift * theta[CL_DE],
        moment * theta[CM_DE],
    )


@partial(inner, fastmath={"contract"})
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


@awaited
@njit(cache=True, error_model="numpy")
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
    return short_period(theta, row_factors(scale), u, dt_s)


def short_period(theta: Array, factors: Array, u: Array, dt_s: float) -> tuple[Array, Array]:
    """`linear_auxiliary` for factors (runs, 4) from `airtruth.identification.regression.rows.row_factors`."""
    alpha, q = np.empty_like(u), np.empty_like(u)
    _respond_runs(theta, factors, u, dt_s, alpha, q)
    return alpha, q


def bounded(theta: Array, factors: Array, duration_s: float, growth: float = GROWTH) -> Bools:
    """Whether the motion of each auxiliary model grows by less than ``growth`` over the record, (runs,).

    A statically unstable aircraft is identified as long as its simulation stays within that.
    """
    lift, moment, half = factors[:, LIFT], factors[:, MOMENT], factors[:, HALF_CHORD]
    a00, a01 = lift * theta[:, CL_ALPHA], 1.0 + lift * half * theta[:, CL_Q]
    a10, a11 = moment * theta[:, CM_ALPHA], moment * half * theta[:, CM_Q]
    half_trace = 0.5 * (a00 + a11)
    spread = half_trace**2 - (a00 * a11 - a01 * a10)
    fastest = half_trace + np.sqrt(np.maximum(spread, 0.0))
    return np.asarray(fastest < np.log(growth) / duration_s)
