"""The paper's Tables 1-3 from flown campaigns, each figure beside the printed one.

A table is a plain description (`TableSpec`); `evaluate` turns it and a campaign into figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from airtruth.report import comparison, published, statistics
from airtruth.report.campaign import Campaign
from airtruth.report.comparison import RUNS, SIX
from airtruth.report.published import ESTIMATED, Printed
from airtruth.report.statistics import MethodStatistics

THRESHOLD: Final = 3.0
"""Combined standard errors beyond which a figure is said to differ from the printed one."""

TRUTH: Final = "truth"
"""Stands for the method in the rows that state true values."""

PRINTED_STATISTICS: Final = ("mean", "std", "relerr_pct", "iterations")
"""Statistics that the paper prints; a published RMSE or ratio of RelErr is derived from them."""


FURTHER: Final = ("frequency", "iv-refined", "output-error", "filter-error")
"""Methods that the paper does not have."""


@dataclass(frozen=True)
class TableSpec:
    """Description of a table.

    Attributes
    ----------
    name : name of the table and of its files.
    title : heading.
    campaign : name of the campaign that it shows; a campaign "NAME-..." is a variant of it.
    published : the paper's table to compare with (key of ``published.load().tables``), None for none.
    columns : methods in order; those absent from the estimates are left out and named in a note.
    reference : method that the RelErr of the others is divided by.
    further : methods that the paper does not have, shown as further columns where there are estimates.
    """

    name: str
    title: str
    campaign: str
    published: str | None
    columns: tuple[str, ...]
    reference: str
    further: tuple[str, ...] = ()

    @property
    def methods(self) -> tuple[str, ...]:
        """All methods that the table can show, in order."""
        return (*self.columns, *self.further)


@dataclass(frozen=True)
class Entry:
    """One figure of a table.

    Attributes
    ----------
    method, parameter, statistic : what it is; in the unit of the parameter, or % for ``..._pct``.
    value, se : figure and Monte Carlo standard error, NaN where it has none.
    published, published_se : printed figure and its Monte Carlo standard error.
    """

    method: str
    parameter: str
    statistic: str
    value: float
    se: float = math.nan
    published: Printed | None = None
    published_se: float = math.nan

    @property
    def z(self) -> float:
        """(value - published)/sqrt(se^2 + published_se^2 + rounding^2), NaN where not comparable."""
        if self.published is None:
            return math.nan
        spread = math.hypot(self.se, self.published_se, self.published.rounding_std)
        return (self.value - self.published.value) / spread

    @property
    def differs(self) -> bool:
        """Whether the figure differs from the printed one beyond Monte Carlo error."""
        return abs(self.z) > THRESHOLD


@dataclass(frozen=True)
class Table:
    """An evaluated table.

    Attributes
    ----------
    spec : its description.
    name : name of its files: that of the description, and the campaign's where it is a variant.
    campaign : what it was evaluated on.
    methods, absent : columns of the description that the estimates hold, and lack.
    statistics : method -> statistics.
    entries : (method, parameter, statistic) -> figure.
    """

    spec: TableSpec
    name: str
    campaign: Campaign
    methods: tuple[str, ...]
    absent: tuple[str, ...]
    statistics: Mapping[str, MethodStatistics]
    entries: Mapping[tuple[str, str, str], Entry]


TABLES: Final[Mapping[str, TableSpec]] = {
    spec.name: spec
    for spec in (
        TableSpec(
            name="table1",
            title="Table 1. Input of the auxiliary model, light turbulence",
            campaign="light",
            published="table1",
            columns=(
                "ls",
                "iv-lowpass",
                "iv-reference",
                "iv-reference-regressor",
                "iv-actuator",
                "iv-actuator-regressor",
            ),
            reference="iv-lowpass",
        ),
        TableSpec(
            name="table2",
            title="Table 2. Pre-filter, light turbulence",
            campaign="light",
            published="table2",
            columns=("ls", "iv-lowpass", "iv-f1", "iv-f2"),
            reference="iv-f1",
            further=FURTHER,
        ),
        TableSpec(
            name="table3",
            title="Table 3. Moderate turbulence and constant wind",
            campaign="moderate",
            published="table3",
            columns=("ls", "iv-lowpass", "iv-f1", "iv-f2"),
            reference="iv-f1",
            further=FURTHER,
        ),
    )
}


def all_methods(campaign: Campaign) -> TableSpec:
    """Description of a table of every method of a campaign, without printed figures."""
    methods = tuple(campaign.estimates)
    return TableSpec(
        name=f"methods-{campaign.name}",
        title="All methods",
        campaign=campaign.name,
        published=None,
        columns=methods,
        reference="iv-f1" if "iv-f1" in methods else methods[0],
    )


def shows(spec: TableSpec, campaign: Campaign) -> bool:
    """Whether a table shows a campaign: the one that it names, or a variant "NAME-..." of it."""
    return campaign.name == spec.campaign or campaign.name.startswith(spec.campaign + "-")


def method_statistics(campaign: Campaign, method: str) -> MethodStatistics:
    """Statistics of one method of a campaign."""
    e = campaign.estimates[method]
    return statistics.method_statistics(
        campaign.truth, campaign.flown, e.values, e.lower, e.upper, e.converged, e.iterations, e.status
    )


def evaluate(spec: TableSpec, campaign: Campaign) -> Table:
    """Every figure of a table, with its standard error and its printed counterpart."""
    methods = tuple(m for m in spec.methods if m in campaign.estimates)
    stats = {m: method_statistics(campaign, m) for m in methods}
    entries = list(_truth(campaign, spec.published is not None))
    for method in methods:
        figures = dict(_figures(stats[method]))
        if spec.reference in stats and method != spec.reference:
            figures[SIX, "relerr_ratio"] = _ratio(stats[method], stats[spec.reference])
        beside = _beside(spec, method, stats)
        entries += [
            Entry(method, parameter, statistic, value, se, *beside.get((parameter, statistic), ()))
            for (parameter, statistic), (value, se) in figures.items()
        ]
    variant = "" if campaign.name == spec.campaign else campaign.name.removeprefix(spec.campaign)
    return Table(
        spec=spec,
        name=spec.name + variant,
        campaign=campaign,
        methods=methods,
        absent=tuple(m for m in spec.columns if m not in campaign.estimates),
        statistics=stats,
        entries={(e.method, e.parameter, e.statistic): e for e in entries},
    )


def _truth(campaign: Campaign, with_published: bool) -> Iterator[Entry]:
    printed = published.load().truth
    truth = campaign.truth[campaign.flown]
    average = truth[0] + (truth - truth[0]).mean(axis=0)  # exact where all runs share one truth
    for name, value in zip(ESTIMATED, average, strict=True):
        # No standard error: a true value is not a Monte Carlo figure, and is not compared as one.
        yield Entry(TRUTH, name, "true", float(value), published=printed[name] if with_published else None)


def _figures(s: MethodStatistics) -> Iterator[tuple[comparison.Key, tuple[float, float]]]:
    for j, name in enumerate(ESTIMATED):
        for statistic, figure, unit in (
            ("mean", s.mean, 1.0),
            ("std", s.std, 1.0),
            ("rmse", s.rmse, 1.0),
            ("coverage_pct", s.coverage, 100.0),
        ):
            yield (name, statistic), (unit * float(figure.value[j]), unit * float(figure.se[j]))
        yield (name, "median"), (float(s.median[j]), math.nan)
        yield (name, "mad"), (float(s.mad[j]), math.nan)
    yield (SIX, "relerr_pct"), (100.0 * s.relerr.value, 100.0 * s.relerr.se)
    yield (SIX, "relerr_floor_pct"), (100.0 * s.relerr.floor, math.nan)
    for j, name in enumerate(ESTIMATED[-2:]):
        relerr = s.relerr_modal
        yield (name, "relerr_pct"), (100.0 * float(relerr.value[j]), 100.0 * float(relerr.se[j]))
    yield (RUNS, "iterations"), (float(s.iterations.value), float(s.iterations.se))
    c = s.counts
    for statistic, count in (
        ("runs", c.total),
        ("runs_failed_to_fly", c.failed_to_fly),
        ("runs_used", c.used),
        ("runs_not_converged", c.not_converged),
        ("runs_diverged", c.diverged),
        ("runs_aperiodic", c.aperiodic),
    ):
        yield (RUNS, statistic), (float(count), math.nan)


def _ratio(own: MethodStatistics, reference: MethodStatistics) -> tuple[float, float]:
    return statistics.ratio(own.relerr.value, own.influence, reference.relerr.value, reference.influence)


def _beside(spec: TableSpec, method: str, stats: Mapping[str, MethodStatistics]) -> comparison.Beside:
    table = published.load().tables[spec.published] if spec.published else None
    column = table.column(method) if table else None
    if table is None or column is None:
        return {}
    beside = comparison.published_figures(column, table.runs, stats[method])
    reference = table.column(spec.reference)
    if reference and spec.reference in stats:
        pair = stats[method], stats[spec.reference]
        beside[SIX, "relerr_ratio"] = comparison.published_ratio(column, reference, table.runs, *pair)
    return beside
