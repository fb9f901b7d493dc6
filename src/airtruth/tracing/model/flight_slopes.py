"""Derivatives of the innovations along a flight of the filter, of many parameters at once.

Every equation of the filter is differentiated at the state that the flight had: its derivatives in the parameters move through
the same updates and the same steps. Parameters are the last axis of each array, which the inner loops run along.

Source: O. Talagrand and P. Courtier, Q. J. R. Meteorol. Soc. 113 (1987) 1311-1328, section 2 (the tangent linear equations).
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.tracing.model.advance import PARTS, Steps, steps_of
from airtruth.tracing.model.by_motion import air_at, early_count, output_count, state_count
from airtruth.tracing.model.filter import Path
from airtruth.tracing.model.kernel_input import FilterModel, GridSignals, KernelInput
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.parameters import DELAY_ORDER, GUST_1, LEAD, LEAD_COUNT
from airtruth.tracing.model.slopes import SlopeWork, output_slopes, rate_slopes, slope_work

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


_BLOCK: Final = 8
"""Parameters that a processor moves at once at the most [-]."""


def width_of(parameters: int) -> int:
    """Length of the last axis of arrays of derivatives: whole blocks, with a spare row for what is no parameter."""
    return _BLOCK * (parameters // _BLOCK + 1)


class GainSlopes(NamedTuple):
    """Derivatives of what the filter used along a flight, see `Path`; one row serves every sample, or each has its own.

    Attributes
    ----------
    k_gain : (rows, states, outputs, parameters); first : (rows, states, early, parameters) and (rows, early, parameters).
    direct : (rows, states, parameters).
    scale : (rows, outputs, outputs, parameters).
    """

    k_gain: Array
    first: FirstUpdate
    direct: Array
    scale: Array


class Moved(NamedTuple):
    """What the parameters move beside the gains.

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


class _Lanes(NamedTuple):
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


def _lanes_of(model: FilterModel, parameters: int) -> _Lanes:
    n, motion, count = model.states.size, model.states.motion, model.sensors.scale.size
    return _Lanes(
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
def _read(
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
def _settle(d_x: Array, d_out: Array, model: FilterModel) -> None:
    """Derivatives of lags and delays in equilibrium with their inputs."""
    for i in range(output_count(model)):
        for p in range(d_x.shape[1]):
            if model.states.lag[i] >= 0:
                d_x[model.states.lag[i], p] = d_out[i, p]
            if model.states.delay[i] >= 0:
                d_x[model.states.delay[i], p] = d_out[i, p]


@inner
def _early(
    k: int, row: int, given: KernelInput, moved: Moved, path: Path, gains: GainSlopes, own: _Lanes
) -> None:
    """Innovations of the early outputs, and the state after the update by them."""
    model, early = given.model, early_count(given.model)
    if k == 0:
        _settle(own.d_x, own.d_out, model)
    for i in range(early):
        _read(i, k, own.x, own.d_x, moved, model, own.d_out, own.d_raw)
    for i in range(output_count(model)):
        for p in range(own.d_raw.shape[1]):
            own.d_before[i, p] = own.d_out[i, p]
    for i in range(own.x.size):
        own.tried[i] = own.x[i]
        for p in range(own.d_raw.shape[1]):
            own.d_tried[i, p] = own.d_x[i, p]
        for m in range(early):
            gain, raw = path.first.gain[k, i, m], path.raw[k, m]
            own.tried[i] += gain * raw
            for p in range(own.d_raw.shape[1]):
                own.d_tried[i, p] += gain * own.d_raw[m, p] + gains.first.gain[row, i, m, p] * raw


@inner
def _late(
    k: int,
    row: int,
    given: KernelInput,
    moved: Moved,
    path: Path,
    gains: GainSlopes,
    shown: float,
    own: _Lanes,
) -> None:
    """Innovation of the late output, see `airtruth.tracing.model.filter.innovation`."""
    model, early = given.model, early_count(given.model)
    _read(early, k, own.tried, own.d_tried, moved, model, own.d_out, own.d_raw)
    for m in range(early):
        share, raw = path.first.share[k, m], path.raw[k, m]
        for p in range(own.d_raw.shape[1]):
            own.d_raw[early, p] += share * own.d_raw[m, p] + gains.first.share[row, m, p] * raw
    if model.states.lag[early] >= 0 or model.states.delay[early] >= 0:
        weight = (1.0 if model.states.lag[early] < 0 else 0.0) - shown
        for p in range(own.d_raw.shape[1]):
            own.d_raw[early, p] += weight * (own.d_out[early, p] - own.d_before[early, p])
        for i in range(own.x.size):
            by, step = weight * path.direct[k, i], weight * (own.tried[i] - own.x[i])
            for p in range(own.d_raw.shape[1]):
                own.d_raw[early, p] -= (
                    by * (own.d_tried[i, p] - own.d_x[i, p]) + step * gains.direct[row, i, p]
                )


@inner
def _update(
    k: int,
    row: int,
    given: KernelInput,
    moved: Moved,
    steps: Steps,
    path: Path,
    gains: GainSlopes,
    own: _Lanes,
) -> None:
    """The update, and the decay of the correlated noise."""
    noise = given.model.states.noise
    for i in range(own.x.size):
        own.x[i] = path.corrected[k, i]
        for m in range(own.d_raw.shape[0]):
            gain, raw = path.k_gain[k, i, m], path.raw[k, m]
            for p in range(own.d_raw.shape[1]):
                own.d_x[i, p] += gain * own.d_raw[m, p] + gains.k_gain[row, i, m, p] * raw
        if 0 <= noise <= i:
            for p in range(own.d_raw.shape[1]):
                own.d_x[i, p] = steps.forget * own.d_x[i, p] + moved.forget[p] * own.x[i]


@inner
def _scaled(k: int, row: int, path: Path, gains: GainSlopes, own: _Lanes, out: Array) -> None:
    """Derivatives of the innovation of a sample, scaled to the common covariance."""
    count = own.d_raw.shape[0]
    for i in range(count):
        for p in range(out.shape[2]):
            out[k, i, p] = 0.0
        for m in range(count):
            scale, raw = path.scale[k, i, m], path.raw[k, m]
            for p in range(out.shape[2]):
                out[k, i, p] += scale * own.d_raw[m, p] + gains.scale[row, i, m, p] * raw


@inner
def _stage(stage: int, model: FilterModel, steps: Steps, own: _Lanes) -> None:
    """State and derivatives at a stage of a step, see `airtruth.tracing.model.advance.advance_motion`."""
    share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
    count, h = state_count(model), share * steps.h
    lead = count + LEAD - GUST_1
    for m in range(model.states.motion):
        own.tried[m] = own.x[m] + (h * own.rate[stage - 1, m] if stage > 0 else 0.0)
        for p in range(own.d_x.shape[1]):
            own.d_tried[m, p] = own.d_x[m, p] + (h * own.d_rate[stage - 1, m, p] if stage > 0 else 0.0)
    if stage > 0:
        j = 1 if stage == 3 else 0
        for i in range(LEAD_COUNT):
            decay, mean = steps.decay[j, i], steps.mean[j, i]
            at, by = lead + i, mean - decay
            own.tried[at] = decay * own.x[at] + by * own.x[count] + (1.0 - mean) * own.tried[count]
            for p in range(own.d_x.shape[1]):
                own.d_tried[at, p] = (
                    decay * own.d_x[at, p] + by * own.d_x[count, p] + (1.0 - mean) * own.d_tried[count, p]
                )


@inner
def _end(model: FilterModel, steps: Steps, own: _Lanes) -> None:
    """State and derivatives at the end of a step, also as those of a last stage."""
    lead, sixth = state_count(model) + LEAD - GUST_1, steps.h / 6.0
    for m in range(model.states.motion):
        if lead <= m < lead + LEAD_COUNT:
            own.x[m] = own.tried[m]
            for p in range(own.d_x.shape[1]):
                own.d_x[m, p] = own.d_tried[m, p]
            continue
        own.x[m] += sixth * (own.rate[0, m] + 2.0 * own.rate[1, m] + 2.0 * own.rate[2, m] + own.rate[3, m])
        own.tried[m] = own.x[m]
        for p in range(own.d_x.shape[1]):
            middle = own.d_rate[1, m, p] + own.d_rate[2, m, p]
            own.d_x[m, p] += sixth * (own.d_rate[0, m, p] + 2.0 * middle + own.d_rate[3, m, p])
            own.d_tried[m, p] = own.d_x[m, p]


@inner
def _advance_sensors(model: FilterModel, steps: Steps, own: _Lanes) -> None:
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
def _advance_delay(delay: int, i: int, steps: Steps, own: _Lanes) -> None:
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


@inner
def _advance(
    point: int, grid: GridSignals, model: FilterModel, moved: Moved, steps: Steps, own: _Lanes
) -> None:
    """One step of the motion, and of the sensors behind it."""
    for stage in range(5 if steps.has_late_sensors else 4):
        if stage < 4:
            _stage(stage, model, steps, own)
        else:
            _end(model, steps, own)
        at = air_at(grid, point + (0 if stage == 0 else (2 if stage >= 3 else 1)))
        d_rate, column = own.d_rate[stage], moved.column
        rate_slopes(
            own.tried, own.d_tried, at, model, moved.aircraft, column, own.rate[stage], d_rate, own.work
        )
        if steps.has_late_sensors and (stage == 0 or stage == 4):
            d_out = own.d_last if stage == 0 else own.d_out
            output_slopes(
                own.tried,
                own.d_tried,
                own.rate[stage],
                d_rate,
                at,
                model,
                moved.aircraft,
                column,
                d_out,
                own.work,
            )
    if steps.has_late_sensors:
        _advance_sensors(model, steps, own)
    else:
        _end(model, steps, own)


@njit(cache=True, nogil=True, error_model="numpy")
def _along(
    given: KernelInput,
    moved: Moved,
    steps: Steps,
    path: Path,
    gains: GainSlopes,
    shown: float,
    own: _Lanes,
    out: Array,
) -> None:
    """`innovation_slopes` from the derivatives of the initial state."""
    model, samples, n = given.model, given.y.shape[0], given.model.states.size
    for k in range(samples):
        row = k if gains.direct.shape[0] > 1 else 0
        at = air_at(given.grid, k * given.sub)
        for i in range(n):
            own.x[i] = own.tried[i] = path.predicted[k, i]
            for p in range(out.shape[2]):
                own.d_tried[i, p] = own.d_x[i, p]
        for turn in range(2):
            rate, d_rate, column = own.rate[0], own.d_rate[0], moved.column
            rate_slopes(own.tried, own.d_tried, at, model, moved.aircraft, column, rate, d_rate, own.work)
            output_slopes(
                own.tried, own.d_tried, rate, d_rate, at, model, moved.aircraft, column, own.d_out, own.work
            )
            if turn == 0:
                _early(k, row, given, moved, path, gains, own)
            else:
                _late(k, row, given, moved, path, gains, shown, own)
        _scaled(k, row, path, gains, own, out)
        if k + 1 == samples:
            break
        _update(k, row, given, moved, steps, path, gains, own)
        for pair in range(given.sub // 2):
            _advance(k * given.sub + 2 * pair, given.grid, model, moved, steps, own)


def innovation_slopes(given: KernelInput, moved: Moved, path: Path, gains: GainSlopes, shown: float) -> Array:
    """(samples, outputs, parameters) derivatives of the innovations, scaled to the common covariance.

    Parameters
    ----------
    path : of the flight with the same inputs; gains : derivatives of its gains.
    shown : see `airtruth.tracing.model.steady.SteadyFilter`.
    """
    samples, count = given.y.shape
    parameters = moved.forget.size
    own = _lanes_of(given.model, parameters)
    own.d_x[:] = moved.start
    out = np.empty((samples, count, parameters))
    _along(given, moved, steps_of(given.model, given.dt_s, given.sub), path, gains, shown, own, out)
    return out


__all__ = ["GainSlopes", "Moved", "innovation_slopes", "width_of"]
