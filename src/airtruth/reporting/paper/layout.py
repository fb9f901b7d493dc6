"""The layout of an evaluated table of the paper: its rows and notes, the same in every format.

`MARK` after a number means that it differs from the published one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from airtruth.errors import counted
from airtruth.reporting.paper import published
from airtruth.reporting.paper.comparison import RUNS, together
from airtruth.reporting.paper.published import DECIMALS
from airtruth.reporting.paper.tables import PRINTED_STATISTICS, THRESHOLD, TRUTH, PaperEntry, PaperTable
from airtruth.table import MISSING, Cell, Group, Number, Pair, Row, Table

MARK: Final = "*"
"""Mark of a number that differs from the published one by more than `THRESHOLD`."""

STANDARD_ERROR: Final = "  std. error"
"""Label of a row of standard errors."""

PUBLISHED: Final = "  published"
"""Label of a row of published numbers."""

DERIVED: Final = "  from published"
"""Label of a row of numbers that follow from published ones."""

CHANCE: Final = math.erfc(THRESHOLD / math.sqrt(2.0))
"""Probability that a normal variable lies beyond `THRESHOLD` by chance [-]."""

OUTLIERS: Final = 1.5
"""Ratio of standard deviation to scaled median absolute deviation above which the table shows medians as well [-];
measured: 0.6 % of
normal samples of 50 runs and 0.03 % of 100 runs exceed it."""


_DIGITS: Final = 4
"""Digits of a parameter that the paper does not print, counted from the first of the truth [-] (those of most of its figures)."""


def lay_out(table: PaperTable) -> Table:
    """Return the rows and notes of an evaluated table."""
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
    return Table(
        title=f"{table.spec.title} - campaign {table.campaign.name!r}, {counted(table.campaign.runs, 'run')}",
        columns=("", "true", *table.methods),
        groups=tuple(group for group in groups if group.rows),
        notes=tuple(_notes(table)),
        keys=2,
    )


def _estimates(table: PaperTable) -> Iterator[Row]:
    for name in table.spec.motion.estimated:
        d = _decimals(table, name)
        true = table.entries[TRUTH, name, "true"]
        pairs = [(table.entries[m, name, "mean"], table.entries[m, name, "std"]) for m in table.methods]
        yield name, Number(true.value, d), *(Pair(_ours(a, d), _ours(b, d)) for a, b in pairs)
        yield STANDARD_ERROR, "", *(Pair(Number(a.se, d + 1), Number(b.se, d + 1)) for a, b in pairs)
        if true.published:
            yield PUBLISHED, _printed(true), *(_printed_pair(a, b) for a, b in pairs)


def _relative_errors(table: PaperTable) -> Iterator[Row]:
    every = together(table.spec.motion)
    for parameter, statistic, label, decimals in (
        (every, "relerr_pct", every, 2),
        (every, "relerr_ratio", f"/ {table.spec.reference}", 2),
        *((name, "relerr_pct", name, 2) for name in table.spec.motion.modal),
    ):
        yield from _beside(table, parameter, statistic, label, decimals)
        if statistic == "relerr_pct" and parameter == every:
            floors = (table.entries[m, every, "relerr_floor_pct"] for m in table.methods)
            yield "  if unbiased", "", *(Number(e.value, 2) for e in floors)


def _rmse(table: PaperTable) -> Iterator[Row]:
    for name in table.spec.motion.estimated:
        yield from _beside(table, name, "rmse", name, _decimals(table, name))


def _decimals(table: PaperTable, name: str) -> int:
    """Decimals of a parameter: those of the paper's truth, or those that show `_DIGITS` digits of the truth."""
    if name in DECIMALS:
        return DECIMALS[name]
    size = abs(table.entries[TRUTH, name, "true"].value)
    return max(0, _DIGITS - 1 - math.floor(math.log10(size))) if math.isfinite(size) and size else _DIGITS


def _rmse_ratios(table: PaperTable) -> Iterator[Row]:
    """RMSE of each method over that of the reference, if the table has methods beyond the paper."""
    if table.spec.reference not in table.methods or set(table.methods).isdisjoint(table.spec.further):
        return
    for name in table.spec.motion.estimated:
        own = table.entries[table.spec.reference, name, "rmse"].value
        yield name, "", *(Number(table.entries[m, name, "rmse"].value / own, 2) for m in table.methods)


def _coverage(table: PaperTable) -> Iterator[Row]:
    for name in table.spec.motion.estimated:
        cells = [table.entries[m, name, "coverage_pct"] for m in table.methods]
        if any(math.isfinite(e.value) for e in cells):
            yield name, "", *(Pair(Number(e.value, 1), Number(e.se, 1)) for e in cells)


def _medians(table: PaperTable) -> Iterator[Row]:
    for name in table.spec.motion.estimated:
        d = _decimals(table, name)
        pairs = [(table.entries[m, name, "median"], table.entries[m, name, "mad"]) for m in table.methods]
        yield name, "", *(Pair(Number(a.value, d), Number(b.value, d)) for a, b in pairs)


def _runs(table: PaperTable) -> Iterator[Row]:
    for statistic, label in (
        ("runs", "planned"),
        ("runs_failed_to_fly", "failed to fly"),
        ("runs_used", "used"),
        ("runs_not_converged", "not converged"),
        ("runs_diverged", "diverged"),
        ("runs_aperiodic", "aperiodic"),
    ):
        cells = (table.entries[m, RUNS, statistic] for m in table.methods)
        yield label, "", *(Number(e.value, 0) for e in cells)
    yield from _beside(table, RUNS, "iterations", "iterations", 2)


def _beside(table: PaperTable, parameter: str, statistic: str, label: str, decimals: int) -> Iterator[Row]:
    """Two rows: our number with its standard error, and the published (or derived) one."""
    cells = [table.entries.get((m, parameter, statistic)) for m in table.methods]
    if not any(cells):
        return
    yield label, "", *(Pair(_ours(e, decimals), Number(e.se, decimals)) if e else MISSING for e in cells)
    if any(e and e.published for e in cells):
        exact = statistic in PRINTED_STATISTICS
        printed = (_printed(e, None if exact else decimals) if e else MISSING for e in cells)
        yield PUBLISHED if exact else DERIVED, "", *printed


def _ours(entry: PaperEntry, decimals: int) -> Number:
    return Number(entry.value, decimals, mark=MARK if entry.differs else "")


def _printed(entry: PaperEntry, decimals: int | None = None) -> Cell:
    """Published number, by default with the decimals of the paper."""
    if entry.published is None:
        return MISSING
    if decimals is None:
        decimals = max(0, -round(math.log10(entry.published.unit)))
    return Number(entry.published.value, decimals)


def _printed_pair(first: PaperEntry, second: PaperEntry) -> Cell:
    mean, std = _printed(first), _printed(second)
    return Pair(mean, std) if isinstance(mean, Number) and isinstance(std, Number) else MISSING


def _medians_matter(table: PaperTable) -> bool:
    """Whether a method has outliers, or finite estimates that did not converge."""
    derivatives = slice(len(table.spec.motion.parameters))
    return any(
        s.counts.not_converged > 0 or bool((s.std.value / OUTLIERS > s.mad)[derivatives].any())
        for s in table.statistics.values()
    )


def _notes(table: PaperTable) -> Iterator[str]:
    yield (
        "Mean (standard deviation), RMSE and RelErr are over the used runs: those that flew and converged. "
        "Standard errors are Monte Carlo ones, that of the standard deviation from the fourth moment. "
        f"RelErr = ||mean - truth||/||truth|| over the {together(table.spec.motion)} derivatives; 'if unbiased': its root mean "
        "square for an estimator of this spread without any bias."
    )
    *others, last = table.spec.motion.unscored or ("",)
    if last:
        yield (
            f"RelErr leaves out {', '.join(others)} and {last}, which a record does not determine: most of their mean, standard "
            "deviation and root mean square error is noise."
        )
    gust = table.campaign.gust
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
            reasons = ", ".join(f"{count} {reason!r}" for reason, count in s.counts.reasons.items())
            yield f"Not used of {method}: {reasons}."
    if table.absent:
        yield f"Not among the estimates of this campaign: {', '.join(table.absent)}."


def _published_notes(table: PaperTable) -> Iterator[str]:
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
    ranked = [
        table.entries[m, together(table.spec.motion), "relerr_pct"]
        for m in table.methods
        if printed.column(m)
    ]
    ours = sorted((e for e in ranked if math.isfinite(e.value)), key=lambda e: e.value)
    theirs = sorted(ranked, key=lambda e: e.published.value if e.published else math.inf)
    yield (
        f"Ranking by RelErr: {' < '.join(e.method for e in ours)}; "
        f"published: {' < '.join(dict.fromkeys(_label(printed, e.method) for e in theirs))}."
    )


def _label(printed: published.PublishedTable, method: str) -> str:
    column = printed.column(method)
    return column.label if column else method
