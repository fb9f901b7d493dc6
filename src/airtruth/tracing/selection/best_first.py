"""Best-first search over sets of effects, which no trace uses yet: quadratics predict their evidence, and the best are refitted.

The quadratic about the best fit predicts the evidence of every set of up to three effects. The best set without a refit is
refitted from the predicted point, and its own quadratic gives its evidence with every explanation of the derivatives. A fit that
leads is expanded in turn. The search ends when no set without a refit is predicted within `ODDS` of the best.

`python -m studies.shadow` compares it with the search of a trace.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.causes import Cause
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.robust import inflation
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.evidence import Quadratic, Weighed
from airtruth.tracing.selection.expansion import Expansion, expanded
from airtruth.tracing.selection.explanation import simplest
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
) -> Posterior | None:
    """Posterior probabilities of the sets of effects; None where not even the declared aircraft can be fitted.

    Parameters
    ----------
    sets : fits of the search; hypothesis, start : the declared aircraft, and where the search for its parameters begins.
    effects : candidates of the filter; causes : of changed derivatives.
    """
    null = sets.converged(hypothesis, start)
    if null is None:
        return None
    held = {e.key for e in effects}
    own = _Search(sets, hypothesis, tuple(effects), tuple(c for c in causes if c.key not in held))
    return own.run(null)


class _Search:
    """Fits, predictions and evidence of one search."""

    def __init__(
        self, sets: SetTable, hypothesis: Hypothesis, effects: tuple[Effect, ...], causes: tuple[Cause, ...]
    ) -> None:
        self.sets, self.hypothesis, self.effects, self.causes = sets, hypothesis, effects, causes
        self.temper = 1.0
        self.refits = 1
        self._fits: dict[frozenset[str], list[Expansion]] = {}
        self._read: dict[tuple[int, float], list[_Predicted]] = {}
        self._predicted: dict[frozenset[str], _Predicted] = {}
        self._tried: set[tuple[frozenset[str], Names, tuple[int, ...]]] = set()

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
            following = self._following(best)
            if following is None or self.refits >= REFITS:
                break
            self._refit(following)
        weights = self._weights()
        names = best.quadratic.names(best.weighed)
        return Posterior(weights, fitted, names, self.refits, self.temper)

    def _tempered(self, fitted: PosteriorFit) -> bool:
        """Set the ratio of variances to that of a fit; whether it has changed."""
        ratio = inflation(self.sets.problem, fitted, unbiased=True)
        layout = fitted.layout
        rows = np.r_[layout.of.common.derivatives, layout.sizes]
        temper = float(np.mean(ratio[rows] ** 2))
        if abs(np.log(temper / self.temper)) < _SAME:
            return False
        self.temper = temper
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
        """Enter what the quadratic about a fit predicts for every set; it replaces what others predicted."""
        expansion = expanded(self.sets.problem, fitted, self.effects)
        q = expansion.quadratic(self.sets.problem, self.causes, self.temper)
        for w in sorted(q.sets(MOST_EFFECTS), key=lambda w: w.log_evidence):
            self._predicted[q.in_filter(w)] = _Predicted(expansion, q, w)

    def _following(self, best: _Predicted) -> _Predicted | None:
        """The set to refit next: the best one under the prior of its own derivatives, else the best without a refit."""
        own = best.weighed
        explains = own.declaration.wrong or any(best.quadratic.columns[i].cause for i in own.columns)
        if explains and self._is_new(best):
            return best
        left = (p for key, p in self._predicted.items() if key not in self._fits and self._is_new(p))
        least = own.log_evidence - ODDS
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
        top = max(logs.values())
        total = sum(np.exp(log - top) for log in logs.values())
        order = sorted(logs, key=lambda names: -logs[names])
        return {names: float(np.exp(logs[names] - top) / total) for names in order}


__all__ = ["ODDS", "Posterior", "best_first"]
