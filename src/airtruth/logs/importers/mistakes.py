"""Known mistakes of a mapping: the ratio by which each changes a channel, and what mends it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

NEAR: Final = 0.2
"""Relative distance within which a ratio counts as that of a known mistake."""


@dataclass(frozen=True)
class Problem:
    """Something in a log that physics contradicts.

    Attributes
    ----------
    certain : whether no flight could look so; such a log is refused.
    channel : channel to look at.
    sentence : what is seen, and the entry of the mapping that mends it.
    """

    certain: bool
    channel: str
    sentence: str


@dataclass(frozen=True)
class Mistake:
    """A mistake: ratio of a channel to what it should be, what was found, the entry that mends it."""

    ratio: float
    found: str
    remedy: str


def nearest(ratio: float, mistakes: Sequence[Mistake]) -> Mistake | None:
    """The mistake whose ratio is within `NEAR` of the one seen; None if 1 is, or none."""
    if abs(ratio - 1.0) <= NEAR:
        return None
    close = [(abs(ratio / m.ratio - 1.0), m) for m in mistakes]
    distance, best = min(close, key=lambda pair: pair[0])
    return best if distance <= NEAR else None


__all__ = ["NEAR", "Mistake", "Problem", "nearest"]
