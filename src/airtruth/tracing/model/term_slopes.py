"""Derivatives of the effects' terms, states and readings along those of the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.tracing.model.effect_states import PLAY, PLAY_S, shape, signal_of
from airtruth.tracing.model.kernel_input import EffectArrays, FilterModel
from airtruth.tracing.model.slopes import SlopeWork

Array = NDArray[np.float64]


@inner
def _shape_slope(number: int, s: float) -> float:
    """Slope of `airtruth.physics.terms.numbered_shape`."""
    if number == 1:
        return 2.0 * s
    if number == 2:
        return 1.0 if s > 0.0 else 0.0
    if number == 3:
        return 1.0 if s < 0.0 else 0.0
    return 1.0


@inner
def _add(by: float, d: Array, row: Array) -> None:
    for p in range(row.size):
        row[p] += by * d[p]


@inner
def add_term(
    t: int,
    x: Array,
    d_x: Array,
    signals: tuple[float, ...],
    effects: EffectArrays,
    turning: int,
    feedback: float,
    by_flow: float,
    d_flow: Array,
    work: SlopeWork,
) -> None:
    """Add the derivatives of a term of a coefficient.

    Parameters
    ----------
    turning : number of the signal that has the rate of the flow angle.
    feedback : loss of this signal by a unit of the first coefficient [-]; by_flow : its slope in a flow angle.
    d_flow : (parameters,) derivatives of this angle.
    """
    number, state, factor = effects.term_index[t, 1], effects.term_index[t, 3], effects.term_index[t, 4]
    amplitude, is_first = effects.amplitude[t], effects.term_index[t, 0] == 0
    raw = x[state] if state >= 0 else signal_of(signals, number)
    loop = 1.0
    if number == turning and is_first:
        loop = 1.0 / (1.0 + amplitude * feedback)
    s = raw * loop - effects.origin[t]
    weight = signal_of(signals, factor) - effects.factor_origin[t] if factor >= 0 else 1.0
    bent = amplitude * _shape_slope(effects.term_index[t, 2], s) * weight
    row = work.increment[effects.term_index[t, 0]]
    if state >= 0:
        _add(bent, d_x[state], row)
    else:
        _add(bent * loop, work.signal[number], row)
        if loop != 1.0:
            _add(-bent * raw * loop * loop * amplitude * by_flow, d_flow, row)
    if factor >= 0:
        _add(amplitude * shape(effects.term_index[t, 2], s), work.signal[factor], row)


@inner
def effect_slopes(
    half: float, turning: int, d_x: Array, model: FilterModel, slope: Array, work: SlopeWork
) -> None:
    """Derivatives of the rates of the effects' states.

    Parameters
    ----------
    half : signal of a unit of the rate of the flow angle [s]; turning : its number.
    """
    effects = model.effects
    if effects.time_s.size > 0:
        own = work.signal[turning]
        for p in range(own.size):
            own[p] = half * slope[0, p]
    for k in range(effects.time_s.size):
        at, signal, wn = model.states.effect[k], effects.state_index[k, 1], 1.0 / effects.time_s[k]
        row = slope[at]
        for p in range(row.size):
            row[p] = 0.0
        if effects.state_index[k, 0] == PLAY:
            _add(1.0 / PLAY_S, work.signal[signal], row)
            _add(-1.0 / PLAY_S, d_x[at], row)
        elif effects.state_index[k, 0] == 0:
            _add(wn, work.signal[signal], row)
            _add(-wn, d_x[at], row)
        else:
            _add(1.0, d_x[at + 1], row)
            row = slope[at + 1]
            for p in range(row.size):
                row[p] = 0.0
            _add(wn * wn, work.signal[signal], row)
            _add(-wn * wn, d_x[at], row)
            _add(-2.0 * effects.damping[k] * wn, d_x[at + 1], row)


@inner
def _add_reading(
    t: int, x: Array, d_x: Array, signals: tuple[float, ...], model: FilterModel, work: SlopeWork, row: Array
) -> None:
    """Add the derivatives of an increment of a reading."""
    effects = model.effects
    number, state, behind = effects.term_index[t, 1], effects.term_index[t, 3], effects.term_index[t, 5]
    s = (x[state] if state >= 0 else signal_of(signals, number)) - effects.origin[t]
    weight = 1.0
    if behind >= 0:
        driver, own = effects.state_index[behind, 1], model.states.effect[behind]
        weight = x[own] - signal_of(signals, driver)
        value = effects.amplitude[t] * shape(effects.term_index[t, 2], s)
        _add(value, d_x[own], row)
        _add(-value, work.signal[driver], row)
    by = effects.amplitude[t] * _shape_slope(effects.term_index[t, 2], s) * weight
    if state >= 0:
        _add(by, d_x[state], row)
    else:
        _add(by, work.signal[number], row)


@inner
def reading_slopes(
    x: Array,
    d_x: Array,
    signals: tuple[float, ...],
    first: int,
    model: FilterModel,
    out: Array,
    work: SlopeWork,
) -> None:
    """Add the derivatives of the increments of the readings, see `airtruth.tracing.model.effect_states.add_readings`."""
    effects = model.effects
    for t in range(effects.amplitude.size):
        output = effects.term_index[t, 0] - first
        if output >= 0:
            _add_reading(t, x, d_x, signals, model, work, out[output])


__all__ = ["add_term", "effect_slopes", "reading_slopes"]
