"""The page of a trace, from its folder or from its result in memory."""

from __future__ import annotations

import html
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from airtruth.charts import as_html as chart_html
from airtruth.errors import StoreError
from airtruth.logs.histories import FILE, Histories, read_histories
from airtruth.logs.provenance import PROVENANCE, Provenance
from airtruth.physics.motion import MOTIONS
from airtruth.reporting.pages.frequency_page import frequency_section
from airtruth.reporting.pages.origin import of_trace, origin_section
from airtruth.reporting.pages.page import Report, Section, data_table, page_of
from airtruth.reporting.pages.records import records_section, records_tables
from airtruth.table import Number, Row, Table, as_latex, escaped, flat
from airtruth.tracing.answer import ANSWER, TraceAnswer
from airtruth.tracing.presentation.candidates import candidate_table
from airtruth.tracing.presentation.charts import (
    innovations_chart,
    scores_chart,
    shifts_chart,
    trace_chart,
    trace_charts,
)
from airtruth.tracing.presentation.derivative_table import derivative_table
from airtruth.tracing.presentation.error_table import axial_words, error_csv, error_table
from airtruth.tracing.presentation.html import verdict_html
from airtruth.tracing.presentation.text import detectable
from airtruth.tracing.presentation.tolerances import tolerance_table

CURE: Final = "run `airtruth trace` again to write it"
"""Advice on writing the files of a trace again."""
_SIMULATED: Final = (
    "declared, before, after: free runs of the declared aircraft, of the refitted one, and with the effects. Each has "
    "the same free biases, initial state and trim of the record."
)
"""How the models of a trace were simulated."""


def trace_report(answer: TraceAnswer, histories: Histories | None = None) -> Report:
    """Return the report of a trace.

    Parameters
    ----------
    answer : content of trace.json.
    histories : records of the trace; None in the folder of an old trace.
    """
    charts = tuple(trace_charts(answer, histories))
    origin = of_trace(Provenance.read(histories.facts.get(PROVENANCE) if histories else None))
    picture = trace_chart(answer, histories) if histories else scores_chart(answer)
    motion = answer.motion
    sections = [
        *trace_sections(answer, histories),
        origin_section(histories, origin, closing(answer), motion),
    ]
    latex = "\n".join(
        as_latex(table, f"trace-{name}")
        for name, table in _tables(answer)
        if name in ("error", "tolerances", "derivatives")
    )
    return Report(page_of("Trace", verdict_html(answer), picture, sections), error_csv(answer), latex, charts)


def read_trace(folder: Path) -> tuple[TraceAnswer, Histories | None]:
    """Read the answer of a trace, and its records if the folder holds them.

    Raises
    ------
    StoreError, LogError
        If a file cannot be read or is not complete.
    """
    return TraceAnswer.read(folder / ANSWER), read_records(folder, CURE)


def read_records(folder: Path, cure: str) -> Histories | None:
    """Read the records of a trace; None if its folder holds none.

    Parameters
    ----------
    cure : what writes them again, for messages.

    Raises
    ------
    StoreError, LogError
        If the file cannot be read or is not complete.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    histories = read_histories(path, cure)
    known = [motion.output_channels for motion in MOTIONS.values()]
    if not any(set(histories.first.measured) == set(channels) for channels in known):
        raise StoreError(f"{path}: does not hold the channels {' or '.join(map(', '.join, known))}; {cure}")
    return histories


def trace_sections(answer: TraceAnswer, histories: Histories | None) -> list[Section]:
    """Records, errors, derivatives, candidates and next flight of a trace."""
    tables = dict(_tables(answer))
    shifts = shifts_chart(answer)
    errors = [data_table(tables[name], name) for name in ("error", "tolerances") if name in tables]
    derivatives = [data_table(tables[name], name) for name in ("derivatives", "shift") if name in tables]
    candidates = [data_table(tables[name], name) for name in ("candidates", "sets") if name in tables]
    reason = f"The folder of this trace holds no {FILE}; {CURE}."
    return [
        records_section(histories, reason, _SIMULATED),
        Section(
            "Error before and after",
            "errors",
            "\n".join(errors + ([records_tables(histories)] if histories else [])),
        ),
        Section(
            "Derivatives", "derivatives", (chart_html(shifts) if shifts else "") + "\n".join(derivatives)
        ),
        frequency_section(histories),
        Section("Candidates", "candidates", chart_html(scores_chart(answer)) + "\n".join(candidates)),
        Section(
            "Remaining residual", "innovations", chart_html(innovations_chart(histories)) if histories else ""
        ),
        Section("Next flight", "next", _next(answer)),
    ]


def _tables(answer: TraceAnswer) -> Iterator[tuple[str, Table]]:
    """Name and table of everything that the answer holds."""
    yield "error", error_table(answer)
    tolerances = tolerance_table(answer)
    if tolerances is not None:
        yield "tolerances", tolerances
    yield "derivatives", derivative_table(answer)
    if answer.declared_model is not None:
        yield "shift", _shift_table(answer)
    yield "candidates", candidate_table(answer)
    if answer.alternatives or answer.inclusion:
        yield "sets", _sets_table(answer)


def _shift_table(answer: TraceAnswer) -> Table:
    assert answer.declared_model is not None
    rows: list[Row] = [
        (
            name,
            *(Number(x) for x in (s.declared, s.declared_std, s.estimate, s.std, *s.ci95)),
            Number(s.sigma, digits=2),
        )
        for name, s in answer.declared_model.shifts.items()
    ]
    columns = (
        "derivative",
        "declared",
        "declared std",
        "estimate",
        "std",
        "lower 95 %",
        "upper 95 %",
        "shift [declared std]",
    )
    return flat(f"Shifts of the derivatives [{answer.motion.derivative_units}]", columns, rows)


def _sets_table(answer: TraceAnswer) -> Table:
    rows: list[Row] = [
        ("set", " + ".join(a.effects) or "none", Number(a.weight, digits=3)) for a in answer.alternatives
    ]
    rows += [("effect", key, Number(p, digits=3)) for key, p in answer.inclusion.items()]
    return flat(
        "Posterior weight of each set of causes, and of each effect", ("kind", "effects", "weight"), rows
    )


def _next(answer: TraceAnswer) -> str:
    parts = [f"<p>{escaped(answer.next_flight)}</p>"]
    sizes = "; ".join(detectable(answer))
    if sizes:
        parts.append(f"<p>Smallest traceable sizes in these records: {html.escape(sizes)}.</p>")
    if answer.updated_aircraft:
        parts.append(f"<p>Updated aircraft: <code>{html.escape(answer.updated_aircraft)}</code></p>")
    return "\n".join(parts)


def closing(answer: TraceAnswer) -> list[str]:
    """Sentences at the end of the page of a trace."""
    records = answer.records
    forced = [f"Overridden by --force: {sentence}" for sentence in answer.forced]
    return [
        f"Fitted: {', '.join(records.fitted)}; held out: {', '.join(records.held_out) or 'none'}.",
        *([axial_words(answer.axial_force)] if answer.axial_force else []),
        *(f"{note}." for note in answer.notes),
        *forced,
    ]


__all__ = ["closing", "read_records", "read_trace", "trace_report", "trace_sections"]
