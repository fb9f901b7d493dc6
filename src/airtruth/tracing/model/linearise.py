"""The filter's linearisation and steady gain.

Sources: gain, R. E. Maine and K. W. Iliff, NASA RP-1138 (1985); delay, G. A. Baker and P. Graves-Morris, Pade
Approximants, 2nd ed. (1996), section 4.6.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import allocating, inner, shared
from airtruth.numerics.discretise import multiply, riccati, step, whitener
from airtruth.tracing.model.by_motion import equations_of, output_count, outputs, rates, state_count
from airtruth.tracing.model.gust_states import gust_of
from airtruth.tracing.model.kernel_input import AnyPoint, FilterModel
from airtruth.tracing.model.parameters import CORE, DELAY_ORDER, GUST_1, core_of

Array = NDArray[np.float64]

ANGLE_RAD: Final = 0.01
"""Half width of the central differences in angles [rad]. Judgement: wide enough to average a break of a table, so that
the gain does not jump with the reference; the curvature of the sines over it is 2e-5."""
RATE_RAD_S: Final = 0.05
"""Half width of the central differences in rates [rad/s]."""
_GUSTS: Final = CORE - GUST_1
"""Number of states of the gusts, which follow those of the motion [-]."""
_GUST: Final = 0.1
"""Half width of the central differences in a gust state that does not move alpha [-]."""
LEAST_MOVE: Final = 1e-9
"""Change of alpha by a gust state of unit size below which its half width is `_GUST` [rad]."""


class FirstUpdate(NamedTuple):
    """The update by the early outputs alone, which precedes that by the late one.

    Attributes
    ----------
    gain : (states, early) gain of this update.
    share : (early,) regression of the innovation of the late output on those of the early ones.
    """

    gain: Array
    share: Array


@shared
def delay_system(delay_s: float) -> Array:
    """A and B (order, order + 1) of a delay; its output is the input less twice the sum of every second state.

    exp(-s) = (1 - z)/(1 + z) with z = tanh(s/2) cut off after `DELAY_ORDER` steps of its continued fraction, a ladder
    of integrators: the diagonal Pade approximant, to one degree up to a phase of 11 rad.
    """
    system = np.zeros((DELAY_ORDER, DELAY_ORDER + 1))
    for row in range(DELAY_ORDER):
        rate = 2.0 * (2.0 * row + 1.0) / delay_s
        if row % 2 == 0:
            for i in range(row + 1, DELAY_ORDER, 2):
                system[row, i] = rate
        else:
            system[row, DELAY_ORDER] = rate
            for i in range(1, DELAY_ORDER, 2):
                system[row, i] = -rate
            for i in range(0, row, 2):
                system[row, i] = -rate
    return system


@allocating
def half_width(state: int, at: AnyPoint, model: FilterModel) -> float:
    """Half width of the central difference in a state of the motion."""
    states = state_count(model)
    core = states + _GUSTS
    if 0 < state < states:
        return RATE_RAD_S
    if state < states or state >= core:
        return ANGLE_RAD
    # a gust that moves alpha as far as above, so that no level or rolloff shifts the breaks that are met
    unit = np.zeros(core)
    unit[state] = 1.0
    moves = abs(model.gusts.level_m_s * gust_of(unit, states, model.gusts.rolloff)) / at.airspeed_m_s
    return ANGLE_RAD / moves if moves > LEAST_MOVE else _GUST


def linearise(x: Array, at: AnyPoint, model: FilterModel, a: Array, c: Array) -> Array:
    """A and C of the motion, effects' states, late sensors and correlated noise about a state, by central differences.

    Parameters
    ----------
    x : (states,) where; at : inputs there.
    a, c : (states, states) and (outputs, states), written.

    Returns
    -------
    (states,) row of C of an accelerometer that is not late.
    """
    direct = np.zeros(x.size)
    _differences(x.copy(), at, model, a, c, direct)
    return direct


@awaited
@njit(cache=True, nogil=True, error_model="numpy")
def _differences(x: Array, at: AnyPoint, model: FilterModel, a: Array, c: Array, direct: Array) -> None:
    """`linearise` about ``x``, which is moved and returns; ``direct``: (states,) the row that it returns."""
    count = output_count(model)
    rate, y = np.empty((2, x.size)), np.empty((2, count))
    a[:] = 0.0
    c[:] = 0.0
    for j in range(model.states.motion):
        h, middle = half_width(j, at, model), x[j]
        for side in range(2):
            x[j] = middle + h if side == 0 else middle - h
            az = rates(x, at, model, rate[side])
            outputs(x, rate[side], az, at, model, y[side])
        x[j] = middle
        for i in range(model.states.motion):
            a[i, j] = (rate[0, i] - rate[1, i]) / (2.0 * h)
        for i in range(count):
            c[i, j] = (y[0, i] - y[1, i]) / (2.0 * h)
    for j in range(x.size):
        direct[j] = c[count - 1, j]
    add_sensors(model, model.sensors.slow_std, model.sensors.slow_time_s, a, c)


@allocating
def add_sensors(model: FilterModel, slow_std: Array, slow_time_s: float, a: Array, c: Array) -> None:
    """Put lags, delays and correlated noise behind the outputs of the motion."""
    sensors, states, n = model.sensors, model.states, a.shape[0]
    for i in range(c.shape[0]):
        lag, delay = states.lag[i], states.delay[i]
        if lag >= 0:
            for j in range(n):
                a[lag, j], c[i, j] = c[i, j] / sensors.lag_s[i], 0.0
            a[lag, lag], c[i, lag] = -1.0 / sensors.lag_s[i], 1.0
        if delay >= 0:
            system = delay_system(sensors.delay_s[i])
            for row in range(DELAY_ORDER):
                for j in range(n):
                    a[delay + row, j] = system[row, DELAY_ORDER] * c[i, j]
                for j in range(DELAY_ORDER):
                    a[delay + row, delay + j] = system[row, j]
            for row in range(1, DELAY_ORDER, 2):
                c[i, delay + row] -= 2.0
    if states.noise >= 0:
        for i in range(c.shape[0]):
            at = states.noise + i
            a[at, at], c[i, at] = -1.0 / slow_time_s, slow_std[i]


def process_intensity(airspeed_m_s: float, model: FilterModel) -> Array:
    """(states,) intensities [1/s] of the white noise that drives gusts and correlated noise."""
    process = np.zeros(model.states.size)
    equations = equations_of(model)
    process[equations.states] = 2.0 * airspeed_m_s / model.gusts.length_m
    if equations.has_roll_gust:
        process[core_of(equations.states)] = 2.0 / model.gusts.roll_time_s
    if model.states.noise >= 0:
        process[model.states.noise :] = 2.0 / model.sensors.slow_time_s
    return process


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
    k_gain, white, s, logdet, *_ = gain_of(phi, c, noise, variance)
    return k_gain, white, s, logdet


def discrete(a: Array, process: Array, dt_s: float) -> tuple[Array, Array]:
    """Transition over a time, and the covariance that the process noise adds in it."""
    n = a.shape[0]
    system = np.zeros((n, n + 1))
    system[:, :n] = a
    phi, noise = np.empty((n, n)), np.empty((n, n))
    early, late = np.empty((n, 1)), np.empty((n, 1))
    step(system, process, n, dt_s, phi, early, late, noise)
    return phi, noise


@inner
def covariance_of(p: Array, c: Array, variance: Array, pc: Array, s: Array) -> None:
    """P C' and the covariance S = C P C' + R of the innovations."""
    for i in range(p.shape[0]):
        for j in range(c.shape[0]):
            total = 0.0
            for k in range(p.shape[0]):
                total += p[i, k] * c[j, k]
            pc[i, j] = total
    multiply(c, pc, s)
    for i in range(c.shape[0]):
        s[i, i] += variance[i]


@allocating
def update_gain(pc: Array, white: Array, k_gain: Array) -> None:
    """K = P C' W' W."""
    count = white.shape[0]
    weight = np.empty((count, count))
    for i in range(count):
        for j in range(count):
            weight[i, j] = 0.0
            for k in range(count):
                weight[i, j] += white[k, i] * white[k, j]
    multiply(pc, weight, k_gain)


@allocating
def first_update(pc: Array, s: Array, first: FirstUpdate) -> None:
    """Write the update by the early outputs.

    Parameters
    ----------
    pc, s : P C' and the covariance of the innovations.
    """
    early = first.share.size
    if early != 2:
        _first_of_many(pc, s, first)
        return
    determinant = s[0, 0] * s[1, 1] - s[0, 1] * s[1, 0]
    for i in range(pc.shape[0]):
        first.gain[i, 0] = (pc[i, 0] * s[1, 1] - pc[i, 1] * s[1, 0]) / determinant
        first.gain[i, 1] = (pc[i, 1] * s[0, 0] - pc[i, 0] * s[0, 1]) / determinant
    first.share[0] = (s[2, 0] * s[1, 1] - s[2, 1] * s[1, 0]) / determinant
    first.share[1] = (s[2, 1] * s[0, 0] - s[2, 0] * s[0, 1]) / determinant


@allocating
def _first_of_many(pc: Array, s: Array, first: FirstUpdate) -> None:
    """`first_update` with any number of early outputs: S^-1 = W' W of their block."""
    early = first.share.size
    white = np.zeros((early, early))
    whitener(s[:early, :early].copy(), white)
    for j in range(early):
        first.share[j] = 0.0
        for i in range(pc.shape[0]):
            first.gain[i, j] = 0.0
        for m in range(early):
            inverse = 0.0
            for k in range(early):
                inverse += white[k, m] * white[k, j]
            first.share[j] += s[early, m] * inverse
            for i in range(pc.shape[0]):
                first.gain[i, j] += pc[i, m] * inverse


@njit(cache=True, nogil=True, error_model="numpy")
def gain_of(
    phi: Array, c: Array, noise: Array, variance: Array
) -> tuple[Array, Array, Array, float, Array, FirstUpdate]:
    """`gain` of a system in discrete time, the steady covariance of its prediction, and the first update."""
    n, count = phi.shape[0], c.shape[0]
    white, s = np.zeros((count, count)), np.zeros((count, count))
    k_gain, pc = np.zeros((n, count)), np.empty((n, count))
    first = FirstUpdate(np.zeros((n, count - 1)), np.zeros(count - 1))
    p = riccati(phi, c, noise, variance)
    covariance_of(p, c, variance, pc, s)
    logdet = whitener(s, white)
    if math.isfinite(logdet):
        update_gain(pc, white, k_gain)
        first_update(pc, s, first)
    return k_gain, white, s, logdet, p, first


__all__ = [
    "ANGLE_RAD",
    "LEAST_MOVE",
    "RATE_RAD_S",
    "FirstUpdate",
    "add_sensors",
    "covariance_of",
    "delay_system",
    "discrete",
    "first_update",
    "gain",
    "gain_of",
    "half_width",
    "linearise",
    "process_intensity",
    "update_gain",
]
