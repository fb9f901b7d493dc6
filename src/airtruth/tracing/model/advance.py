"""One step of the filter's model: the motion, the gusts and the effects, and the sensors behind them.

The motion is integrated by the classical Runge-Kutta method, whose weights are Simpson's: the middle
value of an input carries its area. The low-passed copies of the gust are integrated exactly for a signal that is linear over
half a step, and the lags and the delays of sensors for one that is linear over a quarter.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.numerics.discretise import step
from airtruth.tracing.model.by_motion import (
    air_at,
    equations_of,
    move_plays,
    output_count,
    outputs,
    rates,
    state_count,
)
from airtruth.tracing.model.effect_states import hold_plays
from airtruth.tracing.model.gust_states import lead_decay
from airtruth.tracing.model.kernel_input import AnyGrid, FilterModel
from airtruth.tracing.model.linearise import delay_system
from airtruth.tracing.model.parameters import DELAY_ORDER, GUST_1, LEAD, LEAD_COUNT

Array = NDArray[np.float64]

_LEAD: Final = LEAD - GUST_1
"""Position of the first low-passed copy among the states of the gusts [-]."""
PARTS: Final = 4
"""Parts of a step over which a signal is linear for the lag or the delay of its sensor [-]. With two parts, the error of a gyro
delayed by 5.6 ms is 0.9 standard deviations of its noise, as root sum of squares over a record with 46 elevator steps."""


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
    out, last : (outputs,) at the end and the start of a step; first : rates of the motion at its start.
    ends : (parts + 1,) a signal at the ends of the parts of a step; held : (order,) states of a delay.
    """

    rate: Array
    tried: Array
    out: Array
    last: Array
    first: Array
    ends: Array
    held: Array


def steps_of(model: FilterModel, dt_s: float, sub: int) -> Steps:
    h = 2.0 * dt_s / sub
    decay, mean = np.empty((2, LEAD_COUNT)), np.empty((2, LEAD_COUNT))
    for j in range(2):
        for i in range(LEAD_COUNT):
            decay[j, i], mean[j, i] = lead_decay(0.5 * (j + 1) * h, i)
    count = model.sensors.scale.size
    phi = np.zeros((count, DELAY_ORDER, DELAY_ORDER))
    early, late = np.zeros((count, DELAY_ORDER, 1)), np.zeros((count, DELAY_ORDER, 1))
    unused = np.empty((DELAY_ORDER, DELAY_ORDER))
    for i in range(count):
        if model.states.delay[i] >= 0:
            system = delay_system(model.sensors.delay_s[i])
            step(system, np.zeros(DELAY_ORDER), DELAY_ORDER, h / PARTS, phi[i], early[i], late[i], unused)
    states = model.states
    forget = math.exp(-dt_s / model.sensors.slow_time_s) if states.noise >= 0 else 0.0
    has_late_sensors = states.size > states.motion + (count if states.noise >= 0 else 0)
    return Steps(h, decay, mean, phi, early[:, :, 0].copy(), late[:, :, 0].copy(), forget, has_late_sensors)


def work_of(model: FilterModel) -> Work:
    """Arrays for a model."""
    states, count = model.states.size, model.sensors.scale.size
    return Work(
        np.zeros((4, states)),
        np.zeros(states),
        np.zeros(count),
        np.zeros(count),
        np.zeros(equations_of(model).states),
        np.zeros(PARTS + 1),
        np.zeros(DELAY_ORDER),
    )


@inner
def advance_motion(x: Array, point: int, grid: AnyGrid, model: FilterModel, steps: Steps, work: Work) -> None:
    """One Runge-Kutta step of motion, gusts and effects; the outputs at its start into ``work`` for late sensors."""
    h, rate, tried, motion = steps.h, work.rate, work.tried, model.states.motion
    count = state_count(model)
    lead = count + _LEAD
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
                before = decay * x[lead + i] + (mean - decay) * x[count]
                tried[lead + i] = before + (1.0 - mean) * tried[count]
        az = rates(tried, at, model, rate[stage])
        if stage == 0 and steps.has_late_sensors:
            outputs(tried, rate[0], az, at, model, work.last)
            for m in range(count):
                work.first[m] = rate[0, m]
    for m in range(motion):
        slope = rate[0, m] + 2.0 * rate[1, m] + 2.0 * rate[2, m] + rate[3, m]
        x[m] += h / 6.0 * slope
    hold_plays(tried, x, model)
    for i in range(LEAD_COUNT):
        x[lead + i] = tried[lead + i]
    move_plays(x, air_at(grid, point + 2), model)


@inner
def advance_sensors(
    x: Array, point: int, grid: AnyGrid, model: FilterModel, steps: Steps, work: Work
) -> None:
    """Lags and delays over the parts of the step that `advance_motion` has made.

    In between the signal has the motion's own curvature: a cubic through values and slopes.
    """
    at = air_at(grid, point + 2)
    az = rates(x, at, model, work.rate[0])
    outputs(x, work.rate[0], az, at, model, work.out)
    ends = work.ends
    for i in range(output_count(model)):
        rise = work.out[i] - work.last[i]
        early = late = 0.0  # slopes over the step beyond those of a straight line
        if i < state_count(model):
            early = model.sensors.scale[i] * steps.h * work.first[i] - rise
            late = model.sensors.scale[i] * steps.h * work.rate[0, i] - rise
        for part in range(PARTS + 1):
            s = part / PARTS
            ends[part] = work.last[i] + s * rise + s * (1.0 - s) * ((1.0 - s) * early - s * late)
        if model.states.lag[i] >= 0:
            _advance_lag(x, model.states.lag[i], steps.h / (PARTS * model.sensors.lag_s[i]), ends)
        if model.states.delay[i] >= 0:
            _advance_delay(x, model.states.delay[i], i, steps, work)


@inner
def _advance_lag(x: Array, at: int, r: float, ends: Array) -> None:
    """A lag over the parts of a step of r time constants each; its output replaces its input in ``ends``."""
    decay = math.exp(-r)
    mean = (1.0 - decay) / r
    before = ends[0]
    ends[0] = x[at]
    for part in range(1, PARTS + 1):
        x[at] = decay * x[at] + (mean - decay) * before + (1.0 - mean) * ends[part]
        before, ends[part] = ends[part], x[at]


@inner
def _advance_delay(x: Array, at: int, i: int, steps: Steps, work: Work) -> None:
    ends, held = work.ends, work.held
    for part in range(PARTS):
        for row in range(DELAY_ORDER):
            held[row] = x[at + row]
        for row in range(DELAY_ORDER):
            total = steps.early[i, row] * ends[part] + steps.late[i, row] * ends[part + 1]
            for m in range(DELAY_ORDER):
                total += steps.phi[i, row, m] * held[m]
            x[at + row] = total


__all__ = ["PARTS", "Steps", "Work", "advance_motion", "advance_sensors", "steps_of", "work_of"]
