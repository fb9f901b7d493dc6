"""Cells of the increasing axis of a table."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

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


__all__ = ["lower_point"]
