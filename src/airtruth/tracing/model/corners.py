"""The filter where the surface between two samples is uncertain: a corner that the samples do not show.

Within such a cell the error of the surface is a parabola that vanishes at the samples, and its mean over the cell has the
stated variance. The covariance of the prediction grows by it, and returns to the steady one through the updates that
follow. The innovations are scaled to the steady covariance, so that one whitener serves all samples.

Source: B. D. O. Anderson and J. B. Moore, *Optimal Filtering* (1979), section 3.1, for the recursion.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.discretise import whitener
from airtruth.tracing.model.equations import FASTMATH, outputs, rates
from airtruth.tracing.model.kernel_input import AirPoint, FilterModel
from airtruth.tracing.model.linearise import delay_system, discrete
from airtruth.tracing.model.parameters import DELAY_ORDER, OUTPUTS

Array = NDArray[np.float64]

_STEP_RAD: Final = 0.01
"""Half width of the central difference in the surface [rad]; judgement: as for the other angles of the linearisation."""
_SETTLED: Final = 1e-6
"""Relative distance of the innovations' covariance from the steady one at which the gain is steady again [-].

Judgement: small against the differences that the sensitivities are made of.
"""


class Corners(NamedTuple):
    """The recursion of the covariance about the steady filter.

    Attributes
    ----------
    phi, noise : (states, states) transition and process noise of a sample.
    spread : (states, states) what a unit variance of the surface's mean over a cell adds.
    steady : (states, states) covariance of the prediction; c : (outputs, states).
    variance : (outputs,) of the white noise; covariance : (outputs, outputs) of the steady innovations.
    root : (outputs, outputs) inverse of the steady whitener; logdet : log|covariance|.
    """

    phi: Array
    noise: Array
    spread: Array
    steady: Array
    c: Array
    variance: Array
    covariance: Array
    root: Array
    logdet: float


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def _moved(at: AirPoint, by_rad: float) -> AirPoint:
    """Inputs with another surface."""
    return AirPoint(
        at.elevator_rad + by_rad,
        at.airspeed_m_s,
        at.ground_m_s,
        at.qbar_pa,
        at.theta_rad,
        at.lift,
        at.moment,
    )


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def input_column(x: Array, at: AirPoint, model: FilterModel) -> Array:
    """(states,) slope of x' in the surface [1/rad], late sensors included."""
    n = x.size
    up, down, column = np.zeros(n), np.zeros(n), np.zeros(n)
    y_up, y_down = np.empty(OUTPUTS), np.empty(OUTPUTS)
    above, below = _moved(at, _STEP_RAD), _moved(at, -_STEP_RAD)
    outputs(x, up[1], rates(x, above, model, up), above, model, y_up)
    outputs(x, down[1], rates(x, below, model, down), below, model, y_down)
    for i in range(model.states.motion):
        column[i] = (up[i] - down[i]) / (2.0 * _STEP_RAD)
    for i in range(OUTPUTS):
        direct = (y_up[i] - y_down[i]) / (2.0 * _STEP_RAD)
        lag, delay = model.states.lag[i], model.states.delay[i]
        if lag >= 0:
            column[lag] = direct / model.sensors.lag_s[i]
        elif delay >= 0:
            system = delay_system(model.sensors.delay_s[i])
            for row in range(DELAY_ORDER):
                column[delay + row] = system[row, DELAY_ORDER] * direct
    return column


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def spread_of(a: Array, column: Array, dt_s: float) -> Array:
    """Covariance after a cell of a surface error whose mean has a unit variance and which is zero at both ends.

    The error is a parabola, 6 s (1 - s) over the cell, as in the interpolation of the surface: the samples are known. Its
    two derivatives are states of a system in discrete time, so that the response is exact for lags of any length.
    """
    n = a.shape[0]
    system = np.zeros((n + 3, n + 3))
    system[:n, :n] = a
    system[:n, n] = column
    system[n, n + 1] = 1.0
    system[n + 1, n + 2] = 1.0
    phi, _ = discrete(system, np.zeros(n + 3), dt_s)
    after = phi[:n, n + 1] * (6.0 / dt_s) - phi[:n, n + 2] * (12.0 / (dt_s * dt_s))
    return np.outer(after, after)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def corrected(p: Array, k_gain: Array, c: Array) -> Array:
    """Covariance after an update, (I - K C) P, symmetric."""
    p = p - np.dot(k_gain, np.dot(c, p))
    return 0.5 * (p + p.T)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def predicted(p: Array, corners: Corners, corner_rad2: float) -> Array:
    """Covariance of the next prediction, with the corner of the cell in between."""
    moved: Array = np.dot(corners.phi, np.dot(p, np.ascontiguousarray(corners.phi.T)))
    moved += corners.noise + corner_rad2 * corners.spread
    return moved


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def gain_at(p: Array, corners: Corners, k_gain: Array, scale: Array) -> tuple[float, float]:
    """Gain of a prediction's covariance, and the matrix that scales its innovation to the steady covariance.

    Returns
    -------
    log|S| less the steady one (nan where S is no covariance), and the largest relative distance of S from it.
    """
    pc = np.dot(p, np.ascontiguousarray(corners.c.T))
    s = np.dot(corners.c, pc)
    away = 0.0
    for i in range(OUTPUTS):
        s[i, i] += corners.variance[i]
        away = max(away, abs(s[i, i] / corners.covariance[i, i] - 1.0))
    white = np.zeros((OUTPUTS, OUTPUTS))
    logdet = whitener(s, white)
    k_gain[:] = np.dot(pc, np.dot(np.ascontiguousarray(white.T), white))
    scale[:] = np.dot(corners.root, white)
    return logdet - corners.logdet, away


@njit(cache=True, nogil=True)
def settled(away: float) -> bool:
    """Whether the gain is the steady one again."""
    return away < _SETTLED


__all__ = [
    "Corners",
    "corrected",
    "gain_at",
    "input_column",
    "predicted",
    "settled",
    "spread_of",
]
