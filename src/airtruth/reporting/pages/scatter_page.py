"""The estimates of each run with their errors, and the correlation between the derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.charts import Chart
from airtruth.charts import as_html as chart_html
from airtruth.identification.charts import correlation_chart, runs_chart
from airtruth.identification.covariance_columns import covariance_of
from airtruth.physics.motion import LONGITUDINAL, Motion, motion_of
from airtruth.reporting.pages.page import Section, data_table
from airtruth.table import Group, Number, Row, Table, flat

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

MOST_RUNS: Final = 30
"""Most runs in a table of single runs [-] (judgement: a page stays small)."""
MOST_MARKS: Final = 60
"""Most intervals in a panel of single runs [-] (judgement: they keep apart)."""
LEAST_RUNS: Final = 2
"""Fewest runs per derivative whose scatter gives a correlation matrix [-] (judgement)."""
OF_METHOD: Final = "Correlation by the covariance that the method states, mean over the converged runs."
"""Explanation of a correlation from covariances."""


def runs_section(
    frame: pd.DataFrame,
    of_runs: int | None = None,
    references: Mapping[str, Mapping[str, float]] | None = None,
    confidence: float = 0.95,
) -> tuple[tuple[Chart, ...], Section]:
    """Return chart and section of every run and method; of many runs, the first `MOST_RUNS` alone.

    Parameters
    ----------
    frame : rows of contract 2, of at least the first `MOST_RUNS` runs.
    of_runs : number of all runs; None for those of ``frame``.
    references : label -> parameter -> value of a rule beside the estimates.
    confidence : probability of the intervals [-].
    """
    heading, anchor = "Estimates of each run", "runs"
    runs = list(dict.fromkeys(frame["run_id"]))
    total = of_runs or len(runs)
    if total == 1:
        return (), Section(heading, anchor, "")  # the table of all methods holds them
    kept = frame[frame["run_id"].isin(runs[:MOST_RUNS])]
    methods = list(dict.fromkeys(kept["method"]))
    few = max(1, MOST_MARKS // len(runs[:MOST_RUNS]))
    drawn = runs_chart(kept[kept["method"].isin(methods[:few])], references, confidence)
    if few < len(methods):
        drawn = replace(drawn, caption=f"{drawn.caption} The first {few} of {len(methods)} methods.")
    table = data_table(_runs_table(kept, total), "runs")
    return (drawn,), Section(heading, anchor, chart_html(drawn) + table)


def _runs_table(kept: pd.DataFrame, total: int) -> Table:
    motion = motion_of(kept.columns)
    names = [name for name in (*motion.parameters, *motion.modal) if name in kept]
    shown = [column for name in names for column in (name, f"{name}_std") if column in kept]
    values = kept[shown].to_numpy(dtype=np.float64)
    rows: list[Row] = [
        (
            str(run),
            str(method),
            "yes" if converged else "no",
            *(
                Number(float(x), digits=2 if c.endswith("_std") else 4)
                for c, x in zip(shown, row, strict=True)
            ),
        )
        for run, method, converged, row in zip(
            kept["run_id"], kept["method"], kept["converged"], values, strict=True
        )
    ]
    columns = ["run", "method", "converged", *(c.replace("_std", " std") for c in shown)]
    notes: tuple[str, ...] = ("std: standard error that the method states for the run.",)
    if total > MOST_RUNS:
        notes += (
            f"The first {MOST_RUNS} of {total} runs; the file of estimates holds all, the table above counts all.",
        )
    return replace(flat("Estimates of each run", columns, rows, notes), keys=2)


def stated_correlations(frame: pd.DataFrame) -> dict[str, Array]:
    """Method -> correlation by its covariance, mean over the converged runs; methods without one are left out."""
    found = {}
    for method, own in frame[frame["converged"]].groupby("method", sort=False):
        covariance = covariance_of(own, motion_of(frame.columns).parameters)
        finite = np.isfinite(covariance).all(axis=(1, 2))
        if finite.any():
            matrix = _correlation(covariance[finite].mean(axis=0))
            if matrix is not None:
                found[str(method)] = matrix
    return found


def scattered_correlations(frame: pd.DataFrame) -> dict[str, Array]:
    """Method -> correlation over the converged runs; methods with less than `least_runs` are left out."""
    found = {}
    motion = motion_of(frame.columns)
    for method, own in frame[frame["converged"]].groupby("method", sort=False):
        values = own[list(motion.parameters)].to_numpy(dtype=np.float64)
        values = values[np.isfinite(values).all(axis=1)]
        if len(values) >= least_runs(motion):
            matrix = _correlation(np.cov(values, rowvar=False))
            if matrix is not None:
                found[str(method)] = matrix
    return found


def least_runs(motion: Motion) -> int:
    """Fewest runs whose scatter gives a correlation matrix of the derivatives of a motion."""
    return LEAST_RUNS * len(motion.parameters)


def _correlation(covariance: Array) -> Array | None:
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not (std > 0.0).all():
        return None
    return np.asarray(np.clip(covariance / np.outer(std, std), -1.0, 1.0))


def _with_ones(matrix: Array) -> Array:
    """The matrix with exactly 1 on its diagonal, whatever the order of the sums behind it."""
    exact = matrix.copy()
    np.fill_diagonal(exact, 1.0)
    return exact


def correlation_section(
    correlations: Mapping[str, Array], of: str = OF_METHOD, motion: Motion = LONGITUDINAL
) -> tuple[tuple[Chart, ...], Section]:
    """Return chart and section of the correlation matrices; none and an empty section without one.

    Parameters
    ----------
    correlations : method -> correlation in the order of ``motion.parameters`` [-].
    of : what was correlated, a sentence.
    motion : whose derivatives they are.
    """
    heading, anchor = "Correlation of the estimates", "correlation"
    if not correlations:
        return (), Section(heading, anchor, "")
    correlations = {method: _with_ones(matrix) for method, matrix in correlations.items()}
    chart = correlation_chart(correlations, of, motion)
    groups = tuple(
        Group(
            method,
            tuple(
                (name, *(Number(float(x), decimals=3) for x in row))
                for name, row in zip(motion.parameters, matrix, strict=True)
            ),
        )
        for method, matrix in correlations.items()
    )
    note = f"{of} Beyond 0.9 in size, the records do not separate the two derivatives (Jategaonkar, 2015)."
    table = Table(heading, ("", *motion.parameters), groups, (note,))
    return (chart,), Section(heading, anchor, chart_html(chart) + data_table(table, "correlation"))


__all__ = [
    "MOST_RUNS",
    "correlation_section",
    "least_runs",
    "runs_section",
    "scattered_correlations",
    "stated_correlations",
]
