"""The table of the closed loop over a campaign: estimates of every method without and with the traced effects.

The campaign holds both: the estimates of a method M, and those named M + `WITH_EFFECTS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError, counted
from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting.campaign import Campaign
from airtruth.reporting.paper.layout import STANDARD_ERROR
from airtruth.reporting.paper.published import DECIMALS, SYMBOLS
from airtruth.reporting.paper.tables import statistics_of
from airtruth.reporting.statistics import MethodStatistics
from airtruth.table import MISSING, Cell, Group, Number, Pair, Row, Table, as_text, flat, write_table

Array = NDArray[np.float64]

WITH_EFFECTS: Final = " + effects"
"""Ending of a method's name for its estimates with the traced effects in the model."""

BARS: Final = {"Cmalpha": 3.0, "Cmq": None}
"""Largest bias allowed after the loop [%]; None for the bias before plus two Monte Carlo standard errors. The limits are
the project's requirement (docs/paper.md)."""

STAGES: Final = ("before", "after")
"""Estimates without and with the traced effects in the model."""

LONG_COLUMNS: Final = (
    "table",
    "campaign",
    "method",
    "stage",
    "parameter",
    "statistic",
    "value",
    "standard_error",
)
"""Columns of the long form of the table, which has one row per number."""


@dataclass(frozen=True)
class Bar:
    """A requirement on one derivative of one method: its bias before and after [%], and whether the bar is met."""

    before_pct: float
    after_pct: float
    met: bool


@dataclass(frozen=True)
class LoopTable:
    """Statistics of each method before and after.

    Attributes
    ----------
    name, title : name of the files; heading.
    campaign : evaluated runs.
    truth : (6,) mean true derivatives [-].
    statistics : method -> before, after.
    notes : sentences below the table.
    """

    name: str
    title: str
    campaign: Campaign
    truth: Array
    statistics: dict[str, tuple[MethodStatistics, MethodStatistics]]
    notes: tuple[str, ...]


def without(campaign: Campaign, run_ids: Collection[str]) -> Campaign:
    """Return the campaign without the runs in which the effects were traced."""
    kept = np.array([run_id not in run_ids for run_id in campaign.run_ids])
    return replace(
        campaign,
        run_ids=tuple(r for r, k in zip(campaign.run_ids, kept, strict=True) if k),
        flown=campaign.flown[kept],
        truth=campaign.truth[kept],
        estimates={
            name: replace(
                e,
                values=e.values[kept],
                lower=e.lower[kept],
                upper=e.upper[kept],
                converged=e.converged[kept],
                iterations=e.iterations[kept],
                status=tuple(s for s, k in zip(e.status, kept, strict=True) if k),
            )
            for name, e in campaign.estimates.items()
        },
    )


def evaluate(campaign: Campaign, name: str, title: str, notes: Sequence[str] = ()) -> LoopTable:
    """Return the statistics of every method with estimates both without and with effects.

    Raises
    ------
    LogError
        If no method has both.
    """
    methods = [m for m in campaign.estimates if m + WITH_EFFECTS in campaign.estimates]
    if not methods:
        raise LogError(f"{campaign.folder}: holds no method both as METHOD and as METHOD{WITH_EFFECTS}")
    statistics = statistics_of(campaign)
    return LoopTable(
        name=name,
        title=title,
        campaign=campaign,
        truth=campaign.truth[campaign.flown][:, : len(LONGITUDINAL.parameters)].mean(axis=0),
        statistics={m: (statistics[m], statistics[m + WITH_EFFECTS]) for m in methods},
        notes=tuple(notes),
    )


def bias_pct(s: MethodStatistics, truth: Array) -> tuple[Array, Array]:
    """Return the bias of the six derivatives and its standard error [% of the truth]; positive: too large in magnitude."""
    size = np.abs(truth) / 100.0
    six = slice(len(LONGITUDINAL.parameters))
    sign = np.sign(truth)
    return sign * (s.mean.value[six] - truth) / size, s.mean.se[six] / size


def bars(table: LoopTable) -> dict[str, dict[str, Bar]]:
    """Return method -> derivative of `BARS` -> requirement."""
    result: dict[str, dict[str, Bar]] = {}
    for method, pair in table.statistics.items():
        own = result.setdefault(method, {})
        (before, before_se), (after, after_se) = (bias_pct(s, table.truth) for s in pair)
        for name, limit in BARS.items():
            j = LONGITUDINAL.parameters.index(name)
            most = abs(before[j]) + 2.0 * math.hypot(before_se[j], after_se[j]) if limit is None else limit
            own[name] = Bar(float(before[j]), float(after[j]), bool(abs(after[j]) <= most))
    return result


def lay_out(table: LoopTable) -> Table:
    """Return rows and notes: each number before and after, one below the other."""
    runs = len(table.campaign.run_ids)
    groups = (
        Group("Mean (standard deviation)", tuple(_means(table))),
        Group("Bias [% of the truth] (standard error)", tuple(_biases(table))),
        Group("RelErr [%] (standard error)", tuple(_relerr(table))),
        Group("Root mean square error (standard error)", tuple(_rmse(table))),
        Group("Bars", tuple(_bars(table))),
        Group(f"Runs used of {runs}", tuple(_used(table))),
    )
    return Table(
        title=f"{table.title} - campaign {table.campaign.name!r}, {counted(runs, 'run')}",
        columns=("", "true", *table.statistics),
        groups=groups,
        notes=(
            "Before: the method as it is; after: the same with the traced effects in the model. Means, RMSE and RelErr "
            "are over the runs that flew and converged, standard errors are Monte Carlo ones; a positive bias is one "
            "away from zero. RelErr = ||mean - truth||/||truth|| over the six derivatives.",
            f"Bars: bias of Cmalpha at most {BARS['Cmalpha']:g} % after; bias of Cmq not larger after than before, two "
            "standard errors allowed.",
            *table.notes,
        ),
        keys=2,
    )


def _stages(table: LoopTable, label: str, cell: Callable[[MethodStatistics], Cell]) -> Iterator[Row]:
    """A row before, with the label, and a row after."""
    for stage, name in enumerate(STAGES):
        cells = (cell(pair[stage]) for pair in table.statistics.values())
        yield f"{label} {name}" if stage == 0 else f"  {name}", "", *cells


def _means(table: LoopTable) -> Iterator[Row]:
    for j, name in enumerate(LONGITUDINAL.parameters):
        d = DECIMALS[name]
        for stage, label in enumerate(STAGES):
            own = [pair[stage] for pair in table.statistics.values()]
            yield (
                f"{name} {label}" if stage == 0 else f"  {label}",
                Number(float(table.truth[j]), d) if stage == 0 else "",
                *(_pair(s.mean.value[j], s.std.value[j], d) for s in own),
            )
            yield STANDARD_ERROR, "", *(_pair(s.mean.se[j], s.std.se[j], d + 1) for s in own)


def _biases(table: LoopTable) -> Iterator[Row]:
    def cell(j: int, s: MethodStatistics) -> Cell:
        value, se = bias_pct(s, table.truth)
        return _pair(value[j], se[j], 1)

    for j, name in enumerate(LONGITUDINAL.parameters):
        yield from _stages(table, name, partial(cell, j))


def _relerr(table: LoopTable) -> Iterator[Row]:
    yield from _stages(table, "six", lambda s: _pair(100.0 * s.relerr.value, 100.0 * s.relerr.se, 2))


def _rmse(table: LoopTable) -> Iterator[Row]:
    def cell(j: int, s: MethodStatistics) -> Cell:
        return _pair(s.rmse.value[j], s.rmse.se[j], DECIMALS[LONGITUDINAL.parameters[j]])

    for j, name in enumerate(LONGITUDINAL.parameters):
        yield from _stages(table, name, partial(cell, j))


def _pair(first: float, second: float, decimals: int) -> Pair:
    return Pair(Number(float(first), decimals), Number(float(second), decimals))


def _bars(table: LoopTable) -> Iterator[Row]:
    by_method = bars(table)
    for name in BARS:
        yield name, "", *("met" if own[name].met else "missed" for own in by_method.values())


def _used(table: LoopTable) -> Iterator[Row]:
    for stage, name in enumerate(STAGES):
        yield name, MISSING, *(pair[stage].counts.used for pair in table.statistics.values())


def long_form(table: LoopTable) -> Table:
    """Return one row per number, with the columns `LONG_COLUMNS`."""
    rows: list[Row] = []
    for method, pair in table.statistics.items():
        for stage, s in zip(STAGES, pair, strict=True):
            rows += [
                (table.name, table.campaign.name, method, stage, *number)
                for number in _numbers(s, table.truth)
            ]
    return flat(table.title, LONG_COLUMNS, rows)


def _numbers(s: MethodStatistics, truth: Array) -> Iterator[tuple[str, str, float, float]]:
    """Parameter, statistic, value and standard error."""
    bias = bias_pct(s, truth)
    for j, name in enumerate(LONGITUDINAL.parameters):
        for statistic, values, errors in (
            ("mean", s.mean.value, s.mean.se),
            ("std", s.std.value, s.std.se),
            ("bias_pct", *bias),
            ("rmse", s.rmse.value, s.rmse.se),
        ):
            yield name, statistic, float(values[j]), float(errors[j])
    yield "six", "relerr_pct", 100.0 * s.relerr.value, 100.0 * s.relerr.se
    yield "runs", "used", float(s.counts.used), math.nan


def write_loop(table: LoopTable, out: Path) -> tuple[str, tuple[Path, ...]]:
    """Write NAME.md, NAME.csv and NAME.tex; return the table in plain text and the files.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    shown = lay_out(table)
    return as_text(shown), write_table(shown, out, table.name, long_form(table), SYMBOLS)


__all__ = [
    "BARS",
    "WITH_EFFECTS",
    "Bar",
    "LoopTable",
    "bars",
    "bias_pct",
    "evaluate",
    "lay_out",
    "long_form",
    "without",
    "write_loop",
]
