"""One round of the search: the null, the scores at it, the refits, and the effects that explain the records best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.causes import DeclaredCauses
from airtruth.tracing.inference.derivative_likelihood import Contradiction, contradiction
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.profile import Profile, best_location, location_index
from airtruth.tracing.inference.whitening import Whitener, autoregression
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection import score_test
from airtruth.tracing.selection.absorbed import refit_absorbed
from airtruth.tracing.selection.acceptance import Candidate, has_converged
from airtruth.tracing.selection.budget import Advance
from airtruth.tracing.selection.explanation import CauseSet
from airtruth.tracing.selection.omnibus import anomalies
from airtruth.tracing.selection.ranking import TIE, WHITENED_ITERATIONS, rank
from airtruth.tracing.selection.refit import (
    LEADING,
    LED,
    Refit,
    better_null,
    refit_known,
    refit_leaders,
)
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.release import Release, explained, release
from airtruth.tracing.selection.score_test import ScoreTable
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import (
    BEYOND_DOUBT,
    LATER_LEVEL,
    LEVEL,
    MISFIT_FAMILY_LEVEL,
    MISFIT_LEVEL,
    later_gain,
    significant_gain,
    strongest,
)

Array = NDArray[np.float64]

MOST_EFFECTS: Final = 3
"""Largest number of effects that a trace accepts [-] (judgement: each costs a round, and four in a few records have
not been separable)."""
_RESTARTS: Final = 2
"""Number of times that a round begins again at a better optimum of its null [-] (judgement: one has been enough)."""
NOTHING_KNOWN: Final[Mapping[str, float]] = MappingProxyType({})
"""No effect has a size that is known beforehand."""
NOTHING_DECLARED: Final = DeclaredCauses(wrong_allowed=False)
"""No explanation of a contradiction: the declared derivatives are not tested."""
_STRAINED: Final = 15.0
"""Loss of log-posterior against unconstrained derivatives above which a sensor error may be hidden in an explanation of the
derivatives, so that effects are refitted from the declared aircraft [-] (judgement: one physical cause loses 6, two wrong
declarations lose 8)."""
_RELEASE_LEADS: Final = 30.0
"""Gain in 2 log L by which released derivatives have to lead for no effect to be followed beside them [-] (judgement: what a
later effect may still add to it)."""
_FAR: Final = 5.0
"""Distance in standard errors from which the refit under the autoregression is discarded [-] (judgement)."""


@dataclass(frozen=True)
class RoundStart:
    """Where a round begins.

    Attributes
    ----------
    hypothesis, start : effects accepted so far, and where the search for its parameters begins.
    effects : candidates of the round.
    replacement : keys (old, new) of an effect that became redundant and of the one that replaces it; usually None.
    settled : whether the round follows a replacement or a choice between tied effects; neither is made twice.
    scores_only : whether the candidates are scored and none is refitted.
    leader : key of the effect that leads the round, whatever others gain; "" for the one that gains most.
    in_set : whether the leader belongs to a set that has been fitted, so that no test of it alone refuses it.
    near : a fit near the start, whose derivatives the first steps use.
    """

    hypothesis: Hypothesis
    start: Parameters
    effects: tuple[Effect, ...]
    replacement: tuple[str, str] | None = None
    settled: bool = False
    scores_only: bool = False
    leader: str = ""
    in_set: bool = False
    near: PosteriorFit | None = None

    @property
    def tested(self) -> int:
        """Number of candidates of the whole search."""
        return len(self.effects) + len(self.hypothesis.effects)


@dataclass(frozen=True)
class Rival:
    """A branch of the search that lost.

    Attributes
    ----------
    sets : names of each set that it leaves -> logarithm of its weight beside the set of the branch that remains.
    """

    sets: Mapping[tuple[str, ...], float]


@dataclass(frozen=True)
class SearchRound:
    """One round: its null, the scores at it, and the refitted candidates.

    Attributes
    ----------
    null : fit of the effects accepted so far, noise levels free; gls : the same under ``whitener``.
    omnibus : tests that name no effect.
    adjusted : Holm's p-values of the scores in the table.
    candidates : refitted candidates, best first.
    tied : the best accepted candidate and those that explain the records as well; empty if none was accepted.
    profile : likelihood of the best accepted candidate over its location; None where it has no location.
    declared_test : test of the declared derivatives at the null.
    release : the derivatives released from a declaration that the records contradict; None where they do not.
    sets : what explains the derivatives at a null that is released, that of the answer first; empty at any other.
    rival : the branch of the search that began at this round and lost; None where there is none.
    exchanged : fits with one effect of the null exchanged for a rival, where the search has tried them.
    """

    null: PosteriorFit
    gls: PosteriorFit
    whitener: Whitener
    table: ScoreTable
    omnibus: tuple[HypothesisTest, ...]
    adjusted: Array
    candidates: tuple[Candidate, ...]
    tied: tuple[Candidate, ...]
    declared_test: Contradiction
    profile: Profile | None = None
    release: Release | None = None
    sets: tuple[CauseSet, ...] = ()
    rival: Rival | None = None
    exchanged: tuple[PosteriorFit, ...] = ()
    posterior: Mapping[tuple[str, ...], float] = field(default_factory=dict)

    @property
    def reported(self) -> PosteriorFit:
        """The fit whose sizes are reported: that under the autoregression, where it moved away from the null."""
        stayed = np.array_equal(self.gls.point.common, self.null.point.common)
        return self.null if stayed else self.gls

    @property
    def release_gain(self) -> float:
        """Gain in 2 log L of the released derivatives over the null, comparable with `Candidate.gain`."""
        return -np.inf if self.release is None else 2.0 * (self.null.cost + 1.0 - self.release.cost)

    @property
    def release_leads(self) -> bool:
        """Whether released derivatives explain the records so much better that no effect is followed instead.

        Where no cause explains the derivatives well, an effect is followed however much they gain: they may have
        absorbed it.
        """
        if self.release is None or self.release.strain > _STRAINED:
            return False
        return not self.tied or self.release_gain > self.tied[0].gain + _RELEASE_LEADS

    @property
    def anomaly(self) -> HypothesisTest:
        """The strongest evidence of a missing effect, a score or an omnibus test; p-value by Bonferroni's rule."""
        return strongest(self.omnibus, self.table, self.adjusted)

    def p_value_of(self, where: str) -> float:
        """P-value of an omnibus test, 1 where it was not made [-]."""
        return next((a.p_value for a in self.omnibus if a.null == where), 1.0)


def search_round(
    sets: SetTable,
    begin: RoundStart,
    count: int,
    seed: int,
    advance: Advance,
    declared: DeclaredCauses = NOTHING_DECLARED,
    known: Mapping[str, float] = NOTHING_KNOWN,
) -> SearchRound | None:
    """Run one round.

    Parameters
    ----------
    sets : fits of the search; begin : null and candidates of the round; count : number of rounds before it.
    seed : seed of the draws behind p-values; advance : receives the step that begins.
    declared : candidates that explain a contradiction of the declared derivatives.
    known : effects that are always refitted, with the value at which their refit begins.

    Returns
    -------
    The round; None where not even its null can be fitted.
    """
    problem, start, near, restarts = sets.problem, begin.start, begin.near, _RESTARTS
    if near is not None:
        sets.keep(near)
    while True:
        advance(f"round {count + 1}: refit without further effects")
        null = sets.fit(begin.hypothesis, start, near=near)
        if null is None:
            return None
        whitener = autoregression(null.innovations)
        gls = null if whitener.order == 0 else _refit_whitened(problem, null, whitener)
        advance(f"round {count + 1}: score {len(begin.effects)} effects")
        table = score_test.table(gls, problem, begin.effects, whitener, seed)
        adjusted = score_test.holm([s.p_value for s in table.scores])
        omnibus = anomalies(gls, problem, whitener)
        anomaly = strongest(omnibus, table, adjusted)
        candidates: tuple[Candidate, ...] = ()
        test = contradiction(problem, null)
        free = release(sets, null, declared, test)
        if len(begin.hypothesis.effects) < MOST_EFFECTS and not begin.scores_only:
            later = MISFIT_LEVEL if anomaly.p_value < BEYOND_DOUBT else LATER_LEVEL
            level = later if count else LEVEL
            # the released derivatives contain these causes, alone and together
            skip = declared.keys if free is not None or begin.hypothesis.spread is not None else ()
            rival = free.cost if free is not None and free.strain < _STRAINED else np.inf
            passing = adjusted <= level
            wanted = begin.replacement or ((begin.leader,) if begin.leader else ())
            most = LED if begin.leader else LEADING
            fits = refit_leaders(sets, null, table, passing, advance, wanted, skip, rival, most)
            if free is not None and _may_hide_effects(free, fits):
                fits = refit_absorbed(sets, null, table, fits, advance, skip)
            if known:
                fits = refit_known(sets, null, table, fits, known, advance)
            better = better_null(sets, null, fits) if restarts else None
            if better is not None:
                start, near, restarts = better.point, better, restarts - 1
                continue
            least = later_gain(begin.tested, anomaly) if count else significant_gain(begin.tested)
            candidates = rank(problem, null, fits, least, begin.replacement, begin.leader, begin.in_set)
        causes = () if begin.hypothesis.spread is None else explained(problem, null, declared)
        own = SearchRound(
            null,
            gls,
            whitener,
            table,
            omnibus,
            adjusted,
            candidates,
            _tied(candidates),
            test,
            release=free,
            sets=causes,
        )
        if own.release_leads:
            own = replace(own, tied=())
        return at_best_location(sets, _with_evidence(own, begin), advance)


def scored_round(
    sets: SetTable,
    fitted: PosteriorFit,
    effects: Sequence[Effect],
    count: int,
    seed: int,
    advance: Advance,
) -> SearchRound | None:
    """A round that begins at a fit and scores the candidates that are not in it; none is refitted.

    Parameters
    ----------
    effects : candidates of the search; count, seed, advance : as of `search_round`.
    """
    taken = {e.key for e in fitted.hypothesis.effects}
    left = tuple(e for e in effects if e.key not in taken)
    begin = RoundStart(fitted.hypothesis, fitted.point, left, settled=True, scores_only=True, near=fitted)
    return search_round(sets, begin, count, seed, advance)


def _may_hide_effects(free: Release, fits: Sequence[Refit]) -> bool:
    """Whether released derivatives may have absorbed an effect: no cause explains them well, nor any refit better."""
    best = min((r.cost for r in fits), default=np.inf)
    return free.strain > _STRAINED and best > free.cost - _STRAINED


def at_best_location(sets: SetTable, own: SearchRound, advance: Advance) -> SearchRound:
    """The round with its leader at its best location, where the leader has a location."""
    if not own.tied or location_index(own.tied[0].score.effect) is None:
        return replace(own, profile=None)
    first = own.tied[0]
    advance(f"location of {first.score.effect.key}")
    best, profile = best_location(sets.problem, first.fit)
    sets.keep(best)
    leader = replace(first, fit=best)
    candidates = tuple(leader if c is first else c for c in own.candidates)
    return replace(own, candidates=candidates, tied=(leader, *own.tied[1:]), profile=profile)


def _refit_whitened(problem: TraceProblem, null: PosteriorFit, whitener: Whitener) -> PosteriorFit:
    """The null under an autoregression; at the null's own parameters where the refit leads far away.

    An autoregression of a misfit can absorb the very motion that shows the derivatives.
    """
    again = fit(
        problem,
        null.hypothesis,
        null.point,
        whitener,
        iterations=WHITENED_ITERATIONS,
        free_levels=False,
        near=null,
    )
    if again is not None:
        rows = null.layout.of.common.derivatives
        std = np.sqrt(np.diag(null.covariance)[rows])
        if (np.abs(again.point.common[rows] - null.point.common[rows]) < _FAR * std).all():
            return again
    return (
        fit(problem, null.hypothesis, null.point, whitener, iterations=0, free_levels=False, near=null)
        or null
    )


def _with_evidence(own: SearchRound, begin: RoundStart) -> SearchRound:
    """The round without an effect where no test of the declared aircraft is significant over all tests.

    The scores are tested at `LEVEL` among themselves; with the tests that name no effect they are a larger family. A refit that
    gains as much as one beside an anomaly beyond doubt has to needs no such test: refitted derivatives may hide an effect from
    every score.
    """
    if begin.hypothesis.effects or begin.leader or own.release is not None or not own.tied:
        return own
    if own.anomaly.p_value <= LEVEL or own.tied[0].gain >= significant_gain(
        begin.tested, MISFIT_FAMILY_LEVEL
    ):
        return own
    weak = (replace(c, reasons=(*c.reasons, Refusal.UNSUPPORTED)) for c in own.candidates)
    return replace(own, tied=(), candidates=tuple(weak))


def _tied(candidates: tuple[Candidate, ...]) -> tuple[Candidate, ...]:
    """The best accepted candidate and those within `TIE` of it."""
    accepted = [c for c in candidates if not c.reasons]
    if not accepted:
        return ()
    best = accepted[0]
    others = (
        c
        for c in candidates
        if c is not best and c.reasons[:1] not in ((Refusal.SUPERSEDED,), (Refusal.SURPASSED,))
    )
    near = (c for c in others if abs(best.gain - c.gain) <= TIE and has_converged(c.fit, c.gain))
    return (best, *near)


__all__ = [
    "RoundStart",
    "SearchRound",
    "at_best_location",
    "scored_round",
    "search_round",
]
