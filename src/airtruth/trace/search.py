"""From a table of scores to accepted effects: refit the leading ones, judge them on records left out, repeat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.trace import score
from airtruth.trace.fit import Fit, Hypothesis, Problem, Whitener, autoregression, begin, fit
from airtruth.trace.holdout import Assessment, floor, leave_one_out
from airtruth.trace.lower import lower
from airtruth.trace.model import S
from airtruth.trace.score import Score, Table

Array = NDArray[np.float64]

LEVEL: Final = 0.05
LEADING: Final = 6
MOST: Final = 3
_SIGNIFICANT: Final = 3.84
TIE: Final = 4.0
"""Effects within this of the best in 2 log L cannot be told apart."""


@dataclass(frozen=True)
class Candidate:
    """An effect that was refitted.

    Attributes
    ----------
    score : what put it among the leading ones.
    found : its fit, all free.
    gain : 2 log L gained over the null, less 2 per parameter beyond the first.
    likelihood_gain, free_run_gain : (records,) gains on records left out: log-likelihood; squared residual
        over what gusts and sensors explain.
    size, std : of the first parameter in its size coordinate.
    reasons : what it fails, in words; empty if it is accepted.
    """

    score: Score
    found: Fit
    gain: float
    likelihood_gain: Array
    free_run_gain: Array
    size: float
    std: float
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Stage:
    """One round: the null of the round, the scores at it, and what was made of them.

    Attributes
    ----------
    null : fit of the effects accepted so far, levels free; gls : the same under ``whitener``.
    adjusted : Holm's p-values of the table's scores.
    candidates : refitted ones, best first.
    tied : those that cannot be told from the best accepted one, itself first; empty if none was.
    """

    null: Fit
    gls: Fit
    whitener: Whitener
    table: Table
    adjusted: Array
    candidates: tuple[Candidate, ...]
    tied: tuple[Candidate, ...]

    @property
    def anomaly(self) -> tuple[float, float]:
        """Statistic and p-value of the best evidence that something is missing: the library's or the omnibus's."""
        statistic, _, omnibus = self.table.omnibus
        smallest = float(self.adjusted.min(initial=1.0))
        if smallest <= omnibus and self.table.scores:
            best = int(np.argmin(self.adjusted))
            return self.table.scores[best].z ** 2, min(1.0, 2.0 * smallest)
        return statistic, min(1.0, 2.0 * omnibus)


def search(
    problem: Problem,
    hypothesis: Hypothesis,
    effects: Sequence[Effect],
    seed: int,
    advance: Callable[[str], None] = lambda what: None,
) -> tuple[Stage, ...]:
    """Rounds of scoring, refitting and judging, until nothing more is accepted.

    Parameters
    ----------
    hypothesis : the declared aircraft.
    effects : candidates.
    seed : of the draws behind p-values.
    advance : told what is being done.
    """
    stages: list[Stage] = []
    start = begin(problem, hypothesis)
    while True:
        advance(f"round {len(stages) + 1}: refit without further effects")
        null = fit(problem, hypothesis, start)
        if null is None:
            break
        whitener = autoregression(null.tangents)
        gls = null if whitener.coefficients.shape[0] == 0 else _gls(problem, null, whitener)
        advance(f"round {len(stages) + 1}: score {len(effects)} effects")
        table = score.table(gls, problem, effects, whitener, seed)
        adjusted = score.holm([s.p_value for s in table.scores])
        candidates, tied = (), ()  # type: tuple[Candidate, ...], tuple[Candidate, ...]
        if len(stages) < MOST:
            candidates = _refitted(problem, null, table, adjusted, advance)
            tied = _tied(candidates)
        stages.append(Stage(null, gls, whitener, table, adjusted, candidates, tied))
        if not tied:
            break
        best = tied[0]
        hypothesis, start = best.found.hypothesis, best.found.point
        names = {e.key for e in hypothesis.effects}
        effects = [e for e in effects if e.key not in names]
    return tuple(stages)


def _gls(problem: Problem, null: Fit, whitener: Whitener) -> Fit:
    found = fit(problem, null.hypothesis, null.point, whitener, iterations=6, free_levels=False)
    return found or null


def _refitted(
    problem: Problem, null: Fit, table: Table, adjusted: Array, advance: Callable[[str], None]
) -> tuple[Candidate, ...]:
    order = [i for i in np.argsort(adjusted, kind="stable") if adjusted[i] <= LEVEL]
    order = sorted(order, key=lambda i: -abs(table.scores[i].z))[:LEADING]
    if not order:
        return ()
    fits: list[tuple[float, Score, Fit]] = []
    for i in order:
        s = table.scores[i]
        advance(f"refit {s.effect.key}")
        best = min((f.cost for _, _, f in fits), default=np.inf)
        found = _refit(problem, null, s, best)
        if found is not None:
            gain = 2.0 * (null.cost - found.cost) - 2.0 * (len(s.effect.parameters) - 1)
            fits.append((gain, s, found))
    fits.sort(key=lambda f: -f[0])
    reference = leave_one_out(problem, null)
    judged: list[Candidate] = []
    accepted = np.inf
    for gain, s, found in fits:
        if gain < accepted - TIE and np.isfinite(accepted):
            judged.append(_outdone(s, found, gain))
            continue
        candidate = _candidate(problem, null, s, found, gain, reference)
        judged.append(candidate)
        if not candidate.reasons and not np.isfinite(accepted):
            accepted = gain
    return tuple(judged)


def _refit(problem: Problem, null: Fit, s: Score, rival: float) -> Fit | None:
    """The null and one effect, all free, from the size that the score suggests and from a third of it."""
    hypothesis = null.hypothesis.plus(s.effect)
    low, high = _ends(s.effect)
    best: Fit | None = None
    for share in (1.0, 0.3):
        size = min(max(share * s.size, low), high)
        sizes = np.concatenate([null.point.sizes, s.direction.sizes(size)])
        tried = fit(problem, hypothesis, replace(null.point, sizes=sizes), rival=rival)
        if tried is not None and (best is None or tried.cost < best.cost):
            best = tried
        if best is not None and best.converged and null.cost - best.cost > 0.2 * s.z**2:
            break
    return best


def _ends(effect: Effect) -> tuple[float, float]:
    """Plausible sizes of an effect."""
    first = effect.parameters[0]
    low, high = sorted((first.size(first.low), first.size(first.high)))
    return (
        max(low, 0.0) if first.one_sided and not first.reciprocal else 0.0 if first.reciprocal else low
    ), high


def _outdone(s: Score, found: Fit, gain: float) -> Candidate:
    at = len(found.point.sizes) - len(s.effect.parameters)
    nothing = np.full(len(found.likelihood), np.nan)
    size, std = float(found.point.sizes[at]), float(np.sqrt(found.covariance[S + at, S + at]))
    return Candidate(s, found, gain, nothing, nothing, size, std, ("another effect explains more",))


def _candidate(
    problem: Problem, null: Fit, s: Score, best: Fit, gain: float, reference: tuple[Array, list[Assessment]]
) -> Candidate:
    first = s.effect.parameters[0]
    at = len(null.point.sizes)
    size, std = float(best.point.sizes[at]), float(np.sqrt(best.covariance[S + at, S + at]))
    likelihood, assessed = leave_one_out(problem, best)
    likelihood_gain = reference[0] - likelihood
    low = lower(null.hypothesis.change(null.point.sizes))
    free = []
    for i, (before, after) in enumerate(zip(reference[1], assessed, strict=True)):
        weight = floor(problem.records[i], problem, low, null.point.shared, null.point.local[i])
        squares = [float(((a.residual / weight) ** 2).mean()) for a in (before, after)]
        free.append(squares[0] - squares[1])
    reasons = []
    if not best.converged:
        reasons.append("its refit did not converge")
    if gain < _SIGNIFICANT:
        reasons.append("refitted, it explains nothing significant")
    if _worse(likelihood_gain):
        reasons.append("it worsens the likelihood of records left out")
    if _worse(np.array(free)):
        reasons.append("it worsens the free run of records left out")
    if abs(size) < first.material:
        reasons.append(f"its size is immaterial (below {first.material:g})")
    ends = _ends(s.effect)
    span = ends[1] - ends[0]
    if ends[1] - size < 1e-6 * span or (size - ends[0] < 1e-6 * span and ends[0] != 0.0):
        reasons.append("its size ends at the limit of what is plausible")
    return Candidate(s, best, gain, likelihood_gain, np.array(free), size, std, tuple(reasons))


def _worse(gains: Array) -> bool:
    """Whether records left out lose: their sum is negative by more than its own standard error."""
    total = float(gains.sum())
    if not np.isfinite(total):
        return True
    error = float(gains.std(ddof=1) * np.sqrt(gains.size)) if gains.size > 2 else 0.0
    return total < -error


def _tied(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    accepted = [c for c in candidates if not c.reasons]
    if not accepted:
        return ()
    best = accepted[0]
    return (
        best,
        *(c for c in candidates if c is not best and abs(best.gain - c.gain) <= TIE and c.found.converged),
    )


__all__ = ["Candidate", "Stage", "search"]
