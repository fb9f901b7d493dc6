"""The surface between the samples, where its path counts: in a coarse log, and before a rate limit or a play.

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

Array = NDArray[np.float64]

_STEP: Final = 0.05
"""Change of the implied command that counts as a step, over its range [-] (judgement: above the noise of a sensor)."""
_MOST_STEPS: Final = 0.5
"""Largest share of cells in which the implied command changes [-] (judgement): a step makes two changes, and in a held
command a cell without a step separates it from the next one."""
_BEYOND: Final = 5.5
"""Change of the implied command over its median from which it is a step [-] (judgement: far in the tail of what a damper
commands from gusts and noise)."""


def held_command(surface_rad: Array, dt_s: float, tau_s: float, cells: int) -> Array | None:
    """The surface of a servo behind a held command on a fine grid; None where its samples are not those of one.

    Parameters
    ----------
    surface_rad : (samples,) measured surface [rad].
    dt_s, tau_s : sample period and time constant of the servo [s].
    cells : cells of the fine grid per sample.

    Returns
    -------
    ((samples - 1) cells + 1,) [rad], or None.
    """
    command = implied_command(surface_rad, dt_s, tau_s)
    least = _STEP * float(np.ptp(command))
    changes = int((np.abs(np.diff(command)) > least).sum())
    if least == 0.0 or changes > _MOST_STEPS * command.size:
        return None
    path = _exponentials(surface_rad, command, np.abs(_across(command)) > least, dt_s, tau_s, cells)
    return np.append(path.ravel(), surface_rad[-1])


def is_held(surface_rad: Array, dt_s: float, tau_s: float) -> bool:
    """Whether the command of a servo rests between its steps, see `with_steps`.

    Parameters
    ----------
    surface_rad : (samples,) measured surface [rad].
    dt_s, tau_s : sample period and time constant of the servo [s].
    """
    command = implied_command(surface_rad, dt_s, tau_s)
    return _BEYOND * float(np.median(np.abs(_across(command)))) < _STEP * float(np.ptp(command))


def is_limited(surface_rad: Array, dt_s: float, tau_s: float, rate_rad_s: float) -> NDArray[np.bool_]:
    """(samples - 1,) whether the servo may reach its rate limit in a cell: in or beside one where the command steps that far.

    Parameters
    ----------
    surface_rad : (samples,) measured surface [rad].
    dt_s, tau_s : sample period and time constant of the servo [s]; rate_rad_s : rate limit [rad/s].
    """
    steps = np.abs(_across(implied_command(surface_rad, dt_s, tau_s))) > rate_rad_s * tau_s
    padded = np.pad(steps, 1, mode="edge")
    return np.asarray(padded[:-2] | steps | padded[2:])


def with_steps(
    surface_rad: Array, smoothed_rad: Array, dt_s: float, tau_s: float, cells: int
) -> tuple[Array, NDArray[np.bool_]]:
    """A smoothed surface with the steps of its command, which otherwise moves all the time, as a servo follows them.

    A step is a change of the implied command far beyond the usual one: a pilot's input on top of a damper's.

    Parameters
    ----------
    surface_rad : (samples,) measured surface [rad].
    smoothed_rad : ((samples - 1) cells + 1,) the surface between them without steps [rad].
    dt_s, tau_s : sample period and time constant of the servo [s].
    cells : cells of the fine grid per sample.

    Returns
    -------
    ((samples - 1) cells + 1,) surface [rad]; (samples - 1,) whether a cell is that of a step, or beside one.
    """
    command = implied_command(surface_rad, dt_s, tau_s)
    changes = np.abs(_across(command))
    near = changes > max(_STEP * float(np.ptp(command)), _BEYOND * float(np.median(changes)))
    before, after = _neighbours(changes)
    steps = near & (changes >= before) & (changes > after)
    path = _exponentials(surface_rad, command, steps, dt_s, tau_s, cells)
    made = np.where(near[:, None], path, smoothed_rad[:-1].reshape(-1, cells))
    return np.append(made.ravel(), surface_rad[-1]), near


def step_share(dt_s: float, tau_s: float, phase: float) -> float:
    """How far a servo moves in a sample period after a unit step of its command at a phase [-]."""
    return -float(np.expm1(-(1.0 - phase) * dt_s / tau_s))


def servo_path(
    surface_rad: Array, command_rad: Array, dt_s: float, tau_s: float, cells: int, phase: float
) -> Array:
    """((samples - 1) cells + 1,) path of a servo whose command steps once a sample, through its samples [rad].

    Parameters
    ----------
    surface_rad : (samples,) surface [rad].
    command_rad : (samples,) command before the step in each cell, and after the last [rad].
    dt_s, tau_s : sample period and time constant of the servo [s].
    cells : cells of the fine grid per sample.
    phase : time of the steps after a sample, in sample periods (0 to 1).
    """
    time, at = np.arange(cells) * (dt_s / cells), phase * dt_s
    before, after = command_rad[:-1, None], command_rad[1:, None]
    start = surface_rad[:-1, None] - before
    corner = before + start * np.exp(-at / tau_s) - after
    path = np.where(
        time < at, before + start * np.exp(-time / tau_s), after + corner * np.exp((at - time) / tau_s)
    )
    return np.append(path.ravel(), surface_rad[-1])


def implied_command(surface_rad: Array, dt_s: float, tau_s: float) -> Array:
    """(samples - 1,) command that each cell implies if it is held [rad]."""
    rho = float(np.exp(-dt_s / tau_s))
    return np.asarray((surface_rad[1:] - rho * surface_rad[:-1]) / (1.0 - rho))


def _neighbours(values: Array) -> tuple[Array, Array]:
    """Values of the cell before each cell, and of the cell after it."""
    padded = np.concatenate([values[:1], values, values[-1:]])
    return padded[:-2], padded[2:]


def _across(command: Array) -> Array:
    """Change of the implied command from the cell before each cell to that after it."""
    before, after = _neighbours(command)
    return np.asarray(after - before)


def _exponentials(
    surface_rad: Array, command: Array, steps: NDArray[np.bool_], dt_s: float, tau_s: float, cells: int
) -> Array:
    """(samples - 1, cells) path of the servo; the command steps inside the cells of ``steps`` and is held in the others."""
    rho = float(np.exp(-dt_s / tau_s))
    start, end = surface_rad[:-1], surface_rad[1:]
    before, after = (np.where(steps, beside, command) for beside in _neighbours(command))
    gap = (end - after) - rho * (start - before)
    share = rho * (before - after) / np.where(gap == 0.0, 1.0, gap)
    x = np.where(steps & (gap != 0.0), np.clip(share, rho, 1.0), rho)
    time = np.arange(cells) * (dt_s / cells)
    corner = before + (start - before) * x
    early = before[:, None] + (start - before)[:, None] * np.exp(-time / tau_s)
    late = after[:, None] + (corner - after)[:, None] * np.exp(-time / tau_s) / x[:, None]
    return np.asarray(np.where(np.exp(-time / tau_s) >= x[:, None], early, late))


def shaped(mean_rad: Array, path_rad: Array, cells: int) -> Array:
    """A path with the mean of another one between every two samples.

    Parameters
    ----------
    mean_rad, path_rad : (samples - 1) cells + 1 points each, equal at the samples [rad]; cells : per sample.
    """
    away = mean_rad - path_rad
    share = np.arange(cells) / cells
    parabola = share * (1.0 - share)
    means = away[:-1].reshape(-1, cells).mean(axis=1)
    return np.append(
        (path_rad[:-1].reshape(-1, cells) + np.outer(means, parabola / parabola.mean())).ravel(), path_rad[-1]
    )


def smooth(surface_rad: Array, cells: int) -> Array:
    """The cubic spline through the samples on a fine grid of ``cells`` cells per sample."""
    from scipy.interpolate import CubicSpline  # slow to import, and few surfaces are those of servos

    at = np.arange(surface_rad.size)
    fine = np.arange((surface_rad.size - 1) * cells + 1) / cells
    return np.asarray(CubicSpline(at, surface_rad)(fine))


__all__ = [
    "held_command",
    "implied_command",
    "is_held",
    "is_limited",
    "servo_path",
    "shaped",
    "smooth",
    "step_share",
    "with_steps",
]
