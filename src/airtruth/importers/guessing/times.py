"""The times of a mapping: the column of the file, clocks of single channels, a common rate, and the column that names runs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.foreign.source import Source
from airtruth.importers.clock import Clocked, increasing
from airtruth.importers.guessing.assignment import Decision
from airtruth.importers.guessing.candidates import times_of
from airtruth.importers.guessing.columns import Column, GroupClock
from airtruth.importers.uniform import GAP, even_times
from airtruth.logs.validate import JITTER, single_precision_s

Array = NDArray[np.float64]

_LOWEST_HZ: Final = 0.1
"""Least rate that a guess takes from a clock [Hz] (judgement: slower logs do not show a short period)."""
_HIGHEST_HZ: Final = 1e5
"""Highest rate that a guess takes from a clock [Hz] (judgement: above that of any recorder)."""
_USUAL_HZ: Final = 50.0
"""Rate of a guess without a plausible clock [Hz] (judgement)."""


@dataclass(frozen=True)
class Times:
    """Where the times of a mapping come from.

    Attributes
    ----------
    clocks : group of columns -> its clock.
    decisions : slot -> its reading.
    own : whether the file gives each column times of its own.
    run : column that names the run of each row; "" if there is none.
    """

    clocks: Mapping[str, GroupClock]
    decisions: Mapping[str, Decision]
    own: bool
    run: str = ""

    @property
    def base(self) -> GroupClock | None:
        """Clock of the file, or of the group of most channels."""
        if "" in self.clocks or not self.clocks:
            return self.clocks.get("")
        columns = [c for d in self.decisions.values() for c in d.reading.columns]
        groups = [c.group for c in columns if c.group in self.clocks]
        group = max(groups, key=groups.count) if groups else next(iter(self.clocks))
        return self.clocks[group]

    @property
    def missing(self) -> bool:
        """Whether the file holds no times."""
        return self.base is None and not self.own

    def table(self, used: Sequence[Column]) -> Iterator[str]:
        """[time], and [resample] where the columns that are used do not share even times."""
        base = self.base
        yield "\n[time]"
        if base is not None:
            yield f'{entry(base.column)}\nunit = "{base.unit}" # {base.reason}'
        elif self.own:
            yield "# each topic has its own times"
        else:
            yield "# no time was found: state column and unit, or the sample rate"
            yield '# column = "..."\n# rate_hz = ...'
        if self.run:
            yield f"run = {json.dumps(self.run)} # one value until the time starts again or pauses"
        times = {id(t): t for c in used if (t := times_of(c, self.clocks)) is not None}
        if len(times) > 1 or any(not _regular(part) for t in times.values() for part in _parts(t)):
            yield f'\n[resample] # linear, cubic or previous\nrate_hz = {self._rate_hz(used):.6g}\nmethod = "linear"'

    def clock(self, column: Column) -> Iterator[str]:
        """Clock of a channel whose column is in another group than most."""
        base, own = self.base, self.clocks.get(column.group)
        if column.t_s is not None or own is None or own is base:
            return
        matrix = f", variable = {json.dumps(own.column.variable)}" if own.column.variable else ""
        yield f'clock = {{ column = {json.dumps(own.column.key)}{matrix}, unit = "{own.unit}" }}'

    def _rate_hz(self, used: Sequence[Column]) -> float:
        """Rate of q, or of the first channel whose rate is plausible [Hz]."""
        first = [self.decisions["q"].reading.column] if "q" in self.decisions else []
        for column in (*first, *used):
            t = times_of(column, self.clocks)
            steps = np.diff(t) if t is not None else np.empty(0)
            steps = steps[steps > 0.0]
            step = float(np.median(steps)) if len(steps) else 0.0
            if 1.0 / _HIGHEST_HZ <= step <= 1.0 / _LOWEST_HZ:
                return float(f"{1.0 / step:.3g}")
        return _USUAL_HZ


def run_column(source: Source, clocks: Mapping[str, GroupClock]) -> str:
    """Column that keeps one value, which no other rows have, until the time starts again or pauses; "" if none does."""
    base = clocks.get("")
    if base is None or not source.ordered:
        return ""
    clocked = increasing(base.t_s)
    starts = set(np.flatnonzero(clocked.keep)[_breaks(clocked)].tolist())
    if not starts:
        return ""
    for name in source.names:
        values = source.arrays[name]
        if name == base.column.key or len(values) != len(base.t_s):
            continue
        edges = (
            [row for row in range(1, len(values)) if not _equal(values[row], values[row - 1])]
            if _is_coarse(values)
            else []
        )
        named = [values[row] for row in (0, *edges)]
        if starts <= set(edges) and len(set(map(str, named))) == len(named):
            return name
    return ""


def _is_coarse(values: NDArray[Any]) -> bool:
    """Whether the values are names or whole numbers."""
    if values.dtype.kind not in "biuf":
        return True
    finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    return bool((finite == np.round(finite)).all())


def _equal(one: Any, other: Any) -> bool:
    return bool(one == other) or (one != one and other != other)


def entry(*columns: Column, weights: Sequence[float] = ()) -> str:
    """Column of a channel in a mapping, or several, whose mean is taken without weights."""
    first = columns[0]
    text = f"column = {json.dumps(first.key)}"
    if len(columns) > 1:
        text = f"columns = [{', '.join(json.dumps(c.key) for c in columns)}]"
        text += f"\nweights = {json.dumps(list(weights))}" if weights else " # their mean"
    return text + (f"\nvariable = {json.dumps(first.variable)}" if first.variable else "")


def column_list(columns: Sequence[Column], shown: int) -> Iterator[str]:
    """Columns with their first and last value, the smallest and the largest."""
    for c in columns[:shown]:
        finite = c.values[np.isfinite(c.values)]
        if len(finite):
            where = f"{c.variable} column {c.key}" if c.variable else repr(c.key)
            label = f" ({c.name})" if isinstance(c.key, int) and c.name and not c.name.isdigit() else ""
            yield f"#   {where}{label}: {finite[0]:.6g}, {finite[-1]:.6g}; {finite.min():.6g}, {finite.max():.6g}"


def _breaks(clocked: Clocked) -> list[int]:
    """Indices of times at which a clock starts again, or goes on after a pause."""
    steps = np.diff(clocked.t_s)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    long = steps > max(GAP[0] * usual, GAP[1])
    pauses = np.flatnonzero(long) + 1 if usual else np.empty(0, dtype=np.int64)
    return sorted({*clocked.starts, *pauses.tolist()})


def _parts(t: Array) -> list[Array]:
    """Times of each part of a clock that starts again or pauses; repeated times stay."""
    finite = t[np.isfinite(t)]
    clocked = increasing(finite)
    breaks = np.flatnonzero(clocked.keep)[_breaks(clocked)]
    return [part for part in np.split(finite, breaks) if len(part)]


def _regular(t: Array) -> bool:
    steps = np.diff(t)
    if len(steps) < 2 or not (steps > 0.0).all():
        return bool(len(steps) < 2 or not np.any(steps == 0.0))
    even = even_times(t, single_precision_s(t))
    return bool(np.ptp(np.diff(even)) <= JITTER * float(np.median(steps)))


__all__ = ["Times", "column_list", "entry", "run_column"]
