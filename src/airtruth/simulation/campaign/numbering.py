"""Which chunk a run belongs to."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

_LARGEST_CHUNK: Final = 100
"""Largest number of runs in a chunk (judgement: the work that an interruption loses against the number of files)."""
_CHUNKS_OF_A_SIZE: Final = 16
"""Number of chunks of one size, the next have twice as many runs (judgement: several processes finish a small
campaign at about the same time, and a large one has few files)."""


def chunk_numbers(runs: int) -> NDArray[np.int64]:
    """(runs,) number of the chunk of each run, which depends on the run's number alone: a campaign can grow."""
    sizes = []
    left, size = runs, 1
    while left > 0:
        count = -(-left // size) if size == _LARGEST_CHUNK else _CHUNKS_OF_A_SIZE
        sizes += [size] * count
        left -= size * count
        size = min(2 * size, _LARGEST_CHUNK)
    return np.repeat(np.arange(len(sizes), dtype=np.int64), sizes)[:runs]


def chunk_offsets(table: pd.DataFrame, chunks: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) first row of each chunk in a run table, whose chunks are in order; the number of rows for one beyond the last."""
    return np.searchsorted(table["chunk"].to_numpy(), chunks).astype(np.int64)


__all__ = ["chunk_numbers", "chunk_offsets"]
