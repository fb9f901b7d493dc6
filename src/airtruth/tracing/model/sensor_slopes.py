"""Derivatives along a flight of the filter: their arrays, and what the sensors read with lags, delays and noise.

Parameters are the last axis of each array, which the inner loops run along.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.tracing.model.advance import PARTS, Steps
from airtruth.tracing.model.by_motion import output_count, state_count
from airtruth.tracing.model.kernel_input import FilterModel
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.parameters import DELAY_ORDER
from airtruth.tracing.model.slopes import SlopeWork, slope_work

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_BLOCK: Final = 8
"""Parameters that a processor moves at once at the most [-]."""


def width_of(parameters: int) -> int:
    """Length of the last axis of arrays of derivatives: whole blocks, with a spare row for what is no parameter."""
    return _BLOCK * (parameters // _BLOCK + 1)


class GainSlopes(NamedTuple):
    """Derivatives of what the filter used along a flight, see `Path`; samples with the same derivatives share a row.

    Attributes
    ----------
    k_gain : (rows, states, outputs, parameters); first : (rows, states, early, parameters) and (rows, early, parameters).
    direct : (rows, states, parameters).
    scale : (rows, outputs, outputs, parameters).
    row_of : (samples,) row of each sample.
    """

    k_gain: Array
    first: FirstUpdate
    direct: Array
    scale: Array
    row_of: Ints


class Moved(NamedTuple):
    """Derivatives in the parameters of everything but the gains.

    Attributes
    ----------
    aircraft : of the aircraft, of the motion's own type.
    column : (movers,) see `airtruth.tracing.model.slopes.rate_slopes`; bias : (outputs,) likewise of the biases.
    slow_std : (outputs, parameters) derivatives of the correlated noise; forget : (parameters,) of its decay over a sample.
    start : (states, parameters) of the initial state.
    """

    aircraft: Any
    column: Ints
    bias: Ints
    slow_std: Array
    forget: Array
    start: Array


class Lanes(NamedTuple):
    """Arrays that one record reuses; those of derivatives have the parameters as their last axis.

    Attributes
    ----------
    x, d_x : (states,) state, and derivatives.
    tried, d_tried : at a stage or after the update by the early outputs.
    rate, d_rate : (5, states + 1,) of the stages and of the end of a step.
    work : see `SlopeWork`.
    d_out, d_last : (outputs,) before lags and delays, now and at the start of a step; d_before : before the early update.
    d_raw : (outputs,) of the innovation before its scale.
    d_ends : (parts + 1,) a signal at the ends of the parts of a step; d_held : (order,) of a delay.
    """

    x: Array
    d_x: Array
    tried: Array
    d_tried: Array
    rate: Array
    d_rate: Array
    work: SlopeWork
    d_out: Array
    d_last: Array
    d_before: Array
    d_raw: Array
    d_ends: Array
    d_held: Array


def lanes_of(model: FilterModel, parameters: int) -> Lanes:
    n, motion, count = model.states.size, model.states.motion, model.sensors.scale.size
    return Lanes(
        x=np.zeros(n),
        d_x=np.zeros((n, parameters)),
        tried=np.zeros(n),
        d_tried=np.zeros((n, parameters)),
        rate=np.zeros((5, n)),
        d_rate=np.zeros((5, motion + 1, parameters)),
        work=slope_work(parameters),
        d_out=np.zeros((count, parameters)),
        d_last=np.zeros((count, parameters)),
        d_before=np.zeros((count, parameters)),
        d_raw=np.zeros((count, parameters)),
        d_ends=np.zeros((PARTS + 1, parameters)),
        d_held=np.zeros((DELAY_ORDER, parameters)),
    )


@inner
def read_slopes(
    i: int, k: int, x: Array, d_x: Array, moved: Moved, model: FilterModel, d_out: Array, d_raw: Array
) -> None:
    """Derivatives of measured less predicted value of an output into ``d_raw``, of those before lag and delay."""
    lag, delay, noise = model.states.lag[i], model.states.delay[i], model.states.noise
    for p in range(d_raw.shape[1]):
        d_raw[i, p] = -d_x[lag, p] if lag >= 0 else -d_out[i, p]
    if delay >= 0:
        for row in range(1, DELAY_ORDER, 2):
            for p in range(d_raw.shape[1]):
                d_raw[i, p] += 2.0 * d_x[delay + row, p]
    if noise >= 0:
        for p in range(d_raw.shape[1]):
            d_raw[i, p] -= model.sensors.slow_std[i] * d_x[noise + i, p] + moved.slow_std[i, p] * x[noise + i]
    d_raw[i, moved.bias[i]] -= 1.0


@inner
def settle_slopes(d_x: Array, d_out: Array, model: FilterModel) -> None:
    """Derivatives of lags and delays in equilibrium with their inputs."""
    for i in range(output_count(model)):
        for p in range(d_x.shape[1]):
            if model.states.lag[i] >= 0:
                d_x[model.states.lag[i], p] = d_out[i, p]
            if model.states.delay[i] >= 0:
                d_x[model.states.delay[i], p] = d_out[i, p]


@inner
def advance_sensor_slopes(model: FilterModel, steps: Steps, own: Lanes) -> None:
    """Derivatives of lags and delays over a step, see `airtruth.tracing.model.advance.advance_sensors`."""
    ends, size = own.d_ends, own.d_x.shape[1]
    for i in range(output_count(model)):
        lag, delay = model.states.lag[i], model.states.delay[i]
        if lag < 0 and delay < 0:
            continue
        by = model.sensors.scale[i] * steps.h
        for part in range(PARTS + 1):
            s = part / PARTS
            for p in range(size):
                rise = own.d_out[i, p] - own.d_last[i, p]
                ends[part, p] = own.d_last[i, p] + s * rise
                if i < state_count(model):
                    early, late = by * own.d_rate[0, i, p] - rise, by * own.d_rate[4, i, p] - rise
                    ends[part, p] += s * (1.0 - s) * ((1.0 - s) * early - s * late)
        if lag >= 0:
            r = steps.h / (PARTS * model.sensors.lag_s[i])
            decay = math.exp(-r)
            mean = (1.0 - decay) / r
            for p in range(size):
                before, ends[0, p] = ends[0, p], own.d_x[lag, p]
                for part in range(1, PARTS + 1):
                    now = ends[part, p]
                    own.d_x[lag, p] = decay * own.d_x[lag, p] + (mean - decay) * before + (1.0 - mean) * now
                    before, ends[part, p] = now, own.d_x[lag, p]
        if delay >= 0:
            _advance_delay(delay, i, steps, own)


@inner
def _advance_delay(delay: int, i: int, steps: Steps, own: Lanes) -> None:
    for part in range(PARTS):
        for row in range(DELAY_ORDER):
            for p in range(own.d_x.shape[1]):
                own.d_held[row, p] = own.d_x[delay + row, p]
        for row in range(DELAY_ORDER):
            early, late = steps.early[i, row], steps.late[i, row]
            for p in range(own.d_x.shape[1]):
                own.d_x[delay + row, p] = early * own.d_ends[part, p] + late * own.d_ends[part + 1, p]
            for m in range(DELAY_ORDER):
                by = steps.phi[i, row, m]
                for p in range(own.d_x.shape[1]):
                    own.d_x[delay + row, p] += by * own.d_held[m, p]


__all__ = [
    "GainSlopes",
    "Lanes",
    "Moved",
    "advance_sensor_slopes",
    "lanes_of",
    "read_slopes",
    "settle_slopes",
    "width_of",
]
