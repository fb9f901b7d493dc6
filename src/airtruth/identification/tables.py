"""Tables of estimates: one run, the distribution over runs, methods side by side."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError
from airtruth.identification.estimates import (
    SENTENCES,
    Estimates,
    Parts,
    Status,
    estimates_table,
    point_values,
    quantities,
)
from airtruth.identification.methods import title
from airtruth.physics.motion import LONGITUDINAL, Motion, motion_of
from airtruth.table import Cell, Group, Interval, Number, Table, Uncertain, flat

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


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
            estimates.motion.units[name],
            float(q.value[run, i]),
            float(q.std[run, i]),
            float(q.lower[run, i]),
            float(q.upper[run, i]),
        )
        for i, name in enumerate(q.names)
    ]
    percent = f"{100.0 * estimates.confidence:g} %"
    return flat(
        title=f"{title(estimates.method)}, run {estimates.run_ids[run]}",
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
        rows.append((name, estimates.motion.units[name], mean, error, spread, stated))
    return flat(
        title=f"{title(estimates.method)}, {count} of {len(estimates.run_ids)} runs converged",
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
    """Methods side by side: estimate of one run or mean over the converged runs, with its standard error.

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
    columns: list[str] = ["parameter", "unit"]
    for e in estimates:
        columns += [e.method, f"{e.method} +-"]
    rows = []
    for i, first in enumerate(tables[0].rows):
        cells: list[Cell] = [first[0], first[1]]
        for table in tables:
            cells += [table.rows[i][2], table.rows[i][3]]  # the estimate or the mean, and its standard error
        rows.append(tuple(cells))
    shown = "estimate and its standard error" if single else "mean over the runs and its standard error"
    return flat(
        title=f"{len(estimates)} methods: {shown}",
        columns=tuple(columns),
        rows=tuple(rows),
        notes=tuple(f"{e.method}: {t.notes[0]}" for e, t in zip(estimates, tables, strict=True)),
    )


def overview(estimates: pd.DataFrame, confidence: float = 0.95) -> Table:
    """Estimates of contract 2, a column per method: one run with its intervals, or mean and standard error over the runs.

    Parameters
    ----------
    estimates : rows of estimates.parquet, see `airtruth.identification.result.IdentificationResult.to_frame`.
    confidence : probability of their intervals [-].
    """
    motion = motion_of(estimates.columns)
    names = _names(motion)
    by_method = {str(name): rows for name, rows in estimates.groupby("method", sort=False)}
    if all(len(rows) == 1 for rows in by_method.values()):
        return _single({name: rows.iloc[0] for name, rows in by_method.items()}, confidence, motion)
    return _spread(
        lambda: (
            {
                m: (rows[names].to_numpy(np.float64), rows["converged"].to_numpy())
                for m, rows in by_method.items()
            },
        ),
        motion,
    )


def _names(motion: Motion) -> list[str]:
    return [*motion.parameters, *motion.modal]


def overview_of(parts: Parts) -> Table:
    """`overview` of estimates that come in parts, without a row for each run in memory."""
    runs, first = 0, None
    for part in parts():
        runs, first = runs + len(part[0].run_ids), part if first is None else first
    if first is not None and runs == 1:
        rows = {e.method: estimates_table(e).iloc[0] for e in first}
        return _single(rows, first[0].confidence, first[0].motion)
    motion = LONGITUDINAL if first is None else first[0].motion
    return _spread(
        lambda: ({e.method: (point_values(e), e.converged) for e in part} for part in parts()), motion
    )


def _single(by_method: Mapping[str, pd.Series], confidence: float, motion: Motion) -> Table:
    cells = {name: _intervals(run, motion) for name, run in by_method.items()}
    converged = {name: int(run["converged"]) for name, run in by_method.items()}
    return _overview(
        f"Estimates with {100.0 * confidence:g} % intervals",
        cells,
        converged,
        dict.fromkeys(by_method, 1),
        motion,
    )


def _spread(
    parts: Callable[[], Iterable[Mapping[str, tuple[Array, NDArray[np.bool_]]]]], motion: Motion
) -> Table:
    """Mean and its standard error over the converged runs, from two passes over values (runs, quantities) and convergence."""
    runs: Counter[str] = Counter()
    converged: Counter[str] = Counter()
    size = len(_names(motion))
    count, total, squares = _Sums(size), _Sums(size), _Sums(size)
    for part in parts():
        for method, (values, good) in part.items():
            runs[method] += len(good)
            converged[method] += int(good.sum())
            count[method] += (~np.isnan(values[good])).sum(axis=0)
            total[method] += np.nansum(values[good], axis=0)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        mean = {method: total[method] / count[method] for method in runs}
        for part in parts():
            for method, (values, good) in part.items():
                squares[method] += np.nansum((values[good] - mean[method]) ** 2, axis=0)
        std = {m: np.sqrt(np.where(count[m] > 1, squares[m] / (count[m] - 1), np.nan)) for m in runs}
    cells: dict[str, dict[str, Cell]] = {
        method: {
            name: Uncertain(
                Number(mean[method][i]), Number(std[method][i] / np.sqrt(count[method][i]), digits=2)
            )
            for i, name in enumerate(_names(motion))
        }
        for method in runs
    }
    return _overview("Mean +- standard error over the converged runs", cells, converged, runs, motion)


class _Sums(dict[str, Array]):
    """Sums of each method over its runs, (quantities,)."""

    def __init__(self, size: int) -> None:
        self.size = size

    def __missing__(self, method: str) -> Array:
        return np.zeros(self.size)


def _overview(
    title: str,
    cells: Mapping[str, Mapping[str, Cell]],
    converged: Mapping[str, int],
    runs: Mapping[str, int],
    motion: Motion,
) -> Table:
    return Table(
        title=title,
        columns=("parameter", "unit", *cells),
        groups=(
            Group(
                "",
                tuple((n, motion.units[n], *(c[n] for c in cells.values())) for n in _names(motion)),
            ),
            Group(
                "Runs",
                (
                    ("converged", "", *(converged[m] for m in cells)),
                    ("not converged", "", *(runs[m] - converged[m] for m in cells)),
                ),
            ),
        ),
        keys=2,
    )


def _intervals(run: pd.Series, motion: Motion) -> dict[str, Cell]:
    return {
        name: Interval(Number(run[name]), Number(run[f"{name}_lower"]), Number(run[f"{name}_upper"]))
        for name in _names(motion)
    }
