"""The page of an identification, from its file or from its result in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.charts import Chart
from airtruth.charts import as_html as chart_html
from airtruth.identification import overview
from airtruth.identification.charts import intervals_chart
from airtruth.identification.result import IdentificationResult
from airtruth.identification.simulated import simulated_records
from airtruth.identification.stored import Record
from airtruth.physics.motion import motion_of
from airtruth.reporting.pages.frequency_page import frequency_charts, frequency_section
from airtruth.reporting.pages.identified import (
    SIMULATED,
    Identified,
    answer_of,
    compares,
    refuse_declared,
    require_same_aircraft,
)
from airtruth.reporting.pages.motions import PagePart, report_of
from airtruth.reporting.pages.origin import of_methods, origin_section
from airtruth.reporting.pages.page import Report, Section, answer_html, data_table
from airtruth.reporting.pages.records import records_section, records_tables
from airtruth.reporting.pages.scatter_page import (
    correlation_section,
    runs_section,
    scattered_correlations,
    stated_correlations,
)
from airtruth.reporting.paper.published import SYMBOLS
from airtruth.reporting.symbols import LATERAL_SYMBOLS
from airtruth.table import as_latex

if TYPE_CHECKING:
    import pandas as pd

    from airtruth.reporting.pages.declared import DeclaredDerivatives

_OVER_RUNS: Final = "Correlation over the converged runs."
"""Explanation of a correlation from the scatter of the runs."""
_SYMBOLS: Final = {**SYMBOLS, **LATERAL_SYMBOLS, "wn_rad_s": r"$\omega_n$"}
"""Symbols of a table that has a column of units."""


def estimates_report(title: str, identified: Sequence[Identified]) -> Report:
    """Return the report of estimates.

    Parameters
    ----------
    title : heading.
    identified : the estimates of each motion with their origin.
    """
    return report_of(title, {motion_of(one.frame.columns).name: _part(one) for one in identified})


def _part(identified: Identified) -> PagePart:
    frame, histories = identified.frame, identified.histories
    with np.errstate(over="ignore", invalid="ignore"):  # diverged estimates overflow in means
        table = overview(frame, identified.confidence)
    declared = identified.declared
    references = {"declared": declared.values} if declared else None
    chart = intervals_chart(frame, references, confidence=identified.confidence)
    shifts, shift_section = shifts_of(declared, frame)
    notes = [n for record in identified.records.values() for n in record["notes"]]
    notes += [
        f"Overridden by --force: {s}" for record in identified.records.values() for s in record["forced"]
    ]
    runs, runs_drawn = runs_section(frame, None, references, identified.confidence)
    stated = stated_correlations(frame)
    motion = motion_of(frame.columns)
    correlation, correlated = (
        correlation_section(stated, motion=motion)
        if stated
        else correlation_section(scattered_correlations(frame), _OVER_RUNS, motion)
    )
    sections = (
        records_section(histories, identified.reason, SIMULATED[motion.name]),
        Section("Estimates of all methods", "estimates", data_table(table, "estimates")),
        shift_section,
        runs_drawn,
        correlated,
        frequency_section(histories),
        Section("Error per record", "errors", records_tables(histories) if histories else ""),
        origin_section(histories, of_methods(identified.records), dict.fromkeys(notes), motion),
    )
    return PagePart(
        answer=answer_html(*answer_of(frame)),
        picture=chart,
        sections=sections,
        figures=table,
        latex=as_latex(table, "estimates", _SYMBOLS),
        charts=(chart, *shifts, *runs, *correlation, *frequency_charts(histories)),
    )


def shifts_of(
    declared: DeclaredDerivatives | None, estimates: pd.DataFrame
) -> tuple[tuple[Chart, ...], Section]:
    """Return chart and section of the shifts from the declared aircraft; without one, none and an empty section."""
    heading, anchor = "Shifts from the declared aircraft", "shifts"
    if declared is None:
        return (), Section(heading, anchor, "")
    from airtruth.reporting.pages.declared import shifts_chart, shifts_table

    chart = shifts_chart(declared, estimates)
    table = shifts_table(declared, estimates)
    return (chart,), Section(heading, anchor, chart_html(chart) + data_table(table, "shifts"))


def identification_report(result: IdentificationResult, aircraft: Aircraft | None = None) -> Report:
    """Return the report of an identification in memory, of each motion that it answers.

    Parameters
    ----------
    aircraft : the declared aircraft, beside the estimates of the motion that is compared with it; None for none.
    """
    every = tuple(result.motions.values())
    return estimates_report(
        f"Identification of {result.settings.aircraft}",
        [
            _identified(one, aircraft if len(every) == 1 or compares(one.settings.motion) else None)
            for one in every
        ],
    )


def _identified(result: IdentificationResult, aircraft: Aircraft | None) -> Identified:
    stated = result.to_dict()
    record = {
        name: stated[name]
        for name in ("version", "options", "joint", "aircraft", "constants", "sensors", "notes", "forced")
        if name in stated
    }
    sources = [(s.name, s.sha256, s.runs) for s in result.sources]
    made: Record = {**record, "sources": sources}  # type: ignore[typeddict-item]  # to_dict gives its keys
    records = dict.fromkeys(result.methods, made)
    refuse_declared(result.settings.motion, aircraft)
    histories, declared = result.histories(), None
    if aircraft is not None and histories is not None and result.logs is not None:
        from airtruth.reporting.pages.declared import declared_at

        require_same_aircraft(records, aircraft)
        declared = declared_at(aircraft, histories)
        rows = declared.before(result.to_frame())
        settings = result.settings
        histories = simulated_records(result.logs, rows, settings.constants, taken=settings.sensors)
    return Identified(
        frame=result.to_frame(),
        records=records,
        histories=histories,
        reason="The result holds no logs, so the records are not shown.",
        declared=declared,
    )


__all__ = ["estimates_report", "identification_report", "shifts_of"]
