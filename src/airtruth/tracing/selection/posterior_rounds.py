"""The rounds of the set that an answer names, from the posterior of all sets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.causes import DeclaredCauses
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.profile import best_location, location_index
from airtruth.tracing.selection.acceptance import (
    Candidate,
    is_plausible,
    predicts_records_left_out,
    untested,
)
from airtruth.tracing.selection.best_first import Names, Posterior, best_first
from airtruth.tracing.selection.budget import Advance
from airtruth.tracing.selection.explanation import simplest
from airtruth.tracing.selection.outcome import settled
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.release import explained
from airtruth.tracing.selection.rounds import RoundStart, SearchRound, search_round
from airtruth.tracing.selection.score_test import Score
from airtruth.tracing.selection.set_table import SetTable

AS_GOOD: Final = 0.05
"""Posterior weight over that of the answer from which a set is as good [-] (judgement: odds of one in twenty)."""


def posterior_search(
    sets: SetTable, begin: RoundStart, seed: int, advance: Advance, declared: DeclaredCauses
) -> tuple[SearchRound, ...]:
    advance("weigh sets of effects")
    found = best_first(sets, begin.hypothesis, begin.start, begin.effects, declared.causes)
    if found is None:
        return ()
    own = _Stated(sets, begin, seed, advance, declared, found)
    return own.rounds()


class _Stated:
    def __init__(
        self,
        sets: SetTable,
        begin: RoundStart,
        seed: int,
        advance: Advance,
        declared: DeclaredCauses,
        found: Posterior,
    ) -> None:
        self.sets, self.begin, self.seed, self.advance = sets, begin, seed, advance
        self.declared, self.found = declared, found
        self.null = found.fits[()]

    def rounds(self) -> tuple[SearchRound, ...]:
        names = self._chosen()
        fitted = self.found.fits[names]
        members = self._ordered(fitted)
        rounds: tuple[SearchRound, ...] = ()
        last = self.null
        for number, effect in enumerate(members):
            following = (
                fitted
                if number + 1 == len(members)
                else self._prefix(members[: number + 1], fitted)
            )
            own = self._scored(last, len(rounds), members)
            if own is None:
                break
            final = number + 1 == len(members)
            if final and location_index(effect) is not None:
                following, profile = best_location(self.sets.problem, following)
                self.sets.keep(following)
            else:
                profile = None
            leader = self._candidate(own, effect, last, following)
            tied = (leader, *self._rivals(own, effect, names, leader))
            rounds = (*rounds, replace(own, candidates=tied, tied=tied, profile=profile, release=None))
            last = following
        own = self._scored(last, len(rounds), members)
        if own is None:
            return rounds
        wanted = self._explaining(names, fitted)
        if not wanted or own.release is None:
            own = replace(own, release=None) if rounds or not wanted else own
            return (*rounds, replace(own, posterior=self.found.weights))
        rounds = (*rounds, own)
        free = own.release.fit
        end = self._scored(free, len(rounds), members)
        if end is None:
            return rounds
        causes = explained(self.sets.problem, free, self.declared)
        first = [s for s in causes if tuple(sorted(s.effects)) == wanted]
        causes = (*first[:1], *(s for s in causes if not first or s is not first[0]))
        corrected = replace(own.release, sets=(*first[:1], *(s for s in own.release.sets if tuple(sorted(s.effects)) != wanted)))
        rounds = (*rounds[:-1], replace(own, release=corrected))
        return settled(self.sets, (*rounds, replace(end, sets=causes, posterior=self.found.weights)))

    def _chosen(self) -> Names:
        """The simplest set that is plausible and predicts the records left out."""
        left = dict(self.found.weights)
        while left:
            names = simplest(left)
            fitted = self.found.fits.get(names)
            if not names:
                return ()
            if fitted is not None and fitted.converged and self._is_sound(fitted):
                return names
            del left[names]
            if () not in left:
                break
        return ()

    def _is_sound(self, fitted: PosteriorFit) -> bool:
        if not fitted.hypothesis.effects:
            return True
        return is_plausible(self.sets.problem, fitted) and predicts_records_left_out(
            self.sets.problem, self.null, fitted
        )

    def _ordered(self, fitted: PosteriorFit) -> list[Effect]:
        weights = self.found.weights
        return sorted(fitted.hypothesis.effects, key=lambda e: -weights.get((e.label,), 0.0))

    def _prefix(self, effects: Sequence[Effect], fitted: PosteriorFit) -> PosteriorFit:
        known = self.found.by_keys.get(frozenset(e.key for e in effects))
        if known is not None and known.hypothesis.spread is None:
            return known
        hypothesis = replace(fitted.hypothesis, effects=tuple(effects), spread=None)
        sizes = np.concatenate([fitted.point.sizes[fitted.hypothesis.span(e.key)] for e in effects])
        own = self.sets.converged(hypothesis, replace(fitted.point, sizes=sizes))
        return own or fitted

    def _scored(self, last: PosteriorFit, count: int, members: Sequence[Effect]) -> SearchRound | None:
        taken = {e.key for e in last.hypothesis.effects}
        left = tuple(e for e in self.begin.effects if e.key not in taken)
        start = RoundStart(
            last.hypothesis, last.point, left, settled=True, scores_only=True, near=last
        )
        return search_round(self.sets, start, count, self.seed, self.advance, self.declared)

    def _candidate(
        self, own: SearchRound, effect: Effect, last: PosteriorFit, following: PosteriorFit
    ) -> Candidate:
        gain = 2.0 * (last.cost - following.cost + 1.0 - len(effect.parameters))
        score = next((s for s in own.table.scores if s.effect.key == effect.key), None)
        if score is None:
            score = replace(own.table.scores[0], effect=effect)
        return _stated(score, effect, following, gain)

    def _rivals(
        self, own: SearchRound, effect: Effect, names: Names, leader: Candidate
    ) -> Iterator[Candidate]:
        weights = self.found.weights
        rest = [n for n in names if n != effect.label]
        least = AS_GOOD * weights[names]
        for score in own.table.scores:
            other = score.effect
            swapped = tuple(sorted({*rest, other.label}))
            if other.key == effect.key or other.label in names or weights.get(swapped, 0.0) < least:
                continue
            fitted = self.found.fits.get(swapped)
            if fitted is None or other.key not in [e.key for e in fitted.hypothesis.effects]:
                continue
            gain = leader.gain + 2.0 * float(np.log(weights[swapped] / weights[names]))
            yield _stated(score, other, fitted, gain)

    def _explaining(self, names: Names, fitted: PosteriorFit) -> Names:
        carried = {e.label for e in fitted.hypothesis.effects}
        return tuple(sorted(n for n in names if n not in carried))


def _stated(score: Score, effect: Effect, fitted: PosteriorFit, gain: float) -> Candidate:
    at = fitted.hypothesis.span(effect.key).start
    nothing = np.full(len(fitted.likelihood), np.nan)
    return Candidate(
        score, fitted, gain, nothing, nothing, float(fitted.point.sizes[at]), fitted.size_std(at), ()
    )
