"""The end of a search: its cost, and its last fit under the best explanation of released derivatives."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.selection.explanation import REFERENCE, least_cost
from airtruth.tracing.selection.rounds import Rival, SearchRound
from airtruth.tracing.selection.set_table import SetTable

_ITERATIONS: Final = 6
"""Iterations of the refit under the autoregression [-] (judgement: it begins next to its optimum)."""


def as_declared(sets: SetTable, last: PosteriorFit) -> PosteriorFit | None:
    """The fit under the declaration of the derivatives: released ones absorb what a wrong effect leaves."""
    if last.hypothesis.spread is None:
        return last
    return sets.fit(replace(last.hypothesis, spread=None), last.point, near=last)


def total_cost(last: SearchRound) -> float:
    """Negative log-posterior at the end of a search, with one for each parameter of an effect."""
    if last.null.hypothesis.spread is None:
        own = last.null.cost if last.release is None else last.release.cost
    else:
        own = least_cost(last.sets) if last.sets else np.inf
    return own + len(last.null.point.sizes)


def settled(sets: SetTable, rounds: tuple[SearchRound, ...]) -> tuple[SearchRound, ...]:
    """The rounds with the last fit under the best explanation of the derivatives, where they were released.

    Parameters
    ----------
    rounds : a finished search, with what explains the derivatives at its last null.
    """
    if not rounds or not rounds[-1].sets:
        return rounds
    last = rounds[-1]
    spread = last.sets[0].covariance - sets.problem.declared_covariance
    hypothesis = replace(last.null.hypothesis, spread=spread)
    null = gls = sets.fit(hypothesis, last.null.point, near=last.null) or last.null
    if last.whitener.order:
        again = fit(
            sets.problem, hypothesis, last.gls.point, last.whitener, free_levels=False, iterations=_ITERATIONS
        )
        gls = again or null
    first = next(r.release for r in rounds if r.release is not None)
    end = replace(last, null=null, gls=gls, release=replace(first, fit=last.null, sets=last.sets))
    return (*rounds[:-1], _with_declared(sets, end, last))


def _with_declared(sets: SetTable, end: SearchRound, last: SearchRound) -> SearchRound:
    """The last round with the set of its effects under the declaration, where derivatives are released beside effects."""
    effects = last.null.hypothesis.effects
    if not effects:
        return end
    declared = as_declared(sets, last.null)
    if declared is None:
        return end
    names = tuple(sorted({e.label for e in effects}))
    excess = declared.cost + len(declared.point.sizes) - total_cost(last)
    log_weight = min(0.0, REFERENCE - max(0.0, excess))
    return replace(end, rival=Rival({**(end.rival.sets if end.rival else {}), names: log_weight}))


__all__ = ["as_declared", "settled", "total_cost"]
