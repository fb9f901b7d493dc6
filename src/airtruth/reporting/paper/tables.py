"""The paper's Tables 1-3 from flown campaigns, each number beside the published one, and tables of further campaigns.

`TableSpec` describes a table; `evaluate` computes its numbers from a campaign.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.reporting import partial, statistics
from airtruth.reporting.campaign import Parted, average_truth
from airtruth.reporting.paper import comparison, published
from airtruth.reporting.paper.comparison import RUNS, together
from airtruth.reporting.paper.published import Printed
from airtruth.reporting.statistics import MethodStatistics
from airtruth.table import Table, flat

THRESHOLD: Final = 3.0
"""Combined standard errors beyond which a number counts as different from the published one [-]; judgement: three in a
thousand differ by chance."""

TRUTH: Final = "truth"
"""Name in place of a method for true values."""

LONG_COLUMNS: Final = (
    "table",
    "campaign",
    "parameter",
    "method",
    "statistic",
    "value",
    "standard_error",
    "published",
    "published_standard_error",
    "difference_in_standard_errors",
)
"""Columns of the long form of a table, which has one row per number."""

PRINTED_STATISTICS: Final = ("mean", "std", "relerr_pct", "iterations")
"""Statistics that the paper prints; its RMSE and its ratio of RelErr are derived from them."""

FURTHER: Final = ("iv-kalman", "frequency", "iv-frequency", "iv-refined", "output-error", "filter-error")
"""Methods that the paper does not cover."""


@dataclass(frozen=True)
class TableSpec:
    """Description of a table.

    Attributes
    ----------
    name : name of the table and of its files.
    title : heading.
    campaign : name of the campaign that the table shows; a campaign "NAME-..." is a variant of NAME.
    published : the paper's table to compare with (key of ``published.load().tables``), None for no comparison.
    columns : methods in order; a method without estimates is omitted and named in a note.
    reference : method by whose RelErr the others are divided.
    further : methods beyond the paper, appended as columns if the campaign has estimates of them.
    motion : whose parameters are its rows.
    """

    name: str
    title: str
    campaign: str
    published: str | None
    columns: tuple[str, ...]
    reference: str
    further: tuple[str, ...] = ()
    motion: Motion = LONGITUDINAL

    @property
    def methods(self) -> tuple[str, ...]:
        """All methods that the table can show, in order."""
        return (*self.columns, *self.further)


@dataclass(frozen=True)
class PaperEntry:
    """One number of a table.

    Attributes
    ----------
    method, parameter, statistic : key of the number; its unit is that of the parameter, or % for ``..._pct``.
    value, se : number and its Monte Carlo standard error, NaN where there is none.
    published, published_se : published number and its Monte Carlo standard error.
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
        """(value - published)/sqrt(se^2 + published_se^2 + rounding^2) [-], NaN without a published number."""
        if self.published is None:
            return math.nan
        spread = math.hypot(self.se, self.published_se, self.published.rounding_std)
        return (self.value - self.published.value) / spread

    @property
    def differs(self) -> bool:
        """Whether the number differs from the published one by more than the Monte Carlo error."""
        return abs(self.z) > THRESHOLD


@dataclass(frozen=True)
class PaperTable:
    """An evaluated table.

    Attributes
    ----------
    spec : description of the table.
    name : name of the files: that of the description, followed by the campaign's variant.
    campaign : evaluated campaign.
    methods, absent : methods of the description with and without estimates.
    statistics : method -> statistics.
    entries : (method, parameter, statistic) -> number.
    """

    spec: TableSpec
    name: str
    campaign: Parted
    methods: tuple[str, ...]
    absent: tuple[str, ...]
    statistics: Mapping[str, MethodStatistics]
    entries: Mapping[tuple[str, str, str], PaperEntry]


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
"""The paper's tables by name."""

_REFERENCE: Final[Mapping[str, str]] = {LONGITUDINAL.name: "iv-f1", LATERAL.name: "iv-lowpass"}
"""Motion -> method by which `airtruth identify` estimates without a choice."""


def all_methods(campaign: Parted) -> TableSpec:
    """Return the description of a table of every method of a campaign, without published numbers."""
    methods, motion = campaign.methods, campaign.motion
    longitudinal, reference = motion is LONGITUDINAL, _REFERENCE[motion.name]
    return TableSpec(
        name=f"{'methods' if longitudinal else motion.name}-{campaign.name}",
        title="All methods" if longitudinal else f"{motion.heading}, all methods",
        campaign=campaign.name,
        published=None,
        columns=methods,
        reference=reference if reference in methods else methods[0],
        motion=motion,
    )


def shows(spec: TableSpec, campaign: Parted) -> bool:
    """Return whether a table shows a campaign: the one that it names, or a variant "NAME-..." of it, and its motion."""
    named = campaign.name == spec.campaign or campaign.name.startswith(spec.campaign + "-")
    return named and campaign.motion is spec.motion


def methods_of(campaign: str) -> tuple[str, ...]:
    """Return the methods in the paper's tables of a campaign, or of the campaign that it is a variant of."""
    base = campaign.partition("-")[0]
    return tuple(dict.fromkeys(m for spec in TABLES.values() if spec.campaign == base for m in spec.columns))


def statistics_of(campaign: Parted) -> dict[str, MethodStatistics]:
    """Return the statistics of each method of a campaign."""
    return partial.method_statistics(
        lambda: ({m: part.sample(m) for m in part.methods} for part in campaign.parts())
    )


@np.errstate(over="ignore", invalid="ignore")
def evaluate(
    spec: TableSpec, campaign: Parted, known: Mapping[str, MethodStatistics] | None = None
) -> PaperTable:
    """Return every number of a table, with its standard error and its published counterpart.

    Parameters
    ----------
    spec : description of the table.
    campaign : the campaign that it shows.
    known : its statistics, see `statistics_of`; None to compute them.
    """
    methods = tuple(m for m in spec.methods if m in campaign.methods)
    known = statistics_of(campaign) if known is None else known
    stats = {m: known[m] for m in methods}
    entries = list(_truth(campaign, spec.published is not None))
    every = together(spec.motion)
    for method in methods:
        numbers = dict(_numbers(stats[method], spec.motion))
        if spec.reference in stats and method != spec.reference:
            numbers[every, "relerr_ratio"] = _ratio(stats, method, spec.reference)
        beside = _beside(spec, method, stats)
        entries += [
            PaperEntry(method, parameter, statistic, value, se, *beside.get((parameter, statistic), ()))
            for (parameter, statistic), (value, se) in numbers.items()
        ]
    variant = "" if campaign.name == spec.campaign else campaign.name.removeprefix(spec.campaign)
    return PaperTable(
        spec=spec,
        name=spec.name + variant,
        campaign=campaign,
        methods=methods,
        absent=tuple(m for m in spec.columns if m not in campaign.methods),
        statistics=stats,
        entries={(e.method, e.parameter, e.statistic): e for e in entries},
    )


def long_form(table: PaperTable) -> Table:
    """Return one row per number, with the columns `LONG_COLUMNS`."""
    rows = (
        (
            table.name,
            table.campaign.name,
            e.parameter,
            e.method,
            e.statistic,
            e.value,
            e.se,
            math.nan if e.published is None else e.published.value,
            e.published_se,
            e.z,
        )
        for e in table.entries.values()
    )
    return flat(table.spec.title, LONG_COLUMNS, rows)


def _truth(campaign: Parted, with_published: bool) -> Iterator[PaperEntry]:
    printed = published.load().truth
    for name, value in zip(campaign.motion.estimated, average_truth(campaign), strict=True):
        # a true value has no Monte Carlo error and is therefore not compared
        yield PaperEntry(
            TRUTH, name, "true", float(value), published=printed[name] if with_published else None
        )


def _numbers(s: MethodStatistics, motion: Motion) -> Iterator[tuple[comparison.Key, tuple[float, float]]]:
    every = together(motion)
    for j, name in enumerate(motion.estimated):
        for statistic, estimate, unit in (
            ("mean", s.mean, 1.0),
            ("std", s.std, 1.0),
            ("rmse", s.rmse, 1.0),
            ("coverage_pct", s.coverage, 100.0),
        ):
            yield (name, statistic), (unit * float(estimate.value[j]), unit * float(estimate.se[j]))
        yield (name, "median"), (float(s.median[j]), math.nan)
        yield (name, "mad"), (float(s.mad[j]), math.nan)
    yield (every, "relerr_pct"), (100.0 * s.relerr.value, 100.0 * s.relerr.se)
    yield (every, "relerr_floor_pct"), (100.0 * s.relerr.floor, math.nan)
    for j, name in enumerate(motion.modal):
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


def _ratio(stats: Mapping[str, MethodStatistics], own: str, reference: str) -> tuple[float, float]:
    return statistics.ratio(
        stats[own].relerr.value, stats[reference].relerr.value, _products(stats, own, reference)
    )


def _products(stats: Mapping[str, MethodStatistics], one: str, other: str) -> tuple[float, float, float]:
    """Sums of the squared influences on two RelErr, and of their product."""
    return stats[one].products[one], stats[other].products[other], stats[one].products[other]


def _beside(spec: TableSpec, method: str, stats: Mapping[str, MethodStatistics]) -> comparison.Beside:
    table = published.load().tables[spec.published] if spec.published else None
    column = table.column(method) if table else None
    if table is None or column is None:
        return {}
    beside = comparison.published_figures(column, table.runs, stats[method])
    reference = table.column(spec.reference)
    if reference and spec.reference in stats:
        own, other, common = _products(stats, method, spec.reference)
        beside[together(spec.motion), "relerr_ratio"] = comparison.published_ratio(
            column,
            reference,
            table.runs,
            stats[method],
            stats[spec.reference],
            common / math.sqrt(own * other) if own * other > 0.0 else 0.0,
        )
    return beside
