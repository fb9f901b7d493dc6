"""Channels that repeat their last sample until the next one: their own rate, and their updates alone.

A recorder that writes one table repeats the value of a slow instrument until it has a new one. The values change at the rows that
follow the instants k P of the instrument's clock, so that a row of a change and k P differ by less than a step dt of the table.
Of changes at any rows a share dt/P would do so; N changes that all do have the likelihood ratio (P/dt)^N.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.importers.mapping import Resample
from airtruth.importers.series import Series
from airtruth.physics.motion import MOTIONS

Array = NDArray[np.float64]

_LEAST: Final = 1.5
"""Least period of a held channel [steps of the table]: below it one change and two are not distinguished by their distance."""
_FEWEST: Final = 8
"""Fewest changes [-] (judgement)."""
_EVIDENCE: Final = 20.0
"""Logarithm of the likelihood ratio from which a channel counts as held [-] (judgement: once in 5e8 channels)."""
_ON_GRID: Final = 0.97
"""Least share of the changes that lie within a step of the instrument's clock [-] (judgement: lost rows)."""
_WIDTH: Final = 1.3
"""Distance within which the changes of a block lie [steps]: one, and the error of a period that is fitted to some twenty."""
_BLOCK: Final = 32
"""Changes over which the two clocks may not drift by a step [-] (judgement)."""
_CHANGED: Final = 0.3
"""Least share of the instants at which the value changes [-] (judgement: a coarse reading repeats itself)."""
_COVERED: Final = 0.8
"""Least share of the record between the first change and the last [-]: steps of an input lie closer together."""
_SMOOTH: Final = 0.5
"""Least correlation of successive samples of a surface [-] (judgement): a random sequence of steps has none, and its surface does
keep each value."""
_SET: Final = ("throttle", *(name for motion in MOTIONS.values() for name in motion.commands))
"""Channels that a computer or a pilot sets, and that do keep their value until the next one."""
_SURFACES: Final = tuple(name for motion in MOTIONS.values() for name in motion.surfaces)
"""Channels whose steps may be those of an input."""


@dataclass(frozen=True)
class Updates:
    """The samples that an instrument took: period [s], times (samples,) [s] and values (samples,)."""

    period_s: float
    t_s: Array
    values: Array


def updates(t_s: Array, values: Array) -> Updates | None:
    """Samples of a channel that repeats them; None where the repeats do not follow a clock.

    Parameters
    ----------
    t_s : (rows,) increasing times [s].
    values : (rows,)

    Examples
    --------
    >>> t = np.arange(500) * 0.02
    >>> made = updates(t, np.sin(np.floor(t * 17.0 + 1e-9) / 17.0))
    >>> round(1.0 / made.period_s, 2), len(made.t_s)
    (17.0, 170)
    """
    if len(t_s) < 2:
        return None
    step = (t_s[-1] - t_s[0]) / (len(t_s) - 1)
    rows = np.flatnonzero(values[1:] != values[:-1]) + 1
    if len(rows) < _FEWEST or len(t_s) < _LEAST * len(rows):
        return None
    changes = t_s[rows]
    apart = np.diff(changes)
    near = apart <= 1.5 * np.median(apart)
    period = float(apart[near].mean())
    for _ in range(3):  # the number of instants between changes and the period follow from each other
        instants = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(apart / period), 1.0))])
        period = float(np.polyfit(instants, changes, 1)[0])
    origins, inside = _origins(changes - period * instants, step)
    evidence = len(rows) * np.log(max(period, step) / (_WIDTH * step))
    spanned = changes[-1] - changes[0] + period
    if (
        period < _LEAST * step
        or inside < _ON_GRID
        or evidence < _EVIDENCE
        or len(rows) < _CHANGED * (instants[-1] + 1.0)
        or spanned < _COVERED * (t_s[-1] - t_s[0])
    ):
        return None
    first = -np.floor((changes[0] - t_s[0]) / period + 1e-6)
    numbers = np.arange(first, instants[-1] + np.floor((t_s[-1] - changes[-1]) / period + 1e-6) + 1.0)
    grid = period * numbers + np.interp(numbers, instants, origins)
    seen = np.clip(np.searchsorted(t_s, grid - 1e-6 * step), 0, len(t_s) - 1)
    inner = (grid >= t_s[0] - step) & (grid <= t_s[-1])
    return Updates(period, np.maximum(grid[inner], t_s[0]), values[seen[inner]])


def _origins(rest: Array, step: float) -> tuple[Array, float]:
    """Instant 0 of the instrument's clock as each block of changes has it, and the share of changes within a step of it.

    Parameters
    ----------
    rest : (changes,) times of the changes less those of their instants from 0 [s]; step : that of the table [s].
    """
    origins = np.empty_like(rest)
    inside = 0
    blocks = np.array_split(np.arange(len(rest)), max(1, len(rest) // _BLOCK))
    for block in blocks:
        ordered = np.sort(rest[block])
        within = np.searchsorted(ordered, ordered + _WIDTH * step, side="right") - np.arange(len(ordered))
        best = int(np.argmax(within))
        inside += int(within[best])
        origins[block] = ordered[best]
    return origins, inside / len(rest)


def without_repeats(
    series: Mapping[str, Series], resample: Resample | None
) -> tuple[dict[str, Series], dict[str, float]]:
    """Channels whose repeated samples are left out, and the own rate of each such channel [Hz].

    Without ``resample`` the channels keep their common times, and values between updates are interpolated linearly.

    Parameters
    ----------
    series : channels of a run, with times that increase.
    """
    made, rates = dict(series), dict[str, float]()
    for name, one in series.items():
        if one.constant or name in _SET or (np.diff(one.t_s) <= 0.0).any():
            continue
        known = np.isfinite(one.t_s) & np.isfinite(one.values)
        taken = updates(one.t_s[known], one.values[known])
        if taken is None or (name in _SURFACES and not _is_smooth(taken.values)):
            continue
        rates[name] = float(f"{1.0 / taken.period_s:.3g}")
        if resample is None:
            between = np.where(known, np.interp(one.t_s, taken.t_s, taken.values), one.values)
            made[name] = replace(one, values=between)
        else:
            made[name] = Series(taken.t_s, taken.values)
    return made, rates


def _is_smooth(values: Array) -> bool:
    deviation = values - values.mean()
    return bool(deviation[1:] @ deviation[:-1] > _SMOOTH * (deviation @ deviation))


__all__ = ["Updates", "updates", "without_repeats"]
