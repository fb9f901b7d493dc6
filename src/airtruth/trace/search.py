"""From a table of scores to accepted effects: refit the leading ones, judge them on records left out, repeat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.trace import score
from airtruth.trace.fit import Fit, Hypothesis, Point, Problem, Whitener, autoregression, begin, fit
from airtruth.trace.judge import (
    IMMATERIAL,
    IMPROBABLE,
    OUTDONE,
    SUPERSEDED,
    UNCONVERGED,
    Candidate,
    arrived,
    declared_probability,
    judge,
    own_probability,
    reference_of,
    unjudged,
)
from airtruth.trace.model import GUST_LEVEL, NOISE, respond
from airtruth.trace.profile import Profile, best_place, place_of
from airtruth.trace.score import Score, Table
from airtruth.trace.unnamed import Anomaly, anomalies

Array = NDArray[np.float64]

LEVEL: Final = 0.05
LATER_LEVEL: Final = 0.001
"""Of a further effect: a model that is nobody's leaves something small to explain whatever is added."""
LEADING: Final = 8
MOST: Final = 3
_BETTER: Final = 2.0
_NEAR: Final = 30.0
_RESTARTS: Final = 2
_PATIENCE: Final = 3
_FAR: Final = 5.0
_ANEW: Final = 6
"""Iterations in rough air where a search begins as if nothing was known."""
_VISIBLE: Final = 2.0
_SAME: Final = 0.5
"""Two searches whose log-likelihoods differ by less have ended in the same place."""
_SHARES: Final = (2.0, 1.0, 0.6, 0.3, 0.1, 0.02)
SIGNIFICANT: Final = 10.0
SIGNIFICANT_LATER: Final = 25.0
"""Gains in 2 log L of a refit: chi-square(1) at 5 % over the library's 33 effects (Bonferroni), and at 2e-5."""
_ALTERNATIVES: Final = 2
_CLEAN: Final = 0.05
"""Of what tie with the leader, so many are tried in its place where it leaves an anomaly at this level, or needs a
further effect."""
TIE: Final = 6.0
"""Effects within this of the best in 2 log L cannot be told apart."""


@dataclass(frozen=True)
class Refit:
    """An effect's refit beside the round's null.

    Attributes
    ----------
    score, fit : what put it among the leading ones, and its fit, all free.
    handicap : log-likelihood that the null gains by the mere freedom of derivatives and trim coefficients that the
        effect sets free.
    """

    score: Score
    fit: Fit
    handicap: float

    @property
    def cost(self) -> float:
        """Comparable between effects: one per parameter, none for freedom."""
        return self.fit.cost + self.handicap + self.parameters

    @property
    def parameters(self) -> int:
        """Of the effect."""
        return len(self.score.effect.parameters)


@dataclass(frozen=True)
class Stage:
    """One round: the null of the round, the scores at it, and what was made of them.

    Attributes
    ----------
    null : fit of the effects accepted so far, levels free; gls : the same under ``whitener``.
    unnamed : tests that name no effect.
    adjusted : Holm's p-values of the table's scores.
    candidates : refitted ones, best first.
    tied : those that cannot be told from the best accepted one, itself first; empty if none was.
    profile : of the best accepted one along its place; None without one.
    """

    null: Fit
    gls: Fit
    whitener: Whitener
    table: Table
    unnamed: tuple[Anomaly, ...]
    adjusted: Array
    candidates: tuple[Candidate, ...]
    tied: tuple[Candidate, ...]
    profile: Profile | None = None

    @property
    def anomaly(self) -> Anomaly:
        """The best evidence that something is missing, a score of the library or a test without a name.

        Its p-value allows for all of them (Bonferroni).
        """
        seen = list(self.unnamed)
        if self.table.scores:
            best = min(
                range(len(self.adjusted)), key=lambda i: (self.adjusted[i], -abs(self.table.scores[i].z))
            )
            s = self.table.scores[best]
            seen.append(Anomaly(s.effect.key, s.z**2, 1, float(self.adjusted[best])))
        # of p-values that are all zero the one whose chi-square is farthest out, by R. A. Fisher's sqrt(2 x)
        least = min(seen, key=lambda a: (a.p_value, np.sqrt(2.0 * a.degrees) - np.sqrt(2.0 * a.statistic)))
        return replace(least, p_value=min(1.0, len(seen) * least.p_value))


def search(
    problem: Problem,
    hypothesis: Hypothesis,
    start: Point,
    effects: Sequence[Effect],
    seed: int,
    advance: Callable[[str], None] = lambda what: None,
) -> tuple[Stage, ...]:
    """Rounds of scoring, refitting and judging, until nothing more is accepted.

    Parameters
    ----------
    hypothesis, start : the declared aircraft, and where the search for its parameters begins.
    effects : candidates.
    seed : of the draws behind p-values.
    advance : told what is being done.
    """
    first = Round(hypothesis, start, tuple(effects))
    return _rounds(problem, (first,), (), seed, advance)


@dataclass(frozen=True)
class Round:
    """Where a round begins.

    Attributes
    ----------
    hypothesis, start : the effects accepted so far, and where the search for its parameters begins.
    effects : candidates.
    instead : keys (old, new) of an effect that explains nothing beside a later one, and of that one; None as a rule.
    settled : it lies behind such a round, or behind a choice among effects that tie: neither is made twice.
    """

    hypothesis: Hypothesis
    start: Point
    effects: tuple[Effect, ...]
    instead: tuple[str, str] | None = None
    settled: bool = False


def _rounds(
    problem: Problem,
    rounds: tuple[Round, ...],
    before: tuple[Stage, ...],
    seed: int,
    advance: Callable[[str], None],
) -> tuple[Stage, ...]:
    """Stages from the last of some rounds on, behind those before it."""
    current = rounds[-1]
    stage = _stage(problem, current, len(before), seed, advance)
    if stage is None:
        return before
    stages = (*before, stage)
    if not stage.tied:
        return stages
    best = stage.tied[0]
    empty = None if current.settled else needless(problem, best.found)
    if empty is not None:
        key = stages[empty].tied[0].score.effect.key
        advance(f"{best.score.effect.key} instead of {key}")
        anew = replace(
            rounds[empty],
            start=stages[empty].null.point,
            instead=(key, best.score.effect.key),
            settled=True,
        )
        other = _rounds(problem, (*rounds[:empty], anew), stages[:empty], seed, advance)
        if len(other) > empty and other[empty].tied:
            return other
    ends = _onwards(problem, rounds, stages, current.settled, seed, advance)
    if current.settled or _is_clean(ends, len(stages)):
        return ends
    for rival in (*stage.tied[1 : 1 + _ALTERNATIVES], *_variants(stage)):
        advance(f"{rival.score.effect.key} in the place of {best.score.effect.key}")
        rest = (c for c in stage.tied if c.score.effect.name != rival.score.effect.name)
        led = _led(problem, replace(stage, tied=(rival, *rest)), advance)
        tried = _onwards(problem, rounds, (*before, led), True, seed, advance)
        if _is_clean(tried, len(stages)):
            return tried
    return ends


def _variants(stage: Stage) -> tuple[Candidate, ...]:
    """The leader's other variants that pass every rule but gain less: a break stands in for a curve, and leaves more."""
    best = stage.tied[0]
    return tuple(
        replace(c, reasons=())
        for c in stage.candidates
        if c.score.effect.name == best.score.effect.name
        and c.reasons == (OUTDONE,)
        and np.isfinite(c.likelihood_gain).all()
    )


def _onwards(
    problem: Problem,
    rounds: tuple[Round, ...],
    stages: tuple[Stage, ...],
    settled: bool,
    seed: int,
    advance: Callable[[str], None],
) -> tuple[Stage, ...]:
    """Rounds behind a stage that has accepted an effect."""
    found = stages[-1].tied[0].found
    names = {e.key for e in found.hypothesis.effects}
    effects = tuple(e for e in rounds[-1].effects if e.key not in names)
    following = Round(found.hypothesis, found.point, effects, settled=settled)
    return _rounds(problem, (*rounds, following), stages, seed, advance)


def _is_clean(stages: Sequence[Stage], count: int) -> bool:
    """Whether so many stages explain the records: nothing more was accepted, and nothing else seems to be missing."""
    return not any(s.tied for s in stages[count:]) and stages[-1].anomaly.p_value > _CLEAN


def _stage(
    problem: Problem, current: Round, count: int, seed: int, advance: Callable[[str], None]
) -> Stage | None:
    """One round behind ``count`` others; None where not even its null can be fitted."""
    start, restarts = current.start, _RESTARTS
    while True:
        advance(f"round {count + 1}: refit without further effects")
        null = fit(problem, current.hypothesis, start)
        if null is None:
            return None
        whitener = autoregression(null.tangents)
        gls = null if whitener.coefficients.shape[0] == 0 else _gls(problem, null, whitener)
        advance(f"round {count + 1}: score {len(current.effects)} effects")
        table = score.table(gls, problem, current.effects, whitener, seed)
        adjusted = score.holm([s.p_value for s in table.scores])
        candidates: tuple[Candidate, ...] = ()
        if count < MOST:
            level = LATER_LEVEL if count else LEVEL
            fits = _refitted(problem, null, table, adjusted <= level, advance, current.instead)
            better = _better_null(problem, null, fits) if restarts else None
            if better is not None:
                start, restarts = better.point, restarts - 1
                continue
            least = SIGNIFICANT_LATER if count else SIGNIFICANT
            candidates = _judged(problem, null, fits, least, current.instead)
        unnamed = anomalies(gls, problem, whitener)
        tied = _tied(candidates)
        return _led(problem, Stage(null, gls, whitener, table, unnamed, adjusted, candidates, tied), advance)


def _led(problem: Problem, stage: Stage, advance: Callable[[str], None]) -> Stage:
    """A stage with its leader at its best place, where it has one."""
    if not stage.tied or place_of(stage.tied[0].score.effect) is None:
        return replace(stage, profile=None)
    first = stage.tied[0]
    advance(f"place of {first.score.effect.key}")
    found, profile = best_place(problem, first.found)
    leader = replace(first, found=found)
    candidates = tuple(leader if c is first else c for c in stage.candidates)
    return replace(stage, candidates=candidates, tied=(leader, *stage.tied[1:]), profile=profile)


def needless(problem: Problem, found: Fit) -> int | None:
    """Place of an earlier effect that is immaterial by now, or without which the fit is hardly worse; None if each is
    needed.
    """
    at = 0
    for i, effect in enumerate(found.hypothesis.effects[:-1]):
        count = len(effect.parameters)
        if abs(found.point.sizes[at]) < effect.parameters[0].material:
            return i
        rest = tuple(e for j, e in enumerate(found.hypothesis.effects) if j != i)
        sizes = np.delete(found.point.sizes, np.arange(at, at + count))
        less = fit(problem, replace(found.hypothesis, effects=rest), replace(found.point, sizes=sizes))
        if less is not None and 2.0 * (less.cost - found.cost - count) < SIGNIFICANT:
            return i
        at += count
    return None


def _gls(problem: Problem, null: Fit, whitener: Whitener) -> Fit:
    """The null under an autoregression; at the null's own point where that would lead far away.

    An autoregression of a misfit takes up the very motion that the derivatives are seen in.
    """
    found = fit(problem, null.hypothesis, null.point, whitener, iterations=6, free_levels=False)
    if found is not None:
        std = np.sqrt(np.diag(null.covariance)[:6])
        if (np.abs(found.point.shared[:6] - null.point.shared[:6]) < _FAR * std).all():
            return found
    return fit(problem, null.hypothesis, null.point, whitener, iterations=0, free_levels=False) or null


def _refitted(
    problem: Problem,
    null: Fit,
    table: Table,
    significant: NDArray[np.bool_],
    advance: Callable[[str], None],
    instead: tuple[str, str] | None = None,
) -> list[Refit]:
    """Full refits of the leading effects, best first; none where no score is significant."""
    if not significant.any():
        return []
    # An autoregression of a large misfit inflates what is left, so most are chosen as if there was none; and
    # once something is missing, levels may tell more than means: a lag in gusts is seen in the scatter.
    white = np.array(table.white)
    order = [int(i) for i in np.argsort(-white, kind="stable")[: LEADING - 2] if white[i] > _VISIBLE]
    if _is_improbable(problem, null):
        # what a null far from the declared aircraft has absorbed has no score there
        loose = null.hypothesis.loose
        absorbed = [i for i, s in enumerate(table.scores) if null.hypothesis.plus(s.effect).loose != loose]
        order = [*absorbed, *(i for i in order if i not in absorbed)]
    by_score = np.argsort([-abs(s.z) for s in table.scores], kind="stable")
    order += [int(i) for i in by_score if int(i) not in order and significant[i]][: LEADING - len(order)]
    if instead is not None:
        wanted = [i for i, s in enumerate(table.scores) if s.effect.key in instead]
        order = [*wanted, *(i for i in order if i not in wanted)]
    fits: list[Refit] = []
    for i in order:
        s = table.scores[i]
        advance(f"refit {s.effect.key}")
        rival = min((r.fit.cost for r in fits), default=np.inf)
        found = _refit(problem, null, s, table.white_sizes[i], rival)
        if found is not None:
            fits.append(Refit(s, found, _handicap(problem, null, s.effect, found)))
    for _ in range(_PATIENCE):  # the leader at least has to arrive
        fits.sort(key=lambda r: r.cost)
        if not fits or fits[0].fit.converged:
            break
        first = fits[0].fit
        fits[0] = replace(fits[0], fit=fit(problem, first.hypothesis, first.point) or first)
    return sorted(fits, key=lambda r: r.cost)


def _handicap(problem: Problem, null: Fit, effect: Effect, found: Fit) -> float:
    free = null.hypothesis.plus(effect).loose
    if free == null.hypothesis.loose:
        return 0.0
    hypothesis = replace(null.hypothesis, freed=free)
    ends = [fit(problem, hypothesis, start) for start in (null.point, _without_effect(null, found))]
    return max([null.cost - end.cost for end in ends if end is not None], default=0.0)


def _without_effect(null: Fit, found: Fit) -> Point:
    """Where a null with one effect more ended, without that effect."""
    return replace(found.point, sizes=found.point.sizes[: len(null.point.sizes)])


def _better_null(problem: Problem, null: Fit, fits: Sequence[Refit]) -> Fit | None:
    """The null fitted again from where the best candidate ended, if that is a better optimum of it."""
    if not fits:
        return None
    again = fit(problem, null.hypothesis, _without_effect(null, fits[0].fit), iterations=20)
    return again if again is not None and again.cost < null.cost - _BETTER else None


def _judged(
    problem: Problem,
    null: Fit,
    fits: Sequence[Refit],
    least: float,
    instead: tuple[str, str] | None = None,
) -> tuple[Candidate, ...]:
    """Gains, those near the best compared under one autoregression, and the rules for those that lead."""
    if not fits:
        return ()
    best = fits[0].fit
    gains = {r.score.effect.key: 2.0 * (null.cost + 1.0 - r.cost) for r in fits}
    near = [r for r in fits if r.fit.cost - best.cost < _NEAR]
    whitener = autoregression(best.tangents)
    if whitener.coefficients.shape[0] and len(near) > 1:
        costs = {
            r.score.effect.key: _whitened(problem, r.fit, whitener, best) + r.handicap + r.parameters
            for r in near
        }
        top, lowest = max(gains[key] for key in costs), min(costs.values())
        gains |= {key: top - 2.0 * (cost - lowest) for key, cost in costs.items()}
    ranked = sorted(((gains[r.score.effect.key], r) for r in fits), key=lambda g: -g[0])
    reference = reference_of(problem, null)
    judged: list[Candidate] = []
    accepted, leading = -np.inf, ""
    for gain, r in ranked:
        if instead is not None and r.score.effect.key == instead[0]:
            judged.append(unjudged(r.score, r.fit, gain, SUPERSEDED, f"that is {instead[1]}"))
            continue
        if gain < accepted - TIE and r.score.effect.name != leading:
            judged.append(unjudged(r.score, r.fit, gain, OUTDONE))
            continue
        candidate = judge(problem, r.score, r.fit, gain, reference, least)
        if gain < accepted - TIE:
            candidate = replace(candidate, reasons=(*candidate.reasons, OUTDONE))
        judged.append(candidate)
        if not np.isfinite(accepted) and set(candidate.reasons) <= {IMMATERIAL, UNCONVERGED}:
            accepted = gain  # what explains less than an immaterial effect is not the cause either
            leading = r.score.effect.name
    return tuple(judged)


def _whitened(problem: Problem, found: Fit, whitener: Whitener, levels: Fit) -> float:
    """Cost under an autoregression at another fit's noise and gust levels, so that only the motion counts."""
    shared, local = found.point.shared.copy(), found.point.local.copy()
    shared[list(NOISE)] = levels.point.shared[list(NOISE)]
    local[:, GUST_LEVEL] = levels.point.local[:, GUST_LEVEL]
    start = replace(found.point, shared=shared, local=local)
    again = fit(problem, found.hypothesis, start, whitener, iterations=6, free_levels=False)
    return np.inf if again is None else again.cost


def _refit(problem: Problem, null: Fit, s: Score, white_size: float, rival: float) -> Fit | None:
    """The null and one effect, all free, from shares of the size that the score suggests.

    Where the null is improbable it has absorbed what it can of a large effect, and the search from there can end in
    another optimum: one more begins at what is declared, as if nothing was known, and at the size that the score
    has without an autoregression, which can take up such an effect as a whole.
    """
    hypothesis = null.hypothesis.plus(s.effect)
    is_limit = s.effect.parameters[0].is_limit
    best: Fit | None = None
    for share in _shares(problem, null, hypothesis, s):
        tried = fit(problem, hypothesis, _at(null, s, share * s.size), rival=rival)
        if tried is None:
            continue
        again = best is not None and abs(tried.cost - best.cost) < _SAME
        if best is None or tried.cost < best.cost:
            best = tried
        gain = null.cost - best.cost
        # a limit too high to act is where a search may end from more than one start
        if (best.converged and gain > 0.2 * s.z**2) or (again and not (is_limit and gain < _BETTER)):
            break
    if _is_improbable(problem, null):
        start = begin(problem, hypothesis, _at(null, s, white_size).sizes, _ANEW)
        shared = start.shared.copy()
        shared[list(NOISE)] = null.point.shared[list(NOISE)]
        tried = fit(problem, hypothesis, replace(start, shared=shared), rival=rival)
        if tried is not None and (best is None or tried.cost < best.cost):
            best = tried
    return best


def _is_improbable(problem: Problem, null: Fit) -> bool:
    """Whether derivatives, biases or trim coefficients of a null contradict those declared."""
    return min(declared_probability(problem, null), own_probability(problem, null)) < IMPROBABLE


def _at(null: Fit, s: Score, size: float) -> Point:
    low, high = s.effect.parameters[0].reach
    sizes = s.direction.sizes(min(max(size, low), high))
    return replace(null.point, sizes=np.concatenate([null.point.sizes, sizes]))


def _shares(problem: Problem, null: Fit, hypothesis: Hypothesis, s: Score) -> list[float]:
    """Shares of the size that the score suggests, the most likely first, the rest as the null has it."""
    costs = []
    for share in _SHARES:
        point = _at(null, s, share * s.size)
        change = hypothesis.change(point.sizes)
        total = 0.0
        for record, local in zip(problem.records, point.local, strict=True):
            found = respond(record, problem.settings, change, point.shared, local)
            white = found.e @ found.white.T
            total += 0.5 * len(white) * found.logdet + 0.5 * float((white**2).sum())
        costs.append(total if np.isfinite(total) else np.inf)
    return [_SHARES[i] for i in np.argsort(costs, kind="stable")]


def _tied(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    accepted = [c for c in candidates if not c.reasons]
    if not accepted:
        return ()
    best = accepted[0]
    return (
        best,
        *(
            c
            for c in candidates
            if c is not best
            and c.reasons[:1] != (SUPERSEDED,)
            and abs(best.gain - c.gain) <= TIE
            and arrived(c.found, c.gain)
        ),
    )


__all__ = ["Candidate", "Stage", "needless", "search"]
