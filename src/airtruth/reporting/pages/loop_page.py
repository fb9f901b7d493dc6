"""The page of a closed loop, from its folder or from its result in memory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from airtruth.charts import Chart
from airtruth.charts import as_html as chart_html
from airtruth.documents import read_json
from airtruth.errors import StoreError
from airtruth.identification.charts import intervals_chart
from airtruth.identification.stored import read_stored
from airtruth.logs.histories import Histories
from airtruth.logs.provenance import PROVENANCE, Provenance
from airtruth.loop import NAME, DerivativeChange, LoopResult, loop_chart, loop_table
from airtruth.reporting.pages.origin import of_trace, origin_section
from airtruth.reporting.pages.page import Report, Section, data_table, page_of
from airtruth.reporting.pages.trace_page import closing, read_records, trace_sections
from airtruth.reporting.paper.published import SYMBOLS
from airtruth.table import as_csv, as_latex, flat
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.compensate import Treatment
from airtruth.tracing.presentation.charts import trace_charts
from airtruth.tracing.presentation.html import verdict_html

if TYPE_CHECKING:
    import pandas as pd

DOCUMENT: Final = f"{NAME}.json"
"""File that makes a folder the folder of a loop."""


def loop_report(result: LoopResult) -> Report:
    """Return the report of a loop in memory."""
    trace = result.trace
    frames = {"before": result.before.to_frame(), "after": result.after.to_frame()}
    return _report(trace.answer, trace.histories, result.changes, result.treatments, frames)


def stored_loop_report(folder: Path) -> Report:
    """Return the report of the folder of a loop.

    Raises
    ------
    StoreError, LogError
        If loop.json or a file of the trace or of the estimates cannot be read, or is incomplete.
    """
    path = folder / DOCUMENT
    cure = "run `airtruth loop` again to write it"
    document = read_json(path, StoreError, cure)
    if not isinstance(document, Mapping):
        raise StoreError(f"{path}: is not the result of a loop; {cure}")
    answer = TraceAnswer.from_dict(document.get("trace"), str(path))
    changes, treatments = _stored(document, path, cure)
    try:
        loop_table(changes, treatments, answer.derivatives)
    except (KeyError, ValueError):
        raise StoreError(f"{path}: does not hold every derivative of every method once; {cure}") from None
    histories = read_records(folder / "trace", cure)
    frames = {
        stage: read_stored(folder / f"estimates-{stage}.parquet")[0]
        for stage in ("before", "after")
        if (folder / f"estimates-{stage}.parquet").is_file()
    }
    return _report(answer, histories, changes, treatments, frames)


def _stored(
    document: Mapping[str, Any], path: Path, cure: str
) -> tuple[tuple[DerivativeChange, ...], tuple[Treatment, ...]]:
    from pydantic import TypeAdapter, ValidationError

    rows = document.get("estimates")
    if isinstance(rows, list):  # JSON has no NaN
        rows = [
            {k: math.nan if v is None else v for k, v in row.items()} if isinstance(row, dict) else row
            for row in rows
        ]
    try:
        changes = TypeAdapter(tuple[DerivativeChange, ...]).validate_python(rows)
        treatments = TypeAdapter(tuple[Treatment, ...]).validate_python(document.get("treatments"))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise StoreError(f"{path}: is incomplete ({where}: {first['msg'].lower()}); {cure}") from None
    return changes, treatments


def _report(
    answer: TraceAnswer,
    histories: Histories | None,
    changes: Sequence[DerivativeChange],
    treatments: Sequence[Treatment],
    frames: Mapping[str, pd.DataFrame],
) -> Report:
    table = loop_table(changes, treatments, answer.derivatives)
    names = tuple(asdict(changes[0])) if changes else ("method", "derivative")
    long = flat(table.title, names, [tuple(asdict(change).values()) for change in changes])
    chart = loop_chart(changes)
    intervals = _intervals(frames, {c.derivative: c.declared for c in changes})
    origin = of_trace(Provenance.read(histories.facts.get(PROVENANCE) if histories else None))
    records, *others = trace_sections(answer, histories)
    sections = [
        records,
        Section("Derivatives before and after", NAME, data_table(table, NAME)),
        Section("Intervals of all methods", "intervals", "".join(map(chart_html, intervals))),
        *others,
        origin_section(histories, origin, closing(answer), answer.motion),
    ]
    return Report(
        page=page_of("Closed loop", verdict_html(answer), chart, sections),
        csv=as_csv(long),
        latex=as_latex(table, NAME, SYMBOLS),
        charts=(chart, *intervals, *trace_charts(answer, histories)),
    )


def _intervals(frames: Mapping[str, pd.DataFrame], declared: Mapping[str, float]) -> list[Chart]:
    """One chart of the intervals before and after, in which each method has two rows; one row if they are the same."""
    import pandas as pd

    if not frames:
        return []
    first = next(iter(frames.values()))
    if all(frame.equals(first) for frame in frames.values()):
        return [intervals_chart(first, {"declared": declared})]
    parts = [
        frame.assign(method=[f"{m}, {stage}" for m in frame["method"]]) for stage, frame in frames.items()
    ]
    both = pd.concat(parts, ignore_index=True)
    methods = [f"{m}, {stage}" for m in dict.fromkeys(first["method"]) for stage in frames]
    ordered = both.sort_values("method", kind="stable", key=lambda names: names.map(methods.index))
    drawn = intervals_chart(ordered, {"declared": declared})
    title = "Derivatives without the traced effects (before) and with them (after)"
    return [replace(drawn, title=title)]


__all__ = ["DOCUMENT", "loop_report", "stored_loop_report"]
