"""The surface between its samples: its most likely path, and how far others through the same samples differ from it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.band_limited import band_limited, is_band_limited
from airtruth.numerics.intersample import servo_bend, servo_decay, smooth_bend
from airtruth.tracing.model.servo_surface import (
    held_command,
    is_held,
    is_limited,
    shaped,
    smooth,
    with_steps,
)

Array = NDArray[np.float64]

LONGEST_STEP_S: Final = 0.0201
"""Longest step of integration [s], with room for rounding (judgement): the short period turns 0.1 rad in it."""
_CORNER_SHARE: Final = 0.05
"""Least corner, as a share of the surface's range [-] (judgement): a smaller one moves the aircraft by less."""
_CORNER_NOISE: Final = 20.0
"""The same in standard deviations of the surface's noise [-]: five of half a fourth difference, sqrt(70)/2 each."""


class Between(NamedTuple):
    """The surface between its samples.

    Attributes
    ----------
    surface_rad : ((samples - 1) cells + 1,) on a fine grid [rad].
    corner_rad2 : (samples,) variance of its mean over the cell that ends at each sample [rad2]; empty for none.
    """

    surface_rad: Array
    corner_rad2: Array = np.zeros(0)


def read_between(
    surface: Array,
    dt_s: float,
    cells: int,
    std_rad: float,
    servo_s: float,
    rate_rad_s: float = math.inf,
) -> Between:
    """The surface on a fine grid, and the variance of its mean over each cell.

    The exponentials of a first-order servo do not hold where its rate is limited: the mean there is uncertain.

    Parameters
    ----------
    surface : (samples,) [rad], every ``dt_s`` [s]; cells : cells of the fine grid per sample.
    std_rad : standard deviation of its noise [rad]; servo_s : declared time constant of its servo [s], 0 for none.
    rate_rad_s : declared rate limit of the servo [rad/s].
    """
    if dt_s > LONGEST_STEP_S and servo_s > 0.0:  # a coarse log
        path = held_command(surface, dt_s, servo_s, cells)
        return Between(smooth(surface, cells) if path is None else path)
    relative = (surface - surface[0])[None, :]
    bend, none = servo_bend(relative, std_rad)[0], np.zeros(0)
    if bend.any():
        tau_s = -dt_s / math.log(float(servo_decay(np.diff(relative), std_rad)[0]))
        if servo_s <= 0.0 or is_held(surface, dt_s, tau_s):
            path = held_command(surface, dt_s, tau_s, cells)
            mean = _bent(surface, bend, cells, none)
            limited = is_limited(surface, dt_s, tau_s, rate_rad_s)
            corners = np.append(0.0, np.where(limited, np.diff(surface) ** 2 / 12.0, 0.0))
            return Between(
                mean if path is None else shaped(mean, path, cells), corners if limited.any() else none
            )
    corners = corner_variance(surface, std_rad)
    if corners.size and is_band_limited(surface):
        return Between(band_limited(surface, cells))
    if servo_s <= 0.0 or not corners.size:
        return Between(_bent(surface, np.zeros_like(bend), cells, corners), corners)
    smoothed = _bent(surface, np.zeros_like(bend), cells, none)
    path, steps = with_steps(surface, smoothed, dt_s, servo_s, cells)
    return Between(path, np.append(0.0, np.where(steps, 0.0, corners[1:])))


def _bent(surface: Array, bend: Array, sub: int, corners: Array) -> Array:
    """Parabolas of the cubic's area; straight beside a corner, because the samples across it say nothing of the cell."""
    relative = surface - surface[0]
    cubic = smooth_bend(relative)[1:]
    if corners.size:
        at = np.pad(corners[1:] > 0.0, 1)
        cubic[at[:-2] | at[1:-1] | at[2:]] = 0.0
        cubic += _shared_steps(np.diff(relative), corners[1:] > 0.0)
    bend = bend.copy()
    bend[1:] += cubic
    share = np.arange(sub) / sub
    cells = surface[:-1, None] + (surface[1:] - surface[:-1])[:, None] * share
    cells += 6.0 * bend[1:, None] * share * (1.0 - share)
    return np.append(cells.ravel(), surface[-1])


def _shared_steps(change: Array, corner: NDArray[np.bool_]) -> Array:
    """(cells,) mean of a surface less that of a straight line, where a sample lies within a step that two cells share.

    Beside both cells the surface rests. It moves straight through both, or steps at the sample: then the means are off by half
    of each change. The middle of the two is taken.
    """
    alone = np.pad(~corner, 1, constant_values=True)
    shared = corner[:-1] & corner[1:] & (change[:-1] * change[1:] > 0.0) & alone[:-3] & alone[3:]
    shift = np.zeros(change.size)
    shift[:-1] -= np.where(shared, 0.25 * change[:-1], 0.0)
    shift[1:] += np.where(shared, 0.25 * change[1:], 0.0)
    return shift


def corner_variance(surface: Array, std_rad: float) -> Array:
    """Variance of a surface's mean over each cell where its samples show a corner; empty if they show none.

    A surface that moves in one direction between two samples has any mean between them, all alike: the variance is the
    square of the change over 12. Half the fourth difference bounds that change from above where the samples are smooth:
    it is as large as the change at a step, and falls with the fourth power of the sample period elsewhere.

    Parameters
    ----------
    surface : (samples,) [rad]; std_rad : standard deviation of its noise [rad].
    """
    if len(surface) < 5:
        return np.zeros(0)
    rough = np.pad(np.abs(np.diff(surface, 4)) / 2.0, 2, mode="edge")
    change = np.minimum(np.abs(np.diff(surface)), np.maximum(rough[:-1], rough[1:]))
    change = np.where(change > _least_corner(surface, std_rad), change, 0.0)
    return np.append(0.0, change**2 / 12.0) if change.any() else np.zeros(0)


def _least_corner(surface: Array, std_rad: float) -> float:
    """Least change of the surface within a cell that counts as a corner [rad]."""
    return max(_CORNER_SHARE * float(np.ptp(surface)), _CORNER_NOISE * std_rad)


__all__ = ["LONGEST_STEP_S", "Between", "corner_variance", "read_between"]
