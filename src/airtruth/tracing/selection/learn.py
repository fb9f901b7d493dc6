"""Increments learned from what the named effects leave: screened, refitted with their prior, and tested as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.effects.increment import Increment
from airtruth.physics.short_period import PARAMETERS
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.robust import inflation
from airtruth.tracing.model.parameters import size_index
from airtruth.tracing.selection.acceptance import (
    IMMATERIAL,
    OUTDONE,
    UNCONVERGED,
    Candidate,
    Reference,
    has_converged,
    reference_of,
    tested_on_left_out,
    untested,
)
from airtruth.tracing.selection.budget import Advance, may_begin
from airtruth.tracing.selection.increments import Screened, flown, screen, shapes
from airtruth.tracing.selection.ranking import TIE
from airtruth.tracing.selection.rounds import Rival, RoundStart, SearchRound, search_round
from airtruth.tracing.selection.score_test import Direction, Score
from airtruth.tracing.selection.search import total_cost

Array = NDArray[np.float64]

MOST_INCREMENTS: Final = 3
"""Largest number of increments that a trace accepts [-] (judgement: lift, moment and one with memory)."""
LEAST_RECORDS: Final = 3
"""Least number of fitted records [-] (judgement: the gusts of one or two flights can resemble an increment, and
a measured record of 60 s always leaves an anomaly beside a linear model)."""
REMAINS: Final = 0.01
"""Probability of the remaining anomaly below which increments are learned [-]; that of an unexplained verdict."""
_REFITTED: Final = 3
"""Number of shapes that are refitted for one increment [-] (judgement: a refit costs seconds to a minute)."""
_HOPELESS: Final = 8.0
"""Log evidence behind the leading shape from which a shape is not refitted [-] (judgement)."""
_ITERATIONS: Final = 8
"""Iterations of an increment's refit, and half of it of the refit with another prior [-] (judgement: enough to rank
the shapes; the leader is refitted until it converges)."""
_ATTEMPTS: Final = 3
"""Number of further refits that the leader is given to converge [-] (judgement)."""
_LEAST: Final = 5.0
"""Log of the posterior odds, all shapes equally probable beforehand, from which an increment is accepted [-]
(judgement: the gain of a named effect has to be 10 in 2 log L)."""
_NAMES_LEAD: Final = 5.0
"""Log evidence by which increments alone have to lead for named effects to be given up [-] (judgement: a name is
preferred to a curve)."""
_MATERIAL: Final = 0.02
"""Least swing of an increment over that of the declared derivative in the same range [-] (judgement: 2 % is about the
material size of the named effects)."""
_FLOWN: Final = (0.02, 0.98)
"""Quantiles of the flown signal between which the swing counts [-] (judgement)."""
_DERIVATIVE: Final[Mapping[str, str]] = {
    "alpha": "alpha",
    "elevator": "de",
    "qhat": "q",
    "alpha_dot_hat": "q",
}
"""Derivative with which an increment over a signal is compared; a moment by alpha' with the damping."""


@dataclass(frozen=True)
class _Learned:
    """A refitted increment.

    Attributes
    ----------
    effect : the increment, with its prior.
    fit : with all parameters free.
    log_evidence : log of the posterior odds against the null [-].
    """

    effect: Increment
    fit: PosteriorFit
    log_evidence: float


def with_increments(
    problem: TraceProblem,
    rounds: tuple[SearchRound, ...],
    effects: Sequence[Effect],
    seed: int,
    advance: Advance = lambda step: None,
) -> tuple[SearchRound, ...]:
    """The rounds of a search with increments of what its effects leave.

    Where named effects leave an anomaly, increments are learned beside them and in their stead, and the names
    remain unless increments alone have a much larger evidence.

    Parameters
    ----------
    rounds : a finished search; effects : its candidates, whose scores the later rounds state.
    seed : seed of the draws behind p-values; advance : receives the step that begins.
    """
    few = len(problem.records) < LEAST_RECORDS
    if few or not rounds or rounds[-1].anomaly.p_value > REMAINS:
        return rounds
    learn = _Learning(problem, tuple(effects), seed, advance)
    grown, evidence = learn.grown(rounds)
    named = rounds[-1].null.hypothesis.effects
    if not named or rounds[0].release is not None or rounds[-1].null.hypothesis.spread is not None:
        return grown
    bare = (replace(rounds[0], tied=(), profile=None),)
    alone, alone_evidence = learn.grown(bare)
    lead = (total_cost(rounds[-1]) - evidence) - (bare[0].null.cost - alone_evidence)
    if len(alone) > 1 and lead > _NAMES_LEAD:
        names = tuple(e.name for e in named)
        return (replace(alone[0], rival=Rival(names, lead)), *alone[1:])
    return grown


@dataclass(frozen=True)
class _Learning:
    """What every increment of a trace shares."""

    problem: TraceProblem
    effects: tuple[Effect, ...]
    seed: int
    advance: Advance

    def grown(self, rounds: tuple[SearchRound, ...]) -> tuple[tuple[SearchRound, ...], float]:
        """The rounds with one more for each accepted increment, and the log evidence of all of them."""
        total = 0.0
        for _ in range(MOST_INCREMENTS):
            last = rounds[-1]
            if last.anomaly.p_value > REMAINS:
                break
            candidates = self._candidates(last.null, last)
            tied = _tied(candidates)
            rounds = (*rounds[:-1], replace(last, candidates=(*last.candidates, *candidates), tied=tied))
            if not tied:
                break
            total += 0.5 * tied[0].gain
            following = self._following(rounds, tied[0].fit)
            if following is None:
                break
            rounds = (*rounds, following)
        return rounds, total

    def _following(self, rounds: tuple[SearchRound, ...], fitted: PosteriorFit) -> SearchRound | None:
        """The round whose null has the increment; its candidates are scored and none is refitted."""
        names = {e.key for e in fitted.hypothesis.effects}
        left = tuple(e for e in self.effects if e.key not in names)
        begin = RoundStart(fitted.hypothesis, fitted.point, left, settled=True, scores_only=True)
        own = search_round(self.problem, begin, len(rounds), self.seed, self.advance)
        last = rounds[-1]
        return None if own is None else replace(own, sets=last.sets, release=last.release)

    def _candidates(self, null: PosteriorFit, last: SearchRound) -> tuple[Candidate, ...]:
        """Refitted increments of the leading shapes, best first."""
        if not may_begin(self.advance, "learn increments from what remains"):
            return ()
        present = {e.variant for e in null.hypothesis.effects if isinstance(e, Increment)}
        tried = [s for s in shapes(self.problem) if s.variant not in present]
        leading = _leading(screen(self.problem, last.gls, last.whitener, tried))
        learned = []
        for s in leading:
            if may_begin(self.advance, f"refit {s.effect.key}"):
                own = _refit(self.problem, null, s, len(tried))
                learned += [] if own is None else [own]
        if not learned:
            return ()
        reference = reference_of(self.problem, null)
        ranked = _settled(self.problem, null, learned, len(tried))
        found: list[Candidate] = []
        for own in ranked:
            accepted = next((c for c in found if not c.reasons), None)
            if accepted is not None and 2.0 * own.log_evidence < accepted.gain - TIE:
                found.append(untested(_score(own), own.fit, 2.0 * own.log_evidence, OUTDONE))
            else:
                found.append(_assessed(self.problem, own, reference))
        return tuple(found)


def _leading(screened: Sequence[Screened]) -> list[Screened]:
    """The best shape of each variant, as far as their evidence is near that of the first."""
    best: dict[str, Screened] = {}
    for s in screened:
        best.setdefault(s.effect.variant, s)
    first = screened[0].log_evidence if screened else 0.0
    near = [s for s in best.values() if s.log_evidence > max(first - _HOPELESS, 0.0)]
    return near[:_REFITTED]


def _refit(problem: TraceProblem, null: PosteriorFit, s: Screened, tried: int) -> _Learned | None:
    """All parameters with the increment; the prior's standard deviation is estimated again, once."""
    memory, effect = s.effect.shape.memory, s.effect
    times = [] if memory is None else [memory.time_s, memory.damping][: len(effect.parameters) - effect.bends]
    sizes = np.concatenate([null.point.sizes, s.start, times])
    start = replace(null.point, sizes=sizes)
    own = fit(problem, null.hypothesis.plus(effect), start, iterations=_ITERATIONS)
    if own is None:
        return None
    best = _Learned(effect, own, _log_evidence(null, own, effect, tried))
    again = _restated(own, effect)
    if again is not None:
        own = fit(problem, null.hypothesis.plus(again), own.point, iterations=_ITERATIONS // 2)
        if own is not None:
            retried = _Learned(again, own, _log_evidence(null, own, again, tried))
            best = max(best, retried, key=lambda learned: learned.log_evidence)
    return best


def _settled(
    problem: TraceProblem, null: PosteriorFit, learned: Sequence[_Learned], tried: int
) -> list[_Learned]:
    """The refits, best first, the best one converged if a few more refits achieve it."""
    ranked = sorted(learned, key=lambda own: -own.log_evidence)
    for _ in range(_ATTEMPTS):
        if not ranked or has_converged(ranked[0].fit, 2.0 * ranked[0].log_evidence):
            break
        effect, first = ranked[0].effect, ranked[0].fit
        own = fit(problem, first.hypothesis, first.point)
        if own is None:
            break
        ranked[0] = _Learned(effect, own, _log_evidence(null, own, effect, tried))
        ranked.sort(key=lambda other: -other.log_evidence)
    return ranked


def _restated(own: PosteriorFit, effect: Increment) -> Increment | None:
    """The increment with the prior that its bends ask for (MacKay's fixed point); None where that is the present one."""
    bends, covariance = fitted_bends(own, effect, own.covariance)
    old = effect.parameters[0].prior_std
    effective = effect.bends - float(np.trace(covariance)) / old**2
    if not effective > 0.0:
        return None
    new = float(np.sqrt(bends @ bends / effective))
    low, high = 1e-3 * effect.parameters[0].high, effect.parameters[0].high
    new = min(max(new, low), high)
    return effect.with_prior(new) if abs(np.log(new / old)) > np.log(1.5) else None


def fitted_bends(own: PosteriorFit, effect: Increment, covariance: Array) -> tuple[Array, Array]:
    """Bends of an increment (bends,) [-] and their covariance (bends, bends).

    Parameters
    ----------
    own : a fit with the increment; covariance : of its common parameters and sizes.
    """
    first = own.hypothesis.span(effect.key).start
    at = slice(size_index(first), size_index(first) + effect.bends)
    return own.point.sizes[first : first + effect.bends], covariance[at, at]


def _log_evidence(null: PosteriorFit, own: PosteriorFit, effect: Increment, tried: int) -> float:
    """Log of the posterior odds of an increment (Laplace), one for each of its times; every shape equally probable."""
    _, covariance = fitted_bends(own, effect, own.covariance)
    volume = np.linalg.slogdet(covariance)[1] - 2.0 * effect.bends * np.log(effect.parameters[0].prior_std)
    times = len(effect.parameters) - effect.bends
    return float(null.cost - own.cost + 0.5 * volume - times - np.log(tried))


def _assessed(problem: TraceProblem, own: _Learned, reference: Reference) -> Candidate:
    """A refitted increment with the tests that it fails."""
    gain = 2.0 * own.log_evidence
    ratios = inflation(problem, own.fit)
    first = size_index(own.fit.hypothesis.span(own.effect.key).start)
    excess = float(np.mean(ratios[first : first + own.effect.bends] ** 2))
    left_out = tested_on_left_out(problem, own.fit, reference)
    swing = relative_swing(problem, own.fit, own.effect)
    reasons = (
        *([] if has_converged(own.fit, gain) else [UNCONVERGED]),
        *(["its evidence is not significant"] if own.log_evidence < _LEAST * excess else []),
        *left_out.reasons,
        *([IMMATERIAL] if swing < _MATERIAL else []),
    )
    return Candidate(
        score=_score(own),
        fit=own.fit,
        gain=gain,
        likelihood_gain=left_out.likelihood_gain,
        free_run_gain=left_out.free_run_gain,
        size=swing,
        std=float("nan"),
        reasons=reasons,
    )


def relative_swing(problem: TraceProblem, own: PosteriorFit, effect: Increment) -> float:
    """Swing of an increment over that of the declared derivative in the flown range [-]; for a linear one its share."""
    shape = effect.shape
    bends, _ = fitted_bends(own, effect, own.covariance)
    index = PARAMETERS.index(f"{shape.coefficient}{_DERIVATIVE[shape.signal]}")
    declared = abs(float(problem.declared_derivatives[index]))
    if not shape.cells:
        return abs(float(bends[0])) / declared
    signal = np.concatenate([flown(r, shape.signal) for r in problem.records])
    low, high = np.quantile(signal, _FLOWN)
    values = shape.basis(np.linspace(low, high, 101)) @ bends
    return float(np.ptp(values) / (declared * (high - low)))


def _score(own: _Learned) -> Score:
    """The evidence as a score; the inverse of a Bayes factor bounds the p-value (J. Ville, 1939)."""
    effect = own.effect
    return Score(
        effect=effect,
        z=float(np.sqrt(max(2.0 * own.log_evidence, 0.0))),
        p_value=float(np.exp(-max(own.log_evidence, 0.0))),
        size=float("nan"),
        direction=Direction(effect, (), effect.parameters[0].step),
        information=0.0,
        index=-1,
    )


def _tied(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """The best accepted increment, and those whose evidence is as large."""
    accepted = [c for c in candidates if not c.reasons]
    return tuple(c for c in accepted if accepted[0].gain - c.gain <= TIE)


__all__ = ["LEAST_RECORDS", "MOST_INCREMENTS", "fitted_bends", "relative_swing", "with_increments"]
