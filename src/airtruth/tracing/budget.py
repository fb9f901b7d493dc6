"""A limit of the time that a search takes, and what the limit left out."""

from __future__ import annotations

import time
from collections.abc import Callable

Advance = Callable[[str], None]
"""Receives a phrase that names the step that begins."""


class Budget:
    """Announce the steps of a search, and refuse those that need not begin once its time is over.

    Parameters
    ----------
    seconds : time of the search [s], counted from here.
    advance : receives the steps.
    clock : time [s]; monotonic.
    """

    def __init__(self, seconds: float, advance: Advance, clock: Callable[[], float] = time.monotonic) -> None:
        self._advance = advance
        self._clock = clock
        self._end = clock() + seconds
        self._left_out: list[str] = []

    def __call__(self, step: str) -> None:
        """Announce a step that takes place whatever the time."""
        self._advance(step)

    def allows(self, step: str) -> bool:
        """Whether a step may begin; it is announced, or noted as left out."""
        if self._clock() < self._end:
            self._advance(step)
            return True
        if step not in self._left_out:
            self._left_out.append(step)
        return False

    @property
    def left_out(self) -> tuple[str, ...]:
        """Steps that did not begin, in their order."""
        return tuple(self._left_out)


def may_begin(advance: Advance, step: str) -> bool:
    """Announce a step; False where a `Budget` leaves it out."""
    if isinstance(advance, Budget):
        return advance.allows(step)
    advance(step)
    return True


__all__ = ["Advance", "Budget", "may_begin"]
