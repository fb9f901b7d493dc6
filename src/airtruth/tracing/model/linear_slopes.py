"""Linearisation of the motion, and its derivatives in the parameters that move it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import allocating, inner
from airtruth.tracing.model.by_motion import output_count, outputs, shifted, state_count
from airtruth.tracing.model.corners import STEP_RAD
from airtruth.tracing.model.gust_states import gust_of
from airtruth.tracing.model.kernel_input import AnyPoint, FilterModel
from airtruth.tracing.model.linearise import LEAST_MOVE, half_width
from airtruth.tracing.model.parameters import CORE, GUST_1, LEAD
from airtruth.tracing.model.slopes import LOG_GUST, ROLLOFF, SlopeWork, output_slopes, rate_slopes, slope_work

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class LinearSlopes(NamedTuple):
    """Linearisation of the motion, and its slopes in the columns behind those of the states.

    Attributes
    ----------
    a, c : (motion, motion + controls), (outputs, motion + controls): slopes in the states, then in the surfaces.
    d_a, d_c : the same with a last axis of columns.
    """

    a: Array
    c: Array
    d_a: Array
    d_c: Array


class _Ends(NamedTuple):
    """Rates (2, states), outputs, and their slopes at both ends of a difference, in the states and then the movers.

    Attributes
    ----------
    unit, column : derivatives of the states, and numbers of the movers, along the last axis.
    """

    unit: Array
    column: Ints
    rate: Array
    y: Array
    slope: Array
    out: Array


@inner
def _at_end(
    side: int, x: Array, at: AnyPoint, model: FilterModel, aircraft: Any, ends: _Ends, work: SlopeWork
) -> None:
    rate, slope = ends.rate[side], ends.slope[side]
    az = rate_slopes(x, ends.unit, at, model, aircraft, ends.column, rate, slope, work)
    output_slopes(x, ends.unit, rate, slope, at, model, aircraft, ends.column, ends.out[side], work)
    outputs(x, ends.rate[side], az, at, model, ends.y[side])


@allocating
def linear_slopes(
    x: Array, at: AnyPoint, model: FilterModel, aircraft: Any, columns: int, controls: int
) -> LinearSlopes:
    """Linearisation about a state by the differences of `airtruth.tracing.model.linearise.linearise`, and its slopes.

    The half width in a gust depends on the level and the rolloff, and the difference with it where the tables bend.
    """
    motion, count, wide = model.states.motion, output_count(model), model.states.motion + columns
    ends = _Ends(
        np.zeros((x.size, wide)),
        motion + np.arange(columns),
        np.zeros((2, x.size)),
        np.zeros((2, count)),
        np.zeros((2, motion + 1, wide)),
        np.zeros((2, count, wide)),
    )
    for i in range(motion):
        ends.unit[i, i] = 1.0
    work = slope_work(wide)
    made = LinearSlopes(
        np.zeros((motion, motion + controls)),
        np.zeros((count, motion + controls)),
        np.zeros((motion, motion + controls, columns)),
        np.zeros((count, motion + controls, columns)),
    )
    for j in range(motion + controls):
        h, middle, control = STEP_RAD, 0.0, max(j - motion, 0)
        if j < motion:
            h, middle = half_width(j, at, model), x[j]
        for side in range(2):
            sign = h if side == 0 else -h
            if j < motion:
                x[j] = middle + sign
            _at_end(side, x, shifted(at, control, sign if j >= motion else 0.0), model, aircraft, ends, work)
        _difference(j, h, ends.rate, ends.slope, motion, made.a, made.d_a)
        _difference(j, h, ends.y, ends.out, motion, made.c, made.d_c)
        if j < motion:
            x[j] = middle
            _widths(j, at, model, ends, made)
    return made


@inner
def _difference(j: int, h: float, values: Array, slope: Array, motion: int, out: Array, d_out: Array) -> None:
    """A column of a matrix, and its slopes."""
    for i in range(out.shape[0]):
        out[i, j] = (values[0, i] - values[1, i]) / (2.0 * h)
        for q in range(d_out.shape[2]):
            d_out[i, j, q] = (slope[0, i, motion + q] - slope[1, i, motion + q]) / (2.0 * h)


@allocating
def _widths(j: int, at: AnyPoint, model: FilterModel, ends: _Ends, made: LinearSlopes) -> None:
    """Add the slopes by those of the half width in a gust, whose logarithm falls by one with that of the level."""
    first = state_count(model)
    core = first + CORE - GUST_1
    if j < first or j >= core:
        return
    unit = np.zeros(core)
    unit[j] = 1.0
    by_gust = gust_of(unit, first, model.gusts.rolloff)
    if not abs(model.gusts.level_m_s * by_gust) / at.airspeed_m_s > LEAST_MOVE:
        return
    by_rolloff = (gust_of(unit, first, 1.0) - gust_of(unit, first, 0.0)) / by_gust
    for i in range(made.a.shape[0]):
        if first + LEAD - GUST_1 <= i < core:
            continue  # the low-passed copies are linear
        more = 0.5 * (ends.slope[0, i, j] + ends.slope[1, i, j]) - made.a[i, j]
        made.d_a[i, j, LOG_GUST] -= more
        made.d_a[i, j, ROLLOFF] -= by_rolloff * more
    for i in range(made.c.shape[0]):
        more = 0.5 * (ends.out[0, i, j] + ends.out[1, i, j]) - made.c[i, j]
        made.d_c[i, j, LOG_GUST] -= more
        made.d_c[i, j, ROLLOFF] -= by_rolloff * more


__all__ = ["LinearSlopes", "linear_slopes"]
