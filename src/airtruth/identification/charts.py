"""Chart of an identification: intervals of the methods side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.charts import Chart, Mark, Panel, Rule
from airtruth.physics.short_period import MODAL, PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

LABELS: Final = {"wn_rad_s": "wn [rad/s]", "zeta": "zeta [-]"}
"""Labels of the modal parameters; a derivative's is its name and [1/rad]."""
_MIDDLE: Final = (2.5, 97.5)
"""Percentiles between which 95 % of the runs lie [%]."""
_COLUMNS: Final = 4
"""Panels side by side [-] (judgement)."""


def intervals_chart(
    estimates: pd.DataFrame,
    references: Mapping[str, Mapping[str, float]] | None = None,
    confidence: float = 0.95,
) -> Chart:
    """Draw a panel for each derivative and modal parameter, with one row for each method.

    One run, or a joint estimate: the estimate and its interval. Several runs: the mean over the converged runs,
    a thick line for the mean interval that the method states, and a thin line that holds 95 % of the runs.

    Parameters
    ----------
    estimates : rows of contract 2, see `airtruth.identification.result.IdentificationResult.to_frame`.
    references : label -> parameter -> value of a rule beside the estimates, such as the truth of a campaign.
    confidence : probability of the intervals [-].
    """
    methods = list(dict.fromkeys(map(str, estimates["method"])))
    runs = estimates["run_id"].nunique()
    by_method = {m: estimates[(estimates["method"] == m) & estimates["converged"]] for m in methods}
    panels = []
    for name in (*PARAMETERS, *MODAL):
        marks = [
            mark for row, m in enumerate(methods) for mark in _mark(row, by_method[m], name, single=runs == 1)
        ]
        rules = tuple(
            Rule(values[name], label=label, colour="ink")
            for label, values in (references or {}).items()
            if name in values
        )
        panels.append(
            Panel(
                x_label=LABELS.get(name, f"{name} [1/rad]"),
                rows=tuple(methods),
                marks=tuple(marks),
                rules=rules,
            )
        )
    percent = f"{100.0 * confidence:g} % interval"
    words = (
        f"estimate and {percent}" if runs == 1 else f"mean; mean {percent} (thick); 95 % of the runs (thin)"
    )
    title = f"Run {estimates['run_id'].iloc[0]}" if runs == 1 else f"{runs} runs"
    return Chart("intervals", f"{title}: {words}", tuple(panels), _COLUMNS)


def _mark(row: int, rows: pd.DataFrame, name: str, *, single: bool) -> list[Mark]:
    value = _finite(rows[name])
    if not value.size:
        return []
    with np.errstate(over="ignore", invalid="ignore"):
        centre = float(value.mean())
        half = _finite(0.5 * (rows[f"{name}_upper"] - rows[f"{name}_lower"]))
        width = float(half.mean()) if half.size else float("nan")
        low, high = np.percentile(value, _MIDDLE)
    widest = None if single else (float(low), float(high))
    return [Mark(row, centre, centre - width, centre + width, widest)]


def _finite(values: pd.Series[float]) -> NDArray[np.float64]:
    array = values.to_numpy(dtype=np.float64)
    return np.asarray(array[np.isfinite(array)], dtype=np.float64)


__all__ = ["LABELS", "intervals_chart"]
