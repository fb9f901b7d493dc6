"""Chart of an identification: intervals of the methods side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.charts import Cells, Chart, Colour, Mark, Panel, Rule
from airtruth.numerics.order_statistics import quantiles
from airtruth.physics.motion import LONGITUDINAL, Motion, motion_of

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

_MIDDLE: Final = (0.025, 0.975)
"""Quantiles between which 95 % of the runs lie [-]."""
_COLUMNS: Final = 4
"""Panels side by side [-] (judgement)."""

COLOURS: Final[tuple[Colour, ...]] = (
    "blue",
    "vermillion",
    "green",
    "purple",
    "orange",
    "sky",
    "ink",
    "grey",
)
"""Colours of the methods, in their order."""
_SPREAD: Final = 0.36
"""Half of the height of a row that the methods share [-] (judgement: rows stay apart)."""

Frames = Callable[[], Iterable["pd.DataFrame"]]
"""Returns rows of contract 2 in the same parts at each call, each run in one of them."""


def intervals_chart(
    estimates: pd.DataFrame | Frames,
    references: Mapping[str, Mapping[str, float]] | None = None,
    confidence: float = 0.95,
) -> Chart:
    """Draw a panel for each derivative and modal parameter, with one row for each method.

    One run, or a joint estimate: the estimate and its interval. Several runs: the mean over the converged runs,
    a thick line for the mean interval that the method states, and a thin line that holds 95 % of the runs.

    Parameters
    ----------
    estimates : rows of contract 2, see `airtruth.identification.result.IdentificationResult.to_frame`; or these in parts.
    references : label -> parameter -> value of a rule beside the estimates, such as the truth of a campaign.
    confidence : probability of the intervals [-].
    """
    frames = estimates if callable(estimates) else lambda: [estimates]
    runs, first, methods = 0, "", dict[str, None]()
    motion = LONGITUDINAL
    for frame in frames():
        motion = motion_of(frame.columns)
        runs += frame["run_id"].nunique()
        first = first or str(frame["run_id"].iloc[0] if len(frame) else "")
        methods |= dict.fromkeys(map(str, frame["method"].unique()))
    marks = _marks(frames, list(methods), motion, single=runs == 1)
    panels = tuple(
        Panel(
            x_label=f"{name.removesuffix('_rad_s')} [{motion.units[name]}]",
            rows=tuple(methods),
            marks=tuple(row[name] for row in marks if name in row),
            rules=_rules(references, name),
        )
        for name in _names(motion)
    )
    percent = f"{100.0 * confidence:g} % interval"
    words = (
        f"Estimate and {percent}."
        if runs == 1
        else f"Mean of the converged runs; mean {percent} (thick); 95 % of the runs (thin)."
    )
    by = f"{len(methods)} methods" if len(methods) > 1 else "".join(methods)
    title = f"Derivatives of {f'run {first}' if runs == 1 else f'{runs} runs'}" + (f" by {by}" if by else "")
    return Chart("intervals", title, panels, _COLUMNS, words)


def runs_chart(
    estimates: pd.DataFrame,
    references: Mapping[str, Mapping[str, float]] | None = None,
    confidence: float = 0.95,
) -> Chart:
    """Draw the estimate of each run with its interval: a panel for each derivative, a row for each run.

    Parameters
    ----------
    estimates : rows of contract 2 of several runs, converged or not; only the converged ones are drawn.
    references : label -> parameter -> value of a rule beside the estimates.
    confidence : probability of the intervals [-].
    """
    runs = list(dict.fromkeys(map(str, estimates["run_id"])))
    methods = list(dict.fromkeys(map(str, estimates["method"])))
    good = estimates[estimates["converged"]]
    spread = _SPREAD * (1.0 - 1.0 / max(len(methods), 1))  # marks of one run stay nearer than those of two
    offsets = np.linspace(-spread, spread, len(methods))
    panels = []
    motion = motion_of(estimates.columns)
    for name in motion.parameters:
        marks = [
            Mark(
                runs.index(str(run)) + float(offsets[methods.index(method)]),
                value,
                low,
                high,
                None,
                method,
                colour,
            )
            for run, method, value, low, high in zip(
                good["run_id"],
                map(str, good["method"]),
                *(good[name + end].astype(float).tolist() for end in ("", "_lower", "_upper")),
                strict=True,
            )
            for colour in [COLOURS[methods.index(method) % len(COLOURS)]]
        ]
        rules = _rules(references, name)
        panels.append(
            Panel(x_label=f"{name} [{motion.units[name]}]", rows=tuple(runs), marks=tuple(marks), rules=rules)
        )
    title = "Estimates of each run"
    return Chart(
        "runs",
        title,
        tuple(panels),
        3,
        f"Estimate and {100.0 * confidence:g} % interval of each converged run.",
    )


def _rules(references: Mapping[str, Mapping[str, float]] | None, name: str) -> tuple[Rule, ...]:
    return tuple(
        Rule(values[name], label=label, colour="ink")
        for label, values in (references or {}).items()
        if name in values
    )


def correlation_chart(correlations: Mapping[str, Array], of: str, motion: Motion = LONGITUDINAL) -> Chart:
    """Draw the correlation matrix of the estimates of each method.

    Parameters
    ----------
    correlations : method -> correlation in the order of ``motion.parameters`` [-].
    of : what was correlated, a sentence.
    motion : whose derivatives they are.
    """
    short = tuple(
        name.replace("alpha", "\u03b1").replace("beta", "\u03b2").replace("de", "\u03b4")
        for name in motion.parameters
    )
    panels = tuple(
        Panel(
            title=method,
            rows=short,
            cells=Cells(short, tuple(map(tuple, matrix.tolist()))),
        )
        for method, matrix in correlations.items()
    )
    return Chart("correlation", "Correlation of the estimates", panels, min(3, max(2, len(panels))), of)


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _marks(frames: Frames, methods: Sequence[str], motion: Motion, *, single: bool) -> list[dict[str, Mark]]:
    """Marks in the row of each method, of the parameters that have a finite estimate of a converged run."""
    if not methods:
        return []
    names = _names(motion)
    # by columns: numpy adds those of a single part as it adds those of all runs
    total, count = (np.zeros((2, len(methods), len(names))) for _ in range(2))
    for frame in frames():
        for i, method in enumerate(methods):
            half = 0.5 * (_values(frame, method, names, "_upper") - _values(frame, method, names, "_lower"))
            for kind, columns in enumerate((_values(frame, method, names), half)):
                for k, column in enumerate(columns.T):
                    finite = column[np.isfinite(column)]
                    total[kind, i, k] += finite.sum()
                    count[kind, i, k] += finite.size
    ends = quantiles(lambda: (_side_by_side(frame, methods, names) for frame in frames()), _MIDDLE)
    low, high = ends.reshape(2, len(methods), len(names)).tolist()
    centre, width = (total / count).tolist()
    return [
        {
            name: Mark(i, c, c - w, c + w, None if single else (low[i][k], high[i][k]))
            for k, (name, c, w) in enumerate(zip(names, centre[i], width[i], strict=True))
            if count[0, i, k]
        }
        for i in range(len(methods))
    ]


def _names(motion: Motion) -> tuple[str, ...]:
    return (*motion.parameters, *motion.modal)


def _side_by_side(frame: pd.DataFrame, methods: Sequence[str], names: Sequence[str]) -> Array:
    """(runs, methods x parameters) estimates of the converged runs, filled up with NaN."""
    columns = [_values(frame, method, names) for method in methods]
    block = np.full((max(map(len, columns)), len(methods) * len(names)), np.nan)
    for i, own in enumerate(columns):
        block[: len(own), i * len(names) : (i + 1) * len(names)] = own
    return block


def _values(frame: pd.DataFrame, method: str, names: Sequence[str], end: str = "") -> Array:
    """(runs, parameters) estimates of the converged runs of a method, or bounds of their intervals."""
    own = frame[(frame["method"] == method) & frame["converged"]]
    return np.asarray(own[[name + end for name in names]], dtype=np.float64)


__all__ = ["COLOURS", "Frames", "correlation_chart", "intervals_chart", "runs_chart"]
