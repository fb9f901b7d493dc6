"""Motion of a control surface between samples that a smooth interpolation misses.

A servo of first order behind a held command moves in exponentials that meet in corners. Smooth
interpolation misses the area under a corner, to which the moment derivatives are as sensitive as to the
surface itself (0.5 % at 50 Hz). Only where the samples show such a servo its motion is reconstructed: with
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
_QUANTILES: Final = (0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5)
"""Weighted quantiles of the ratios that are tried [-]; judgement."""
_QUARTER, _MEDIAN = _QUANTILES.index(0.25), _QUANTILES.index(0.5)
_NONE, _DECLARED = len(_QUANTILES), len(_QUANTILES) + 1
"""Numbers of the surface without a servo and of the declared servo among what is tried."""
_SETTLES: Final = 0.4
"""Decay below which a declared servo is preferred [-]; judgement: it settles within three samples."""
_FEWER: Final = 0.85
"""Share of the moving cells below which a lower quantile replaces the median [-]; judgement."""
_LIKE_STEPS: Final = 1.4
"""Moving cells with a declared decay, over those of the surface itself, up to which it is taken [-]; judgement: they are twice
as many where the surface steps at the samples."""
_LIKE_OTHERS: Final = 2.2
"""The same over those with another decay [-]; judgement: a step within a cell moves the command in two cells, and another
decay can explain one of them."""
_NOISE: Final = 6.0
"""Move of the command that counts by half, in medians of the surface's increments [-]; judgement, four standard deviations of
its noise where the surface rests in most cells."""
_STILL: Final = 0.005
"""The same over the largest increment [-]; judgement, for a surface without noise."""
_EXPLAINS: Final = 0.7
"""Moving cells with the decay of a servo over those of the surface itself below which it shows one [-]; judgement: held commands
give 0.03 to 0.61, and smooth inputs of a pilot 0.75 or more. For a fast servo the limit is 1 - rho."""
_AGREEING: Final = 0.5
"""Least lower quartile of the ratios over their median that shows a servo [-]; judgement."""
_SURE: Final = 3.0
"""Least increment that follows another one by a servo, in standard deviations of an increment's noise [-] (convention)."""
_SLOWEST: Final = 0.98
"""Largest rho of a servo [-]; judgement: above it the motion over a cell is within sensor noise."""
_FASTEST: Final = 0.02
"""Least rho of a servo [-]; judgement: below it the servo settles within a cell."""


def decay_of(time_s: float, dt_s: float) -> float:
    """Decay over a sample period of a time constant [s]; 0 for none."""
    return math.exp(-dt_s / time_s) if time_s > 0.0 else 0.0


def servo_decay(increments: Array, noise_std_rad: float, declared: float = 0.0) -> Array:
    """Decay rho of a servo over a sample period, by neighbouring increments of the surface.

    It is the weighted median of their ratio, or a lower quantile with which the command moves in far fewer cells. The command has
    to move in far fewer cells than the surface, because increments of a pilot's smooth inputs have such ratios too.

    A step within a cell gives ratios above that of the servo. The median is among them where the servo settles within two or
    three samples. A declared decay of such a servo is taken, unless the command moves in far fewer cells with another one. A
    surface that stops within a cell gives ratios about zero: the increment of the median has to exceed the noise.

    Parameters
    ----------
    increments : (runs, samples - 1) [rad]; noise_std_rad : standard deviation of the surface's noise [rad].
    declared : decay of the declared servo [-]; 0 for none.

    Returns
    -------
    (runs,) [-]; NaN if nothing moves or the ratios show no servo.
    """
    runs = increments.shape[0]
    if increments.shape[1] < 2:
        return np.full(runs, np.nan)
    decays, sizes = np.full((runs, len(_QUANTILES)), np.nan), np.zeros((runs, len(_QUANTILES)))
    _decays(np.ascontiguousarray(increments), np.array(_QUANTILES), decays, sizes)
    tried = np.concatenate([np.nan_to_num(decays), np.zeros((runs, 1)), np.full((runs, 1), declared)], axis=1)
    moving = np.empty_like(tried)
    _moving_cells(np.ascontiguousarray(increments), tried, _least_move(increments), moving)
    best = np.argmin(moving[:, : len(_QUANTILES)], axis=1)
    row = np.arange(runs)
    is_fewer = moving[row, best] < _FEWER * np.minimum(moving[:, _MEDIAN], moving[:, _NONE])
    best = np.where(is_fewer, best, _MEDIAN)
    own = decays[row, best]
    is_sure = own * sizes[row, best] >= _SURE * math.sqrt(2.0) * noise_std_rad
    agree = is_fewer | (decays[:, _QUARTER] > _AGREEING * decays[:, _MEDIAN])
    explains = moving[row, best] < np.fmax(_EXPLAINS, 1.0 - own) * moving[:, _NONE]
    own = np.where(agree & is_sure & explains, own, np.nan)
    if not 0.0 < declared < _SETTLES:
        return own
    others = np.minimum(
        _LIKE_STEPS * moving[:, _NONE], _LIKE_OTHERS * moving[:, : len(_QUANTILES)].min(axis=1)
    )
    is_declared = moving[:, _DECLARED] <= others
    return np.where(is_declared & (sizes[:, 0] > 0.0), declared, own)


@njit(cache=True, error_model="numpy")
def _decays(increments: Array, quantiles: Array, decays: Array, sizes: Array) -> None:
    """Weighted quantiles (runs, quantiles) of the ratios of neighbouring increments, and the increments that they follow."""
    cells = increments.shape[1] - 1
    ratio, weight = np.empty(cells), np.empty(cells)
    for run in range(increments.shape[0]):
        move = increments[run]
        largest = 0.0
        for k in range(cells + 1):
            largest = max(largest, abs(move[k]))
        count, whole = 0, 0.0
        for k in range(cells):
            if abs(move[k]) > _MOVING * largest:
                ratio[count], weight[count] = move[k + 1] / move[k], abs(move[k])
                count += 1
        order = np.argsort(ratio[:count], kind="mergesort")
        for k in range(count):
            whole += weight[order[k]]
        total, number = 0.0, 0
        for k in range(count):
            total += weight[order[k]]
            while number < quantiles.size and total >= quantiles[number] * whole:
                decays[run, number], sizes[run, number] = ratio[order[k]], weight[order[k]]
                number += 1


def _least_move(increments: Array) -> Array:
    """(runs,) move of the command that counts by half [rad]."""
    size = np.abs(increments)
    return np.asarray(np.maximum(_NOISE * np.median(size, axis=1), _STILL * size.max(axis=1)))


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _moving_cells(increments: Array, decays: Array, least: Array, moving: Array) -> None:
    """Cells in which the command moves behind a servo of each decay, into (runs, decays); a small move counts in part."""
    for run in range(decays.shape[0]):
        move, limit = increments[run], least[run] ** 4
        for number in range(decays.shape[1]):
            rho, total = decays[run, number], 0.0
            if limit > 0.0:
                for k in range(1, move.size):
                    size = move[k] - rho * move[k - 1]
                    size *= size  # twice: the noise of the many cells at rest adds little
                    size *= size
                    total += size / (size + limit)
            moving[run, number] = total


@njit(cache=True, error_model="numpy")
def _bends(surface: Array, decay: Array, command: Array, bend: Array) -> None:
    cells = command.size
    for run in range(surface.shape[0]):
        de, out, rho = surface[run], bend[run], decay[run]
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


def smooth_bend(x: Array, axis: int = -1) -> Array:
    """Mean of the cubic through the four nearest samples over the cell that ends at each sample, less that of its ends."""
    u = np.moveaxis(x, axis, -1)
    edge = np.concatenate([u[..., :1], u, u[..., -1:]], axis=-1)
    bend = np.zeros_like(u)
    bend[..., 1:] = (edge[..., 1:-2] + edge[..., 2:-1] - edge[..., :-3] - edge[..., 3:]) / 24.0
    return np.moveaxis(bend, -1, axis)


def servo_bend(surface: Array, noise_std_rad: float = 0.0, declared_decay: float = 0.0) -> Array:
    """Mean over the cell that ends at each sample: reconstructed servo motion minus the smooth hold.

    The smooth hold has the area of the cubic through the four nearest samples,
    (-de[k-1] + 13 de[k] + 13 de[k+1] - de[k+2])/24 dt.

    Parameters
    ----------
    surface : (runs, samples) measured surface [rad].
    noise_std_rad : standard deviation of its noise, where it is known [rad].
    declared_decay : decay of the declared servo over a sample period [-]; 0 for none.

    Returns
    -------
    (runs, samples) [rad]; zero throughout where the record shows no servo with a held command.
    """
    surface = np.ascontiguousarray(surface)  # one layout, so that the kernel compiles once
    bend = np.zeros_like(surface)
    decay = servo_decay(np.diff(surface, axis=1), noise_std_rad, declared_decay)
    _bends(surface, decay, np.empty(surface.shape[1] - 1), bend)
    return bend
