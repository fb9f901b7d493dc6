"""The result of `airtruth check`: errors of sensors, the sets of errors that explain a log, conclusions in words."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from airtruth import style
from airtruth.result import shortened
from airtruth.table import WIDTH, Cell, Table, as_text, flat

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from airtruth.checks.kinematics_search import ErrorSearch

Verdict = Literal["agrees", "errors", "one_of", "cannot_tell", "failed"]
"""Answers of a check: the channels agree; errors of sensors are present; one of several sets of errors is; the
records cannot tell; the check itself failed."""
State = Literal["present", "one of", "not needed", "not shown", "not assessed"]
"""An error is in every explanation, in some, in none although the records would show it, or the records would not
show it; or an explanation has it and the check failed."""


@dataclass(frozen=True)
class Finding:
    """A sensor error with its uncertainty.

    Attributes
    ----------
    name, unit, meaning : which error.
    value, std, lower, upper : estimate, standard error, 95 % interval [unit].
    declared : value in the aircraft file, or that without an error; of a bias the sum that all declared biases make.
    smallest : smallest change from the declared value that these records show [unit].
    state : see `State`.
    """

    name: str
    unit: str
    meaning: str
    value: float
    std: float
    lower: float
    upper: float
    declared: float
    smallest: float
    state: State


@dataclass(frozen=True)
class PossibleCause:
    """A set of errors that was compared.

    Attributes
    ----------
    errors : errors of the set, sizes as fitted together; none in the set without an error.
    statistic : motion of the elevator that the set leaves unexplained, the same statistic for every set.
    distance : cost over that of the cheapest set, as a difference of 2 log likelihood.
    possible : whether the records do not exclude the set.
    """

    errors: tuple[Finding, ...]
    statistic: float
    distance: float
    possible: bool

    @property
    def name(self) -> str:
        """Names of the errors, "none" without one."""
        return " + ".join(sorted(f.name for f in self.errors)) or "none"


@dataclass(frozen=True)
class CheckResult:
    """Errors of the sensors of a log, as its kinematics show them; see `airtruth.result.Result`.

    Attributes
    ----------
    verdict : see `Verdict`.
    run_ids : runs that were used, together.
    findings : every error that the kinematics can show, averaged over the sets that contain it, and biases.
    causes : sets of errors, the cheapest first.
    statistic, degrees, p_value : absolute test of the best set over all records and equations.
    enlargement : factor on variances for motion that no set explains.
    residual_rms : channel -> rms of the unexplained remainder: moving air and noise [unit of the channel].
    sentences : conclusions, ambiguities and missing channels in words, the conclusion first.
    forced : faults of the log that the gate found and ``force`` overruled.
    search : comparison of the sets of errors; None where there was none.
    """

    verdict: Verdict
    run_ids: tuple[str, ...]
    findings: tuple[Finding, ...]
    causes: tuple[PossibleCause, ...]
    statistic: float
    degrees: int
    p_value: float
    enlargement: float
    residual_rms: Mapping[str, float]
    sentences: tuple[str, ...]
    forced: tuple[str, ...] = ()
    search: ErrorSearch | None = field(default=None, repr=False, compare=False)

    @property
    def possible(self) -> tuple[PossibleCause, ...]:
        """Sets that the records do not exclude, the cheapest first."""
        return tuple(c for c in self.causes if c.possible)

    def finding(self, name: str) -> Finding:
        """Return the finding of an error.

        Raises
        ------
        KeyError
            If the check has no such error.
        """
        for one in self.findings:
            if one.name == name:
                return one
        raise KeyError(name)

    def summary(self) -> str:
        """Conclusion and both tables, as text."""
        shown_tables = tables(self) if self.causes else ()
        lines = (textwrap.fill(sentence, WIDTH, break_on_hyphens=False) for sentence in self.sentences)
        return "\n\n".join(["\n".join(lines), *(as_text(table) for table in shown_tables)])

    def to_frame(self) -> pd.DataFrame:
        """One row per error of a sensor: estimate, std, 95 % interval, declared value."""
        return tables(self)[0].to_frame()

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        stated = asdict(replace(self, search=None))
        del stated["search"]
        return stated

    @style.themed
    def plot(self) -> Figure:
        """Estimates less the declared values in standard errors, and the distance of each set of errors."""
        figure, axes = style.panels(1, 2, width_in=10.0, height_in=4.0)
        left, right = axes[0, 0], axes[0, 1]
        shown_ones = [f for f in self.findings if f.state != "not shown" and f.std > 0.0]
        places = np.arange(len(shown_ones))
        value = np.array([(f.value - f.declared) / f.std for f in shown_ones])
        ends = np.array([[(f.value - f.lower) / f.std, (f.upper - f.value) / f.std] for f in shown_ones])
        left.errorbar(value, places, xerr=np.maximum(ends.reshape(-1, 2), 0.0).T, fmt="o", color=style.BLUE)
        left.axvline(0.0, color=style.GREY)
        left.set_yticks(places, [f.name for f in shown_ones])
        left.invert_yaxis()
        left.set_xlabel("estimate less declared value [standard errors]")
        left.set_title("errors of sensors, 95 % intervals")
        causes = self.causes[:SETS]
        for place, cause in enumerate(causes):
            right.barh(place, cause.distance, color=style.GREEN if cause.possible else style.GREY)
            right.text(cause.distance, place, f" {_judged(cause, self)}", va="center", fontsize=7.5)
        right.margins(x=0.3)  # the words behind the longest bar
        right.set_xlim(left=0.0)
        right.set_yticks(np.arange(len(causes)), [c.name for c in causes])
        right.invert_yaxis()
        right.set_xlabel("distance from the best set [-]")
        right.set_title("sets of errors, the best first")
        title = self.sentences[0].replace("+-", "\u00b1")
        figure.suptitle(textwrap.fill(title, 110), fontsize=10.0, fontweight="bold")
        return figure

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return "\n".join(table._repr_html_() for table in tables(self))


def shown(one: Finding) -> str:
    """ "13.1 +- 0.2 m (95 %: 12.7 to 13.5)", digits by the standard error."""
    digits = digits_of(one.std)
    unit = "" if one.unit == "-" else f" {one.unit}"
    return (
        f"{one.value:.{digits}f} +- {one.std:.{digits}f}{unit} "
        f"(95 %: {one.lower:.{digits}f} to {one.upper:.{digits}f})"
    )


def digits_of(size: float) -> int:
    """Decimals that show two digits of a size."""
    return int(np.clip(1 - np.floor(np.log10(max(size, 1e-12))), 0, 8)) if np.isfinite(size) else 0


def tables(result: CheckResult) -> tuple[Table, Table]:
    """Errors, and sets of errors, as tables for people."""
    open_ones = undetermined(result)
    rows: list[tuple[Cell, ...]] = [
        (
            f.name,
            f.unit,
            *((math.nan,) * 4 if f.name in open_ones else (f.value, f.std, f.lower, f.upper)),
            f.declared,
            f.smallest,
            f.state,
        )
        for f in result.findings
    ]
    words = (
        f"{', '.join(open_ones)}: the records determine no size unless the other errors are known; the sets below state the "
        "size in each",
    )
    found = flat(
        title=f"Errors of sensors in {len(result.run_ids)} run{'s' * (len(result.run_ids) > 1)}, 95 % intervals",
        columns=("error", "unit", "estimate", "std", "lower", "upper", "declared", "smallest shown", "state"),
        rows=tuple(rows),
        notes=(*(words if open_ones else ()), *(f"{f.name}: {f.meaning}" for f in result.findings)),
    )
    rows = [
        (_judged(c, result), c.distance, c.statistic, "; ".join(_size(f) for f in c.errors) or "none")
        for c in result.causes[:SETS]
    ]
    causes = flat(
        title=f"Sets of errors by one statistic, the best first ({len(result.causes)} compared)",
        columns=("verdict", "distance", "unexplained", "errors"),
        rows=tuple(rows),
        notes=(
            f"absolute test of the best set: chi-square {result.statistic:.1f} with {result.degrees} degrees of freedom, "
            f"p = {result.p_value:.2g}",
        ),
    )
    return found, causes


UNDETERMINED: Final = 3.0
"""Standard error over all sets, relative to that within a possible set, from which an error has no size of its own [-]:
judgement; the sets that hold it then differ by more than the noise."""


def undetermined(result: CheckResult) -> tuple[str, ...]:
    """Errors of a possible set whose size depends on the other errors, so that their average over all sets determines nothing."""
    within: dict[str, float] = {}
    for cause in result.possible:
        for f in cause.errors:
            within.setdefault(f.name, f.std)
    return tuple(f.name for f in result.findings if f.std > UNDETERMINED * within.get(f.name, math.inf))


def _judged(one: PossibleCause, result: CheckResult) -> str:
    if one.possible:
        return "possible"
    names = {f.name for f in one.errors}
    if any(names > {f.name for f in c.errors} for c in result.possible):
        return "not needed"
    odds = math.exp(0.5 * one.distance) if one.distance < 2.0 * math.log(EXCLUDED) else math.inf
    return f"unlikely (1:{odds:.0f})" if odds < EXCLUDED else "excluded"


EXCLUDED: Final = 1000.0
"""Odds against a set, relative to the best one, from which it is called excluded and not unlikely [-] (convention)."""


SETS: Final = 8
"""Largest number of sets in a table [-]: judgement; the result holds all of them."""


def _size(one: Finding) -> str:
    digits = digits_of(one.std)
    return f"{one.name} {one.value:.{digits}f}" + ("" if one.unit == "-" else f" {one.unit}")


__all__ = [
    "CheckResult",
    "Finding",
    "PossibleCause",
    "State",
    "Verdict",
    "digits_of",
    "shown",
    "tables",
    "undetermined",
]
