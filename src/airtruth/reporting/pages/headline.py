"""The headline of a campaign: which method is nearest to the truth, if the runs tell, and intervals that miss it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final

from scipy.stats import binom, t

from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.reporting.paper.comparison import together
from airtruth.reporting.statistics import MethodStatistics, difference
from airtruth.table import significant

LEVEL: Final = 0.05
"""Level of the tests of the headline [-]."""


def definition(motion: Motion) -> str:
    """Meaning of RelErr."""
    words = (
        f"RelErr: norm of the mean error of the {together(motion)} derivatives over the norm of the truth."
    )
    *others, last = motion.unscored or ("",)
    return (
        f"{words} A record does not determine {', '.join(others)} and {last}, which are not counted."
        if last
        else words
    )


def headline(
    statistics: Mapping[str, MethodStatistics],
    flown: int,
    planned: int,
    confidence: float = 0.95,
    motion: Motion = LONGITUDINAL,
) -> list[str]:
    """Sentences of the answer: the comparison of the methods, the intervals that fail, the number of runs.

    Two methods are compared run by run, because both see the same noise: the difference of their RelErr over its
    paired standard error is tested with Student's t.

    Parameters
    ----------
    statistics : method -> its statistics.
    flown, planned : numbers of runs.
    confidence : probability of the intervals [-].
    motion : whose parameters were estimated.
    """
    known = {m: s for m, s in statistics.items() if math.isfinite(s.relerr.value)}
    runs = f"{flown} of {planned} runs flew."
    if not known:
        return ["No method has a converged estimate.", runs]
    ordered = sorted(known, key=lambda m: known[m].relerr.value)
    return [
        _comparison(known, ordered),
        *_failing(known, confidence, motion),
        f"{definition(motion)} {runs}",
    ]


def _comparison(known: Mapping[str, MethodStatistics], ordered: list[str]) -> str:
    best = ordered[0]
    stated = {m: _with_error(known[m]) for m in ordered}
    if len(ordered) == 1:
        return f"The mean derivatives of {best} are off by {stated[best]} (RelErr)."
    second = ordered[1]
    p = _paired_p(known, best, second)
    if p < LEVEL / (len(ordered) - 1):
        words = f"{best} is nearest to the truth: RelErr {stated[best]}, {second} {stated[second]}"
        rest = (
            "" if len(ordered) == 2 else f"; the other methods {stated[ordered[2]]} to {stated[ordered[-1]]}"
        )
        return f"{words}{rest} (paired test over the runs, p = {significant(p, 2)})."
    tied = [best, *(m for m in ordered[1:] if not _paired_p(known, best, m) < LEVEL / (len(ordered) - 1))]
    words = ", ".join(f"{m} {stated[m]}" for m in tied[:_MOST_NAMED])
    more = f" and {len(tied) - _MOST_NAMED} more" if len(tied) > _MOST_NAMED else ""
    why = f"p = {significant(p, 2)}" if math.isfinite(p) else "too few runs"
    return f"These runs do not tell which method is nearest to the truth: RelErr {words}{more} (paired test, {why})."


_MOST_NAMED: Final = 4
"""Most methods that a sentence names [-] (judgement)."""


def _paired_p(known: Mapping[str, MethodStatistics], one: str, other: str) -> float:
    """Two-sided p-value of the difference of two RelErr; NaN where it has no standard error."""
    runs = min(known[m].counts.used for m in (one, other))
    if runs < 2:
        return math.nan
    products = (
        known[one].products.get(one, math.nan),
        known[other].products.get(other, math.nan),
        known[one].products.get(other, math.nan),
    )
    value, error = difference(known[one].relerr.value, known[other].relerr.value, products, runs)
    return float(2.0 * t.sf(abs(value) / error, runs - 1)) if error > 0.0 else math.nan


def _with_error(s: MethodStatistics) -> str:
    value, error = 100.0 * s.relerr.value, 100.0 * s.relerr.se
    shown = significant(value, 2 if abs(value) < _LARGE_PCT else 3)
    return f"{shown} +- {significant(error, 2)} %" if math.isfinite(error) else f"{shown} %"


_LARGE_PCT: Final = 100.0
"""RelErr from which three digits are shown [%] (convention)."""


def _failing(known: Mapping[str, MethodStatistics], confidence: float, motion: Motion) -> Iterator[str]:
    """Intervals that hold the truth in too few runs: exact binomial test, Bonferroni over methods and derivatives."""
    level = LEVEL / (len(known) * len(motion.scored))
    parts = []
    for method, s in known.items():
        used = s.counts.used
        found = []
        for name in motion.scored:
            share = float(s.coverage.value[motion.index(name)])
            if not math.isfinite(share):
                continue
            hits = round(share * used)
            if binom.cdf(hits, used, confidence) < level:
                found.append(f"{name} {hits} of {used}")
        if found:
            parts.append(f"{method}: {', '.join(found)}")
    if parts:
        yield (
            f"The {100.0 * confidence:g} % intervals hold the truth in too few runs ({'; '.join(parts)}): they "
            "count noise, and not errors of the model."
        )


__all__ = ["LEVEL", "definition", "headline"]
