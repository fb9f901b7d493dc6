"""Tables of estimates: one run, the distribution over runs, methods side by side."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from airtruth.errors import ConfigurationError
from airtruth.identification.estimates import (
    SENTENCES,
    Estimates,
    Status,
    estimates_table,
    point_values,
    quantities,
)
from airtruth.identification.methods import METHODS
from airtruth.physics.short_period import MODAL, PARAMETERS
from airtruth.table import Cell, Group, Interval, Number, Pair, Table, flat

if TYPE_CHECKING:
    import pandas as pd

UNITS: Final = {"wn_rad_s": "rad/s"}
"""Units of the parameters that have one."""


def details(estimates: Estimates, run_id: str | None = None) -> Table:
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
    return flat(
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
    return flat(
        title=f"{METHODS[estimates.method].title}, {count} of {len(estimates.run_ids)} runs converged",
        columns=("parameter", "unit", "mean", "standard error", "spread over runs", "stated std (rms)"),
        rows=tuple(rows),
        notes=(*_outcomes(estimates), f"covariance: {estimates.covariance_name}"),
    )


def _outcomes(estimates: Estimates) -> tuple[str, ...]:
    """Numbers of runs by outcome."""
    counts = Counter(Status(int(s)) for s in estimates.status)
    iterations = estimates.iterations[estimates.converged]
    mean = f", {iterations.mean():.2f} iterations on average" if iterations.size else ""
    return tuple(
        f"{counts[status]} {'run' if counts[status] == 1 else 'runs'}: {SENTENCES[status]}"
        + (mean if status == Status.CONVERGED else "")
        for status in Status
        if counts[status]
    )


def comparison(estimates: Sequence[Estimates], run_id: str | None = None) -> Table:
    """Methods side by side: estimate and deviation of one run, or mean and spread over converged runs.

    Parameters
    ----------
    estimates : one for each method.
    run_id : as in `details`.

    Raises
    ------
    ConfigurationError
        If one of the estimates lacks the run.
    """
    tables = [details(e, run_id) for e in estimates]
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
    shown = "estimate and its standard deviation" if single else "mean and spread over runs"
    return flat(
        title=f"{len(estimates)} methods: {shown}",
        columns=tuple(columns),
        rows=tuple(rows),
        notes=tuple(f"{e.method}: {t.notes[0]}" for e, t in zip(estimates, tables, strict=True)),
    )


def overview(estimates: pd.DataFrame) -> Table:
    """Estimates of contract 2, a column per method: one run with its intervals, or mean and standard deviation.

    Parameters
    ----------
    estimates : rows of estimates.parquet, see `airtruth.identification.result.IdentificationResult.to_frame`.
    """
    return _overview({str(name): rows for name, rows in estimates.groupby("method", sort=False)})


def _overview(by_method: Mapping[str, pd.DataFrame]) -> Table:
    single = all(len(rows) == 1 for rows in by_method.values())
    cells = {
        name: _intervals(rows.iloc[0]) if single else _spreads(rows[rows["converged"]])
        for name, rows in by_method.items()
    }
    converged = {name: int(rows["converged"].sum()) for name, rows in by_method.items()}
    return Table(
        title="Estimates with 95 % intervals"
        if single
        else "Mean (standard deviation) over the converged runs",
        columns=("parameter", "unit", *by_method),
        groups=(
            Group(
                "",
                tuple((n, UNITS.get(n, "-"), *(c[n] for c in cells.values())) for n in (*PARAMETERS, *MODAL)),
            ),
            Group(
                "Runs",
                (
                    ("converged", "", *converged.values()),
                    ("not converged", "", *(len(rows) - converged[n] for n, rows in by_method.items())),
                ),
            ),
        ),
        keys=2,
    )


def overview_of(estimates: Sequence[Estimates]) -> Table:
    """`overview` of estimates by several methods, without a row for each run in memory."""
    import pandas as pd

    frames = {
        e.method: estimates_table(e)
        if len(e.run_ids) == 1
        else pd.DataFrame(point_values(e), columns=[*PARAMETERS, *MODAL]).assign(converged=e.converged)
        for e in estimates
    }
    return _overview(frames)


def _intervals(run: pd.Series) -> dict[str, Cell]:
    return {
        name: Interval(Number(run[name]), Number(run[f"{name}_lower"]), Number(run[f"{name}_upper"]))
        for name in (*PARAMETERS, *MODAL)
    }


def _spreads(runs: pd.DataFrame) -> dict[str, Cell]:
    return {
        name: Pair(Number(runs[name].mean()), Number(runs[name].std(), digits=2))
        for name in (*PARAMETERS, *MODAL)
    }
