"""Estimates for people: one plain table, printed as text, HTML, CSV or JSON."""

from __future__ import annotations

import csv
import html
import io
import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airtruth.errors import ConfigurationError
from airtruth.identify.methods import METHODS
from airtruth.identify.results import SENTENCES, Estimates, Status, quantities

Cell = str | float | int

UNITS = {"wn_rad_s": "rad/s"}


@dataclass(frozen=True)
class Table:
    """A table of text and numbers.

    Attributes
    ----------
    title : one line.
    columns : names of the columns.
    rows : cells; numbers are kept in full, NaN means that there is none.
    notes : lines below the table.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()


def summary(estimates: Estimates, run_id: str | None = None) -> Table:
    """Estimates of one run, or the distribution over all converged runs.

    Parameters
    ----------
    estimates : of one method.
    run_id : the run; None for all, unless there is only one.

    Raises
    ------
    ConfigurationError
        If the run is not among the estimates.
    """
    q = quantities(estimates)
    if run_id is None and len(estimates.run_ids) > 1:
        return _distribution(estimates)
    if run_id is not None and run_id not in estimates.run_ids:
        raise ConfigurationError(
            f"run {run_id!r} is not among the {len(estimates.run_ids)} runs of these estimates, "
            f"the first of which is {estimates.run_ids[0]!r}"
        )
    run = 0 if run_id is None else estimates.run_ids.index(run_id)
    rows: list[tuple[Cell, ...]] = [
        (
            name,
            UNITS.get(name, "-"),
            float(q.value[run, i]),
            float(q.std[run, i]),
            float(q.lower[run, i]),
            float(q.upper[run, i]),
        )
        for i, name in enumerate(q.names)
    ]
    percent = f"{100.0 * estimates.confidence:g} %"
    return Table(
        title=f"{METHODS[estimates.method].title}, run {estimates.run_ids[run]}",
        columns=("parameter", "unit", "estimate", "std", f"lower {percent}", f"upper {percent}"),
        rows=tuple(rows),
        notes=(
            f"{SENTENCES[Status(int(estimates.status[run]))]}, {int(estimates.iterations[run])} iterations",
            f"covariance: {estimates.covariance_name}; true airspeed "
            f"{float(np.atleast_1d(estimates.scale.airspeed_m_s)[run]):.4g} m/s",
        ),
    )


def _distribution(estimates: Estimates) -> Table:
    q = quantities(estimates)
    good = estimates.converged
    count = int(good.sum())
    rows: list[tuple[Cell, ...]] = []
    for i, name in enumerate(q.names):
        value = q.value[good, i]
        value = value[np.isfinite(value)]
        spread = float(value.std(ddof=1)) if value.size > 1 else math.nan
        mean = float(value.mean()) if value.size else math.nan
        std = q.std[good, i]
        std = std[np.isfinite(std)]
        stated = float(np.sqrt(np.mean(std**2))) if std.size else math.nan
        error = spread / math.sqrt(value.size) if value.size > 1 else math.nan
        rows.append((name, UNITS.get(name, "-"), mean, error, spread, stated))
    return Table(
        title=f"{METHODS[estimates.method].title}, {count} of {len(estimates.run_ids)} runs converged",
        columns=("parameter", "unit", "mean", "standard error", "spread over runs", "stated std (rms)"),
        rows=tuple(rows),
        notes=(*_outcomes(estimates), f"covariance: {estimates.covariance_name}"),
    )


def _outcomes(estimates: Estimates) -> tuple[str, ...]:
    """What became of the runs, those that did not converge counted by reason."""
    counts = Counter(Status(int(s)) for s in estimates.status)
    iterations = estimates.iterations[estimates.converged]
    mean = f", {iterations.mean():.2f} iterations on average" if iterations.size else ""
    return tuple(
        f"{counts[status]} {'run' if counts[status] == 1 else 'runs'}: {SENTENCES[status]}"
        + (mean if status == Status.CONVERGED else "")
        for status in Status
        if counts[status]
    )


def compare(estimates: Sequence[Estimates], run_id: str | None = None) -> Table:
    """Methods side by side: estimate and deviation of one run, or mean and spread over converged runs.

    Parameters
    ----------
    estimates : one for each method.
    run_id : as in `summary`.

    Raises
    ------
    ConfigurationError
        If there are no estimates, or one of them lacks the run.
    """
    if not estimates:
        raise ConfigurationError("compare needs the estimates of at least one method")
    tables = [summary(e, run_id) for e in estimates]
    single = run_id is not None or len(estimates[0].run_ids) == 1
    value, deviation = (2, 3) if single else (2, 4)
    columns: list[str] = ["parameter", "unit"]
    for e in estimates:
        columns += [e.method, f"{e.method} +-"]
    rows = []
    for i, first in enumerate(tables[0].rows):
        cells: list[Cell] = [first[0], first[1]]
        for table in tables:
            cells += [table.rows[i][value], table.rows[i][deviation]]
        rows.append(tuple(cells))
    what = "estimate and its standard deviation" if single else "mean and spread over runs"
    return Table(
        title=f"{len(estimates)} methods: {what}",
        columns=tuple(columns),
        rows=tuple(rows),
        notes=tuple(f"{e.method}: {t.notes[0]}" for e, t in zip(estimates, tables, strict=True)),
    )


def _shown(cell: Cell) -> str:
    if isinstance(cell, float):
        return f"{cell:.4g}" if math.isfinite(cell) else "-"
    return str(cell)


def as_text(table: Table) -> str:
    """Aligned columns, the first two to the left."""
    cells = [table.columns, *(tuple(_shown(c) for c in row) for row in table.rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(table.columns))]
    lines = [table.title]
    for row in cells:
        padded = (
            c.ljust(w) if i < 2 else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  ".join(padded).rstrip())
    return "\n".join([*lines, *table.notes]) + "\n"


def as_html(table: Table) -> str:
    """A table element with caption; notes follow as a list."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    body = "\n".join(line([_shown(c) for c in row], "td") for row in table.rows)
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in table.notes)
    return (
        f"<table>\n<caption>{html.escape(table.title)}</caption>\n"
        f"<thead>{line(table.columns, 'th')}</thead>\n<tbody>\n{body}\n</tbody>\n</table>\n"
        + (f"<ul>{notes}</ul>\n" if notes else "")
    )


def as_csv(table: Table) -> str:
    """Header and rows with every digit; no title, no notes."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows([[repr(c) if isinstance(c, float) else c for c in row] for row in table.rows])
    return out.getvalue()


def as_json(table: Table) -> str:
    """title, notes and rows as objects; what is not finite is null."""
    rows = [
        {
            name: (None if isinstance(c, float) and not math.isfinite(c) else c)
            for name, c in zip(table.columns, row, strict=True)
        }
        for row in table.rows
    ]
    return json.dumps({"title": table.title, "notes": list(table.notes), "rows": rows}, indent=2) + "\n"
