"""Best-first search over sets of effects, which no trace uses yet: quadratics predict their evidence, and the best are refitted.

The quadratic about the best fit predicts the evidence of every set of up to three effects. The best set without a refit is
refitted from the predicted point, and its own quadratic gives its evidence with every explanation of the derivatives. A fit that
leads is expanded in turn. The search ends when no set without a refit is predicted within `ODDS` of the best.

A discrepancy that no effect describes is one hypothesis beside the set that leads: a smooth function, a play, a lag or a mode
(`airtruth.tracing.selection.increments`), whose evidence is averaged over its shapes and needs no refit.

`python -m studies.shadow` compares it with the search of a trace.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import logsumexp

from airtruth.effects.effect import Effect, Prior
from airtruth.effects.increment import NAME, Shape
from airtruth.tracing.inference.causes import Cause
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.robust import inflation
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.evidence import Quadratic, Weighed
from airtruth.tracing.selection.expansion import Expansion, expanded
from airtruth.tracing.selection.explanation import simplest
from airtruth.tracing.selection.increments import screen
from airtruth.tracing.selection.rounds import MOST_EFFECTS
from airtruth.tracing.selection.set_table import SetTable

ODDS: Final = 3.0
"""Log-evidence behind the best set from which a set is not refitted [-] (judgement: odds of one in twenty)."""
REFITS: Final = 30
"""Largest number of refits [-] (judgement: ten to forty seconds)."""
_SAME: Final = 0.05
"""Change of the logarithm of the ratio of variances that leaves every evidence as it is [-] (judgement)."""
Names = tuple[str, ...]
"""Names of a set, sorted."""


@dataclass(frozen=True)
class Posterior:
    """Outcome of a search.

    Attributes
    ----------
    weights : names of each set -> its posterior probability among all sets, the most probable first.
    best : the fit of the most probable set; names : of that set.
    refits : number of refits, that without any effect included.
    temper : long-run variance of the slopes of the likelihood over that of white innovations [-].
    """

    weights: Mapping[Names, float]
    best: PosteriorFit
    names: Names
    refits: int
    temper: float
    fits: Mapping[Names, PosteriorFit]
    by_keys: Mapping[frozenset[str], PosteriorFit]

    @property
    def simplest(self) -> Names:
        """The set of an answer, see `airtruth.tracing.selection.explanation.simplest`."""
        return simplest(self.weights)


@dataclass(frozen=True)
class _Predicted:
    """A set as a quadratic predicts it."""

    expansion: Expansion
    quadratic: Quadratic
    weighed: Weighed


def best_first(
    sets: SetTable,
    hypothesis: Hypothesis,
    start: Parameters,
    effects: Sequence[Effect],
    causes: Sequence[Cause],
    shapes: Sequence[Shape] = (),
) -> Posterior | None:
    """Posterior probabilities of the sets of effects; None where not even the declared aircraft can be fitted.

    Parameters
    ----------
    sets : fits of the search; hypothesis, start : the declared aircraft, and where the search for its parameters begins.
    effects : candidates of the filter; causes : of changed derivatives.
    shapes : of a discrepancy that no effect describes; none leaves this hypothesis out.
    """
    null = sets.converged(hypothesis, start)
    if null is None:
        return None
    held = {e.key for e in effects}
    others = tuple(c for c in causes if c.key not in held)
    own = _BestFirst(sets, hypothesis, tuple(effects), others, tuple(shapes))
    return own.run(null)


class _BestFirst:
    """Fits, predictions and evidence of one search."""

    def __init__(
        self,
        sets: SetTable,
        hypothesis: Hypothesis,
        effects: tuple[Effect, ...],
        causes: tuple[Cause, ...],
        shapes: tuple[Shape, ...],
    ) -> None:
        self.sets, self.hypothesis, self.effects, self.causes = sets, hypothesis, effects, causes
        self.shapes = shapes
        self.temper = 1.0
        self.refits = 1
        self._fits: dict[frozenset[str], list[Expansion]] = {}
        self._read: dict[tuple[int, float], list[_Predicted]] = {}
        self._expansions: list[Expansion] = []
        self._told: dict[tuple[int, float], dict[frozenset[str], _Predicted]] = {}
        self._predicted: dict[frozenset[str], _Predicted] = {}
        self._tried: set[tuple[frozenset[str], Names, tuple[int, ...]]] = set()
        self._discrepancies: dict[Names, float] = {}

    def run(self, null: PosteriorFit) -> Posterior:
        """Refit set after set until no other one can come within the odds."""
        self._fits[frozenset()] = [expanded(self.sets.problem, null)]
        self._tempered(null)
        measured: list[PosteriorFit] = [null]
        seen: list[PosteriorFit] = []
        while True:
            best = self._best()
            fitted = best.expansion.last
            if not any(fitted is other for other in measured):  # once: two fits could lead in turn
                measured.append(fitted)
                if self._tempered(fitted):
                    continue
            if not any(fitted is other for other in seen):
                seen.append(fitted)
                self._predict(fitted)
                self._compare_discrepancy(best)
            following = self._following(best)
            if following is None or self.refits >= REFITS:
                break
            self._refit(following)
        weights = self._weights()
        names = best.quadratic.names(best.weighed)
        fits: dict[Names, tuple[float, PosteriorFit]] = {}
        for key in self._fits:
            for p in self._of_fit(key):
                own = p.quadratic.names(p.weighed)
                if own not in fits or p.weighed.log_evidence > fits[own][0]:
                    fits[own] = p.weighed.log_evidence, p.expansion.last
        by_keys = {
            key: min((e.last for e in every), key=lambda f: f.cost) for key, every in self._fits.items()
        }
        fits[()] = 0.0, null
        return Posterior(
            weights, fitted, names, self.refits, self.temper, {n: f for n, (_, f) in fits.items()}, by_keys
        )

    def _tempered(self, fitted: PosteriorFit) -> bool:
        """Set the ratio of variances to that of a fit; whether it has changed."""
        ratio = inflation(self.sets.problem, fitted, unbiased=True)
        layout = fitted.layout
        rows = np.r_[layout.of.common.derivatives, layout.sizes]
        temper = float(np.mean(ratio[rows] ** 2))
        if abs(np.log(temper / self.temper)) < _SAME:
            return False
        self.temper = temper
        self._predicted = self._predictions()
        return True

    def _best(self) -> _Predicted:
        """The most probable set with a refit."""
        every = [p for key in self._fits for p in self._of_fit(key)]
        return max(every, key=lambda p: p.weighed.log_evidence)

    def _of_fit(self, key: frozenset[str]) -> list[_Predicted]:
        """The sets with some effects of the filter that their fits weigh: with each explanation of the derivatives."""
        found: list[_Predicted] = []
        for expansion in self._fits[key]:
            at = id(expansion), self.temper
            if at not in self._read:
                q = expansion.quadratic(self.sets.problem, self.causes, self.temper)
                every = q.sets(min(MOST_EFFECTS + 1, len(key) + 2))
                own = (w for w in every if q.in_filter(w) == key)
                self._read[at] = [_Predicted(expansion, q, w) for w in own]
            found += self._read[at]
        return found

    def _predict(self, fitted: PosteriorFit) -> None:
        """Enter the quadratic about a fit among those that predict the other sets."""
        self._expansions.append(expanded(self.sets.problem, fitted, self.effects))
        self._predicted = self._predictions()

    def _predictions(self) -> dict[frozenset[str], _Predicted]:
        """The sets by their effects of the filter, each as the quadratic predicts it whose fit differs from it by the fewest
        effects; the later of two."""
        nearest: dict[frozenset[str], tuple[int, _Predicted | None]] = {}
        every = [(frozenset(e.key for e in x.last.hypothesis.effects), self._told_by(x)) for x in self._expansions]
        for key in {key for _, told in every for key in told}:
            for own, told in every:
                apart = len(own ^ key)
                if key not in nearest or apart <= nearest[key][0]:
                    nearest[key] = apart, told.get(key)
        return {key: p for key, (_, p) in nearest.items() if p is not None}

    def _told_by(self, expansion: Expansion) -> dict[frozenset[str], _Predicted]:
        at = id(expansion), self.temper
        if at not in self._told:
            q = expansion.quadratic(self.sets.problem, self.causes, self.temper)
            self._told[at] = {
                q.in_filter(w): _Predicted(expansion, q, w)
                for w in sorted(q.sets(MOST_EFFECTS), key=lambda w: w.log_evidence)
            }
        return self._told[at]

    def _compare_discrepancy(self, best: _Predicted) -> None:
        """Enter the evidence of a discrepancy beside a set, from the quadratic about its fit."""
        if not self.shapes:
            return
        total = sum(shape.prior_weight for shape in self.shapes)
        screened = screen(self.sets.problem, best.expansion.last, NO_WHITENER, self.shapes)
        logs = [
            s.log_evidence / self.temper + float(np.log(s.effect.shape.prior_weight / total))
            for s in screened
        ]
        if logs:
            names = tuple(sorted({*best.quadratic.names(best.weighed), NAME}))
            own = best.weighed.log_evidence + Prior.log_odds
            self._discrepancies[names] = own + float(logsumexp(logs))

    def _following(self, best: _Predicted) -> _Predicted | None:
        """The set to refit next: the best one under the prior of its own derivatives, else the best without a refit."""
        own = best.weighed
        explains = own.declaration.wrong or any(best.quadratic.columns[i].cause for i in own.columns)
        if explains and self._is_new(best):
            return best
        left = (p for key, p in self._predicted.items() if key not in self._fits and self._is_new(p))
        least = max([own.log_evidence, *self._discrepancies.values()]) - ODDS
        return max(
            (p for p in left if p.weighed.log_evidence > least),
            key=lambda p: p.weighed.log_evidence,
            default=None,
        )

    def _is_new(self, p: _Predicted) -> bool:
        return self._row(p) not in self._tried

    @staticmethod
    def _row(p: _Predicted) -> tuple[frozenset[str], Names, tuple[int, ...]]:
        return p.quadratic.in_filter(p.weighed), p.quadratic.names(p.weighed), p.weighed.declaration.wrong

    def _refit(self, p: _Predicted) -> None:
        """Refit a set from its predicted point, and from the declared aircraft where that leads nowhere."""
        self._tried.add(self._row(p))
        hypothesis, start = self._start(p)
        before = p.expansion.last
        own = self.sets.converged(hypothesis, start)
        self.refits += 1
        if hypothesis.effects and (own is None or own.cost > before.cost):
            again = self.sets.fit_from_declared(hypothesis, start.sizes, before)
            self.refits += 1
            if again is not None and (own is None or again.cost < own.cost):
                own = again
        if own is not None:
            key = frozenset(e.key for e in hypothesis.effects)
            self._fits.setdefault(key, []).append(expanded(self.sets.problem, own))

    def _start(self, p: _Predicted) -> tuple[Hypothesis, Parameters]:
        """The hypothesis of a set with its own prior of the derivatives, and the point where the quadratic is least."""
        q, w = p.quadratic, p.weighed
        spread = w.declaration.spread.copy()
        of_cause = np.zeros_like(spread)
        for i in w.columns:
            cause = q.columns[i].cause
            if cause is not None:
                of_cause += q.widening(i) + cause.prior.std**2 * np.outer(cause.direction, cause.direction)
        # what a curvature frees the filter frees itself
        freed = sum((q.widening(i) for i in w.columns if q.columns[i].freed), np.zeros_like(spread))
        members = [k for k, i in enumerate(w.columns) if q.columns[i].effect is not None]
        chosen, sizes = [w.columns[k] for k in members], w.sizes[members]
        x = np.zeros(len(q.columns))
        x[chosen] = sizes
        declared = q.most_probable(spread + of_cause + freed, x)
        common = self.sets.problem.layout.common
        at = [*range(common.derivatives.stop), common.inertia]
        point = p.expansion.point(chosen, sizes, dict(zip(at, declared.tolist(), strict=True)))
        effects = tuple(p.expansion.effects[i] for i in chosen)
        total = spread + of_cause
        return replace(self.hypothesis, effects=effects, spread=total if total.any() else None), point

    def _weights(self) -> dict[Names, float]:
        """Names of each set -> posterior probability; a set without a refit has the predicted evidence."""
        logs: dict[Names, float] = {}
        for key in self._fits:
            best: dict[tuple[tuple[int, ...], tuple[int, ...], float], _Predicted] = {}
            for p in self._of_fit(key):
                d = p.weighed.declaration
                row = p.weighed.columns, d.wrong, float(np.trace(d.spread))
                if row not in best or p.weighed.log_evidence > best[row].weighed.log_evidence:
                    best[row] = p
            for p in best.values():
                names = p.quadratic.names(p.weighed)
                logs[names] = np.logaddexp(logs.get(names, -np.inf), p.weighed.log_evidence)
        for key, p in self._predicted.items():
            if key not in self._fits and self._is_new(p):
                names = p.quadratic.names(p.weighed)
                logs[names] = np.logaddexp(logs.get(names, -np.inf), p.weighed.log_evidence)
        for names, log in self._discrepancies.items():
            logs[names] = np.logaddexp(logs.get(names, -np.inf), log)
        top = max(logs.values())
        total = sum(np.exp(log - top) for log in logs.values())
        order = sorted(logs, key=lambda names: -logs[names])
        return {names: float(np.exp(logs[names] - top) / total) for names in order}


__all__ = ["ODDS", "Posterior", "best_first"]
