"""Random numbers: one counter-based stream for each run and purpose, all of one seed.

A stream depends on the seed, the run's number and the purpose alone. A run therefore draws the same numbers in any
process, in any order and in a campaign of any size.
"""

from __future__ import annotations

import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS

GUST: Final = 0
"""Purpose of the gusts."""
SENSORS: Final = {name: number for number, name in enumerate(SIGNALS, start=1)}
"""Purpose of the noise of each channel."""
SIDE_GUST: Final = 255
"""Purpose of the side gusts: the last, so that channels can be added."""
_PURPOSES: Final = 256
"""Keys reserved for one run; more than there are purposes, so that channels can be added."""
_PLAN: Final = 1 << 63
"""Bit of the key that separates the draws of the run table from those of the runs."""


def normals(seed: int, run: int, purpose: int, count: int) -> NDArray[np.float64]:
    """(count,) standard normals of one run and purpose (`GUST`, `SIDE_GUST` or one of `SENSORS`)."""
    return _stream(seed, run * _PURPOSES + purpose).standard_normal(count)


def plan_stream(seed: int, quantity: str) -> np.random.Generator:
    """Return the generator of one quantity of the run table; run k takes its k-th draw."""
    return _stream(seed, _PLAN | zlib.crc32(quantity.encode()))


def _stream(seed: int, number: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=np.array([seed, number], dtype=np.uint64)))
