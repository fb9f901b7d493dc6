"""Effects that delay a signal: a delay and a lag of one signal have the same size, a time."""

from __future__ import annotations

from typing import Final

from airtruth.effects.effect import Effect

_LATE: Final = ("delay", "lag")
"""Kinds of terms that delay a signal."""


def late_signal(effect: Effect) -> str:
    """Channel whose reading an effect delays, or "surface"; empty for any other effect.

    The size of such an effect is a time [s].
    """
    change = effect.describe({p.name: p.value(p.step) for p in effect.parameters})
    if any(term.kind in _LATE for term in change.surface):
        return "surface"
    return next((term.channel for term in change.sensors if term.kind in _LATE), "")


__all__ = ["late_signal"]
