"""The loop's table: every method's estimates without and with the traced effects in the model.

A campaign holds both: those of a method M, and those named M + `WITH_EFFECTS`.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.logs.atomic import make_folder, write_text
from airtruth.physics.short_period import PARAMETERS
from airtruth.report import render
from airtruth.report.campaign import Campaign
from airtruth.report.layout import NONE, STANDARD_ERROR, Grid, Group, Row, number
from airtruth.report.published import DECIMALS
from airtruth.report.statistics import MethodStatistics
from airtruth.report.tables import method_statistics

Array = NDArray[np.float64]

WITH_EFFECTS: Final = " + effects"
BARS: Final = {"Cmalpha": 3.0, "Cmq": None}
"""Largest bias that the loop may leave [%]; None: that of before, Monte Carlo error (two standard errors) allowed."""
STAGES: Final = ("before", "after")
CSV_COLUMNS: Final = (
    "table",
    "campaign",
    "method",
    "stage",
    "parameter",
    "statistic",
    "value",
    "standard_error",
)


@dataclass(frozen=True)
class LoopTable:
    """Figures of each method before and after.

    Attributes
    ----------
    name, title : of the files; heading.
    campaign : the runs that are judged.
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
    """The campaign without some of its runs: those that the effects were traced in."""
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
    """Statistics of every method that the campaign holds both without and with effects.

    Raises
    ------
    LogError
        If there is none.
    """
    methods = [m for m in campaign.estimates if m + WITH_EFFECTS in campaign.estimates]
    if not methods:
        raise LogError(f"{campaign.folder}: holds no method both as METHOD and as METHOD{WITH_EFFECTS}")
    return LoopTable(
        name=name,
        title=title,
        campaign=campaign,
        truth=campaign.truth[campaign.flown][:, : len(PARAMETERS)].mean(axis=0),
        statistics={
            m: (method_statistics(campaign, m), method_statistics(campaign, m + WITH_EFFECTS))
            for m in methods
        },
        notes=tuple(notes),
    )


def bias_pct(s: MethodStatistics, truth: Array) -> tuple[Array, Array]:
    """Bias of the six derivatives and its standard error, in percent of the truth's size; positive: too large."""
    size = np.abs(truth) / 100.0
    six = slice(len(PARAMETERS))
    sign = np.sign(truth)
    return sign * (s.mean.value[six] - truth) / size, s.mean.se[six] / size


def bars(table: LoopTable) -> dict[str, dict[str, tuple[float, float, bool]]]:
    """Method -> derivative of `BARS` -> bias before, bias after [%], and whether the bar is met."""
    result: dict[str, dict[str, tuple[float, float, bool]]] = {}
    for method, pair in table.statistics.items():
        own = result.setdefault(method, {})
        (before, before_se), (after, after_se) = (bias_pct(s, table.truth) for s in pair)
        for name, limit in BARS.items():
            j = PARAMETERS.index(name)
            most = abs(before[j]) + 2.0 * math.hypot(before_se[j], after_se[j]) if limit is None else limit
            own[name] = float(before[j]), float(after[j]), bool(abs(after[j]) <= most)
    return result


def lay_out(table: LoopTable) -> Grid:
    """Rows and notes: each figure before and after, one below the other."""
    runs = len(table.campaign.run_ids)
    groups = (
        Group("Mean (standard deviation)", tuple(_means(table))),
        Group("Bias [% of the truth] (standard error)", tuple(_biases(table))),
        Group("RelErr [%] (standard error)", tuple(_relerr(table))),
        Group("Root mean square error (standard error)", tuple(_rmse(table))),
        Group("Bars", tuple(_bars(table))),
        Group(f"Runs used of {runs}", tuple(_used(table))),
    )
    return Grid(
        title=f"{table.title} - campaign {table.campaign.name!r}, {runs} runs",
        header=("", "true", *table.statistics),
        groups=groups,
        notes=(
            "Before: the method as it is; after: the same with the traced effects in the model. Means, RMSE and RelErr "
            "are over the runs that flew and converged, standard errors are Monte Carlo ones; a positive bias is one "
            "away from zero. RelErr = ||mean - truth||/||truth|| over the six derivatives.",
            f"Bars: bias of Cmalpha at most {BARS['Cmalpha']:g} % after; bias of Cmq not larger after than before, two "
            "standard errors allowed.",
            *table.notes,
        ),
    )


def _pairs(table: LoopTable, label: str, true: str, cell: Callable[[MethodStatistics], str]) -> Iterator[Row]:
    """A row before, headed by the label, and a row after."""
    for stage, name in enumerate(STAGES):
        cells = (cell(pair[stage]) for pair in table.statistics.values())
        yield f"{label} {name}" if stage == 0 else f"  {name}", true if stage == 0 else "", *cells


def _means(table: LoopTable) -> Iterator[Row]:
    for j, name in enumerate(PARAMETERS):
        d = DECIMALS[name]
        for stage, label in enumerate(STAGES):
            own = [pair[stage] for pair in table.statistics.values()]
            yield (
                f"{name} {label}" if stage == 0 else f"  {label}",
                number(float(table.truth[j]), d) if stage == 0 else "",
                *(f"{number(s.mean.value[j], d)} ({number(s.std.value[j], d)})" for s in own),
            )
            yield (
                STANDARD_ERROR,
                "",
                *(f"{number(s.mean.se[j], d + 1)} ({number(s.std.se[j], d + 1)})" for s in own),
            )


def _biases(table: LoopTable) -> Iterator[Row]:
    def cell(s: MethodStatistics, j: int) -> str:
        value, se = bias_pct(s, table.truth)
        return f"{number(value[j], 1)} ({number(se[j], 1)})"

    for j, name in enumerate(PARAMETERS):
        yield from _pairs(table, name, "", lambda s, j=j: cell(s, j))  # type: ignore[misc]


def _relerr(table: LoopTable) -> Iterator[Row]:
    yield from _pairs(
        table,
        "six",
        "",
        lambda s: f"{number(100.0 * s.relerr.value, 2)} ({number(100.0 * s.relerr.se, 2)})",
    )


def _rmse(table: LoopTable) -> Iterator[Row]:
    for j, name in enumerate(PARAMETERS):
        d = DECIMALS[name]
        yield from _pairs(
            table,
            name,
            "",
            lambda s, j=j, d=d: f"{number(s.rmse.value[j], d)} ({number(s.rmse.se[j], d)})",  # type: ignore[misc]
        )


def _bars(table: LoopTable) -> Iterator[Row]:
    judged = bars(table)
    for name in BARS:
        yield name, "", *("met" if own[name][2] else "missed" for own in judged.values())


def _used(table: LoopTable) -> Iterator[Row]:
    for stage, name in enumerate(STAGES):
        yield name, NONE, *(str(pair[stage].counts.used) for pair in table.statistics.values())


def csv_text(table: LoopTable) -> str:
    """Long form: one row per figure, full precision, an empty field where there is none."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for method, pair in table.statistics.items():
        for stage, s in zip(STAGES, pair, strict=True):
            bias = bias_pct(s, table.truth)
            rows: list[tuple[str, str, float, float]] = []
            for j, name in enumerate(PARAMETERS):
                for statistic, values, errors in (
                    ("mean", s.mean.value, s.mean.se),
                    ("std", s.std.value, s.std.se),
                    ("bias_pct", *bias),
                    ("rmse", s.rmse.value, s.rmse.se),
                ):
                    rows.append((name, statistic, float(values[j]), float(errors[j])))
            rows.append(("six", "relerr_pct", 100.0 * s.relerr.value, 100.0 * s.relerr.se))
            rows.append(("runs", "used", float(s.counts.used), math.nan))
            for name, statistic, value, error in rows:
                cells = (repr(x) if math.isfinite(x) else "" for x in (value, error))
                writer.writerow([table.name, table.campaign.name, method, stage, name, statistic, *cells])
    return out.getvalue()


def write_loop(table: LoopTable, out: Path) -> tuple[str, tuple[Path, ...]]:
    """Write NAME.md, NAME.csv and NAME.tex; the table in plain text and the files.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    make_folder(out)
    grid = lay_out(table)
    paths = []
    for suffix, content in (
        ("md", render.markdown(grid)),
        ("csv", csv_text(table)),
        ("tex", render.latex(grid, table.name)),
    ):
        paths.append(out / f"{table.name}.{suffix}")
        write_text(paths[-1], content)
    return render.text(grid), tuple(paths)


__all__ = [
    "BARS",
    "WITH_EFFECTS",
    "LoopTable",
    "bars",
    "bias_pct",
    "csv_text",
    "evaluate",
    "lay_out",
    "without",
    "write_loop",
]
