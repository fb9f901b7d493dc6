"""Increments learned from what the named effects leave: screened, refitted with their prior, and tested as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import expit

from airtruth.effects.effect import Effect
from airtruth.effects.increment import NAME, Increment, Shape
from airtruth.tracing.budget import Advance, may_begin
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.learning.increment_fit import (
    assessed,
    converged,
    evidence_score,
    refitted,
)
from airtruth.tracing.learning.increments import Screened, screen, shapes, sharpened
from airtruth.tracing.selection.candidate import Candidate, Refusal
from airtruth.tracing.selection.explanation import shares
from airtruth.tracing.selection.predictive import reference_of
from airtruth.tracing.selection.rounds import SearchRound, scored
from airtruth.tracing.selection.set_table import SetTable

TIE: Final = 6.0
"""Difference in 2 log L up to which two increments explain the records equally well [-] (judgement: a likelihood ratio of 20)."""
MOST_INCREMENTS: Final = 3
"""Largest number of increments that a trace accepts [-] (judgement: lift, moment and one with memory)."""
LEAST_RECORDS: Final = 3
"""Least number of fitted records [-] (judgement: the gusts of one or two flights can resemble an increment, and
a measured record of 60 s always leaves an anomaly beside a linear model)."""
_REFITTED: Final = 3
"""Number of shapes that are refitted for one increment [-] (judgement: a refit costs seconds to a minute)."""
_SHARPENED: Final = 12
"""Number of variants whose detail is sharpened before they are compared [-] (judgement: about a second, and the evidence of a
lightly damped mode beside the grid may be less than half of that at its peak)."""
_HOPELESS: Final = 8.0
"""Log evidence behind the leading shape up to which a shape is refitted in any case [-] (judgement)."""
_HALF: Final = 0.5
"""Evidence over that of the leading shape from which a shape is refitted [-] (judgement: refits have doubled it)."""
_PROMISING: Final = 0.2
"""Log evidence of a shape without a refit, over the lead of names without an anomaly, from which the shape is refitted [-]
(judgement: refits have tripled it)."""
_AS_GOOD: Final = -1.0
"""Log evidence over that of names from which increments alone are a rival also where they act as the names do [-] (judgement:
true names lead by 3.7 to 26 in the 13 trials of 28 where such increments were learned)."""


def with_increments(
    sets: SetTable,
    rounds: tuple[SearchRound, ...],
    effects: Sequence[Effect],
    seed: int,
    advance: Advance = lambda step: None,
) -> tuple[SearchRound, ...]:
    """The rounds of a search with increments of what its effects leave.

    Where an anomaly remains, increments are learned beside the named effects, and so are evident ones where none remains.
    Instead of names they are learned in any case: names that fit may imitate what the library lacks. Causes of changed
    derivatives have such rivals where they leave the derivatives contradicted. The names remain unless increments alone have a
    much larger evidence.

    Parameters
    ----------
    rounds : a finished search; effects : its candidates, whose scores the later rounds state.
    seed : seed of the draws behind p-values; advance : receives the step that begins.
    """
    if len(sets.problem.records) < LEAST_RECORDS or not rounds:
        return rounds
    learn = _Learning(sets, tuple(effects), seed, advance)
    grown, evidence = learn.grown(rounds)
    last = rounds[-1]
    explained = last.explanation is not None
    unexplained = explained and last.declared_test.p_value <= CRITERION.significant
    if not unexplained and (explained or not last.null.hypothesis.effects):
        return grown
    bare = (replace(rounds[0], candidates=(), tied=(), profile=None),)
    gain = bare[0].null.cost - last.null.cost - len(last.null.point.sizes) + evidence
    named = gain if last.anomaly.p_value > CRITERION.significant else 0.0
    alone, alone_evidence = replace(learn, named=named).grown(bare)
    return chosen(grown, alone, alone_evidence - gain, last)


def chosen(
    grown: tuple[SearchRound, ...], alone: tuple[SearchRound, ...], lead: float, named: SearchRound
) -> tuple[SearchRound, ...]:
    """The rounds with the named effects, or those of increments alone where these lead by far; the others keep their weight.

    Increments alone with less evidence are no rival of names that need no increment beside them and act on the same
    coefficients and channels, because a curve can imitate any name there.

    Parameters
    ----------
    grown, alone : rounds with names, and increments beside them where those were learned, and rounds of increments alone.
    lead : log evidence of the second over the first [-].
    named : last round of the names alone.
    """
    learned = tuple(c.score.effect for c in _accepted(alone))
    if not learned:
        return grown
    increments = (NAME,)
    if lead > CRITERION.lead:
        return (*alone[:-1], replace(alone[-1], posterior=_weighed({named.names: -lead, increments: 0.0})))
    if lead > _AS_GOOD or _accepted(grown) or _acts_on(learned) != _acts_on(named.null.hypothesis.effects):
        end = grown[-1]
        own = end.posterior.get(end.names, 1.0)
        total = {**end.posterior, increments: own * float(np.exp(min(lead, 0.0)))}
        return (*grown[:-1], replace(end, posterior=shares(total)))
    return grown


def _weighed(logs: Mapping[tuple[str, ...], float]) -> dict[tuple[str, ...], float]:
    """Probabilities of sets by the logarithms of their weights."""
    top = max(logs.values())
    return shares({names: float(np.exp(log - top)) for names, log in logs.items()})


def _acts_on(effects: Sequence[Effect]) -> set[str]:
    """Coefficients and channels that effects change; the where of those that change neither."""
    found: set[str] = set()
    for effect in effects:
        change = effect.change({p.name: p.high for p in effect.parameters})
        own = {str(t.coefficient) for t in change.aero}
        own |= {str(t.channel) for t in change.readings} | {t.channel for t in change.sensors}
        found |= own or {effect.where}
    return found


@dataclass(frozen=True)
class _Learning:
    """Common inputs of every increment of a trace.

    Attributes
    ----------
    named : log evidence of names without an anomaly that increments have to reach [-].
    """

    sets: SetTable
    effects: tuple[Effect, ...]
    seed: int
    advance: Advance
    named: float = 0.0

    def grown(self, rounds: tuple[SearchRound, ...]) -> tuple[tuple[SearchRound, ...], float]:
        """The rounds with one more for each accepted increment, and the log evidence of all of them."""
        every = shapes(self.sets.problem)
        for _ in range(2 * MOST_INCREMENTS):
            last, accepted = rounds[-1], _accepted(rounds)
            if len(accepted) >= MOST_INCREMENTS:
                break
            # derivatives over a signal are flexible enough to describe what a first increment has wrong
            tried = [s for s in every if not (accepted and s.of_derivative)]
            evident, lacking = 0.0, self.named - _evidence(accepted)
            if last.anomaly.p_value > CRITERION.significant:
                if accepted:
                    break
                evident = CRITERION.lead
            candidates = self._candidates(last.null, last, tried, evident, max(_PROMISING * lacking, 0.0))
            tied = _tied(candidates)
            rounds = (*rounds[:-1], replace(last, candidates=(*last.candidates, *candidates), tied=tied))
            if not tied:
                break
            rounds = (*rounds, self._following(rounds, rounds[-1].tied[0].fit))
        return rounds, _evidence(_accepted(rounds))

    def _following(self, rounds: tuple[SearchRound, ...], fitted: PosteriorFit) -> SearchRound:
        """The round whose null has the increment; its candidates are scored and none is refitted."""
        self.advance("score the effects")
        own, last = scored(self.sets.problem, fitted, self.effects, self.seed), rounds[-1]
        beside = float(expit(0.5 * last.tied[0].gain))
        posterior: dict[tuple[str, ...], float] = {}
        for names, weight in (last.posterior or {(): 1.0}).items():
            for added, share in ((names, 1.0 - beside), (tuple(sorted({*names, NAME})), beside)):
                posterior[added] = posterior.get(added, 0.0) + weight * share
        return replace(own, explanation=last.explanation, posterior=posterior)

    def _candidates(
        self, null: PosteriorFit, last: SearchRound, every: Sequence[Shape], evident: float, promising: float
    ) -> tuple[Candidate, ...]:
        """Refitted increments of the leading shapes, best first; none if the log evidence of the first is below ``evident``.

        Parameters
        ----------
        promising : log evidence of a shape from which it is refitted [-].
        """
        if not may_begin(self.advance, "learn increments from what remains"):
            return ()
        present = {e.variant for e in _increments_of(null)}
        tried = [s for s in every if s.variant not in present]
        screened = _of_each_variant(screen(self.sets.problem, last.null, NO_WHITENER, tried))[:_SHARPENED]
        first = screened[0].log_evidence if screened else -np.inf
        if first < _PROMISING * max(evident, promising):  # no finer detail makes up for that
            return ()
        leading = _leading(sharpened(self.sets.problem, last.null, NO_WHITENER, screened), promising)
        if not leading or leading[0].log_evidence < evident:
            return ()
        learned = []
        for s in leading:
            if may_begin(self.advance, f"refit {s.effect.key}"):
                own = refitted(self.sets.problem, null, s, _weight(tried))
                learned += [] if own is None else [own]
        if not learned:
            return ()
        reference = reference_of(self.sets.problem, null)
        ranked = converged(self.sets.problem, null, learned, _weight(tried))
        found: list[Candidate] = []
        for own in ranked:
            accepted = next((c for c in found if not c.reasons), None)
            if accepted is not None and 2.0 * own.log_evidence < accepted.gain - TIE:
                refused = (Refusal.OUTDONE,)
                found.append(Candidate(evidence_score(own), own.fit, 2.0 * own.log_evidence, refused))
            else:
                found.append(assessed(self.sets.problem, own, reference))
        return tuple(found)


def _increments_of(fitted: PosteriorFit) -> list[Increment]:
    return [e for e in fitted.hypothesis.effects if isinstance(e, Increment)]


def _evidence(accepted: Sequence[Candidate]) -> float:
    """Log evidence of accepted increments [-]."""
    return sum(0.5 * c.gain for c in accepted)


def _accepted(rounds: Sequence[SearchRound]) -> list[Candidate]:
    """The accepted increments."""
    return [r.tied[0] for r in rounds if r.tied and isinstance(r.tied[0].score.effect, Increment)]


def _weight(shapes: Sequence[Shape]) -> float:
    return sum(s.prior_weight for s in shapes)


def _of_each_variant(screened: Sequence[Screened]) -> list[Screened]:
    """The best shape of each variant, best first."""
    best: dict[str, Screened] = {}
    for s in screened:
        best.setdefault(s.effect.variant, s)
    return list(best.values())


def _leading(screened: Sequence[Screened], least: float) -> list[Screened]:
    """The shapes whose evidence is near that of the first and above ``least``."""
    first = screened[0].log_evidence if screened else 0.0
    near = max(min(first - _HOPELESS, _HALF * first), least)
    return [s for s in screened if s.log_evidence > near][:_REFITTED]


def _tied(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """The best accepted increment, and those whose evidence is as large."""
    accepted = [c for c in candidates if not c.reasons]
    return tuple(c for c in accepted if accepted[0].gain - c.gain <= TIE)


__all__ = ["LEAST_RECORDS", "MOST_INCREMENTS", "chosen", "with_increments"]
