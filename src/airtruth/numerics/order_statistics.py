"""Exact quantiles of columns that are read in blocks, in a memory that does not depend on the number of rows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Keys = NDArray[np.uint64]
Blocks = Callable[[], Iterable[Array]]
"""Returns the same blocks (rows, columns) at each call."""

KEPT: Final = 16_384
"""Most values of a column that the memory holds [-] (judgement: 128 kB; a column of fewer rows needs one pass)."""
BITS: Final = 12
"""Bits of a value that a pass decides [-] (judgement: 4096 counters of 8 B for a column)."""
_WORD: Final = 64
"""Bits of a float64 [-]."""


def quantiles(blocks: Blocks, probabilities: Sequence[float]) -> Array:
    """Return quantiles of each column over its finite rows, with linear interpolation between order statistics.

    The order statistics are those of the whole column, as `numpy.quantile` takes them, and no approximation. A pass
    counts the values by the leading bits that are not yet decided, so that at most six passes follow one another.

    Parameters
    ----------
    blocks : rows of the columns, any number of blocks of any length, of the same columns.
    probabilities : of the quantiles, from 0 to 1 [-].

    Returns
    -------
    (probabilities, columns)
        NaN for a column without a finite value.
    """
    searches: list[_Column] = []
    while not searches or any(column.open for column in searches):
        for block in blocks():
            searches = searches or [_Column(tuple(probabilities)) for _ in range(block.shape[1])]
            for column, values in zip(searches, block.T, strict=True):
                column.take(values)
        if not searches:
            return np.full((len(probabilities), 0), np.nan)
        for column in searches:
            column.decide()
    return np.array([column.answer() for column in searches]).T.reshape(len(probabilities), len(searches))


def medians(blocks: Blocks) -> Array:
    """Return the median of each column over its finite rows, (columns,); see `quantiles`."""
    return np.asarray(quantiles(blocks, (0.5,))[0])


@dataclass
class _Bracket:
    """Values whose leading bits are known: keys from ``low`` to before ``low`` + 2^``width``."""

    low: int
    width: int
    below: int
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2**BITS, dtype=np.int64))
    kept: list[Keys] = field(default_factory=list)
    size: int = 0

    @property
    def step(self) -> int:
        """Bits that a bin of this bracket leaves open."""
        return max(self.width - BITS, 0)

    def take(self, keys: Keys) -> None:
        offset = keys - np.uint64(self.low)  # wraps around below the bracket, to beyond its end
        inside = offset if self.width == _WORD else offset[offset >> np.uint64(self.width) == 0]
        self.counts += np.bincount((inside >> np.uint64(self.step)).astype(np.int64), minlength=2**BITS)
        self.size += inside.size
        if self.size <= KEPT:
            self.kept.append(inside + np.uint64(self.low))
        else:
            self.kept.clear()

    def narrowed(self, rank: int) -> _Bracket:
        """The bin that holds the value of a rank."""
        ends = np.cumsum(self.counts)
        chosen = int(np.searchsorted(ends, rank - self.below, side="right"))
        before = int(ends[chosen - 1]) if chosen else 0
        return _Bracket(self.low + (chosen << self.step), self.step, self.below + before)


class _Column:
    """Search for the order statistics of one column."""

    def __init__(self, probabilities: tuple[float, ...]) -> None:
        self.probabilities = probabilities
        self.total = -1
        self.found: dict[int, float] = {}
        self.brackets: dict[int, _Bracket] = {-1: _Bracket(0, _WORD, 0)}

    @property
    def open(self) -> bool:
        """Whether a value is not yet known."""
        return bool(self.brackets)

    def take(self, values: Array) -> None:
        """Count the values of a block."""
        if not self.brackets:
            return
        keys = _keys(values[np.isfinite(values)])
        for bracket in {id(b): b for b in self.brackets.values()}.values():
            bracket.take(keys)

    def decide(self) -> None:
        """After a pass: read the values that are known, and narrow the brackets of the others."""
        if self.total < 0:
            whole = self.brackets.pop(-1)
            self.total = whole.size
            self.brackets = dict.fromkeys(self._ranks(), whole)
        following: dict[tuple[int, int], _Bracket] = {}
        left: dict[int, _Bracket] = {}
        for rank, bracket in self.brackets.items():
            if bracket.size <= KEPT:
                self.found[rank] = _value(int(np.sort(np.concatenate(bracket.kept))[rank - bracket.below]))
                continue
            narrow = bracket.narrowed(rank)
            if narrow.width == 0:
                self.found[rank] = _value(narrow.low)
            else:
                left[rank] = following.setdefault((narrow.low, narrow.width), narrow)
        self.brackets = left

    def answer(self) -> list[float]:
        """The quantiles."""
        if self.total < 1:
            return [np.nan] * len(self.probabilities)
        return [self._between(p) for p in self.probabilities]

    def _ranks(self) -> list[int]:
        if not self.total:
            return []
        at = [int(p * (self.total - 1)) for p in self.probabilities]
        return sorted({r for first in at for r in (first, min(first + 1, self.total - 1))})

    def _between(self, probability: float) -> float:
        position = probability * (self.total - 1)
        first = int(position)
        low, high = self.found[first], self.found[min(first + 1, self.total - 1)]
        share = position - first
        if share == 0.5:
            return 0.5 * low + 0.5 * high
        # from the nearer end, so that the upper one is met exactly
        return low + (high - low) * share if share < 0.5 else high - (high - low) * (1.0 - share)


def _keys(values: Array) -> Keys:
    """Whole numbers in the order of the values: the bits of a float64, inverted for a negative one."""
    bits = np.ascontiguousarray(values, dtype=np.float64).view(np.uint64)
    negative = bits >> np.uint64(_WORD - 1) != 0
    return np.where(negative, ~bits, bits | np.uint64(1 << (_WORD - 1)))


def _value(key: int) -> float:
    """The value of a key."""
    sign = 1 << (_WORD - 1)
    bits = key ^ sign if key & sign else key ^ (2**_WORD - 1)
    return float(np.array([bits], dtype=np.uint64).view(np.float64)[0])


__all__ = ["Blocks", "medians", "quantiles"]
