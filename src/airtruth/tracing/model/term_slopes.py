"""Derivatives of the effects' terms, states and readings along those of the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.tracing.model.equations import (
    ALPHA_DOT,
    PLAY,
    PLAY_S,
    READING,
    Signals,
    air_alpha,
    effective_elevator,
    gust,
    shape,
    signal_of,
)
from airtruth.tracing.model.kernel_input import AirPoint, EffectArrays, FilterModel
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
def _add_signal(number: int, by: float, work: SlopeWork, row: Array) -> None:
    """Add a multiple of the derivatives of a signal; the surface and the dynamic pressure are known inputs."""
    if number == 0 or number == 2 or number == ALPHA_DOT:
        d = work.alpha if number == 0 else (work.qhat if number == 2 else work.alpha_dot_hat)
        _add(by, d, row)


@inner
def add_term(
    t: int,
    x: Array,
    d_x: Array,
    signals: Signals,
    effects: EffectArrays,
    feedback: float,
    by_alpha: float,
    work: SlopeWork,
) -> None:
    """Add the derivatives of a term of CL or Cm.

    Parameters
    ----------
    feedback : loss of alpha_dot_hat by a unit of CL [-]; by_alpha : its slope in alpha.
    """
    number, state, factor = effects.term_index[t, 1], effects.term_index[t, 3], effects.term_index[t, 4]
    amplitude, is_first = effects.amplitude[t], effects.term_index[t, 0] == 0
    raw = x[state] if state >= 0 else signal_of(signals, number)
    loop = 1.0
    if number == ALPHA_DOT and is_first:
        loop = 1.0 / (1.0 + amplitude * feedback)
    s = raw * loop - effects.origin[t]
    weight = signal_of(signals, factor) - effects.factor_origin[t] if factor >= 0 else 1.0
    bent = amplitude * _shape_slope(effects.term_index[t, 2], s) * weight
    row = work.increment[effects.term_index[t, 0]]
    if state >= 0:
        _add(bent, d_x[state], row)
    else:
        _add_signal(number, bent * loop, work, row)
        if loop != 1.0:
            _add(-bent * raw * loop * loop * amplitude * by_alpha, work.alpha, row)
    if factor >= 0:
        _add_signal(factor, amplitude * shape(effects.term_index[t, 2], s), work, row)


@inner
def effect_slopes(half: float, d_x: Array, model: FilterModel, slope: Array, work: SlopeWork) -> None:
    """Derivatives of the rates of the effects' states."""
    effects = model.effects
    if effects.time_s.size > 0:
        for p in range(work.alpha.size):
            work.alpha_dot_hat[p] = half * slope[0, p]
    for k in range(effects.time_s.size):
        at, signal, wn = model.states.effect[k], effects.state_index[k, 1], 1.0 / effects.time_s[k]
        row = slope[at]
        for p in range(row.size):
            row[p] = 0.0
        if effects.state_index[k, 0] == PLAY:
            _add_signal(signal, 1.0 / PLAY_S, work, row)
            _add(-1.0 / PLAY_S, d_x[at], row)
        elif effects.state_index[k, 0] == 0:
            _add_signal(signal, wn, work, row)
            _add(-wn, d_x[at], row)
        else:
            _add(1.0, d_x[at + 1], row)
            row = slope[at + 1]
            for p in range(row.size):
                row[p] = 0.0
            _add_signal(signal, wn * wn, work, row)
            _add(-wn * wn, d_x[at], row)
            _add(-2.0 * effects.damping[k] * wn, d_x[at + 1], row)


@inner
def _add_reading(
    t: int, x: Array, d_x: Array, signals: Signals, model: FilterModel, work: SlopeWork, row: Array
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
        _add_signal(driver, -value, work, row)
    by = effects.amplitude[t] * _shape_slope(effects.term_index[t, 2], s) * weight
    if state >= 0:
        _add(by, d_x[state], row)
    else:
        _add_signal(number, by, work, row)


@inner
def reading_slopes(
    x: Array, d_x: Array, at: AirPoint, model: FilterModel, out: Array, work: SlopeWork
) -> None:
    """Add the derivatives of the increments of the readings, which take q c/(2V) of the body and no alpha'."""
    half, effects = 0.5 * model.aircraft.chord_m / at.airspeed_m_s, model.effects
    if effects.amplitude.size == 0:
        return
    for p in range(out.shape[1]):
        work.qhat[p], work.alpha_dot_hat[p] = half * d_x[1, p], 0.0
    alpha = air_alpha(x, gust(x, model.gusts.rolloff), model.gusts.level_m_s, at)
    surface = effective_elevator(at.elevator_rad, model.aircraft)
    signals = Signals(alpha, surface, x[1] * half, 0.0, at.qbar_pa)
    for t in range(effects.amplitude.size):
        if effects.term_index[t, 0] >= READING:
            _add_reading(t, x, d_x, signals, model, work, out[effects.term_index[t, 0] - READING])


__all__ = ["add_term", "effect_slopes", "reading_slopes"]
