"""The search: rounds of scoring, refitting and acceptance until no further effect is accepted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.causes import DeclaredCauses
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.profile import relocated
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.absorbed import refit_absorbed
from airtruth.tracing.selection.acceptance import Candidate, is_plausible, predicts_records_left_out
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.exchange import AHEAD, BETTER, better_set
from airtruth.tracing.selection.explanation import events
from airtruth.tracing.selection.outcome import CLEAN, STRONG_ODDS, Outcome, required_lead, settled, total_cost
from airtruth.tracing.selection.refit import redundant_effect
from airtruth.tracing.selection.refusal import Refusal
from airtruth.tracing.selection.release import Release
from airtruth.tracing.selection.rounds import (
    NOTHING_DECLARED,
    NOTHING_KNOWN,
    RoundStart,
    SearchRound,
    at_best_location,
    search_round,
)
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import REMAINS, later_gain, significant_gain
from airtruth.tracing.selection.weights import rival_of, with_rival

_ALTERNATIVES: Final = 2
"""Number of tied effects to try instead of the leader [-] (judgement: each costs the rounds that follow)."""
_EXCHANGES: Final = 2
"""Number of better sets that a search follows, one after another [-] (judgement: each costs the rounds that lead to it)."""
_WEAK: Final = 40.0
"""Gain in 2 log L of a single effect below which one that refitted derivatives had absorbed may explain more [-] (judgement)."""
_EFFECT_LEADS: Final = 30.0
"""Gain in 2 log L by which an effect has to lead for the released derivatives not to be followed beside it [-]
(judgement: what a later effect may still add to them)."""


def search(
    sets: SetTable,
    hypothesis: Hypothesis,
    start: Parameters,
    effects: Sequence[Effect],
    seed: int,
    advance: Advance = lambda step: None,
    declared: DeclaredCauses = NOTHING_DECLARED,
    known: Mapping[str, float] = NOTHING_KNOWN,
    other: Sequence[Effect] = (),
    causes: Sequence[frozenset[str]] = (),
) -> tuple[SearchRound, ...]:
    """Rounds of scoring, refitting and acceptance, until nothing more is accepted.

    Where the records contradict the declared derivatives, the search follows two branches: effects that the
    derivatives cannot express, and derivatives released from their declaration. The branch of the larger posterior
    remains.

    Parameters
    ----------
    sets : fits of the search.
    hypothesis, start : the declared aircraft, and where the search for its parameters begins.
    effects : candidates.
    seed : seed of the random draws behind p-values.
    advance : receives the step that begins.
    declared : candidates that explain a contradiction of the declared derivatives.
    known : effects that are always refitted, with the value [SI] at which their refit begins.
    other : effects that another search accepted, in their order; they lead a further search where this one lacks any.
    causes : sets of errors of sensors, each of which explains the kinematics of the records; none where nothing is known.
    """
    first = RoundStart(hypothesis, start, tuple(effects))
    own = _Search(sets, seed, advance, declared, known, tuple(causes))
    rounds = own.improved(first, own.rounds((first,), ()))
    if rounds and {e.key for e in other} - {e.key for e in rounds[-1].null.hypothesis.effects}:
        rounds = own.led(first, other, rounds)
    return settled(sets, rounds)


@dataclass(frozen=True)
class _Search:
    """Common inputs of every round of a search."""

    sets: SetTable
    seed: int
    advance: Advance
    declared: DeclaredCauses
    known: Mapping[str, float]
    causes: tuple[frozenset[str], ...]

    def rounds(
        self, starts: tuple[RoundStart, ...], before: tuple[SearchRound, ...]
    ) -> tuple[SearchRound, ...]:
        """Finished rounds from the last of ``starts`` on, after those before it."""
        current = starts[-1]
        own = search_round(
            self.sets, current, len(before), self.seed, self.advance, self.declared, self.known
        )
        if own is None:
            return before
        if own.release is not None:
            return self._branches(starts, before, own, own.release)
        return self._accepting(starts, (*before, own))

    def improved(self, first: RoundStart, rounds: tuple[SearchRound, ...]) -> tuple[SearchRound, ...]:
        """The rounds, or those of a set that explains more: led by what the kinematic check names, or by an exchange."""
        if not rounds:
            return rounds
        for cause in self.causes:
            members = tuple(e for e in first.effects if e.key in cause)
            reached = self._outcome(rounds[-1])
            if len(members) == len(cause) and reached.is_misfit and not reached.agrees:
                rounds = self.led(first, members, rounds)
        weak = [r.tied[0].gain < _WEAK for r in rounds if r.tied]
        if (rounds[-1].anomaly.p_value < REMAINS or weak == [True]) and len(
            rounds[-1].null.hypothesis.effects
        ) < 2:
            rounds = self._with_absorbed(first, rounds, beside=not any(weak))
        for count in range(_EXCHANGES + 1):
            is_single = len(rounds[-1].null.hypothesis.effects) + len(rounds[-1].sets[:1]) < 2
            if is_single and rounds[-1].anomaly.p_value > REMAINS:
                return rounds
            last = self.sets.declared(rounds[-1].null)
            if last is None:
                return rounds
            least = later_gain(first.tested, rounds[-1].anomaly)
            better = better_set(self.sets, rounds, last, first.effects, least, self.advance)
            if better is None or count == _EXCHANGES:
                break
            before, rounds = rounds, self.led(first, better, rounds, 0.5 * AHEAD, as_set=True)
            if rounds[-1].null is before[-1].null:
                break
        if last is rounds[-1].null:
            rounds = (*rounds[:-1], replace(rounds[-1], exchanged=self.sets.exchanges(last)))
        return rounds

    def _outcome(self, last: SearchRound) -> Outcome:
        accepted = {e.key for e in last.null.hypothesis.effects}
        agrees = not self.causes or any(cause <= accepted for cause in self.causes)
        return Outcome(len(_effects_of(last)), last.anomaly.p_value, agrees)

    def _with_absorbed(
        self, first: RoundStart, rounds: tuple[SearchRound, ...], beside: bool
    ) -> tuple[SearchRound, ...]:
        """The rounds, or those led by an effect that refitted derivatives had absorbed, so that it had no score.

        Parameters
        ----------
        beside : whether it is refitted beside the accepted effect, and not in its place.
        """
        last = rounds[-1]
        accepted = last.null.hypothesis.effects
        base = last if beside else rounds[0]
        null = self.sets.declared(base.null)
        if null is None:
            return rounds
        taken = {e.key for e in accepted}
        cost = total_cost(last)
        fits = refit_absorbed(
            self.sets,
            null,
            base.table,
            (),
            self.advance,
            taken,
            either_sign=True,
            rival=cost,
            only_better=True,
        )
        if not fits or fits[0].cost > cost:
            return rounds
        effect = fits[0].score.effect
        size = effect.parameters[0].value(fits[0].size)
        leaders = (*(accepted if beside else ()), effect)
        return replace(self, known={**self.known, effect.key: size}).led(first, leaders, rounds)

    def led(
        self,
        first: RoundStart,
        effects: Sequence[Effect],
        rounds: tuple[SearchRound, ...],
        lead: float = BETTER,
        as_set: bool = False,
    ) -> tuple[SearchRound, ...]:
        """The rounds of a search that accepts these effects first, if they lead others by a log-posterior (`required_lead`)
        and predict the records left out. The search that loses is a rival of the other one.

        Parameters
        ----------
        as_set : whether the effects have been fitted together: no test of one of them alone refuses the set.
        """
        starts: tuple[RoundStart, ...] = (first,)
        again: tuple[SearchRound, ...] = ()
        for effect in effects:
            if not may_begin(self.advance, f"search led by {effect.key}"):
                return rounds
            begin = replace(starts[-1], leader=effect.key, in_set=as_set, settled=True)
            known = {key: value for key, value in self.known.items() if key == effect.key}
            own = search_round(self.sets, begin, len(again), self.seed, self.advance, known=known)
            if own is None or not own.tied or own.tied[0].score.effect.key != effect.key:
                return rounds
            fitted = relocated(self.sets.problem, own.tied[0].fit, placed=effect.key)
            again = (*again, replace(own, release=None))
            accepted = {effect.key, *(e.key for e in fitted.hypothesis.effects)}
            left = tuple(e for e in begin.effects if e.key not in accepted)
            starts = (*starts, RoundStart(fitted.hypothesis, fitted.point, left, settled=True, near=fitted))
        again = self.rounds(starts, again)
        if not is_plausible(self.sets.problem, again[-1].null):
            return rounds
        needed = required_lead(self._outcome(rounds[-1]), self._outcome(again[-1]), lead)
        if total_cost(again[-1]) >= total_cost(rounds[-1]) - needed:
            return with_rival(rounds, again)
        if not predicts_records_left_out(self.sets.problem, again[0].null, again[-1].null):
            return rounds
        return with_rival(again, rounds)

    def _branches(
        self,
        starts: tuple[RoundStart, ...],
        before: tuple[SearchRound, ...],
        own: SearchRound,
        release: Release,
    ) -> tuple[SearchRound, ...]:
        """The better of the rounds after an effect and after the release of the derivatives; the one of fewer effects
        unless the odds against it are strong."""
        ends = []
        if own.tied:
            ends.append(self._accepting(starts, (*before, replace(own, release=None))))
        phrase, leads = "release the derivatives from their declaration", own.tied[:1]
        if not leads:
            self.advance(phrase)
        behind = not leads or leads[0].gain < own.release_gain + _EFFECT_LEADS
        if behind and (not leads or may_begin(self.advance, phrase)):
            left = tuple(e for e in starts[-1].effects if e.key not in self.declared.keys)
            fitted = relocated(self.sets.problem, release.refit or release.fit)
            following = RoundStart(fitted.hypothesis, fitted.point, left, settled=True, near=fitted)
            corrected = replace(self, declared=replace(self.declared, corrections=release.corrections))
            ends.append(
                corrected.rounds((*starts, following), (*before, replace(own, tied=(), profile=None)))
            )
        if len(ends) == 1:
            return ends[0]
        costs = np.array([total_cost(rounds[-1]) for rounds in ends])
        if all(rounds[-1].sets for rounds in ends):
            # An effect beside released derivatives has to be significant.
            handicap = BETTER * np.array([events(_names(r[-1])) for r in ends])
        else:
            counts = np.array([events(_effects_of(r[-1])) for r in ends])
            handicap = -STRONG_ODDS * (counts > counts.min())
        best = int(np.argmin(costs + handicap))
        won, lost = ends[best], ends[1 - best]
        rival = rival_of(lost, float(costs[1 - best] - costs[best]))
        at = len(before)
        return (*won[:at], replace(won[at], rival=rival), *won[at + 1 :])

    def _accepting(
        self, starts: tuple[RoundStart, ...], rounds: tuple[SearchRound, ...]
    ) -> tuple[SearchRound, ...]:
        """The rounds with what follows the last one's accepted effect."""
        current, own = starts[-1], rounds[-1]
        if not own.tied:
            return rounds
        if not current.settled:
            replaced = self._replacing(starts, rounds)
            if replaced is not None:
                return replaced
        ends = self._onwards(starts, rounds, current.settled)
        if current.settled or _is_clean(ends, len(rounds)):
            return ends
        return self._with_alternative(starts, rounds, ends)

    def _replacing(
        self, starts: tuple[RoundStart, ...], rounds: tuple[SearchRound, ...]
    ) -> tuple[SearchRound, ...] | None:
        """The search with the last effect in place of an earlier one that it makes redundant."""
        best = rounds[-1].tied[0]
        effect = redundant_effect(self.sets, best.fit, significant_gain(starts[-1].tested))
        if effect is None:
            return None
        index = [i for i, r in enumerate(rounds) if r.tied][effect]
        old, new = rounds[index].tied[0].score.effect.key, best.score.effect.key
        if not may_begin(self.advance, f"{new} instead of {old}"):
            return None
        again = replace(starts[index], start=rounds[index].null.point, replacement=(old, new), settled=True)
        other = self.rounds((*starts[:index], again), rounds[:index])
        return other if len(other) > index and other[index].tied else None

    def _with_alternative(
        self,
        starts: tuple[RoundStart, ...],
        rounds: tuple[SearchRound, ...],
        ends: tuple[SearchRound, ...],
    ) -> tuple[SearchRound, ...]:
        """The first search that explains the records with an effect that ties with the leader, or is its variant.

        It needs no later effect; or with later ones it leads ``ends``, the search with the leader, and leaves no larger anomaly.
        """
        own = rounds[-1]
        best = own.tied[0]
        for rival in (*own.tied[1 : 1 + _ALTERNATIVES], *_variants(own)):
            if not may_begin(self.advance, f"{rival.score.effect.key} instead of {best.score.effect.key}"):
                return ends
            rest = (c for c in own.tied if c.score.effect.label != rival.score.effect.label)
            led = at_best_location(self.sets, replace(own, tied=(rival, *rest)), self.advance)
            tried = self._onwards(starts, (*rounds[:-1], led), True)
            leads = total_cost(tried[-1]) < total_cost(ends[-1]) - BETTER
            leaves_more = tried[-1].anomaly.p_value < min(CLEAN, ends[-1].anomaly.p_value)
            if _is_clean(tried, len(rounds)) or (leads and not leaves_more):
                return tried
        return ends

    def _onwards(
        self, starts: tuple[RoundStart, ...], rounds: tuple[SearchRound, ...], settled: bool
    ) -> tuple[SearchRound, ...]:
        """The rounds after one that has accepted an effect."""
        first = rounds[-1].tied[0]
        fitted = relocated(self.sets.problem, first.fit, placed=first.score.effect.key)
        accepted = {e.key for e in fitted.hypothesis.effects}
        effects = tuple(e for e in starts[-1].effects if e.key not in accepted)
        following = RoundStart(fitted.hypothesis, fitted.point, effects, settled=settled, near=fitted)
        return self.rounds((*starts, following), rounds)


def _names(last: SearchRound) -> tuple[str, ...]:
    """Names of the accepted effects of a branch that ends with this round."""
    return tuple(e.label for e in last.null.hypothesis.effects)


def _effects_of(last: SearchRound) -> tuple[str, ...]:
    """The same with those that explain its derivatives."""
    return (*_names(last), *(last.sets[0].effects if last.sets else ()))


def _variants(own: SearchRound) -> tuple[Candidate, ...]:
    """Other variants of the leader that pass every test but gain less.

    A break can stand in for a curve, and then leaves a larger residual.
    """
    best = own.tied[0]
    return tuple(
        replace(c, reasons=())
        for c in own.candidates
        if c.score.effect.label == best.score.effect.label
        and c.reasons == (Refusal.OUTDONE,)
        and np.isfinite(c.likelihood_gain).all()
    )


def _is_clean(rounds: Sequence[SearchRound], count: int) -> bool:
    """Whether the first ``count`` rounds explain the records: no later effect, and no anomaly that remains."""
    return not any(r.tied for r in rounds[count:]) and rounds[-1].anomaly.p_value > CLEAN


__all__ = ["search"]
