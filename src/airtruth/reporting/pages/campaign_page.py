"""The page of an identified campaign: estimates against the truth, the tables that show it, and some of its records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import norm

from airtruth.aircraft import Aircraft
from airtruth.errors import AirtruthError
from airtruth.identification.charts import Frames, intervals_chart
from airtruth.logs.names import ESTIMATES as FILES
from airtruth.logs.sources import Logs
from airtruth.physics.motion import Motion
from airtruth.reporting.campaign import FlownCampaign, Parted
from airtruth.reporting.pages.estimates_page import shifts_of
from airtruth.reporting.pages.frequency_page import frequency_charts, frequency_section
from airtruth.reporting.pages.headline import headline
from airtruth.reporting.pages.identified import SIMULATED, Identified, compares, read_identified
from airtruth.reporting.pages.motions import PagePart, report_of
from airtruth.reporting.pages.origin import of_methods, origin_section
from airtruth.reporting.pages.page import Report, Section, answer_html, data_table
from airtruth.reporting.pages.records import records_section, records_tables
from airtruth.reporting.pages.scatter_page import (
    MOST_RUNS,
    correlation_section,
    least_runs,
    runs_section,
)
from airtruth.reporting.paper import tables
from airtruth.reporting.paper.layout import lay_out
from airtruth.reporting.paper.tables import PaperTable
from airtruth.reporting.stored_campaign import StoredCampaign
from airtruth.reporting.symbols import SYMBOLS
from airtruth.table import as_latex, flat

if TYPE_CHECKING:
    import pandas as pd


def campaign_report(
    campaigns: Sequence[Parted], logs: Logs | None = None, aircraft: Aircraft | None = None
) -> Report:
    """Return the report of a campaign, each method in the first of the paper's tables that has it.

    Parameters
    ----------
    campaigns : the campaign with the estimates of each motion.
    logs : logs of the campaign; None for those in its folder.
    aircraft : the declared aircraft; None for none. It is compared with the longitudinal motion.
    """
    parts = {}
    for one in campaigns:
        own = aircraft if len(campaigns) == 1 or compares(one.motion) else None
        parts[one.motion.name] = _part(one, logs, own)
    return report_of(campaigns[0].title or campaigns[0].name, parts)


def _part(campaign: Parted, logs: Logs | None, aircraft: Aircraft | None) -> PagePart:
    motion = campaign.motion
    shown = _tables(campaign)
    laid_out = [lay_out(table) for table in shown]
    rows = [row for table in shown for row in tables.long_form(table).rows]
    latex = [as_latex(one, table.name, SYMBOLS) for one, table in zip(laid_out, shown, strict=True)]
    flown, truth = _flown(campaign)

    def frames() -> Iterator[pd.DataFrame]:
        return map(_frame, campaign.parts())

    first = _first(frames(), MOST_RUNS)
    chart = intervals_chart(frames, {"truth": truth})
    identified = _identified(campaign, first, flown, logs, aircraft)
    shifts, shift_section = shifts_of(identified.declared, _means(frames) if identified.declared else first)
    histories = identified.histories
    statistics = {m: s for table in shown for m, s in table.statistics.items()}
    facts = [f"Gust: {campaign.gust}."] if campaign.gust else []
    confidence = identified.confidence
    runs, runs_drawn = runs_section(_with_std(first, confidence, motion), flown, {"truth": truth}, confidence)
    correlation, correlated = correlation_section(
        {m: s.correlation for m, s in statistics.items() if s.counts.used >= least_runs(motion)},
        "Correlation over the converged runs.",
        motion,
    )
    sections = (
        records_section(histories, identified.reason, SIMULATED[motion.name]),
        Section(
            "Estimates against the truth",
            "tables",
            "".join(data_table(one, table.name) for one, table in zip(laid_out, shown, strict=True)),
        ),
        shift_section,
        runs_drawn,
        correlated,
        frequency_section(histories),
        Section("Error per record", "errors", records_tables(histories) if histories else ""),
        origin_section(histories, of_methods(identified.records), facts, motion),
    )
    return PagePart(
        answer=answer_html(*headline(statistics, flown, campaign.runs, confidence, motion)),
        picture=chart,
        sections=sections,
        figures=flat(campaign.title, tables.LONG_COLUMNS, rows),
        latex="\n".join(latex),
        charts=(chart, *shifts, *runs, *correlation, *frequency_charts(histories)),
    )


def _with_std(rows: pd.DataFrame, confidence: float, motion: Motion) -> pd.DataFrame:
    """The rows with the standard errors of their intervals, which are symmetric and normal."""
    half = float(norm.isf(0.5 * (1.0 - confidence)))
    with np.errstate(over="ignore", invalid="ignore"):
        std = {f"{n}_std": 0.5 * (rows[f"{n}_upper"] - rows[f"{n}_lower"]) / half for n in motion.estimated}
    return rows.assign(**std)


def _flown(campaign: Parted) -> tuple[int, dict[str, float]]:
    """Number of the runs that flew, and their mean truth."""
    names = campaign.motion.estimated
    count, total = 0, np.zeros(len(names))
    with np.errstate(over="ignore"):
        for part in campaign.parts():
            count += int(part.flown.sum())
            total += part.truth[part.flown].sum(axis=0)
        return count, dict(zip(names, (total / count).tolist(), strict=True))


def _frame(campaign: FlownCampaign) -> pd.DataFrame:
    """The estimates of a part as rows of contract 2, one method after another."""
    import pandas as pd

    parts = []
    for method, e in campaign.estimates.items():
        columns: dict[str, object] = {"run_id": campaign.run_ids, "method": method, "converged": e.converged}
        for j, name in enumerate(campaign.motion.estimated):
            columns[name] = e.values[:, j]
            columns[f"{name}_lower"] = e.lower[:, j]
            columns[f"{name}_upper"] = e.upper[:, j]
        parts.append(pd.DataFrame(columns)[campaign.flown])
    return pd.concat(parts, ignore_index=True)


def _first(frames: Iterable[pd.DataFrame], most: int) -> pd.DataFrame:
    """Rows of the first runs, one method after another."""
    import pandas as pd

    kept: list[pd.DataFrame] = []
    runs: list[str] = []
    for frame in frames:
        new = list(dict.fromkeys(frame["run_id"]))[: most - len(runs)]
        kept.append(frame[frame["run_id"].isin(new)])
        runs += new
        if len(runs) == most:
            break
    whole = pd.concat(kept, ignore_index=True)
    rank = {name: i for i, name in enumerate(dict.fromkeys(whole["method"]))}
    return whole.sort_values("method", kind="stable", key=lambda names: names.map(rank), ignore_index=True)


def _means(frames: Frames) -> pd.DataFrame:
    """One row for each method: the means over its converged runs."""
    import pandas as pd

    total: dict[str, pd.Series[float]] = {}
    count: dict[str, pd.Series[int]] = {}
    with np.errstate(over="ignore", invalid="ignore"):
        for frame in frames():
            for name, own in frame.groupby("method", sort=False):
                numbers = own[own["converged"]].drop(columns=["run_id", "method", "converged"])
                method = str(name)
                total[method] = numbers.sum() + total.get(method, 0.0)
                count[method] = numbers.count() + count.get(method, 0)
    means = [{"method": method, "converged": True, **(total[method] / count[method])} for method in total]
    return pd.DataFrame(means)


def _identified(
    campaign: Parted, first: pd.DataFrame, flown: int, logs: Logs | None, aircraft: Aircraft | None
) -> Identified:
    layout = (flown, len(campaign.methods)) if isinstance(campaign, StoredCampaign) else None
    try:
        return read_identified(campaign.folder / FILES[campaign.motion.name], logs, aircraft, layout)
    except AirtruthError as error:
        if logs is not None or aircraft is not None:
            raise
        # the tables need less of the file than the records do
        return Identified(first, {}, None, f"The records are not shown: {error}.")


def _tables(campaign: Parted) -> list[PaperTable]:
    """The tables that show a method which no earlier table shows; one of all methods if they leave some out."""
    known = tables.statistics_of(campaign)
    shown: list[PaperTable] = []
    methods: set[str] = set()
    for spec in tables.TABLES.values():
        own = [m for m in spec.columns if m in campaign.methods]
        if tables.shows(spec, campaign) and not methods.issuperset(own):
            shown.append(tables.evaluate(spec, campaign, known))
            methods.update(shown[-1].methods)
    if not methods.issuperset(campaign.methods):
        shown.append(tables.evaluate(tables.all_methods(campaign), campaign, known))
    return shown
