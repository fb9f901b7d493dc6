"""The filter's linearisation and steady gain.

Sources: gain, R. E. Maine and K. W. Iliff, NASA RP-1138 (1985); delay, G. A. Baker and P. Graves-Morris, Pade
Approximants, 2nd ed. (1996), section 4.6.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.discretise import riccati, step, whitener
from airtruth.tracing.model.equations import FASTMATH, gust, outputs, rates
from airtruth.tracing.model.kernel_input import AirPoint, FilterModel
from airtruth.tracing.model.parameters import CORE, DELAY_ORDER, OUTPUTS

Array = NDArray[np.float64]

_ANGLE_RAD: Final = 0.01
"""Half width of the central differences in angles [rad]. Judgement: wide enough to average a break of a table, so that
the gain does not jump with the reference; the curvature of the sines over it is 2e-5."""
_RATE_RAD_S: Final = 0.05
"""The same in the pitch rate [rad/s]."""
_GUST: Final = 0.1
"""The same in a gust state that does not move alpha [-]."""


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def delay_system(delay_s: float) -> Array:
    """A and B (order, order + 1) of a delay; its output is the input less twice the sum of every second state.

    exp(-s) = (1 - z)/(1 + z) with z = tanh(s/2) cut off after `DELAY_ORDER` steps of its continued fraction, a ladder
    of integrators: the diagonal Pade approximant, to one degree up to a phase of 11 rad.
    """
    system = np.zeros((DELAY_ORDER, DELAY_ORDER + 1))
    for row in range(DELAY_ORDER):
        rate = 2.0 * (2.0 * row + 1.0) / delay_s
        if row % 2 == 0:
            system[row, row + 1 : DELAY_ORDER : 2] = rate
        else:
            system[row, DELAY_ORDER] = rate
            system[row, 1:DELAY_ORDER:2] = -rate
            system[row, 0:row:2] = -rate
    return system


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def _half_width(state: int, at: AirPoint, model: FilterModel) -> float:
    """Half width of the central difference in a state of the motion."""
    if state == 1:
        return _RATE_RAD_S
    if state < 2 or state >= CORE:
        return _ANGLE_RAD
    # a gust that moves alpha as far as above, so that no level or rolloff shifts the breaks that are met
    unit = np.zeros(CORE)
    unit[state] = 1.0
    moves = abs(model.gusts.level_m_s * gust(unit, model.gusts.rolloff)) / at.airspeed_m_s
    return _ANGLE_RAD / moves if moves > 1e-9 else _GUST


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def linearise(x: Array, at: AirPoint, model: FilterModel, a: Array, c: Array) -> None:
    """A and C of the motion, effects' states, late sensors and slow noise about a state, by central differences.

    Parameters
    ----------
    x : (states,) where; at : inputs there.
    a, c : (states, states) and (outputs, states), written.
    """
    a[:] = 0.0
    c[:] = 0.0
    up, down = np.empty(x.size), np.empty(x.size)
    y_up, y_down = np.empty(OUTPUTS), np.empty(OUTPUTS)
    moved = x.copy()
    for j in range(model.states.motion):
        h = _half_width(j, at, model)
        moved[j] = x[j] + h
        az = rates(moved, at, model, up)
        outputs(moved, up[1], az, at, model, y_up)
        moved[j] = x[j] - h
        az = rates(moved, at, model, down)
        outputs(moved, down[1], az, at, model, y_down)
        moved[j] = x[j]
        for i in range(model.states.motion):
            a[i, j] = (up[i] - down[i]) / (2.0 * h)
        for i in range(OUTPUTS):
            c[i, j] = (y_up[i] - y_down[i]) / (2.0 * h)
    _add_sensors(model, a, c)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def _add_sensors(model: FilterModel, a: Array, c: Array) -> None:
    """Put lags, delays and slow noise behind the outputs of the motion."""
    sensors, states = model.sensors, model.states
    n = a.shape[0]
    for i in range(OUTPUTS):
        at = states.lag[i]
        if at >= 0:
            for j in range(n):
                a[at, j] = c[i, j] / sensors.lag_s[i]
                c[i, j] = 0.0
            a[at, at] = -1.0 / sensors.lag_s[i]
            c[i, at] = 1.0
        at = states.delay[i]
        if at >= 0:
            system = delay_system(sensors.delay_s[i])
            for row in range(DELAY_ORDER):
                for j in range(n):
                    a[at + row, j] = system[row, DELAY_ORDER] * c[i, j]
            a[at : at + DELAY_ORDER, at : at + DELAY_ORDER] = system[:, :DELAY_ORDER]
            for row in range(1, DELAY_ORDER, 2):
                c[i, at + row] -= 2.0
    if states.noise >= 0:
        for i in range(OUTPUTS):
            at = states.noise + i
            a[at, at] = -1.0 / sensors.slow_time_s
            c[i, at] = sensors.slow_std[i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def process_intensity(airspeed_m_s: float, model: FilterModel) -> Array:
    """(states,) intensities [1/s] of the white noise that drives gusts and slow noise."""
    process = np.zeros(model.states.size)
    process[2] = 2.0 * airspeed_m_s / model.gusts.length_m
    if model.states.noise >= 0:
        process[model.states.noise :] = 2.0 / model.sensors.slow_time_s
    return process


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def gain(
    a: Array, c: Array, process: Array, variance: Array, dt_s: float
) -> tuple[Array, Array, Array, float]:
    """Steady gain K of the update, whitener W with W S W' = I, S itself, and log|S| (nan where there is none).

    Parameters
    ----------
    a, c : see `linearise`; process : see `process_intensity`; variance : (outputs,) of the white noise.
    dt_s : sample period [s].
    """
    phi, noise = discrete(a, process, dt_s)
    k_gain, white, s, logdet, _ = gain_of(phi, c, noise, variance)
    return k_gain, white, s, logdet


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def discrete(a: Array, process: Array, dt_s: float) -> tuple[Array, Array]:
    """Transition over a time, and the covariance that the process noise adds in it."""
    n = a.shape[0]
    system = np.zeros((n, n + 1))
    system[:, :n] = a
    phi, noise = np.empty((n, n)), np.empty((n, n))
    early, late = np.empty((n, 1)), np.empty((n, 1))
    step(system, process, n, dt_s, phi, early, late, noise)
    return phi, noise


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def gain_of(phi: Array, c: Array, noise: Array, variance: Array) -> tuple[Array, Array, Array, float, Array]:
    """`gain` of a system in discrete time, and the steady covariance of its prediction."""
    n = phi.shape[0]
    white = np.zeros((OUTPUTS, OUTPUTS))
    k_gain = np.zeros((n, OUTPUTS))
    s = np.zeros((OUTPUTS, OUTPUTS))
    if not (np.isfinite(phi).all() and np.isfinite(noise).all()):
        return k_gain, white, s, np.nan, noise
    p = riccati(phi, c, noise, variance)
    pc = np.dot(p, np.ascontiguousarray(c.T))
    s = np.dot(c, pc)
    for i in range(OUTPUTS):
        s[i, i] += variance[i]
    if not np.isfinite(s).all():
        return k_gain, white, s, np.nan, p
    logdet = whitener(s, white)
    if not math.isfinite(logdet):
        return k_gain, white, s, np.nan, p
    k_gain[:] = np.dot(pc, np.dot(np.ascontiguousarray(white.T), white))
    return k_gain, white, s, logdet, p


__all__ = ["delay_system", "discrete", "gain", "gain_of", "linearise", "process_intensity"]
