"""Derivatives of the innovations along a flight of the filter, of many parameters at once.

Every equation of the filter is differentiated at the state that the flight had: its derivatives in the parameters move through
the same updates and the same steps. Parameters are the last axis of each array, which the inner loops run along.

Source: O. Talagrand and P. Courtier, Q. J. R. Meteorol. Soc. 113 (1987) 1311-1328, section 2 (the tangent linear equations).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import inner
from airtruth.tracing.model.advance import Steps, steps_of
from airtruth.tracing.model.by_motion import air_at, early_count, output_count, state_count
from airtruth.tracing.model.filter import Path
from airtruth.tracing.model.kernel_input import AnyGrid, FilterModel, KernelInput
from airtruth.tracing.model.parameters import GUST_1, LEAD, LEAD_COUNT
from airtruth.tracing.model.sensor_slopes import (
    GainSlopes,
    Lanes,
    Moved,
    advance_sensor_slopes,
    lanes_of,
    read_slopes,
    settle_slopes,
)
from airtruth.tracing.model.slopes import output_slopes, rate_slopes

Array = NDArray[np.float64]


@inner
def _early(
    k: int, row: int, given: KernelInput, moved: Moved, path: Path, gains: GainSlopes, own: Lanes
) -> None:
    """Innovations of the early outputs, and the state after the update by them."""
    model, early = given.model, early_count(given.model)
    if k == 0:
        settle_slopes(own.d_x, own.d_out, model)
    for i in range(early):
        read_slopes(i, k, own.x, own.d_x, moved, model, own.d_out, own.d_raw)
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
    own: Lanes,
) -> None:
    """Innovation of the late output, see `airtruth.tracing.model.filter.innovation`."""
    model, early = given.model, early_count(given.model)
    read_slopes(early, k, own.tried, own.d_tried, moved, model, own.d_out, own.d_raw)
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
    own: Lanes,
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
def _scaled(k: int, row: int, path: Path, gains: GainSlopes, own: Lanes, out: Array) -> None:
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
def _stage(stage: int, model: FilterModel, steps: Steps, own: Lanes) -> None:
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
def _end(model: FilterModel, steps: Steps, own: Lanes) -> None:
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
def _advance(point: int, grid: AnyGrid, model: FilterModel, moved: Moved, steps: Steps, own: Lanes) -> None:
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
        advance_sensor_slopes(model, steps, own)
    else:
        _end(model, steps, own)


@awaited
@njit(cache=True, nogil=True, error_model="numpy")
def _along(
    given: KernelInput,
    moved: Moved,
    steps: Steps,
    path: Path,
    gains: GainSlopes,
    shown: float,
    own: Lanes,
    out: Array,
) -> None:
    """`innovation_slopes` from the derivatives of the initial state."""
    model, samples, n = given.model, given.y.shape[0], given.model.states.size
    for k in range(samples):
        row = gains.row_of[k]
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
    own = lanes_of(given.model, parameters)
    own.d_x[:] = moved.start
    out = np.empty((samples, count, parameters))
    _along(given, moved, steps_of(given.model, given.dt_s, given.sub), path, gains, shown, own, out)
    return out


__all__ = ["innovation_slopes"]
