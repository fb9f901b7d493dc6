"""States and terms of effects, in the equations of every motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.physics.terms import numbered_shape
from airtruth.tracing.model.kernel_input import EffectArrays, FilterModel

Array = NDArray[np.float64]

PLAY: Final = 2
"""Number of the play in `airtruth.physics.terms.STATE_KINDS`."""
PLAY_S: Final = 0.05
"""Time constant of the lag that takes the place of a play in the linearisation [s] (judgement: a play follows a motion that is
large against its width at once)."""

shape = cast("Callable[[int, float], float]", inner(numbered_shape))


@inner
def signal_of(signals: tuple[float, ...], number: int) -> float:
    """A signal of any motion by its number."""
    return signals[number]


@inner
def effect_rates(x: Array, signals: tuple[float, ...], model: FilterModel, out: Array) -> None:
    """x' of the effects' states."""
    effects = model.effects
    for k in range(effects.time_s.size):
        at = model.states.effect[k]
        s = signal_of(signals, effects.state_index[k, 1])
        if effects.state_index[k, 0] == PLAY:
            out[at] = (s - x[at]) / PLAY_S
        elif effects.state_index[k, 0] == 0:
            out[at] = (s - x[at]) / effects.time_s[k]
        else:
            wn = 1.0 / effects.time_s[k]
            out[at] = x[at + 1]
            out[at + 1] = wn * wn * (s - x[at]) - 2.0 * effects.damping[k] * wn * x[at + 1]


@inner
def hold_plays(x: Array, tried: Array, model: FilterModel) -> None:
    """Put the states of plays in ``tried`` back to those of ``x``: they do not move within a step."""
    effects = model.effects
    for k in range(effects.time_s.size):
        if effects.state_index[k, 0] == PLAY:
            tried[model.states.effect[k]] = x[model.states.effect[k]]


@inner
def has_plays(effects: EffectArrays) -> bool:
    """Whether an effect has a play."""
    found = False
    for k in range(effects.time_s.size):
        found = found or effects.state_index[k, 0] == PLAY
    return found


@inner
def follow(x: Array, signals: tuple[float, ...], model: FilterModel) -> None:
    """Move the states of plays to no more than their half width from their signals."""
    effects = model.effects
    for k in range(effects.time_s.size):
        if effects.state_index[k, 0] == PLAY:
            s = signal_of(signals, effects.state_index[k, 1])
            i, half = model.states.effect[k], effects.half_width[k]
            x[i] = min(max(x[i], s - half), s + half)


@inner
def add_readings(x: Array, signals: tuple[float, ...], first: int, model: FilterModel, y: Array) -> None:
    """Add the increments of the readings; ``first``: first number of a reading among what a term acts on."""
    effects = model.effects
    for t in range(effects.amplitude.size):
        output = effects.term_index[t, 0] - first
        if output >= 0:
            state = effects.term_index[t, 3]
            s = x[state] if state >= 0 else signal_of(signals, effects.term_index[t, 1])
            more = effects.amplitude[t] * shape(effects.term_index[t, 2], s - effects.origin[t])
            behind = effects.term_index[t, 5]
            if behind >= 0:
                driver = signal_of(signals, effects.state_index[behind, 1])
                more *= x[model.states.effect[behind]] - driver
            y[output] += more


__all__ = [
    "PLAY",
    "PLAY_S",
    "add_readings",
    "effect_rates",
    "follow",
    "has_plays",
    "hold_plays",
    "shape",
    "signal_of",
]
