"""Innovations of a record: the nonlinear motion, corrected with the steady gain of its linearisation, or with gains that
follow the airspeed.

Source: R. E. Maine and K. W. Iliff, NASA RP-1138 (1985), for the filter.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import inner
from airtruth.tracing.model.advance import Steps, Work, advance_motion, advance_sensors, steps_of, work_of
from airtruth.tracing.model.by_motion import air_at, early_count, equations_of, output_count, outputs, rates
from airtruth.tracing.model.corners import (
    corrected,
    gain_at,
    is_uncertain,
    predicted,
    settled,
)
from airtruth.tracing.model.gains import Gains, interpolate, scaled
from airtruth.tracing.model.gust_states import gust_of
from airtruth.tracing.model.kernel_input import AnyPoint, FilterModel, KernelInput
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.parameters import DELAY_ORDER, core_of, lead_of
from airtruth.tracing.model.steady import SteadyFilter, without_update

Array = NDArray[np.float64]

_LOST: Final = 1e6
"""Magnitude of a state [its unit] beyond which the motion has left all bounds; judgement."""


class Path(NamedTuple):
    """Gains that the filter used along a record; see `Gains` and `FirstUpdate`. Without samples nothing is kept.

    Attributes
    ----------
    predicted, corrected : (samples, states) before and after the update; the last one has no update.
    k_gain : (samples, states, outputs) gain of the update.
    first, direct : (samples, states, early) and (samples, early), (samples, states).
    scale : (samples, outputs, outputs), from the innovation to that of the common covariance.
    raw : (samples, outputs) innovations before this scale.
    """

    predicted: Array
    corrected: Array
    k_gain: Array
    first: FirstUpdate
    direct: Array
    scale: Array
    raw: Array


def path_of(samples: int, states: int, outputs: int) -> Path:
    """An empty path of a number of samples."""
    return Path(
        predicted=np.zeros((samples, states)),
        corrected=np.zeros((samples, states)),
        k_gain=np.zeros((samples, states, outputs)),
        first=FirstUpdate(np.zeros((samples, states, outputs - 1)), np.zeros((samples, outputs - 1))),
        direct=np.zeros((samples, states)),
        scale=np.zeros((samples, outputs, outputs)),
        raw=np.zeros((samples, outputs)),
    )


_NOT_KEPT: Final = path_of(0, 0, 1)
"""The path of a flight of which innovations alone are wanted."""


def initial_state(given: KernelInput, start: Array) -> Array:
    """The stated start; the gust at the tail and its copies, and the effects' states, in equilibrium with it."""
    model = given.model
    x = np.zeros(model.states.size)
    states = equations_of(model).states
    x[: start.size] = start
    x[lead_of(states) : core_of(states)] = start[states]
    x[start.size] = gust_of(x, states, model.gusts.rolloff)
    at = type(given.reference)(*(column[0] for column in given.grid))
    equations_of(model).settle(x, at, model)
    return x


@inner
def _settle_sensors(x: Array, out: Array, model: FilterModel) -> None:
    """Put the sensors' lags and delays into equilibrium with their inputs."""
    for i in range(output_count(model)):
        if model.states.lag[i] >= 0:
            x[model.states.lag[i]] = out[i]
        if model.states.delay[i] >= 0:
            x[model.states.delay[i]] = out[i]


@inner
def _reading(x: Array, value: float, i: int, model: FilterModel) -> float:
    """Reading of an output by a sensor with lag, delay and correlated noise."""
    at = model.states.lag[i]
    if at >= 0:
        value = x[at]
    at = model.states.delay[i]
    if at >= 0:
        for row in range(1, DELAY_ORDER, 2):
            value -= 2.0 * x[at + row]
    if model.states.noise >= 0:
        value += model.sensors.slow_std[i] * x[model.states.noise + i]
    return value


@inner
def _update(x: Array, k_gain: Array, e: Array, model: FilterModel) -> bool:
    """x += K e; False if the motion leaves all bounds."""
    for i in range(x.size):
        total = 0.0
        for m in range(output_count(model)):
            total += k_gain[i, m] * e[m]
        x[i] += total
        if not abs(x[i]) < _LOST:
            return False
    return True


@inner
def _read(x: Array, at: AnyPoint, model: FilterModel, work: Work) -> None:
    """Readings of the sensors before lags, delays and correlated noise, into ``work.out``."""
    az = rates(x, at, model, work.rate[0])
    outputs(x, work.rate[0], az, at, model, work.out)


@inner
def _residual(x: Array, i: int, k: int, given: KernelInput, work: Work) -> float:
    """Measured less predicted value of an output at a sample."""
    value = _reading(x, work.out[i], i, given.model)
    return float(given.y[k, i] - value - given.model.sensors.bias[i] - given.more[k, i])


@inner
def innovation(
    x: Array,
    k: int,
    at: AnyPoint,
    given: KernelInput,
    first: FirstUpdate,
    direct: Array,
    shown: float,
    work: Work,
    raw: Array,
) -> None:
    """Innovation of a sample; that of the late output, az, is predicted after the update by the early ones, alpha and q.

    In a linear model this is the innovation of all three at once. Where the lift curve bends, az is predicted at an angle of
    attack that the vane has measured and not at one that a gust may have moved over the bend. A late accelerometer shows only
    a share of this bend, that of a change over the last sample period; the rest of its reading follows the update linearly.
    """
    model, early = given.model, early_count(given.model)
    if k == 0:
        _read(x, at, model, work)
        _settle_sensors(x, work.out, model)
    else:
        outputs(x, work.rate[0], 0.0, at, model, work.out)
    for i in range(early):
        raw[i] = _residual(x, i, k, given, work)
    late = model.states.lag[early] >= 0 or model.states.delay[early] >= 0
    for i in range(x.size):
        total = x[i]
        for m in range(early):
            total += first.gain[i, m] * raw[m]
        work.tried[i] = total
    bend = 0.0
    if late:
        _read(x, at, model, work)
        bend = -work.out[early]
        for i in range(x.size):
            bend -= direct[i] * (work.tried[i] - x[i])
    _read(work.tried, at, model, work)
    total = _residual(work.tried, early, k, given, work)
    for m in range(early):
        total += first.share[m] * raw[m]
    raw[early] = total
    if late:
        bend += work.out[early]
        in_reading = 1.0 if model.states.lag[early] < 0 else 0.0
        raw[early] += (in_reading - shown) * bend


@inner
def _keep(
    path: Path, k: int, x: Array, k_gain: Array, first: FirstUpdate, direct: Array, scale: Array, node: int
) -> None:
    """Keep what the filter uses at a sample, but for the corrected state."""
    count = k_gain.shape[1]
    for i in range(x.size):
        path.predicted[k, i], path.direct[k, i] = x[i], direct[i]
        for m in range(count):
            path.k_gain[k, i, m] = k_gain[i, m]
        for m in range(count - 1):
            path.first.gain[k, i, m] = first.gain[i, m]
    for m in range(count - 1):
        path.first.share[k, m] = first.share[m]
    for i in range(count):
        for m in range(count):
            path.scale[k, i, m] = scale[node, i, m]


@inner
def _keep_scaled(path: Path, k: int, scale: Array) -> None:
    """Put a further scale before the one that is kept."""
    count = scale.shape[0]
    for i in range(count):
        for m in range(count):
            total = 0.0
            for j in range(m, count):  # both are lower triangular
                total += path.scale[k, i, j] * scale[j, m]
            path.scale[k, i, m] = total


@awaited
@njit(cache=True, nogil=True, error_model="numpy")
def _innovations(
    given: KernelInput, steps: Steps, work: Work, x: Array, steady: SteadyFilter, e: Array, path: Path
) -> tuple[bool, float]:
    """`innovations` from a state ``x``, which moves along the record."""
    model, grid, states = given.model, given.grid, given.model.states
    n, samples = states.size, given.y.shape[0]
    scheduled, node, corners = steady.lower.size > 0, 0, steady.corners
    keeps = path.scale.shape[0] > 0
    uncertain, is_steady, more_logdet, away, p = False, True, 0.0, 0.0, corners.steady[0].copy()
    first = FirstUpdate(steady.first.gain[0].copy(), steady.first.share[0].copy())
    settled_gains = Gains(steady.k_gain[0].copy(), first, steady.direct[0].copy(), steady.scale[:1].copy())
    own_gain, own_first = (
        settled_gains.k_gain.copy(),
        FirstUpdate(first.gain.copy(), first.share.copy()),
    )
    count = output_count(model)
    scale, raw, turned = np.empty((count, count)), np.empty(count), np.empty(count)
    for k in range(samples):
        at = air_at(grid, k * given.sub)
        if scheduled:
            interpolate(steady, k, settled_gains)
            node = steady.lower[k] + (1 if steady.share[k] > 0.5 else 0)
        if uncertain:
            more, away = gain_at(p, corners, node, own_gain, own_first, scale)
            if not math.isfinite(more):
                return False, 0.0
            innovation(x, k, at, given, own_first, settled_gains.direct, steady.shown, work, raw)
            for i in range(count):
                turned[i] = 0.0
                for m in range(count):
                    turned[i] += scale[i, m] * raw[m]
            more_logdet += more + scaled(steady.scale, node, turned, e, k)
            uncertain, is_steady = not settled(away), False
            now = own_gain
            if keeps:
                _keep(path, k, x, now, own_first, settled_gains.direct, steady.scale, node)
                _keep_scaled(path, k, scale)
        else:
            innovation(x, k, at, given, settled_gains.first, settled_gains.direct, steady.shown, work, raw)
            more_logdet += scaled(settled_gains.scale, 0, raw, e, k)
            now, is_steady = settled_gains.k_gain, True
            if keeps:
                _keep(path, k, x, now, settled_gains.first, settled_gains.direct, settled_gains.scale, 0)
        if keeps:
            for i in range(count):
                path.raw[k, i] = raw[i]
        if k + 1 == samples:
            break
        if not _update(x, now, raw, model):
            return False, 0.0
        if keeps:
            for i in range(n):
                path.corrected[k, i] = x[i]
        if given.corner_rad2.size > 0 and (uncertain or is_uncertain(given.corner_rad2, k + 1)):
            if is_steady:
                p = corners.steady[node].copy()
            p = predicted(corrected(p, now, corners.c[node]), corners, node, given.corner_rad2, k + 1)
            uncertain = True
        if states.noise >= 0:
            for i in range(states.noise, n):
                x[i] *= steps.forget
        for pair in range(given.sub // 2):
            point = k * given.sub + 2 * pair
            advance_motion(x, point, grid, model, steps, work)
            if steps.has_late_sensors:
                advance_sensors(x, point, grid, model, steps, work)
    return True, more_logdet


def innovations(
    given: KernelInput, steady: SteadyFilter, e: Array, path: Path = _NOT_KEPT
) -> tuple[bool, float]:
    """Innovations of one record into ``e`` (samples, outputs).

    Where the surface is uncertain or the airspeed is another one, they are scaled to the common covariance. The
    kernels are few and flat, because numba optimises what a kernel calls again with it.

    Returns
    -------
    Whether the motion keeps its bounds, and the sum of log|S| beyond the common one.
    """
    steps = steps_of(given.model, given.dt_s, given.sub)
    work = work_of(given.model)
    sound, more = _innovations(given, steps, work, initial_state(given, given.start), steady, e, path)
    return bool(sound), float(more)


def free_run(given: KernelInput, e: Array) -> bool:
    """Residuals of a simulation into ``e`` (samples, outputs); whether the motion keeps its bounds.

    The surface is taken as known between the samples.
    """
    certain = given._replace(corner_rad2=np.zeros((0, 0)))
    return innovations(certain, without_update(given.model), e)[0]


__all__ = ["Path", "free_run", "initial_state", "innovation", "innovations", "path_of"]
