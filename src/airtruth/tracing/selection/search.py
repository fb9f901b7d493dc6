"""The search of a trace: the posterior of the sets of effects, and the rounds of the set that the answer states."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.tracing.anomalies.score_test import Score
from airtruth.tracing.budget import Advance
from airtruth.tracing.inference.causes import DeclaredCauses
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.profile import best_location, location_index, relocated
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.best_first import best_first
from airtruth.tracing.selection.candidate import Candidate
from airtruth.tracing.selection.explanation import shares, simplest
from airtruth.tracing.selection.posterior import EvaluatedSet, Names, Posterior
from airtruth.tracing.selection.rounds import SearchRound, scored
from airtruth.tracing.selection.set_table import SetTable, in_order_of


def search(
    sets: SetTable,
    hypothesis: Hypothesis,
    start: Parameters,
    effects: Sequence[Effect],
    seed: int,
    declared: DeclaredCauses,
    advance: Advance = lambda step: None,
    required: Collection[str] = (),
    known: Sequence[Mapping[str, float]] = (),
) -> tuple[SearchRound, ...]:
    """The rounds of the set that an answer states; none where not even the declared aircraft can be fitted.

    It is the simplest set within the odds (`airtruth.tracing.selection.explanation.simplest`) whose sizes are plausible and that
    predicts the fitted records left out. The first round has no effect, each following one has one effect more, and the last
    one has all and what explains the derivatives.

    Parameters
    ----------
    sets : fits of the search.
    hypothesis, start : the declared aircraft, and where the search for its parameters begins.
    effects : candidates of the filter; declared : what else changes the derivatives.
    seed : seed of the random draws behind p-values.
    advance : receives the step that begins, or holds the time budget.
    required : keys of effects that the set has to hold, where any set has them.
    known : as of `airtruth.tracing.selection.best_first.best_first`.
    """
    found = best_first(sets, hypothesis, start, effects, declared, advance, known)
    if found is None:
        return ()
    chosen, left = _chosen(found, required)
    return _Stated(sets, tuple(effects), seed, advance).rounds(replace(found, weights=left), chosen)


def _chosen(found: Posterior, required: Collection[str]) -> tuple[EvaluatedSet | None, dict[Names, float]]:
    """The set of the answer, None for none, and the weights of the sets without those that were refused."""
    left = {
        names: weight
        for names, weight in found.weights.items()
        if set(required) <= found.evaluated[names].in_filter
    } or dict(found.weights)
    best = None
    while any(left.values()) and (names := simplest(left)):
        best = found.evaluated[names]
        if best.is_refitted and found.is_sound(best.expansion.last):
            break
        best = None
        del left[names]
    return best, shares(left if any(left.values()) else {(): 1.0})


@dataclass(frozen=True)
class _Stated:
    """The rounds of one set.

    Attributes
    ----------
    sets, effects, seed, advance : as of `search`.
    """

    sets: SetTable
    effects: tuple[Effect, ...]
    seed: int
    advance: Advance

    def rounds(self, found: Posterior, chosen: EvaluatedSet | None) -> tuple[SearchRound, ...]:
        """A round for each effect of the filter, the most probable one first, and the last round."""
        last, rounds = found.null, []
        if chosen is not None:
            fitted, weights = chosen.expansion.last, found.weights
            members = sorted(fitted.hypothesis.effects, key=lambda e: -weights.get((e.label,), 0.0))
            for number, effect in enumerate(members, 1):
                following = self._of(members[:number], fitted, found)
                if following is None:
                    break
                rounds.append(self._accepting(last, effect, following))
                last = rounds[-1].tied[0].fit
            if chosen.explains_derivatives:
                rounds = rounds or [scored(self.sets.problem, last, self.effects, self.seed)]
                last = self._explained(fitted, last)
            rounds[:1] = [self._with_runner_up(own, fitted, found) for own in rounds[:1]]
        self.advance("score the effects")
        end = scored(self.sets.problem, last, self.effects, self.seed)
        explanation = None if chosen is None else chosen.explanation
        return (*rounds, replace(end, explanation=explanation, posterior=found.weights))

    def _of(self, members: Sequence[Effect], fitted: PosteriorFit, found: Posterior) -> PosteriorFit | None:
        """The fit of some effects of a set under the declaration, with the effects in this order."""
        hypothesis = replace(fitted.hypothesis, effects=tuple(members), spread=None)
        known = found.fits.get(frozenset(e.key for e in members))
        if known is not None and known.hypothesis.spread is None:
            return in_order_of(known, hypothesis)
        sizes = np.concatenate([fitted.point.sizes[fitted.hypothesis.span(e.key)] for e in members])
        return self.sets.converged(hypothesis, replace(fitted.point, sizes=sizes))

    def _accepting(self, last: PosteriorFit, effect: Effect, following: PosteriorFit) -> SearchRound:
        """The round of a null with the effect that follows, at its best location where it has one."""
        self.advance("score the effects")
        own = scored(self.sets.problem, last, self.effects, self.seed)
        profile = None
        if location_index(effect) is not None:
            self.advance(f"location of {effect.key}")
            following, profile = best_location(self.sets.problem, following)
        following = relocated(self.sets.problem, following, placed=effect.key)
        gain = 2.0 * (last.cost - following.cost + 1.0 - len(effect.parameters))
        score = next((s for s in own.table.scores if s.effect.key == effect.key), None)
        leader = Candidate(score or Score.none(effect), following, gain)
        return replace(own, candidates=(leader,), tied=(leader,), profile=profile)

    def _with_runner_up(self, own: SearchRound, fitted: PosteriorFit, found: Posterior) -> SearchRound:
        """The first round with the effect of the largest score among those that the answer lacks."""
        members = {e.label for e in fitted.hypothesis.effects}
        others = [s for s in own.table.scores if s.effect.label not in members]
        if not others:
            return own
        score = max(others, key=lambda s: abs(s.z))
        effect, null = score.effect, own.null
        runner_up = found.fits.get(frozenset((effect.key,)))
        if runner_up is None:
            more = [score.size, *score.direction.locations]
            start = replace(null.point, sizes=np.append(null.point.sizes, more))
            runner_up = self.sets.fit(null.hypothesis.plus(effect), start, near=null)
        if runner_up is None:
            return own
        gain = 2.0 * (null.cost - runner_up.cost + 1.0 - len(effect.parameters))
        return replace(own, candidates=(*own.candidates, Candidate(score, runner_up, gain)))

    def _explained(self, fitted: PosteriorFit, last: PosteriorFit) -> PosteriorFit:
        """The fit under the explanation of the derivatives, which begins where the effects are under the declaration."""
        hypothesis = replace(last.hypothesis, spread=fitted.hypothesis.spread)
        if not hypothesis.effects:
            return fitted
        point = replace(fitted.point, sizes=last.point.sizes)
        return self.sets.converged(hypothesis, point) or in_order_of(fitted, hypothesis)


__all__ = ["search"]
