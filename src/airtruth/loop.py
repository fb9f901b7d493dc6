"""The closed loop: trace, take the traced effects out of the records, identify again, compare before and after."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.charts import Chart, Colour, Mark, Panel, Rule
from airtruth.identification import Options, identify
from airtruth.identification.result import IdentificationResult
from airtruth.identification.store import write_estimates
from airtruth.logs.atomic import make_folder, write_text
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.sources import Logs, named_logs
from airtruth.physics.short_period import PARAMETERS, UNITS
from airtruth.result import shortened
from airtruth.table import MISSING, Cell, Group, Number, Pair, Row, Table, as_html, as_text, write_table
from airtruth.tracing import TraceOptions, TraceResult, trace
from airtruth.tracing.accepted import AcceptedEffect
from airtruth.tracing.compensate import (
    Compensation,
    Treatment,
    compensated_log,
    compensation_of,
    updated_constants,
)
from airtruth.tracing.presentation.html import verdict_html
from airtruth.tracing.presentation.text import effect_line, verdict

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

METHODS: Final = ("ls", "iv-f1")
"""Methods of a loop by default: least squares, and the default method of `airtruth identify`."""
NAME: Final = "loop"
"""Name of the table's files and of loop.json."""
OUTPUTS: Final = (
    "estimates-before.parquet",
    "estimates-after.parquet",
    *(f"{NAME}.{suffix}" for suffix in ("json", "md", "csv", "tex")),
)
"""Files of a loop, beside those of its trace."""


@dataclass(frozen=True)
class DerivativeChange:
    """One derivative by one method, without and with the traced effects taken out.

    Attributes
    ----------
    method, derivative : names.
    declared : declared value [1/rad, rates as q c/(2V)].
    before, after : mean over the converged runs; NaN where none converged.
    before_error, after_error : standard error of the mean, from the scatter of the runs; of a single run, its own.
    runs_before, runs_after : number of converged runs.
    """

    method: str
    derivative: str
    declared: float
    before: float
    before_error: float
    after: float
    after_error: float
    runs_before: int
    runs_after: int


@dataclass(frozen=True)
class LoopResult:
    """A closed loop; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    trace : the trace of the records.
    treatments : treatment of each traced effect.
    before, after : estimates of every run by every method.
    changes : every derivative by every method, before and after.
    """

    trace: TraceResult
    treatments: tuple[Treatment, ...]
    before: IdentificationResult
    after: IdentificationResult
    changes: tuple[DerivativeChange, ...]

    def table(self) -> Table:
        """The derivatives of every method before and after, beside the declared ones."""
        return loop_table(self.changes, self.treatments)

    @property
    def verdict(self) -> str:
        """Verdict of the trace."""
        return self.trace.verdict

    @property
    def effects(self) -> tuple[AcceptedEffect, ...]:
        """Accepted effects of the trace."""
        return self.trace.effects

    def summary(self) -> str:
        """Verdict, effects and the table of before and after."""
        answer = self.trace.answer
        lines = [verdict(answer), *(effect_line(e) for e in answer.effects), ""]
        if not self.treatments:
            why = (
                "The accepted effects change no channel of a regression"
                if answer.effects
                else "No effect was accepted"
            )
            lines += [f"{why}, so the estimates after are those before.", ""]
        return "\n".join([*lines, as_text(self.table())])

    def to_frame(self) -> pd.DataFrame:
        """One row per method and derivative, the fields of `DerivativeChange`."""
        import pandas as pd

        return pd.DataFrame([asdict(c) for c in self.changes])

    def to_dict(self) -> dict[str, Any]:
        """The content of loop.json: the trace, the treatments and the changes of the derivatives."""
        changes = [{k: _finite(v) for k, v in asdict(c).items()} for c in self.changes]
        return {
            "trace": self.trace.to_dict(),
            "treatments": [asdict(t) for t in self.treatments],
            "estimates": changes,
        }

    def plot(self) -> Figure:
        """Every derivative by every method before and after, with two standard errors, and the declared value."""
        from airtruth.charts import as_figure

        return as_figure(loop_chart(self.changes))

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return verdict_html(self.trace.answer) + as_html(self.table())

    def write(self, out: Path) -> tuple[Path, ...]:
        """Write the estimates, loop.json and the table (.md, .csv, .tex) into a folder.

        Raises
        ------
        StoreError
            If a file cannot be written.
        """
        make_folder(out)
        paths = [out / name for name in OUTPUTS[:3]]
        for path, result in zip(paths, (self.before, self.after), strict=False):
            write_estimates(path, result, merge=False)
        write_text(paths[2], json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n")
        return (*paths, *write_table(self.table(), out, NAME))


def loop_table(changes: Sequence[DerivativeChange], treatments: Sequence[Treatment]) -> Table:
    """Return the derivatives of every method before and after, beside the declared ones.

    Parameters
    ----------
    changes : every derivative by every method.
    treatments : treatment of each traced effect, for the notes.
    """
    methods = list(dict.fromkeys(c.method for c in changes))
    cells = {(c.derivative, c.method): c for c in changes}
    groups = []
    for name in PARAMETERS:
        own = [cells[name, method] for method in methods]
        declared: Cell = Number(own[0].declared) if own else MISSING
        rows: list[Row] = [
            ("before", declared, *(_pair(c.before, c.before_error) for c in own)),
            ("after", "", *(_pair(c.after, c.after_error) for c in own)),
        ]
        groups.append(Group(name, tuple(rows)))
    converged = [next(c for c in changes if c.method == m) for m in methods]
    counts: list[Row] = [
        ("before", "", *(c.runs_before for c in converged)),
        ("after", "", *(c.runs_after for c in converged)),
    ]
    return Table(
        title="Derivatives before and after the traced effects are taken out of the records",
        columns=("", "declared", *methods),
        groups=(*groups, Group("converged runs", tuple(counts))),
        notes=(
            "Mean over the converged runs (standard error of the mean) [1/rad, rates as q c/(2V)].",
            *(f"{t.sentence}." for t in treatments),
        ),
        keys=2,
    )


def loop_chart(changes: Sequence[DerivativeChange]) -> Chart:
    """Draw every derivative by every method before and after, with two standard errors, and the declared value."""
    methods = list(dict.fromkeys(c.method for c in changes))
    panels = []
    for name in PARAMETERS:
        own = [c for c in changes if c.derivative == name]
        marks = []
        for c in own:
            row = methods.index(c.method)
            for shift, label, value, error in (
                (-0.17, "before", c.before, 2.0 * c.before_error),
                (0.17, "after", c.after, 2.0 * c.after_error),
            ):
                colour: Colour = "vermillion" if label == "before" else "blue"
                words = f"{label}, two standard errors"
                marks.append(Mark(row + shift, value, value - error, value + error, None, words, colour))
        rules = tuple(Rule(c.declared, label="declared") for c in own[:1])
        panels.append(
            Panel(x_label=f"{name} [{UNITS[name]}]", rows=tuple(methods), marks=tuple(marks), rules=rules)
        )
    title = "Derivatives before and after the traced effects are taken out"
    return Chart(NAME, title, tuple(panels), columns=3)


def close_loop(
    logs: Logs,
    aircraft: str | Path | Aircraft,
    out: Path | None = None,
    methods: Sequence[str] = METHODS,
    *,
    trace_options: TraceOptions | None = None,
    options: Options | None = None,
    force: bool = False,
    advance: Callable[[str], None] = lambda step: None,
) -> LoopResult:
    """Trace, take the accepted effects out of the records, and identify before and after.

    Each effect is treated by its kind (`airtruth.tracing.compensate`): increments of CL and Cm are subtracted, errors
    of sensors are undone, the elevator is replaced by the surface that the air sees, and a traced mass or inertia
    changes the constants. The result states the treatment of each effect.

    Parameters
    ----------
    logs : logs of one aircraft, as of `airtruth.tracing.trace`.
    aircraft : folder with aircraft.toml, a shipped name, or a loaded aircraft.
    out : folder of trace/, the estimates, loop.json and the table; None to write nothing.
    methods : names of estimators, see docs/methods.md.
    trace_options, options : choices of the trace and of the estimators; None for the defaults.
    force : use logs that contradict physics; the answer lists the faults.
    advance : receives the step that begins.

    Raises
    ------
    LogError, ConfigurationError, AircraftError, StoreError
        As `airtruth.tracing.trace` and `airtruth.identification.identify`.
    """
    declared = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    advance("identify before")
    before = identify(logs, declared, methods, options, force=force)
    folder = None if out is None else out / "trace"
    result = trace(logs, declared, trace_options, folder, force, advance)
    taken = compensation_of(result)
    advance("identify after")
    after = before
    if taken.treatments:
        read = [log for _, log in named_logs(logs)]
        after = identify_without_effects(read, declared, methods, taken, options, force)
    loop = LoopResult(
        trace=result,
        treatments=taken.treatments,
        before=before,
        after=after,
        changes=_changes(before, after, result.answer.derivatives.declared),
    )
    if out is not None:
        loop.write(out)
    return loop


def identify_without_effects(
    logs: Sequence[FlightLog],
    aircraft: Aircraft,
    methods: Sequence[str],
    taken: Compensation,
    options: Options | None = None,
    force: bool = False,
) -> IdentificationResult:
    """Identify with the traced effects taken out of the records.

    The intervals are those of the method: they count the effects as known.

    Parameters
    ----------
    logs : checked logs.
    taken : the traced effects; the other arguments are those of `airtruth.identification.identify`.

    Raises
    ------
    LogError, ConfigurationError
        As `airtruth.identification.identify`.
    """
    updated = updated_constants(aircraft, taken)
    compensated = [compensated_log(log, updated, taken) for log in logs]
    return identify(compensated, updated, methods, options, force=force)


def _changes(
    before: IdentificationResult, after: IdentificationResult, declared: dict[str, float]
) -> tuple[DerivativeChange, ...]:
    rows = []
    tables = [result.to_frame() for result in (before, after)]
    for method in before.methods:
        own = [table[table["method"] == method] for table in tables]
        good = [table[table["converged"]] for table in own]
        for name in PARAMETERS:
            (first, first_error), (second, second_error) = (_mean(table, name) for table in good)
            rows.append(
                DerivativeChange(
                    method=method,
                    derivative=name,
                    declared=declared[name],
                    before=first,
                    before_error=first_error,
                    after=second,
                    after_error=second_error,
                    runs_before=len(good[0]),
                    runs_after=len(good[1]),
                )
            )
    return tuple(rows)


def _mean(table: pd.DataFrame, name: str) -> tuple[float, float]:
    """Mean over the runs and its standard error."""
    values = table[name].to_numpy(dtype=np.float64)
    if len(values) == 0:
        return math.nan, math.nan
    if len(values) == 1:
        return float(values[0]), float(table[f"{name}_std"].iloc[0])
    return float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values)))


def _pair(value: float, error: float) -> Pair:
    return Pair(Number(value), Number(error, digits=2))


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


__all__ = [
    "METHODS",
    "OUTPUTS",
    "DerivativeChange",
    "LoopResult",
    "close_loop",
    "identify_without_effects",
    "loop_chart",
    "loop_table",
]
