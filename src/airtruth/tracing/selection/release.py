"""The declared derivatives against the records: a contradiction, a fit without the declaration, and what explains it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.assess import likelihood_at
from airtruth.tracing.inference.causes import Cause, DeclaredCauses
from airtruth.tracing.inference.derivative_likelihood import (
    Contradiction,
    DerivativeLikelihood,
    derivative_likelihood,
)
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.selection.explanation import (
    WRONG_BY,
    CauseSet,
    explain,
    least_cost,
    predicted_cost,
    simplest_first,
)
from airtruth.tracing.selection.set_table import SetTable

CONTRADICTED: Final = 0.01
"""Probability below which records contradict the declared derivatives [-] (convention: one true declaration in a
hundred is contradicted)."""
_REFITS: Final = 4
"""Number of sets that are refitted in the filter [-] (judgement: each costs a refit)."""
_HOPELESS: Final = 30.0
"""Log-posterior behind the best set from which a set is not refitted [-] (judgement: more than a curve explains)."""


@dataclass(frozen=True)
class Release:
    """The derivatives released from a declaration that the records contradict.

    Attributes
    ----------
    test : of the declaration; fit : every declaration taken as wrong.
    sets : what explains the shifts, that of the answer first (`airtruth.tracing.selection.explanation.simplest_first`).
    strain : log-posterior that the most probable set loses to derivatives without any prior [-].
    refit : the first set as effects of the filter, where it carries all of them; else None.
    corrections : see `DeclaredCauses`.
    """

    test: Contradiction
    fit: PosteriorFit
    sets: tuple[CauseSet, ...]
    strain: float
    refit: PosteriorFit | None = None
    corrections: Mapping[tuple[str, ...], float] = field(default_factory=dict)

    @cached_property
    def cost(self) -> float:
        """Cost of the most probable set, comparable with that of a refitted effect."""
        return least_cost(self.sets)


def released(hypothesis: Hypothesis, problem: TraceProblem) -> Hypothesis:
    """The hypothesis with every declared derivative taken as wrong."""
    spread = (max(WRONG_BY) ** 2 - 1.0) * np.diag(np.diag(problem.declared_covariance))
    return replace(hypothesis, spread=spread)


def release(
    sets: SetTable, null: PosteriorFit, declared: DeclaredCauses, test: Contradiction
) -> Release | None:
    """Where a test contradicts the declaration, fit without it and explain the shifts.

    Parameters
    ----------
    test : of the declaration at ``null``.

    Returns
    -------
    None where the records do not contradict the declaration, or where nothing may explain a contradiction.
    """
    problem = sets.problem
    declared = declared.beside(null.hypothesis)
    allowed = declared.causes or declared.wrong_allowed
    if null.hypothesis.spread is not None or not allowed or test.p_value > CONTRADICTED:
        return None
    free = sets.converged(released(null.hypothesis, problem), null.point, near=null)
    if free is None:
        return None
    own = derivative_likelihood(problem, free)
    explaining = _explaining(own, declared)
    if not explaining:
        return None
    peak = 0.5 * float(own.vector @ np.linalg.pinv(own.information, hermitian=True) @ own.vector)
    explaining, refits, corrections = _refitted(sets, null, free, declared, explaining)
    strain = least_cost(explaining) - (own.cost - peak)
    explaining = simplest_first(explaining)
    return Release(test, free, explaining, strain, refits.get(explaining[0].effects), corrections)


def _refitted(
    sets: SetTable,
    null: PosteriorFit,
    free: PosteriorFit,
    declared: DeclaredCauses,
    explaining: tuple[CauseSet, ...],
) -> tuple[tuple[CauseSet, ...], dict[tuple[str, ...], PosteriorFit], dict[tuple[str, ...], float]]:
    """The sets with the leading ones refitted in the filter, where it carries their effects; best first.

    A shift of the CG bends the moment as the lift is bent, and an inertia stretches it; first order in the derivatives
    does not show this. A set's cost changes by the difference between its refit and what first order predicts.
    """
    effects = {e.key: e for e in declared.effects}
    causes = {c.key: c for c in declared.causes}
    plain = derivative_likelihood(sets.problem, free, robust=False)
    carried = [s for s in explaining if s.causes and not s.wrong and set(s.causes) <= set(effects)]
    refits: dict[tuple[str, ...], PosteriorFit] = {}
    corrections: dict[tuple[str, ...], float] = {}
    for s in carried[:_REFITS]:
        if s.cost > explaining[0].cost + _HOPELESS:
            break
        ahead = min((r.cost for r in refits.values()), default=np.inf)
        own = _as_effects(sets, null, free, s, effects, causes, ahead)
        if own is not None:
            corrections[s.causes] = own.cost - predicted_cost(plain, [causes[key] for key in s.causes])
            refits[s.effects] = own
    return _corrected(explaining, corrections), refits, corrections


def _as_effects(
    sets: SetTable,
    null: PosteriorFit,
    free: PosteriorFit,
    s: CauseSet,
    effects: Mapping[str, Effect],
    causes: Mapping[str, Cause],
    rival: float,
) -> PosteriorFit | None:
    """A set refitted as effects of the filter; None where no start converges before the null. ``rival`` as of `fit`.

    It begins at the declared aircraft, else at the released derivatives, of which first order takes off what the causes bring,
    or at the null, where the records are more likely.
    """
    problem = sets.problem
    hypothesis, sizes = null.hypothesis, list(null.point.sizes)
    away = free.point.common.copy()
    for key, told, std in zip(s.causes, s.sizes, s.size_std, strict=True):
        hypothesis = hypothesis.plus(effects[key])
        low, high = effects[key].parameters[0].reach
        size = min(max(size_in_filter(effects[key], causes[key].most_probable(told, std)), low), high)
        away[problem.layout.common.derivatives] -= (
            size_in_derivatives(effects[key], size) * causes[key].direction
        )
        sizes.append(size)
    first = np.array(sizes)
    own = sets.fit_from_declared(hypothesis, first, null, rival=rival)
    if _leads(own, null):
        return own
    starts = [replace(start, sizes=first) for start in (null.point, replace(free.point, common=away))]
    start = min(starts, key=lambda start: likelihood_at(problem, hypothesis, start))
    own = sets.fit_from(hypothesis, start, rival=rival)
    if own is not None and not own.converged:
        own = sets.converged(hypothesis, start, rival=rival)
    return own if _leads(own, null) else None


def _leads(own: PosteriorFit | None, null: PosteriorFit) -> bool:
    return own is not None and own.converged and own.cost < null.cost


def _corrected(
    sets: Sequence[CauseSet], corrections: Mapping[tuple[str, ...], float]
) -> tuple[CauseSet, ...]:
    """The sets, best first, with the costs of those that were refitted corrected by what first order does not show."""
    every = (s if s.wrong else replace(s, cost=s.cost + corrections.get(s.causes, 0.0)) for s in sets)
    return tuple(sorted(every, key=lambda s: s.cost))


def size_in_filter(effect: Effect, size: float) -> float:
    """Size of a cause's effect in the filter: a mass or inertia divides the coefficients."""
    return size / (1.0 - size) if effect.divides else size


def size_in_derivatives(effect: Effect, size: float) -> float:
    """Inverse of `size_in_filter`."""
    return size / (1.0 + size) if effect.divides else size


def explained(problem: TraceProblem, free: PosteriorFit, declared: DeclaredCauses) -> tuple[CauseSet, ...]:
    """Sets that explain the derivatives of a released fit, that of the answer first; the declaration itself is not among
    them."""
    own = derivative_likelihood(problem, free)
    return simplest_first(_explaining(own, declared.beside(free.hypothesis)))


def _explaining(likelihood: DerivativeLikelihood, declared: DeclaredCauses) -> tuple[CauseSet, ...]:
    sets = explain(likelihood, declared.causes, declared.wrong_allowed)
    return _corrected([s for s in sets if s.effects], declared.corrections)


__all__ = [
    "CONTRADICTED",
    "Release",
    "explained",
    "release",
    "released",
    "size_in_derivatives",
    "size_in_filter",
]
