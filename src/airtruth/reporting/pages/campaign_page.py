"""The page of an identified campaign: estimates against the truth, the tables that show it, and some of its records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.errors import AirtruthError
from airtruth.identification.charts import intervals_chart
from airtruth.logs.sources import Logs
from airtruth.reporting.campaign import ESTIMATES, Campaign
from airtruth.reporting.pages.estimates_page import runs_tables, shifts_of
from airtruth.reporting.pages.identified import SIMULATED, Identified, read_identified
from airtruth.reporting.pages.origin import of_methods, origin_section
from airtruth.reporting.pages.page import Report, Section, answer_html, data_table, page_of
from airtruth.reporting.pages.records import records_section, records_tables
from airtruth.reporting.paper import tables
from airtruth.reporting.paper.layout import lay_out
from airtruth.reporting.paper.published import ESTIMATED, SYMBOLS
from airtruth.reporting.paper.tables import PaperTable
from airtruth.reporting.statistics import MethodStatistics
from airtruth.table import as_csv, as_latex, flat, significant

if TYPE_CHECKING:
    import pandas as pd


def campaign_report(campaign: Campaign, logs: Logs | None = None, aircraft: Aircraft | None = None) -> Report:
    """Return the report of a campaign, each method in the first of the paper's tables that has it.

    Parameters
    ----------
    logs : logs of the campaign; None for those in its folder.
    aircraft : the declared aircraft; None for none.
    """
    shown = _tables(campaign)
    laid_out = [lay_out(table) for table in shown]
    rows = [row for table in shown for row in tables.long_form(table).rows]
    latex = [as_latex(one, table.name, SYMBOLS) for one, table in zip(laid_out, shown, strict=True)]
    frame = _frame(campaign)
    chart = intervals_chart(frame, {"truth": _truth(campaign)})
    identified = _identified(campaign, frame, logs, aircraft)
    shifts, shift_section = shifts_of(identified)
    histories = identified.histories
    statistics = {m: s for table in shown for m, s in table.statistics.items()}
    facts = [f"Gust: {campaign.gust}."] if campaign.gust else []
    sections = [
        Section(
            "Estimates against the truth",
            "tables",
            "".join(data_table(one, table.name) for one, table in zip(laid_out, shown, strict=True)),
        ),
        records_section(histories, identified.reason, SIMULATED),
        shift_section,
        Section("Estimates of each run", "runs", runs_tables(frame)),
        Section("Error per record", "errors", records_tables(histories) if histories else ""),
        origin_section(histories, of_methods(identified.records), facts),
    ]
    return Report(
        page=page_of(
            campaign.title or campaign.name, answer_html(*_answer(statistics, campaign)), chart, sections
        ),
        csv=as_csv(flat(campaign.title, tables.LONG_COLUMNS, rows)),
        latex="\n".join(latex),
        charts=(chart, *shifts),
    )


def _answer(statistics: Mapping[str, MethodStatistics], campaign: Campaign) -> list[str]:
    """The method nearest to the truth, and the number of runs."""
    relerr = {m: s.relerr.value for m, s in statistics.items() if math.isfinite(s.relerr.value)}
    runs = f"{int(campaign.flown.sum())} of {len(campaign.run_ids)} runs flew."
    if not relerr:
        return ["No method has a converged estimate.", runs]
    best = min(relerr, key=lambda m: relerr[m])
    words = (
        f"{best} is nearest to the truth: its mean derivatives are off by {_percent(relerr[best])} (RelErr)"
    )
    if len(relerr) > 1:
        worst = max(relerr, key=lambda m: relerr[m])
        words += f", those of {worst} by {_percent(relerr[worst])}"
    return [words + ".", runs]


def _percent(value: float) -> str:
    return f"{significant(100.0 * value, 2)} %"


def _truth(campaign: Campaign) -> dict[str, float]:
    truth = campaign.truth[campaign.flown]
    with np.errstate(over="ignore"):
        return dict(zip(ESTIMATED, truth.mean(axis=0).tolist(), strict=True))


def _frame(campaign: Campaign) -> pd.DataFrame:
    """The estimates as rows of contract 2."""
    import pandas as pd

    parts = []
    for method, e in campaign.estimates.items():
        columns: dict[str, object] = {"run_id": campaign.run_ids, "method": method, "converged": e.converged}
        for j, name in enumerate(ESTIMATED):
            columns[name] = e.values[:, j]
            columns[f"{name}_lower"] = e.lower[:, j]
            columns[f"{name}_upper"] = e.upper[:, j]
        parts.append(pd.DataFrame(columns)[campaign.flown])
    return pd.concat(parts, ignore_index=True)


def _identified(
    campaign: Campaign, frame: pd.DataFrame, logs: Logs | None, aircraft: Aircraft | None
) -> Identified:
    if logs is not None or aircraft is not None:
        return read_identified(campaign.folder / ESTIMATES, logs, aircraft)
    try:
        return read_identified(campaign.folder / ESTIMATES)
    except AirtruthError as error:  # the tables need less of the file than the records do
        return Identified(frame, {}, None, f"The records are not shown: {error}.")


def _tables(campaign: Campaign) -> list[PaperTable]:
    """The tables that show a method which no earlier table shows; one of all methods if they leave some out."""
    known = tables.statistics_of(campaign)
    shown: list[PaperTable] = []
    methods: set[str] = set()
    for spec in tables.TABLES.values():
        own = [m for m in spec.columns if m in campaign.estimates]
        if tables.shows(spec, campaign) and not methods.issuperset(own):
            shown.append(tables.evaluate(spec, campaign, known))
            methods.update(shown[-1].methods)
    if not methods.issuperset(campaign.estimates):
        shown.append(tables.evaluate(tables.all_methods(campaign), campaign, known))
    return shown
