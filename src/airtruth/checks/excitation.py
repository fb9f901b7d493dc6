"""Does a control surface of a record move, or does its column hold only the noise of its sensor? Does the aircraft turn?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK
from airtruth.checks.together import Runs
from airtruth.numerics.whiteness import is_white
from airtruth.physics.motion import LATERAL
from airtruth.units import DEG

Array = NDArray[np.float64]

LEAST_ELEVATOR_RAD: Final = 0.1 * DEG
"""Least movement of the elevator that excites a record [rad] (judgement: above the noise of a surface sensor)."""
SMOOTH_S: Final = 0.2
"""Width of the mean that smooths an elevator [s] (judgement: shorter than the steps of a manoeuvre)."""


LEAST_TURN_RAD: Final = 1.0 * DEG
"""Least change of bank or heading that shows roll or yaw [rad] (judgement: twice the drift of a gyroscope in ten seconds)."""


def turns(channels: Mapping[str, Array], dt_s: float) -> NDArray[np.bool_]:
    """(runs,) whether the aircraft rolls or yaws by more than `LEAST_TURN_RAD`, by its rates or its bank, lines removed.

    Parameters
    ----------
    channels : p_rad_s, r_rad_s and where recorded phi_rad, (runs, samples).
    dt_s : sample period [s].
    """
    signals = [np.cumsum(channels[n], axis=1) * dt_s for n in LATERAL.gyros if n in channels]
    signals += [np.unwrap(channels[n], axis=1) for n in (BANK,) if n in channels]
    if not signals:
        return np.zeros(0, dtype=np.bool_)
    return np.asarray(np.any([swing(x) > LEAST_TURN_RAD for x in signals], axis=0))


def turned(runs: Runs) -> bool:
    """Whether any of several runs rolls or yaws."""
    if not set(LATERAL.gyros) & set(runs.channels):
        return False
    return bool(runs.each(lambda c, dt_s: turns(c, dt_s).astype(np.float64)).any())


def swing(x: Array) -> Array:
    """(runs,) range of (runs, samples), lines removed."""
    return np.asarray(np.ptp(_without_line(x), axis=1))


def moves(surface: Array, dt_s: float) -> NDArray[np.bool_]:
    """(runs,) whether a control surface moves.

    It does not where its smoothed range is below `LEAST_ELEVATOR_RAD` and its samples are white noise about a line. A small
    motion that is no noise counts: the column may have a wrong unit.

    Parameters
    ----------
    surface : (runs, samples) [rad].
    dt_s : sample period [s].
    """
    width = min(max(round(SMOOTH_S / dt_s), 1), surface.shape[1])
    sums = np.cumsum(np.pad(surface - surface[:, :1], ((0, 0), (1, 0))), axis=1)
    smooth = (sums[:, width:] - sums[:, :-width]) / width
    return np.asarray((np.ptp(smooth, axis=1) >= LEAST_ELEVATOR_RAD) | ~is_white(_without_line(surface)))


def _without_line(x: Array) -> Array:
    """Rows (runs, samples) less their least-squares lines."""
    line = np.linspace(-1.0, 1.0, x.shape[1])
    x = x - x[:, :1]  # so that a constant is exactly zero
    rest = x - x.mean(axis=1, keepdims=True)
    return np.asarray(rest - np.outer(rest @ line / (line @ line), line))


__all__ = ["LEAST_ELEVATOR_RAD", "LEAST_TURN_RAD", "moves", "swing", "turned", "turns"]
