"""Random numbers: one counter-based stream for each run and purpose, all of one seed.

A stream depends on the seed, the run's number and the purpose alone, so a run draws the same numbers
whoever flies it, in whatever order, and however many runs there are.
"""

from __future__ import annotations

import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.signals import SIGNALS

GUST: Final = 0
SENSORS: Final = {name: number for number, name in enumerate(SIGNALS, start=1)}
_PURPOSES: Final = 256
_PLAN: Final = 1 << 63


def normals(seed: int, run: int, purpose: int, count: int) -> NDArray[np.float64]:
    """(count,) standard normals of one run and purpose (`GUST` or one of `SENSORS`)."""
    return _stream(seed, run * _PURPOSES + purpose).standard_normal(count)


def plan_stream(seed: int, quantity: str) -> np.random.Generator:
    """Generator of the run table's draws of one quantity; run k takes its k-th draw."""
    return _stream(seed, _PLAN | zlib.crc32(quantity.encode()))


def _stream(seed: int, number: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=np.array([seed, number], dtype=np.uint64)))
