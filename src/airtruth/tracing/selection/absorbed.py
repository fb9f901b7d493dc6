"""Refits of effects that refitted derivatives may have absorbed, so that they have no score."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.refit import Refit, with_effect
from airtruth.tracing.selection.score_test import Score, ScoreTable
from airtruth.tracing.selection.set_table import SetTable

_USUAL: Final = 0.15
"""Share of its plausible range at which the search for an effect without a score begins [-] (judgement)."""
_LARGE: Final = 0.5
"""Share at which a second search begins where either sign is tried [-] (judgement: near the usual share the derivatives may
keep a large effect in an optimum of their own)."""
RECORDS: Final = 8
"""Largest number of records to which every effect is refitted [-] (judgement: six to eight records name a cause as a rule, and
a planned flight has up to 30)."""
_LEADERS: Final = 4
"""Number of effects that are refitted to all of more records [-] (judgement)."""
Starts = Sequence[tuple[Score, tuple[float, ...]]]
"""Scores, each with the sizes at which a refit of its effect begins."""


def refit_absorbed(
    sets: SetTable,
    null: PosteriorFit,
    table: ScoreTable,
    fits: Sequence[Refit],
    advance: Advance,
    skip: Collection[str] = (),
    *,
    either_sign: bool = False,
    rival: float = np.inf,
    only_better: bool = False,
) -> list[Refit]:
    """The refits with those of effects that refitted derivatives may have absorbed, best first.

    At a null whose derivatives contradict the declaration such an effect has no score; its refit begins at the
    declared aircraft.

    Parameters
    ----------
    fits : refits of the leading candidates; skip : keys of effects that are not refitted.
    either_sign : whether a two-sided size begins at a usual size of either sign, and not at zero.
    rival : cost of another explanation; refits that stay far behind end early.
    only_better : whether a refit that does not lead the rival and the others is of no use.
    """
    known = {r.score.effect.key for r in fits} | set(skip)
    untried = (s for s in table.scores if s.effect.key not in known and len(s.effect.parameters) == 1)
    starts: Starts = [(s, _usual_sizes(s, either_sign)) for s in untried]
    if len(sets.problem.records) > RECORDS:
        starts = _leading_starts(sets, null, starts, advance)
    ahead = min([rival, *(r.fit.cost for r in fits)])
    ends = _refitted(sets, null, starts, advance, "from the declared aircraft", ahead, only_better)
    return sorted([*fits, *(r for r, _ in ends)], key=lambda r: r.cost)


def _refitted(
    sets: SetTable,
    null: PosteriorFit,
    starts: Starts,
    advance: Advance,
    phrase: str,
    rival: float = np.inf,
    only_better: bool = False,
) -> list[tuple[Refit, float]]:
    """Refits from the declared aircraft, each with the size at which it began; rival and only_better as of `refit_absorbed`."""
    found: list[tuple[Refit, float]] = []
    for s, sizes in starts:
        if not may_begin(advance, f"refit {s.effect.key} {phrase}"):
            continue
        for size in sizes:
            ahead = min([rival, *(r.fit.cost for r, _ in found)])
            tried = with_effect(sets, null, s, size, ahead, only_better=only_better)
            if tried is not None:
                found.append((Refit(s, tried, 0.0), size))
    return found


def _usual_sizes(s: Score, either_sign: bool) -> tuple[float, ...]:
    """Sizes at which the search for an effect without a score begins."""
    first = s.effect.parameters[0]
    low, high = first.reach
    if first.one_sided:
        return (_USUAL * high,)
    if not either_sign:
        return (0.0,)
    return tuple(share * end for share in (_USUAL, _LARGE) for end in (high, low))


def _leading_starts(sets: SetTable, null: PosteriorFit, starts: Starts, advance: Advance) -> Starts:
    """The scores of the effects that explain some of the records best, each with the best of its starts."""
    problem = sets.problem
    number = len(problem.records)
    kept = np.linspace(0, number - 1, RECORDS).round().astype(int)
    some = SetTable(replace(problem, records=tuple(problem.records[i] for i in kept)))
    base = some.fit(null.hypothesis, replace(null.point, per_record=null.point.per_record[kept]))
    if base is None:
        return starts
    ends = _refitted(some, base, starts, advance, f"to {RECORDS} of {number} records")
    best: dict[str, tuple[Score, tuple[float, ...]]] = {}
    for r, size in sorted(ends, key=lambda pair: pair[0].cost):
        best.setdefault(r.score.effect.key, (r.score, (size,)))
    return list(best.values())[:_LEADERS]


__all__ = ["RECORDS", "refit_absorbed"]
