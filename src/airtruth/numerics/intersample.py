"""Motion of an elevator between samples that a smooth interpolation misses.

A servo of first order behind a held command moves in exponentials that meet in corners. Smooth
interpolation misses the area under a corner, to which the moment derivatives are as sensitive as to the
elevator itself (0.5 % at 50 Hz). Only where the samples show such a servo its motion is reconstructed: with
rho = exp(-dt/tau), the command that a cell implies is (de[k+1] - rho de[k])/(1 - rho), and it is constant
except for a few steps.
"""

from __future__ import annotations

import math
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
_SURE: Final = 3.0
"""Least increment that follows another one by a servo, in standard deviations of an increment's noise [-] (convention)."""
_SLOWEST: Final = 0.98
"""Largest rho of a servo [-]; judgement: above it the motion over a cell is within sensor noise."""
_FASTEST: Final = 0.02
"""Least rho of a servo [-]; judgement: below it the servo settles within a cell."""


def servo_decay(increments: Array, noise_std_rad: float) -> Array:
    """Decay rho of a servo over a sample period, by neighbouring increments of the surface.

    It is the weighted median of their ratio.

    A step within a cell gives ratios above that of the servo, so that the least ones agree. A surface that stops within a
    cell gives ratios about zero: the increment of the median has to exceed the noise.

    Parameters
    ----------
    increments : (runs, samples - 1) [rad]; noise_std_rad : standard deviation of the surface's noise [rad].

    Returns
    -------
    (runs,) [-]; NaN if nothing moves or the ratios show no servo.
    """
    if increments.shape[1] < 2:
        return np.full(increments.shape[0], np.nan)
    weights = np.abs(increments[:, :-1])
    used = weights > _MOVING * np.abs(increments).max(axis=1, keepdims=True)
    weights = np.where(used, weights, 0.0)
    ratios = np.divide(increments[:, 1:], increments[:, :-1], out=np.full_like(weights, np.nan), where=used)
    order = np.argsort(ratios, axis=1, kind="stable")
    ranked = np.take_along_axis(ratios, order, axis=1)
    total = np.cumsum(np.take_along_axis(weights, order, axis=1), axis=1)
    whole = np.cumsum(weights, axis=1)[:, -1:]
    at_quarter, at_median = (np.argmax(total >= share * whole, axis=1)[:, None] for share in (0.25, 0.5))
    quarter, median = (np.take_along_axis(ranked, at, axis=1)[:, 0] for at in (at_quarter, at_median))
    first = np.take_along_axis(np.take_along_axis(weights, order, axis=1), at_median, axis=1)[:, 0]
    is_sure = median * first >= _SURE * math.sqrt(2.0) * noise_std_rad
    return np.where((quarter > _AGREEING * median) & is_sure, median, np.nan)


@njit(cache=True, error_model="numpy")
def _bends(elevator: Array, decay: Array, command: Array, bend: Array) -> None:
    cells = command.size
    for run in range(elevator.shape[0]):
        de, out, rho = elevator[run], bend[run], decay[run]
        if not _FASTEST < rho < _SLOWEST:
            continue
        low, high = math.inf, -math.inf
        for k in range(cells):
            command[k] = de[k] + (de[k + 1] - de[k]) / (1.0 - rho)
            low = command[k] if command[k] < low else low
            high = command[k] if command[k] > high else high
        threshold = _STEP * (high - low)
        steps = 0
        for k in range(1, cells):
            if abs(command[k] - command[k - 1]) > threshold:
                steps += 1
        if threshold == 0.0 or steps * _DENSE > cells:
            continue
        tau = -1.0 / math.log(rho)  # in samples
        # mean of one exponential over the cell, less the mean of its ends, per unit of increment
        curve = 1.0 / (1.0 - rho) - tau - 0.5
        for k in range(cells):
            start, end = de[k], de[k + 1]
            mean = 0.5 * (start + end) + curve * (end - start)
            first = command[k - 1 if k > 0 else 0]
            second = command[k + 1 if k + 1 < cells else k]
            if abs(second - first) > threshold:
                # the command steps inside the cell, at the time where both exponentials meet: x = exp(-s/tau)
                x = rho * (first - second) / ((end - second) - rho * (start - first))
                x = rho if x < rho else (1.0 if x > 1.0 else x)
                time = -tau * math.log(x)
                corner = first + (start - first) * x
                mean = first * time + (start - first) * tau * (1.0 - x)
                mean += second * (1.0 - time) + (corner - second) * tau * (1.0 - rho / x)
            before, after = de[k - 1 if k > 0 else 0], de[k + 2 if k + 2 < cells else cells]
            out[k + 1] = mean - (13.0 * (start + end) - before - after) / 24.0


def servo_bend(elevator: Array, noise_std_rad: float = 0.0) -> Array:
    """Mean over the cell that ends at each sample: reconstructed servo motion minus the smooth hold.

    The smooth hold has the area of the cubic through the four nearest samples,
    (-de[k-1] + 13 de[k] + 13 de[k+1] - de[k+2])/24 dt.

    Parameters
    ----------
    elevator : (runs, samples) measured surface [rad].
    noise_std_rad : standard deviation of its noise, where it is known [rad].

    Returns
    -------
    (runs, samples) [rad]; zero throughout where the record shows no servo with a held command.
    """
    elevator = np.ascontiguousarray(elevator)  # one layout, so that the kernel compiles once
    bend = np.zeros_like(elevator)
    _bends(
        elevator, servo_decay(np.diff(elevator, axis=1), noise_std_rad), np.empty(elevator.shape[1] - 1), bend
    )
    return bend
