"""Does the elevator of a record move, or does its column hold only the noise of its sensor?"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.whiteness import is_white
from airtruth.units import DEG

Array = NDArray[np.float64]

LEAST_ELEVATOR_RAD: Final = 0.1 * DEG
"""Least movement of the elevator that excites a record [rad] (judgement: above the noise of a surface sensor)."""
SMOOTH_S: Final = 0.2
"""Width of the mean that smooths an elevator [s] (judgement: shorter than the steps of a manoeuvre)."""


def moves(elevator: Array, dt_s: float) -> NDArray[np.bool_]:
    """(runs,) whether the elevator moves.

    It does not where its smoothed range is below `LEAST_ELEVATOR_RAD` and its samples are white noise about a line. A small
    motion that is no noise counts: the column may have a wrong unit.

    Parameters
    ----------
    elevator : (runs, samples) [rad].
    dt_s : sample period [s].
    """
    width = min(max(round(SMOOTH_S / dt_s), 1), elevator.shape[1])
    sums = np.cumsum(np.pad(elevator - elevator[:, :1], ((0, 0), (1, 0))), axis=1)
    smooth = (sums[:, width:] - sums[:, :-width]) / width
    return np.asarray((np.ptp(smooth, axis=1) >= LEAST_ELEVATOR_RAD) | ~is_white(_without_line(elevator)))


def _without_line(x: Array) -> Array:
    """Rows (runs, samples) less their least-squares lines."""
    line = np.linspace(-1.0, 1.0, x.shape[1])
    x = x - x[:, :1]  # so that a constant is exactly zero
    rest = x - x.mean(axis=1, keepdims=True)
    return np.asarray(rest - np.outer(rest @ line / (line @ line), line))


__all__ = ["LEAST_ELEVATOR_RAD", "moves"]
