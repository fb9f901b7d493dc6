"""Gains of the refitted candidates, compared under one autoregression, and the tests of those that lead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.whitening import Whitener, autoregression
from airtruth.tracing.selection.acceptance import (
    Candidate,
    assess_candidate,
    implausibility,
    reference_of,
    untested,
)
from airtruth.tracing.selection.refit import Refit
from airtruth.tracing.selection.refusal import Refusal

TIE: Final = 6.0
"""Difference in 2 log L up to which two effects explain the records equally well [-] (judgement: a likelihood ratio of
20; a wider tie names more look-alikes, a narrower one names a wrong effect more often)."""
_NEAR: Final = 30.0
"""Difference in log L up to which candidates are compared under one autoregression [-] (judgement: wide enough for
the change of a gain by the autoregression)."""
WHITENED_ITERATIONS: Final = 6
"""Iterations of a refit under an autoregression [-] (judgement: it begins next to its optimum)."""


def rank(
    problem: TraceProblem,
    null: PosteriorFit,
    fits: Sequence[Refit],
    least: float,
    replacement: tuple[str, str] | None = None,
    leader: str = "",
    in_set: bool = False,
) -> tuple[Candidate, ...]:
    """Rank the refitted candidates by their gain, and test those that lead.

    Parameters
    ----------
    fits : refits, best first; least : gain in 2 log L that is significant.
    replacement : keys (old, new); the old effect explains nothing beside the new one.
    leader : key of the effect that leads whatever others gain, because the set with it explains more; "" for none. Records
        left out test the set and not its leader: a true effect can make them worse while another is missing.
    in_set : whether that set has been fitted, so that no test of the leader alone refuses it.
    """
    if not fits:
        return ()
    gains = gains_of(problem, null, fits)
    ranked = sorted(((gains[r.score.effect.key], r) for r in fits), key=lambda g: -g[0])
    reference = reference_of(problem, null)
    candidates: list[Candidate] = []
    accepted, leading = -np.inf, ""
    led = gains.get(leader, np.inf)
    for gain, r in ranked:
        if leader in gains and gain > led:
            candidates.append(untested(r.score, r.fit, gain, Refusal.SURPASSED))
            continue
        if replacement is not None and r.score.effect.key == replacement[0]:
            candidates.append(untested(r.score, r.fit, gain, Refusal.SUPERSEDED, f"that is {replacement[1]}"))
            continue
        if gain < accepted - TIE and r.score.effect.label != leading:
            implausible = implausibility(problem, r.score.effect, r.fit)
            candidates.append(untested(r.score, r.fit, gain, Refusal.OUTDONE, *implausible))
            continue
        candidate = assess_candidate(problem, r.score, r.fit, gain, reference, least)
        if r.score.effect.key == leader:
            alone = (
                set(candidate.reasons) - {Refusal.UNCONVERGED}
                if in_set
                else {Refusal.WORSE_LIKELIHOOD, Refusal.WORSE_FREE_RUN}
            )
            still = (why for why in candidate.reasons if why not in alone)
            candidate = replace(candidate, reasons=tuple(still))
        if gain < accepted - TIE:
            candidate = replace(candidate, reasons=(*candidate.reasons, Refusal.OUTDONE))
        candidates.append(candidate)
        if not np.isfinite(accepted) and set(candidate.reasons) <= {Refusal.IMMATERIAL, Refusal.UNCONVERGED}:
            accepted = gain  # an effect that explains less than an immaterial one is not the cause either
            leading = r.score.effect.label
    return tuple(candidates)


def gains_of(problem: TraceProblem, null: PosteriorFit, fits: Sequence[Refit]) -> dict[str, float]:
    """Key -> gain in 2 log L over the null; those near the best under the autoregression of its innovations.

    Parameters
    ----------
    fits : refits, best first.
    """
    best = fits[0].fit
    gains = {r.score.effect.key: 2.0 * (null.cost + 1.0 - r.cost) for r in fits}
    near = [r for r in fits if r.fit.cost - best.cost < _NEAR]
    whitener = autoregression(best.innovations)
    if whitener.order and len(near) > 1:
        costs = {
            r.score.effect.key: _whitened_cost(problem, r.fit, whitener, best)
            + r.freedom_correction
            + r.parameters
            for r in near
        }
        top, lowest = max(gains[key] for key in costs), min(costs.values())
        gains |= {key: top - 2.0 * (cost - lowest) for key, cost in costs.items()}
    return gains


def _whitened_cost(
    problem: TraceProblem, own: PosteriorFit, whitener: Whitener, levels: PosteriorFit
) -> float:
    """Cost under an autoregression, at the noise and gust levels of another fit, so that only the motion counts."""
    start = own.point.with_levels(levels.point)
    again = fit(
        problem, own.hypothesis, start, whitener, iterations=WHITENED_ITERATIONS, free_levels=False, near=own
    )
    return np.inf if again is None else again.cost


__all__ = ["TIE", "WHITENED_ITERATIONS", "gains_of", "rank"]
