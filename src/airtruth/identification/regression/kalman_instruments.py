"""Instruments from a Kalman filter: predictions of alpha and q from the elevator and from all earlier measurements.

Source: V. Klein, "Identification Evaluation Methods", AGARD-LS-104, 1979, as M. Brunot, "An Instrumental Variable Approach
for Aircraft Identification", section I, refers to it. The filter is the steady-state one of the linear short period that the
last estimate makes:

    x(k+1|k) = E [x(k|k-1) + K (y(k) - x(k|k-1))] + g u(k) + h u(k+1),   y = [alpha, q]

The instruments are x(k|k-1). They are exogenous to white measurement noise at and after sample k. A gust persists, so a
prediction contains the gust of the samples before: these instruments reduce the bias of least squares in turbulence and do
not remove it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from airtruth.identification.condition import Observation, origin_of
from airtruth.identification.regression.auxiliary import state_matrices
from airtruth.identification.signals import ALPHA, ELEVATOR, Q
from airtruth.numerics.hold import first_order_hold

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_NOISE: Final = 1e-12
"""Least variance of a measurement or a state [rad^2], [rad^2/s^2]: far below any sensor; keeps the filter regular."""
_THIRD: Final = 20.0
"""Variance of the third differences of white noise over its own [-]: 1 + 9 + 9 + 1."""


def measurement_variance(signals: Array) -> Array:
    """Variance of the white noise of each signal, from its third differences.

    Parameters
    ----------
    signals : (..., samples), slow against the sample rate.
    """
    third = np.diff(signals, n=3, axis=-1)
    return np.asarray(np.maximum(np.mean(third**2, axis=-1) / _THIRD, LEAST_NOISE))


@njit(cache=True)
def _discretise(theta: Array, factors: Array, dt_s: float, e: Array, g: Array, h: Array) -> None:
    """Fill the matrices of x(k+1) = e x(k) + g u(k) + h u(k+1) of all runs: (runs, 2, 2), (runs, 2), (runs, 2)."""
    for r in range(theta.shape[0]):
        s = state_matrices(theta[r], factors[r])
        flat, early, late = first_order_hold(s[0], s[1], s[2], s[3], s[4], s[5], dt_s)
        for i in range(2):
            e[r, i, 0], e[r, i, 1] = flat[2 * i], flat[2 * i + 1]
            g[r, i], h[r, i] = early[i], late[i]


def steady_gain(e: Array, step: Array, variance: Array) -> Array:
    """Gain K (2, 2) of the filter whose process noise is what the one-step errors hold beyond the measurement noise.

    Parameters
    ----------
    e : (2, 2) transition.
    step : (2, 2) covariance of y(k+1) - e y(k) - g u(k) - h u(k+1).
    variance : (2,) of the measurement noise.
    """
    own = np.diag(step) - variance - e**2 @ variance
    noise = np.diag(np.maximum(own, LEAST_NOISE))
    p = solve_discrete_are(e.T, np.eye(2), noise, np.diag(variance))
    return np.asarray(p @ np.linalg.inv(p + np.diag(variance)))


@njit(cache=True)
def predict(e: Array, g: Array, h: Array, gain: Array, y: Array, u: Array, made: Array) -> None:
    """Predictions of all runs from earlier samples.

    Parameters
    ----------
    e, g, h : (runs, 2, 2), (runs, 2), (runs, 2) of x(k+1) = e x(k) + g u(k) + h u(k+1).
    gain : (runs, 2, 2) K; y : (runs, 2, samples) measured alpha [rad] and q [rad/s]; u : (runs, samples) [rad].
    made : (runs, 3, samples), written: alpha [rad], q [rad/s], and u.
    """
    for r in range(u.shape[0]):
        x0, x1 = y[r, 0, 0], y[r, 1, 0]
        for k in range(u.shape[1]):
            now = u[r, k]
            made[r, 0, k], made[r, 1, k], made[r, 2, k] = x0, x1, now
            if k + 1 < u.shape[1]:
                v0, v1 = y[r, 0, k] - x0, y[r, 1, k] - x1
                x0, x1 = (
                    x0 + gain[r, 0, 0] * v0 + gain[r, 0, 1] * v1,
                    x1 + gain[r, 1, 0] * v0 + gain[r, 1, 1] * v1,
                )
                then = u[r, k + 1]
                x0, x1 = (
                    e[r, 0, 0] * x0 + e[r, 0, 1] * x1 + g[r, 0] * now + h[r, 0] * then,
                    e[r, 1, 0] * x0 + e[r, 1, 1] * x1 + g[r, 1] * now + h[r, 1] * then,
                )


def predictions(observation: Observation, elevator: Array, theta: Array, active: Ints) -> Array:
    """Predicted alpha [rad] and q [rad/s], and the elevator [rad], of the active runs, (active, 3, samples).

    Parameters
    ----------
    observation : measured signals; deviations are from its trim.
    elevator : (runs, samples) elevator of the instruments, deviation from the trim [rad].
    theta : (active, 6) derivatives of the filter's model [-]; active : indices of the runs.
    """
    signals = observation.signals[active]
    y = signals[:, [ALPHA, Q]] - origin_of(signals, observation.window)[:, [ALPHA, Q], None]
    u = np.ascontiguousarray(elevator[active])
    runs = active.size
    e, g, h = np.empty((runs, 2, 2)), np.empty((runs, 2)), np.empty((runs, 2))
    _discretise(np.ascontiguousarray(theta), observation.factors[active], observation.dt_s, e, g, h)
    moved = e @ y[:, :, :-1] + g[:, :, None] * u[:, None, :-1] + h[:, :, None] * u[:, None, 1:]
    error = y[:, :, 1:] - moved
    error -= error.mean(axis=2, keepdims=True)
    step = error @ np.swapaxes(error, 1, 2) / error.shape[2]
    variance = measurement_variance(signals[:, [ALPHA, Q]])
    gain = np.array([steady_gain(*each) for each in zip(e, step, variance, strict=True)])
    made = np.empty((runs, 3, u.shape[1]))
    predict(e, g, h, gain, np.ascontiguousarray(y), u, made)
    return made


def deviation(observation: Observation) -> Array:
    """(runs, samples) low-passed elevator, deviation from its value at the trim [rad]."""
    smooth = observation.smooth
    return np.asarray(smooth[:, ELEVATOR] - origin_of(smooth, observation.window)[:, ELEVATOR, None])


__all__ = ["LEAST_NOISE", "deviation", "measurement_variance", "predict", "predictions", "steady_gain"]
