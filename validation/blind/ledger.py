"""The ledger of the blind trials: a row for each run, and the tables of docs/blind.md that follow from the rows.

    python -m validation.blind.ledger

``results/MODE.json`` holds the rows of a mode. A row has the version, the seeds, the drawn trials and, for each score, the
trials that have it and the trials that are scored. Rows of a group are added. ``results/notes.md`` has the misses of each run.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from scipy.stats import binomtest

ROWS: Final = Path(__file__).resolve().parent / "results"
"""Folder of the ledger."""

PAGE: Final = Path(__file__).resolve().parents[2] / "docs" / "blind.md"
"""The page that has the tables."""

PRESENT: Final = "page"
"""Group of the rows that the summary of the page counts."""

GROUPS: Final = {
    PRESENT: "trials",
    "rules": "trials of the search by rules",
    "further": "further trials",
    "earlier": "earlier versions",
    "delays": "delays and lags alone",
}
"""Group of rows -> heading of its column."""


@dataclass(frozen=True)
class Run:
    """A run of the blind trials.

    Attributes
    ----------
    mode : mode of `python -m validation.blind`, or the name of another program of validation.
    version : commit of the tracer, or its description.
    seeds, trials : seeds and number of the drawn trials.
    group : key of `GROUPS`.
    counts : score -> trials that have it, trials that are scored.
    held_out_error : median of the held-out error over the truth's own [-].
    bound_first : highest share of right first names that the most similar effect permits [-].
    note : what the counts do not show.
    """

    mode: str
    version: str
    seeds: tuple[int, ...]
    trials: int
    group: str
    counts: Mapping[str, tuple[int, int]]
    held_out_error: float | None = None
    bound_first: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        if self.group not in GROUPS:
            raise ValueError(f"{self.mode} {self.version}: group {self.group!r} is none of {list(GROUPS)}")
        for score, (hits, of) in self.counts.items():
            if not 0 <= hits <= of:
                raise ValueError(f"{self.mode} {self.version}: {score} has {hits} of {of} trials")


@dataclass(frozen=True)
class Score:
    """A row of a table: key of the counts, its words, the required share, and whether a small share is the good one."""

    key: str
    words: str
    required: str = ""


@dataclass(frozen=True)
class Table:
    """Table of the runs of several modes.

    Attributes
    ----------
    modes : modes with a column each (and each group of their rows).
    scores : rows.
    held_out : required median of the held-out error over the truth's own; empty without this row.
    """

    modes: tuple[str, ...]
    scores: tuple[Score, ...]
    held_out: str = ""


_SETS: Final = (
    Score("contradicted", "declared model called contradicted", "0.99"),
    Score("contradicted_outside", "the same, of aircraft outside their declared uncertainty"),
    Score("reported", "right set reported", "0.97"),
    Score("first", "right set first", "0.85"),
    Score("parameters", "parameters inside their 95 % interval", "0.93 to 0.97"),
    Score("derivatives", "derivatives inside their 95 % interval", "0.93 to 0.97"),
    Score("worse_unreported", "held-out error worse, not reported", "0"),
)
_FLAGGED: Final = (
    Score("flagged", "unexplained, learned or provisional", "0.95"),
    Score("named", "named without reservation", "0.05"),
    Score("none", "answered `none`"),
    Score("increment", "an increment learned"),
)
TABLES: Final = {
    "null": Table(
        ("null",),
        (
            Score("false_cause", "false cause named", "0.03"),
            Score("false_cause_provisional", "of these provisional"),
            Score("contradicted", "declared model falsely contradicted", "0.01"),
            Score("contradicted_within", "the same, of aircraft within their declared uncertainty"),
            Score("increment", "increment learned", "0.02"),
        ),
    ),
    "single": Table(
        ("single",),
        (
            Score("in_set", "true effect in the reported set", "0.99"),
            Score("in_set_if_named", "the same where something is named"),
            Score("first", "true effect first"),
            Score("second", "a second effect named"),
            Score("parameters", "parameters inside their 95 % interval", "0.93 to 0.97"),
        ),
        "1.05",
    ),
    "sets": Table(("derivative", "composite", "slow"), _SETS, "1.05"),
    "triple": Table(("triple",), _SETS[2:5], "1.05"),
    "outside": Table(("unmodelled", "leave-one-out"), _FLAGGED, "1.10"),
    "clutter": Table(
        ("clutter",),
        (
            Score("reported", "dominant effect reported", "0.90"),
            Score("first", "dominant effect first"),
            Score("named_without", "something named without a dominant effect"),
            Score("not_worse", "held-out free run not worse"),
        ),
    ),
    "conditions": Table(
        ("drift", "coarse", "loop"),
        (
            Score("reported", "right set reported", "0.95"),
            Score("first", "right set first"),
            Score("parameters", "parameters inside their 95 % interval", "0.93 to 0.97"),
            Score("derivatives", "derivatives inside their 95 % interval", "0.93 to 0.97"),
            Score("none", "answered `none` without an effect"),
        ),
    ),
}
"""Tables of the page by the name of their mark."""


@dataclass
class Sum:
    """Added rows of a mode and a group."""

    hits: Counter[str] = field(default_factory=Counter)
    scored: Counter[str] = field(default_factory=Counter)
    errors: list[float] = field(default_factory=list)
    bounds: list[float] = field(default_factory=list)


def runs(folder: Path = ROWS) -> list[Run]:
    """Rows of the ledger, in the order of its files."""
    rows = []
    for path in sorted(folder.glob("*.json")):
        for row in json.loads(path.read_text(encoding="utf-8")):
            counts = {score: (pair[0], pair[1]) for score, pair in row["counts"].items()}
            rows.append(Run(**(row | {"seeds": tuple(row["seeds"]), "counts": counts})))
    return rows


def added(rows: Iterable[Run]) -> dict[tuple[str, str], Sum]:
    """Sums of the rows of each mode and group."""
    sums: dict[tuple[str, str], Sum] = {}
    for row in rows:
        total = sums.setdefault((row.mode, row.group), Sum())
        for score, (hits, of) in row.counts.items():
            total.hits[score] += hits
            total.scored[score] += of
        if row.held_out_error is not None:
            total.errors.append(row.held_out_error)
        if row.bound_first is not None:
            total.bounds.append(row.bound_first)
    return sums


def interval(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share (Clopper and Pearson, Biometrika 26 (1934) 404-413)."""
    ends = binomtest(hits, of).proportion_ci(0.95, method="exact")
    return float(ends.low), float(ends.high)


def share(hits: int, of: int) -> str:
    """Count, share and its interval as a cell."""
    low, high = interval(hits, of)
    return f"{hits} of {of} = {hits / of:.3f} ({low:.3f} to {high:.3f})"


def _range(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.2f}" if low == high else f"{low:.2f} to {high:.2f}"


def rendered(table: Table, sums: Mapping[tuple[str, str], Sum]) -> str:
    """A table in Markdown: a column for each mode and each group of its rows."""
    columns = [(mode, group) for mode in table.modes for group in GROUPS if (mode, group) in sums]
    heads = [f"`{mode}`, {GROUPS[group]}" for mode, group in columns]
    lines = [["score", *heads, "required"]]
    for score in table.scores:
        totals = [sums[column] for column in columns]
        cells = [share(t.hits[score.key], t.scored[score.key]) if t.scored[score.key] else "" for t in totals]
        if any(cells):
            lines.append([score.words, *cells, score.required])
        if score.key == "first" and any(t.bounds for t in totals):
            bounds = [_range(t.bounds) if t.bounds else "" for t in totals]
            lines.append(["upper bound by the most similar set, of each run", *bounds, ""])
    if table.held_out:
        cells = [_range(sums[c].errors) if sums[c].errors else "" for c in columns]
        lines.append(["held-out error over the truth's own, median of each run", *cells, table.held_out])
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def with_tables(page: str, rows: Iterable[Run]) -> str:
    """The page with the tables of the rows between their marks.

    Raises
    ------
    ValueError
        If a table has no mark in the page.
    """
    sums = added(rows)
    for name, table in TABLES.items():
        begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
        if begin not in page or end not in page:
            raise ValueError(f"{PAGE.name}: no mark of the table {name!r}")
        text = f"{begin}{rendered(table, sums)}\n{end}"
        page = re.sub(
            re.escape(begin) + ".*?" + re.escape(end), lambda _, text=text: text, page, flags=re.DOTALL
        )
    return page


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8"), runs()), encoding="utf-8")
