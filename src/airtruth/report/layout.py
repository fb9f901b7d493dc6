"""Lays an evaluated table out as rows of words, once for every format.

Cells are plain text; `MARK` after a figure says that it differs from the printed one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from airtruth.physics import short_period
from airtruth.report import published
from airtruth.report.comparison import RUNS, SIX
from airtruth.report.published import DECIMALS, ESTIMATED
from airtruth.report.tables import PRINTED_STATISTICS, THRESHOLD, TRUTH, Entry, Table

MARK: Final = "*"
NONE: Final = "-"
STANDARD_ERROR: Final = "  std. error"
PUBLISHED: Final = "  published"
DERIVED: Final = "  from published"

CHANCE: Final = math.erfc(THRESHOLD / math.sqrt(2.0))
"""Probability that a normal figure lies beyond `THRESHOLD` by chance."""

OUTLIERS: Final = 1.5
"""Ratio of the standard deviation to the robust spread from which medians are shown as well."""


Row = tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """Rows under one heading; ``supplement`` where the paper has no such figures."""

    heading: str
    rows: tuple[Row, ...]
    supplement: bool = False


@dataclass(frozen=True)
class Grid:
    """A table in words.

    Attributes
    ----------
    title : heading.
    header : names of the columns: parameter, true value, one per method.
    groups : groups of rows, each row as long as ``header``.
    notes : sentences below the table.
    """

    title: str
    header: Row
    groups: tuple[Group, ...]
    notes: tuple[str, ...]


def lay_out(table: Table) -> Grid:
    """Rows and notes of an evaluated table."""
    groups = [
        Group("Mean (standard deviation)", tuple(_estimates(table))),
        Group("RelErr [%] (standard error)", tuple(_relative_errors(table))),
        Group("Runs", tuple(_runs(table))),
        Group("Root mean square error (standard error)", tuple(_rmse(table)), supplement=True),
        Group(f"The same / {table.spec.reference}", tuple(_rmse_ratios(table)), supplement=True),
        Group("Coverage of the intervals [%] (standard error)", tuple(_coverage(table)), supplement=True),
    ]
    if _medians_matter(table):
        heading = "Median (scaled median absolute deviation)"
        groups.append(Group(heading, tuple(_medians(table)), supplement=True))
    return Grid(
        title=f"{table.spec.title} - campaign {table.campaign.name!r}, {len(table.campaign.run_ids)} runs",
        header=("", "true", *table.methods),
        groups=tuple(group for group in groups if group.rows),
        notes=tuple(_notes(table)),
    )


def number(value: float, decimals: int) -> str:
    """Figure with fixed decimals; in powers of ten where that would be too wide to read."""
    if not math.isfinite(value):
        return NONE
    return f"{value:.{decimals}f}" if abs(value) < 1e5 else f"{value:.2e}"


def _estimates(table: Table) -> Iterator[Row]:
    for name in ESTIMATED:
        d = DECIMALS[name]
        true = table.entries[TRUTH, name, "true"]
        pairs = [(table.entries[m, name, "mean"], table.entries[m, name, "std"]) for m in table.methods]
        yield name, number(true.value, d), *(f"{_ours(a, d)} ({_ours(b, d)})" for a, b in pairs)
        yield (
            STANDARD_ERROR,
            "",
            *(f"{number(a.se, d + 1)} ({number(b.se, d + 1)})" for a, b in pairs),
        )
        if true.published:
            told = (f"{_theirs(a)} ({_theirs(b)})" if a.published else NONE for a, b in pairs)
            yield PUBLISHED, _theirs(true), *told


def _relative_errors(table: Table) -> Iterator[Row]:
    for parameter, statistic, label, decimals in (
        (SIX, "relerr_pct", "six", 2),
        (SIX, "relerr_ratio", f"/ {table.spec.reference}", 2),
        ("wn_rad_s", "relerr_pct", "wn_rad_s", 2),
        ("zeta", "relerr_pct", "zeta", 2),
    ):
        yield from _beside(table, parameter, statistic, label, decimals)
        if statistic == "relerr_pct" and parameter == SIX:
            floors = (table.entries[m, SIX, "relerr_floor_pct"] for m in table.methods)
            yield "  if unbiased", "", *(number(e.value, 2) for e in floors)


def _rmse(table: Table) -> Iterator[Row]:
    for name in ESTIMATED:
        yield from _beside(table, name, "rmse", name, DECIMALS[name])


def _rmse_ratios(table: Table) -> Iterator[Row]:
    """Each method's RMSE over that of the reference, where the table has methods beyond the paper's."""
    if table.spec.reference not in table.methods or set(table.methods).isdisjoint(table.spec.further):
        return
    for name in ESTIMATED:
        own = table.entries[table.spec.reference, name, "rmse"].value
        yield name, "", *(number(table.entries[m, name, "rmse"].value / own, 2) for m in table.methods)


def _coverage(table: Table) -> Iterator[Row]:
    for name in ESTIMATED:
        cells = [table.entries[m, name, "coverage_pct"] for m in table.methods]
        if any(math.isfinite(e.value) for e in cells):
            yield name, "", *(f"{number(e.value, 1)} ({number(e.se, 1)})" for e in cells)


def _medians(table: Table) -> Iterator[Row]:
    for name in ESTIMATED:
        d = DECIMALS[name]
        pairs = [(table.entries[m, name, "median"], table.entries[m, name, "mad"]) for m in table.methods]
        yield name, "", *(f"{number(a.value, d)} ({number(b.value, d)})" for a, b in pairs)


def _runs(table: Table) -> Iterator[Row]:
    for statistic, label in (
        ("runs", "planned"),
        ("runs_failed_to_fly", "failed to fly"),
        ("runs_used", "used"),
        ("runs_not_converged", "not converged"),
        ("runs_diverged", "diverged"),
        ("runs_aperiodic", "aperiodic"),
    ):
        cells = (table.entries[m, RUNS, statistic] for m in table.methods)
        yield label, "", *(number(e.value, 0) for e in cells)
    yield from _beside(table, RUNS, "iterations", "iterations", 2)


def _beside(table: Table, parameter: str, statistic: str, label: str, decimals: int) -> Iterator[Row]:
    """Two rows: our figure with its standard error, and the printed (or derived) one."""
    cells = [table.entries.get((m, parameter, statistic)) for m in table.methods]
    if not any(cells):
        return
    yield label, "", *(f"{_ours(e, decimals)} ({number(e.se, decimals)})" if e else NONE for e in cells)
    if any(e and e.published for e in cells):
        exact = statistic in PRINTED_STATISTICS
        told = (_theirs(e, None if exact else decimals) if e else NONE for e in cells)
        yield PUBLISHED if exact else DERIVED, "", *told


def _ours(entry: Entry, decimals: int) -> str:
    return number(entry.value, decimals) + (MARK if entry.differs else "")


def _theirs(entry: Entry, decimals: int | None = None) -> str:
    if entry.published is None:
        return NONE
    if decimals is None:
        decimals = max(0, -round(math.log10(entry.published.unit)))
    return f"{entry.published.value:.{decimals}f}"


def _medians_matter(table: Table) -> bool:
    """Whether a method has outliers, or finite estimates that its means leave out."""
    six = slice(len(short_period.PARAMETERS))
    return any(
        s.counts.not_converged > 0 or bool((s.std.value > OUTLIERS * s.mad)[six].any())
        for s in table.statistics.values()
    )


def _notes(table: Table) -> Iterator[str]:
    yield (
        "Mean (standard deviation), RMSE and RelErr are over the used runs: those that flew and converged. "
        "Standard errors are Monte Carlo ones, that of the standard deviation from the fourth moment. "
        "RelErr = ||mean - truth||/||truth|| over the six derivatives; 'if unbiased': its root mean "
        "square for an estimator of this spread without any bias."
    )
    gust = ", ".join(f"{key} {_plain(value)}" for key, value in table.campaign.gust.items())
    yield f"Campaign: {table.campaign.title}" + (f"; gust: {gust}." if gust else ".")
    if table.spec.published:
        yield from _published_notes(table)
    if _medians_matter(table):
        yield (
            "Medians are over every finite estimate, converged or not; they are shown where a standard "
            f"deviation exceeds {OUTLIERS} times the robust spread or an estimate did not converge."
        )
    for method, s in table.statistics.items():
        if s.counts.reasons:
            told = ", ".join(f"{count} {reason!r}" for reason, count in s.counts.reasons.items())
            yield f"Not used of {method}: {told}."
    if table.absent:
        yield f"Not among the estimates of this campaign: {', '.join(table.absent)}."


def _published_notes(table: Table) -> Iterator[str]:
    paper = published.load()
    printed = paper.tables[table.spec.published or ""]
    compared = [e for e in table.entries.values() if e.statistic in PRINTED_STATISTICS and math.isfinite(e.z)]
    differing = sum(e.differs for e in compared)
    yield (
        f"Published: {paper.source} ({printed.name}, {printed.runs} runs); rows 'from published' are "
        "computed from its figures. The number of iterations depends on a tolerance, which it gives as "
        "1 to 5 %."
    )
    yield (
        f"{MARK} |z| > {THRESHOLD:g}: differs from the published figure by more than {THRESHOLD:g} combined "
        "standard errors (ours, the paper's from its own standard deviation and number of runs, and the "
        f"rounding of its digits). {differing} of {len(compared)} printed figures differ; "
        f"{CHANCE * len(compared):.1f} would by chance."
    )
    ranked = [table.entries[m, SIX, "relerr_pct"] for m in table.methods if printed.column(m)]
    ours = sorted((e for e in ranked if math.isfinite(e.value)), key=lambda e: e.value)
    theirs = sorted(ranked, key=lambda e: e.published.value if e.published else math.inf)
    yield (
        f"Ranking by RelErr: {' < '.join(e.method for e in ours)}; "
        f"published: {' < '.join(dict.fromkeys(_label(printed, e.method) for e in theirs))}."
    )


def _label(printed: published.PublishedTable, method: str) -> str:
    column = printed.column(method)
    return column.label if column else method


def _plain(setting: object) -> str:
    """A campaign's setting in words: a plain value, or a distribution with its figures."""
    if not isinstance(setting, dict):
        return str(setting)
    if set(setting) == {"value"}:
        return str(setting["value"])
    return " ".join(f"{key} {_plain(value)}" for key, value in setting.items() if value is not None)
