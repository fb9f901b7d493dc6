"""Motion of an elevator between samples that a smooth interpolation misses.

A servo of first order behind a held command moves in exponentials that meet in corners. Smooth
interpolation misses the area under a corner, to which the moment derivatives are as sensitive as to the
elevator itself (0.5 % at 50 Hz). Only where the samples show such a servo its motion is reconstructed: with
rho = exp(-dt/tau), the command that a cell implies is (de[k+1] - rho de[k])/(1 - rho), and it is constant
except for a few steps.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEP: Final = 0.05
"""Change of the implied command that counts as a step, over its range [-]; judgement, above sensor noise."""
_DENSE: Final = 8
"""Cells per step below which the command is not held [-]; judgement."""
_MOVING: Final = 0.1
"""Least increment over the largest one that determines rho [-]; judgement."""
_AGREEING: Final = 0.5
"""Least lower quartile of the ratios over their median that shows a servo [-]; judgement."""
_SLOWEST: Final = 0.98
"""Largest rho of a servo [-]; judgement: above it the motion over a cell is within sensor noise."""
_FASTEST: Final = 0.02
"""Least rho of a servo [-]; judgement: below it the servo settles within a cell."""


@njit(cache=True)
def _decay(increments: Array) -> float:
    """Weighted median of the ratio of neighbouring increments, NaN if nothing moves or the ratios do not show a servo.

    A step within a cell gives ratios above that of the servo, so that the least ones agree. A surface that stops within a
    cell gives ratios about zero.
    """
    count = increments.size - 1
    largest = np.abs(increments).max()
    ratios = np.empty(count)
    weights = np.empty(count)
    used = 0
    for k in range(count):
        weight = abs(increments[k])
        if weight > _MOVING * largest:
            ratios[used] = increments[k + 1] / increments[k]
            weights[used] = weight
            used += 1
    order = np.argsort(ratios[:used])
    whole = weights[:used].sum()
    quarter = np.nan
    total = 0.0
    for i in order:
        total += weights[i]
        if np.isnan(quarter) and total >= 0.25 * whole:
            quarter = ratios[i]
        if total >= 0.5 * whole:
            return float(ratios[i]) if quarter > _AGREEING * ratios[i] else np.nan
    return np.nan


@njit(cache=True)
def _bend(elevator: Array, bend: Array) -> None:
    samples = elevator.size
    bend[:] = 0.0
    increments = elevator[1:] - elevator[:-1]
    rho = _decay(increments)
    if not _FASTEST < rho < _SLOWEST:
        return
    command = elevator[:-1] + increments / (1.0 - rho)
    threshold = _STEP * (command.max() - command.min())
    steps = 0
    for k in range(1, command.size):
        if abs(command[k] - command[k - 1]) > threshold:
            steps += 1
    if threshold == 0.0 or steps * _DENSE > command.size:
        return
    tau = -1.0 / np.log(rho)  # in samples
    # mean of one exponential over the cell, less the mean of its ends, per unit of increment
    curve = 1.0 / (1.0 - rho) - tau - 0.5
    for k in range(command.size):
        start, end = elevator[k], elevator[k + 1]
        mean = 0.5 * (start + end) + curve * (end - start)
        first = command[max(k - 1, 0)]
        second = command[min(k + 1, command.size - 1)]
        if abs(second - first) > threshold:
            # the command steps inside the cell, at the time where both exponentials meet: x = exp(-s/tau)
            x = rho * (first - second) / ((end - second) - rho * (start - first))
            x = min(max(x, rho), 1.0)
            time = -tau * np.log(x)
            corner = first + (start - first) * x
            mean = first * time + (start - first) * tau * (1.0 - x)
            mean += second * (1.0 - time) + (corner - second) * tau * (1.0 - rho / x)
        before, after = elevator[max(k - 1, 0)], elevator[min(k + 2, samples - 1)]
        bend[k + 1] = mean - (13.0 * (start + end) - before - after) / 24.0


@njit(cache=True)
def _bends(elevator: Array, bend: Array) -> None:
    for run in range(elevator.shape[0]):
        _bend(elevator[run], bend[run])


def servo_bend(elevator: Array) -> Array:
    """Mean over the cell that ends at each sample: reconstructed servo motion minus the smooth hold.

    The smooth hold has the area of the cubic through the four nearest samples,
    (-de[k-1] + 13 de[k] + 13 de[k+1] - de[k+2])/24 dt.

    Parameters
    ----------
    elevator : (runs, samples) measured surface [rad].

    Returns
    -------
    (runs, samples) [rad]; zero throughout where the record shows no servo with a held command.
    """
    elevator = np.ascontiguousarray(elevator)  # one layout, so that the kernel compiles once
    bend = np.empty_like(elevator)
    _bends(elevator, bend)
    return bend
