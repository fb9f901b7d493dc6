"""Does the elevator of a record move, or does its column hold only the noise of its sensor?"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.units import DEG

Array = NDArray[np.float64]

LEAST_ELEVATOR_RAD: Final = 0.1 * DEG
"""Least movement of the elevator that excites a record [rad] (judgement: above the noise of a surface sensor)."""
SMOOTH_S: Final = 0.2
"""Width of the mean that smooths an elevator [s] (judgement: shorter than the steps of a manoeuvre)."""
WHITE_STD: Final = 3.0
"""Standard deviations of von Neumann's ratio below 1 up to which samples are white noise [-] (convention)."""


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
    return np.asarray((np.ptp(smooth, axis=1) >= LEAST_ELEVATOR_RAD) | ~_white(elevator))


def _white(x: Array) -> NDArray[np.bool_]:
    """(runs,) whether samples are a line and white noise, by the mean square of their differences.

    Source: J. von Neumann, Ann. Math. Statist. 12 (1941) 367-395: of white noise its ratio to twice the variance has a mean of
    about 1 and a standard deviation of about 1/sqrt(samples).
    """
    samples = x.shape[1]
    line = np.linspace(-1.0, 1.0, samples)
    x = x - x[:, :1]  # so that a constant is exactly zero
    rest = x - x.mean(axis=1, keepdims=True)
    rest = rest - np.outer(rest @ line / (line @ line), line)
    differences = 0.5 * (np.diff(rest, axis=1) ** 2).mean(axis=1)
    return np.asarray(differences >= (1.0 - WHITE_STD / np.sqrt(samples)) * rest.var(axis=1))


__all__ = ["LEAST_ELEVATOR_RAD", "moves"]
