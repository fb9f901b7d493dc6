"""Innovations of a record: the nonlinear motion, corrected with the steady gain of its linearisation, or with gains that
follow the airspeed.

Between samples the motion is integrated by the classical Runge-Kutta method, whose weights are Simpson's: the middle
value of an input carries its area. The low-passed copies of the gust are integrated exactly for a signal that is linear over
half a step, and the lags and the delays of sensors for one that is linear over a quarter.

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
from airtruth.numerics.discretise import step
from airtruth.tracing.model.corners import (
    corrected,
    gain_at,
    predicted,
    settled,
)
from airtruth.tracing.model.equations import (
    air_at,
    effective_elevator,
    gust,
    hold_plays,
    lead_decay,
    move_plays,
    outputs,
    rates,
    settle_effects,
)
from airtruth.tracing.model.gains import Gains, interpolate, scaled
from airtruth.tracing.model.kernel_input import AirPoint, FilterModel, GridSignals, KernelInput
from airtruth.tracing.model.linearise import (
    FirstUpdate,
    delay_system,
)
from airtruth.tracing.model.parameters import AZ, CORE, DELAY_ORDER, LEAD, LEAD_COUNT, OUTPUTS
from airtruth.tracing.model.steady import SteadyFilter, without_update

Array = NDArray[np.float64]

_PARTS: Final = 4
"""Parts of a step over which a signal is linear for the lag or the delay of its sensor [-]. With two parts, the error of a gyro
delayed by 5.6 ms is 0.9 standard deviations of its noise, as root sum of squares over a record with 46 elevator steps."""
_LOST: Final = 1e6
"""Magnitude of a state [its unit] beyond which the motion has left all bounds; judgement."""


class Steps(NamedTuple):
    """Exact steps of the linear states, over half a step of integration and a whole one.

    Attributes
    ----------
    h : step of integration [s].
    decay, mean : (2, leads) of the gust's low-passed copies [-].
    phi, early, late : (outputs, order, order), (outputs, order) of the sensors' delays over a part of a step.
    forget : decay of the correlated noise over a sample [-].
    has_late_sensors : whether any sensor has a lag or a delay.
    """

    h: float
    decay: Array
    mean: Array
    phi: Array
    early: Array
    late: Array
    forget: float
    has_late_sensors: bool


class Work(NamedTuple):
    """Arrays that one record reuses.

    Attributes
    ----------
    rate : (4, states) of the stages; tried : (states,) at a stage.
    out, last : (outputs,) at the end and the start of a step; first : (2,) rates of alpha and q at its start.
    ends : (parts + 1,) a signal at the ends of the parts of a step; held : (order,) states of a delay.
    """

    rate: Array
    tried: Array
    out: Array
    last: Array
    first: Array
    ends: Array
    held: Array


def _steps(model: FilterModel, dt_s: float, sub: int) -> Steps:
    h = 2.0 * dt_s / sub
    decay, mean = np.empty((2, LEAD_COUNT)), np.empty((2, LEAD_COUNT))
    for j in range(2):
        for i in range(LEAD_COUNT):
            decay[j, i], mean[j, i] = lead_decay(0.5 * (j + 1) * h, i)
    phi = np.zeros((OUTPUTS, DELAY_ORDER, DELAY_ORDER))
    early, late = np.zeros((OUTPUTS, DELAY_ORDER, 1)), np.zeros((OUTPUTS, DELAY_ORDER, 1))
    unused = np.empty((DELAY_ORDER, DELAY_ORDER))
    for i in range(OUTPUTS):
        if model.states.delay[i] >= 0:
            system = delay_system(model.sensors.delay_s[i])
            step(system, np.zeros(DELAY_ORDER), DELAY_ORDER, h / _PARTS, phi[i], early[i], late[i], unused)
    states = model.states
    forget = math.exp(-dt_s / model.sensors.slow_time_s) if states.noise >= 0 else 0.0
    has_late_sensors = states.size > states.motion + (OUTPUTS if states.noise >= 0 else 0)
    return Steps(h, decay, mean, phi, early[:, :, 0].copy(), late[:, :, 0].copy(), forget, has_late_sensors)


def _initial_state(given: KernelInput) -> Array:
    """The stated start; the gust at the tail and its copies, and the effects' states, in equilibrium with it."""
    model = given.model
    x = np.zeros(model.states.size)
    x[:4] = given.start
    x[LEAD:CORE] = given.start[2]
    x[4] = gust(x, model.gusts.rolloff)
    settle_effects(x, x[0], effective_elevator(given.grid.elevator_rad[0], model.aircraft), model)
    return x


@inner
def _settle_sensors(x: Array, out: Array, model: FilterModel) -> None:
    """Put the sensors' lags and delays into equilibrium with their inputs."""
    for i in range(OUTPUTS):
        if model.states.lag[i] >= 0:
            x[model.states.lag[i]] = out[i]
        if model.states.delay[i] >= 0:
            x[model.states.delay[i]] = out[i]


@inner
def _reading(x: Array, value: float, i: int, model: FilterModel) -> float:
    """What a sensor with lag, delay and correlated noise reads of an output."""
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
def _advance_motion(
    x: Array, point: int, grid: GridSignals, model: FilterModel, steps: Steps, work: Work
) -> None:
    """One Runge-Kutta step of motion, gusts and effects; the outputs at its start into ``work`` for late sensors."""
    h, rate, tried, motion = steps.h, work.rate, work.tried, model.states.motion
    for stage in range(4):
        share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        at = air_at(grid, point + (0 if stage == 0 else (2 if stage == 3 else 1)))
        for m in range(motion):
            tried[m] = x[m] + (share * h * rate[stage - 1, m] if stage > 0 else 0.0)
        hold_plays(x, tried, model)
        if stage > 0:
            j = 1 if stage == 3 else 0
            for i in range(LEAD_COUNT):
                decay, mean = steps.decay[j, i], steps.mean[j, i]
                tried[LEAD + i] = decay * x[LEAD + i] + (mean - decay) * x[2] + (1.0 - mean) * tried[2]
        az = rates(tried, at, model, rate[stage])
        if stage == 0 and steps.has_late_sensors:
            outputs(tried, rate[0, 1], az, at, model, work.last)
            work.first[0], work.first[1] = rate[0, 0], rate[0, 1]
    for m in range(motion):
        slope = rate[0, m] + 2.0 * rate[1, m] + 2.0 * rate[2, m] + rate[3, m]
        x[m] += h / 6.0 * slope
    hold_plays(tried, x, model)
    for i in range(LEAD_COUNT):
        x[LEAD + i] = tried[LEAD + i]
    move_plays(x, air_at(grid, point + 2), model)


@inner
def _advance_sensors(
    x: Array, point: int, grid: GridSignals, model: FilterModel, steps: Steps, work: Work
) -> None:
    """Lags and delays over the parts of the step that `_advance_motion` has made.

    In between the signal has the motion's own curvature: a cubic through values and slopes.
    """
    at = air_at(grid, point + 2)
    az = rates(x, at, model, work.rate[0])
    outputs(x, work.rate[0, 1], az, at, model, work.out)
    ends = work.ends
    for i in range(OUTPUTS):
        rise = work.out[i] - work.last[i]
        early = late = 0.0  # slopes over the step beyond those of a straight line
        if i < 2:
            early = model.sensors.scale[i] * steps.h * work.first[i] - rise
            late = model.sensors.scale[i] * steps.h * work.rate[0, i] - rise
        for part in range(_PARTS + 1):
            s = part / _PARTS
            ends[part] = work.last[i] + s * rise + s * (1.0 - s) * ((1.0 - s) * early - s * late)
        if model.states.lag[i] >= 0:
            _advance_lag(x, model.states.lag[i], steps.h / (_PARTS * model.sensors.lag_s[i]), ends)
        if model.states.delay[i] >= 0:
            _advance_delay(x, model.states.delay[i], i, steps, work)


@inner
def _advance_lag(x: Array, at: int, r: float, ends: Array) -> None:
    """A lag over the parts of a step of r time constants each; its output replaces its input in ``ends``."""
    decay = math.exp(-r)
    mean = (1.0 - decay) / r
    before = ends[0]
    ends[0] = x[at]
    for part in range(1, _PARTS + 1):
        x[at] = decay * x[at] + (mean - decay) * before + (1.0 - mean) * ends[part]
        before, ends[part] = ends[part], x[at]


@inner
def _advance_delay(x: Array, at: int, i: int, steps: Steps, work: Work) -> None:
    ends, held = work.ends, work.held
    for part in range(_PARTS):
        for row in range(DELAY_ORDER):
            held[row] = x[at + row]
        for row in range(DELAY_ORDER):
            total = steps.early[i, row] * ends[part] + steps.late[i, row] * ends[part + 1]
            for m in range(DELAY_ORDER):
                total += steps.phi[i, row, m] * held[m]
            x[at + row] = total


@inner
def _update(x: Array, k_gain: Array, e: Array) -> bool:
    """x += K e; False if the motion leaves all bounds."""
    for i in range(x.size):
        total = 0.0
        for m in range(OUTPUTS):
            total += k_gain[i, m] * e[m]
        x[i] += total
        if not abs(x[i]) < _LOST:
            return False
    return True


@inner
def _read(x: Array, at: AirPoint, model: FilterModel, work: Work) -> None:
    """What the sensors read before lags, delays and correlated noise, into ``work.out``."""
    az = rates(x, at, model, work.rate[0])
    outputs(x, work.rate[0, 1], az, at, model, work.out)


@inner
def _residual(x: Array, i: int, k: int, given: KernelInput, work: Work) -> float:
    """Measured less predicted value of an output at a sample."""
    value = _reading(x, work.out[i], i, given.model)
    return float(given.y[k, i] - value - given.model.sensors.bias[i] - given.more[k, i])


@inner
def _innovation(
    x: Array,
    k: int,
    at: AirPoint,
    given: KernelInput,
    first: FirstUpdate,
    direct: Array,
    shown: float,
    work: Work,
    raw: Array,
) -> None:
    """Innovation of a sample; that of az is predicted after the update by alpha and q.

    In a linear model this is the innovation of all three at once. Where the lift curve bends, az is predicted at an angle of
    attack that the vane has measured and not at one that a gust may have moved over the bend. A late accelerometer shows only
    a share of this bend, that of a change over the last sample period; the rest of its reading follows the update linearly.
    """
    if k == 0:
        _read(x, at, given.model, work)
        _settle_sensors(x, work.out, given.model)
    else:
        outputs(x, 0.0, 0.0, at, given.model, work.out)
    for i in range(2):
        raw[i] = _residual(x, i, k, given, work)
    late = given.model.states.lag[AZ] >= 0 or given.model.states.delay[AZ] >= 0
    for i in range(x.size):
        work.tried[i] = x[i] + first.gain[i, 0] * raw[0] + first.gain[i, 1] * raw[1]
    bend = 0.0
    if late:
        _read(x, at, given.model, work)
        bend = -work.out[AZ]
        for i in range(x.size):
            bend -= direct[i] * (work.tried[i] - x[i])
    _read(work.tried, at, given.model, work)
    raw[AZ] = _residual(work.tried, AZ, k, given, work) + first.share[0] * raw[0] + first.share[1] * raw[1]
    if late:
        bend += work.out[AZ]
        in_reading = 1.0 if given.model.states.lag[AZ] < 0 else 0.0
        raw[AZ] += (in_reading - shown) * bend


@awaited
@njit(cache=True, nogil=True, error_model="numpy")
def _innovations(
    given: KernelInput, steps: Steps, work: Work, x: Array, steady: SteadyFilter, e: Array
) -> tuple[bool, float]:
    """`innovations` from a state ``x``, which moves along the record."""
    model, grid, states = given.model, given.grid, given.model.states
    n, samples = states.size, given.y.shape[0]
    scheduled, node, corners = steady.lower.size > 0, 0, steady.corners
    uncertain, is_steady, more_logdet, away, p = False, True, 0.0, 0.0, corners.steady[0].copy()
    first = FirstUpdate(steady.first.gain[0].copy(), steady.first.share[0].copy())
    settled_gains = Gains(steady.k_gain[0].copy(), first, steady.direct[0].copy(), steady.scale[:1].copy())
    own_gain, own_first = (
        settled_gains.k_gain.copy(),
        FirstUpdate(first.gain.copy(), first.share.copy()),
    )
    scale, raw, turned = np.empty((OUTPUTS, OUTPUTS)), np.empty(OUTPUTS), np.empty(OUTPUTS)
    for k in range(samples):
        at = air_at(grid, k * given.sub)
        if scheduled:
            interpolate(steady, k, settled_gains)
            node = steady.lower[k] + (1 if steady.share[k] > 0.5 else 0)
        if uncertain:
            more, away = gain_at(p, corners, node, own_gain, own_first, scale)
            if not math.isfinite(more):
                return False, 0.0
            _innovation(x, k, at, given, own_first, settled_gains.direct, steady.shown, work, raw)
            for i in range(OUTPUTS):
                turned[i] = 0.0
                for m in range(OUTPUTS):
                    turned[i] += scale[i, m] * raw[m]
            more_logdet += more + scaled(steady.scale, node, turned, e, k)
            uncertain, is_steady = not settled(away), False
            now = own_gain
        else:
            _innovation(x, k, at, given, settled_gains.first, settled_gains.direct, steady.shown, work, raw)
            more_logdet += scaled(settled_gains.scale, 0, raw, e, k)
            now, is_steady = settled_gains.k_gain, True
        if k + 1 == samples:
            break
        if not _update(x, now, raw):
            return False, 0.0
        if given.corner_rad2.size > 0 and (uncertain or given.corner_rad2[k + 1] > 0.0):
            if is_steady:
                p = corners.steady[node].copy()
            p = predicted(corrected(p, now, corners.c[node]), corners, node, given.corner_rad2[k + 1])
            uncertain = True
        if states.noise >= 0:
            for i in range(states.noise, n):
                x[i] *= steps.forget
        for pair in range(given.sub // 2):
            point = k * given.sub + 2 * pair
            _advance_motion(x, point, grid, model, steps, work)
            if steps.has_late_sensors:
                _advance_sensors(x, point, grid, model, steps, work)
    return True, more_logdet


def innovations(given: KernelInput, steady: SteadyFilter, e: Array) -> tuple[bool, float]:
    """Innovations of one record into ``e`` (samples, outputs).

    Where the surface is uncertain or the airspeed is another one, they are scaled to the common covariance. The
    kernels are few and flat, because numba optimises what a kernel calls again with it.

    Returns
    -------
    Whether the motion keeps its bounds, and the sum of log|S| beyond the common one.
    """
    n = given.model.states.size
    steps = _steps(given.model, given.dt_s, given.sub)
    work = Work(
        np.zeros((4, n)),
        np.zeros(n),
        np.zeros(OUTPUTS),
        np.zeros(OUTPUTS),
        np.zeros(2),
        np.zeros(_PARTS + 1),
        np.zeros(DELAY_ORDER),
    )
    sound, more = _innovations(given, steps, work, _initial_state(given), steady, e)
    return bool(sound), float(more)


def free_run(given: KernelInput, e: Array) -> bool:
    """Residuals of a simulation into ``e`` (samples, outputs); whether the motion keeps its bounds.

    The surface is taken as known between the samples.
    """
    certain = given._replace(corner_rad2=np.zeros(0))
    return innovations(certain, without_update(given.model), e)[0]


__all__ = ["free_run", "innovations"]
