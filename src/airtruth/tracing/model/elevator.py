"""The surface between the samples of a coarse log, where several steps of integration lie in a cell.

A declared servo of first order behind a held command moves in exponentials that meet in corners: with rho =
exp(-dt/tau) the command that a cell implies is (de[k+1] - rho de[k])/(1 - rho), and where the cells before and after
imply two commands a and b, the command has changed at the time at which both exponentials meet,

    x = exp(-s/tau) = rho (a - b)/((de[k+1] - b) - rho (de[k] - a)).

Where the implied command changes in most cells it moves with the samples or faster, and the surface, which the servo
smooths, is the cubic spline through its samples.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]

_STEP: Final = 0.05
"""Change of the implied command that counts as a step, over its range [-] (judgement: above the noise of a sensor)."""
_MOST_STEPS: Final = 0.5
"""Largest share of cells in which the implied command changes [-] (judgement): a step makes two changes, and in a held
command a cell without a step separates it from the next one."""


def held_command(elevator_rad: Array, dt_s: float, tau_s: float, cells: int) -> Array | None:
    """The surface of a servo behind a held command on a fine grid; None where its samples are not those of one.

    Parameters
    ----------
    elevator_rad : (samples,) measured surface [rad].
    dt_s, tau_s : sample period and time constant of the servo [s].
    cells : cells of the fine grid per sample.

    Returns
    -------
    ((samples - 1) cells + 1,) [rad], or None.
    """
    rho = float(np.exp(-dt_s / tau_s))
    start, end = elevator_rad[:-1], elevator_rad[1:]
    command = (end - rho * start) / (1.0 - rho)
    least = _STEP * float(np.ptp(command))
    changes = int((np.abs(np.diff(command)) > least).sum())
    if least == 0.0 or changes > _MOST_STEPS * command.size:
        return None
    padded = np.concatenate([command[:1], command, command[-1:]])
    before, after = padded[:-2], padded[2:]
    steps = np.abs(after - before) > least
    before, after = np.where(steps, before, command), np.where(steps, after, command)
    gap = (end - after) - rho * (start - before)
    share = rho * (before - after) / np.where(gap == 0.0, 1.0, gap)
    x = np.where(steps & (gap != 0.0), np.clip(share, rho, 1.0), rho)
    time = np.arange(cells) * (dt_s / cells)
    corner = before + (start - before) * x
    early = before[:, None] + (start - before)[:, None] * np.exp(-time / tau_s)
    late = after[:, None] + (corner - after)[:, None] * np.exp(-time / tau_s) / x[:, None]
    path = np.where(np.exp(-time / tau_s) >= x[:, None], early, late)
    return np.append(path.ravel(), elevator_rad[-1])


def smooth(elevator_rad: Array, cells: int) -> Array:
    """The cubic spline through the samples on a fine grid of ``cells`` cells per sample."""
    at = np.arange(elevator_rad.size)
    fine = np.arange((elevator_rad.size - 1) * cells + 1) / cells
    return np.asarray(CubicSpline(at, elevator_rad)(fine))


__all__ = ["held_command", "smooth"]
