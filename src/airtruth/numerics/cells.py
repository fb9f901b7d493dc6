"""Cells of the increasing axis of a table."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def lower_point(axis: Array, x: float) -> int:
    """Lower point of the cell of an increasing axis that holds x; the end cells reach beyond the ends."""
    low, high = 0, axis.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if axis[middle] <= x:
            low = middle
        else:
            high = middle
    return low


@inner
def cell(axis: Array, x: float) -> tuple[int, float]:
    """Lower point of the cell that holds x and the share of the cell below x; the end cells go on outside."""
    low = lower_point(axis, x)
    return low, (x - axis[low]) / (axis[low + 1] - axis[low])


__all__ = ["cell", "lower_point"]
