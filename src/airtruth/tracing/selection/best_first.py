"""Best-first search over sets of effects: quadratics predict their evidence, and the best are refitted.

Quadratics about the declared aircraft, the fit without any effect and the best fit predict every set of up to three effects, and
the best fit with a fourth one. The best set without a refit is refitted from the predicted point, and its own quadratic gives
its evidence with every explanation of the derivatives. A fit that leads is expanded in turn. The search ends when no set
without a refit is expected within odds of one in twenty of the best one that records left out do not refuse.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.effects.effect import Effect
from airtruth.tracing.anomalies.omnibus import anomalies
from airtruth.tracing.budget import Advance, may_begin
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.causes import DeclaredCauses
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.robust import inflation
from airtruth.tracing.inference.whitening import autoregression
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.expansion import Expansion, expanded
from airtruth.tracing.selection.explanation import simplest
from airtruth.tracing.selection.posterior import EvaluatedSet, Names, Posterior, normalised
from airtruth.tracing.selection.predictions import LARGEST, Predictions
from airtruth.tracing.selection.predictive import Soundness
from airtruth.tracing.selection.set_table import SAME, SetTable

REFITS: Final = 30
"""Largest number of refits [-] (judgement: ten to forty seconds)."""
_HELD: Final = 1e-4
"""Variance of derivatives that are held as they are declared, over the declared one [-] (judgement: a hundredth of a standard
deviation)."""


def best_first(
    sets: SetTable,
    hypothesis: Hypothesis,
    start: Parameters,
    effects: Sequence[Effect],
    declared: DeclaredCauses,
    advance: Advance = lambda step: None,
    known: Sequence[Mapping[str, float]] = (),
) -> Posterior | None:
    """Posterior probabilities of the sets of effects; None where not even the declared aircraft can be fitted.

    Parameters
    ----------
    sets : fits of the search; hypothesis, start : the declared aircraft, and where the search for its parameters begins.
    effects : candidates of the filter; declared : what else changes the derivatives.
    advance : receives the step that begins, or holds the time budget.
    known : sets of effects at which the search begins too: key -> value of the first parameter in its unit.
    """
    null = sets.converged(hypothesis, start)
    if null is None:
        return None
    free = tuple(e for e in effects if e.parameters[0].low < e.parameters[0].high)
    return _BestFirst(sets, null, free, declared, advance).run(known)


class _BestFirst:
    """Fits, predictions and evidence of one search."""

    def __init__(
        self,
        sets: SetTable,
        null: PosteriorFit,
        effects: tuple[Effect, ...],
        declared: DeclaredCauses,
        advance: Advance,
    ) -> None:
        # derivatives that have absorbed a lost surface leave its effect nothing to scale: it is a cause of theirs too
        scaled = {control.name for control in null.hypothesis.motion.controls}
        held = {e.key for e in effects if e.quantity not in scaled}
        self.sets, self.null, self.hypothesis = sets, null, null.hypothesis
        self.effects, self.advance = effects, advance
        causes = tuple(c for c in declared.causes if c.key not in held)
        self.predictions = Predictions(sets, causes, declared.wrong_allowed)
        self.is_sound = Soundness(sets.problem, null)
        self.refits = 1
        self._fits: dict[frozenset[str], list[Expansion]] = {}
        self._read: dict[tuple[int, float], list[EvaluatedSet]] = {}
        self._refused: list[PosteriorFit] = []
        self._tried: set[tuple[frozenset[str], Names, tuple[int, ...]]] = set()

    def run(self, known: Sequence[Mapping[str, float]]) -> Posterior:
        """Refit set after set until no other one can come within the odds."""
        null = self.null
        self._fits[frozenset()] = [expanded(self.sets.problem, null)]
        for sizes in known:
            self._begin_at(sizes)
        self._tempered(self._best().expansion.last)
        self._reweighed()
        as_declared = self._as_declared()
        if as_declared is not None:
            self.predictions.add(expanded(self.sets.problem, as_declared, self.effects))
        self._tempered(null)
        self._predict(null)
        measured: list[PosteriorFit] = [null]
        seen: list[PosteriorFit] = [null]
        swept, limit = False, REFITS
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
            if following is None and best.is_refitted and self._is_overfitted(fitted):
                self._refused.append(fitted)
                continue
            if following is None or self.refits >= limit:
                if not self._reweighed():
                    if swept or not self._is_misfit(fitted):
                        break
                    self._sweep()
                    swept, limit = True, self.refits + REFITS
                continue
            if not may_begin(self.advance, f"refit {' + '.join(following.names)}"):
                break
            self._refit(following)
        logs, evaluated = self._evidence()
        fits = {key: _first(every) for key, every in self._fits.items()}
        return Posterior(
            normalised(logs), evaluated, fits, null, self.refits, self.predictions.temper, self.is_sound
        )

    def _reweighed(self) -> bool:
        """Weigh the kinematics by the present ratio of variances; whether fits were made again for it."""
        if not self.sets.weigh_kinematics(self.predictions.temper):
            return False
        least = self._best().weighed.log_evidence + float(np.log(CRITERION.level))
        near = [k for k in self._fits if any(p.weighed.log_evidence > least for p in self._of_fit(k))]
        changed = [key for key in near if self.sets.holds_sensor_error(key)]
        for key in changed:
            for last in [expansion.last for expansion in self._fits.pop(key)]:
                self._enter(self.sets.converged(last.hypothesis, last.point, near=last))
                self.refits += 1
        self.predictions.combine()
        return bool(changed)

    def _begin_at(self, known: Mapping[str, float]) -> None:
        """Refit a set from the declared aircraft at known values."""
        effects = tuple(e for e in self.effects if e.key in known and len(e.parameters) == 1)
        if effects and may_begin(self.advance, f"refit {' + '.join(e.key for e in effects)}"):
            self._from_declared(effects, [e.parameters[0].size(known[e.key]) for e in effects])

    def _from_declared(self, effects: tuple[Effect, ...], sizes: Sequence[float]) -> PosteriorFit | None:
        """Refit a set from the declared aircraft."""
        hypothesis = replace(self.hypothesis, effects=effects)
        self.refits += 1
        return self._enter(self.sets.fit_from_declared(hypothesis, np.array(sizes), self.null))

    def _is_overfitted(self, fitted: PosteriorFit) -> bool:
        """Whether records left out refuse a possible fit: another set may explain them all.

        Impossible sizes show something that the library lacks, which no other set replaces.
        """
        return self.is_sound.is_possible(fitted) and not self.is_sound(fitted)

    def _is_misfit(self, fitted: PosteriorFit) -> bool:
        """Whether a fit leaves an anomaly beyond doubt."""
        tests = [t.p_value for t in anomalies(fitted, self.sets.problem, autoregression(fitted.innovations))]
        return len(tests) * min(tests) < CRITERION.certain

    def _sweep(self) -> None:
        """Refit every effect alone from the declared aircraft, until one of them leaves no anomaly beyond doubt.

        About a fit that lacks a large effect no quadratic shows it. Each refit is completed, because its cost may be far above
        that of the null until the search turns to the optimum.
        """
        for effect in self.effects:
            first = effect.parameters[0]
            if frozenset((effect.key,)) in self._fits or len(effect.parameters) > 1:
                continue
            if not may_begin(self.advance, f"refit {effect.key}"):
                return
            own = self._from_declared((effect,), [(first.sign or 1.0) * first.material])
            if own is not None and own.cost < self.null.cost and not self._is_misfit(own):
                return

    def _as_declared(self) -> PosteriorFit | None:
        """The fit with the declared derivatives: those of the null may have absorbed an effect."""
        spread = (_HELD - 1.0) * self.sets.problem.declared_covariance
        return self.sets.fit(replace(self.hypothesis, spread=spread), self.null.point)

    def _tempered(self, fitted: PosteriorFit) -> bool:
        """Set the ratio of variances to that of a fit; whether it has changed."""
        ratio = inflation(self.sets.problem, fitted, unbiased=True)
        layout = fitted.layout
        rows = np.r_[layout.of.common.derivatives, layout.sizes]
        temper = float(np.mean(ratio[rows] ** 2))
        if abs(np.log(temper / self.predictions.temper)) < SAME:
            return False
        self.predictions.temper = temper
        self.predictions.combine()
        return True

    def _best(self) -> EvaluatedSet:
        """The most probable set whose refit records left out have not refused, as they never refuse the null."""
        every = [p for key in self._fits for p in self._compared(key)]
        left = [p for p in every if not any(p.expansion.last is fitted for fitted in self._refused)]
        return max(left, key=lambda p: p.weighed.log_evidence)

    def _of_fit(self, key: frozenset[str]) -> list[EvaluatedSet]:
        """The sets with some effects of the filter that their fits weigh: with each explanation of the derivatives."""
        found: list[EvaluatedSet] = []
        for expansion in self._fits[key]:
            at = id(expansion), self.predictions.temper
            if at not in self._read:
                q = self.predictions.quadratic(expansion)
                every = q.sets(min(LARGEST, len(key) + 1) + 1)
                own = (w for w in every if q.in_filter(w) == key)
                self._read[at] = [EvaluatedSet(expansion, q, w) for w in own]
            found += self._read[at]
        return found

    def _compared(self, key: frozenset[str]) -> list[EvaluatedSet]:
        """The sets of a key, each explanation once: its refit, or its best prediction where it has none."""
        compared: dict[tuple[tuple[int, ...], tuple[int, ...], float], EvaluatedSet] = {}
        for p in sorted(self._of_fit(key), key=lambda p: (p.is_refitted, p.weighed.log_evidence)):
            d = p.weighed.declaration
            compared[p.weighed.columns, d.wrong, float(np.trace(d.spread))] = p  # the last one remains
        return list(compared.values())

    def _predict(self, fitted: PosteriorFit) -> None:
        """Enter the quadratic about a fit among those that predict the other sets."""
        self.predictions.add(expanded(self.sets.problem, fitted, self.effects))

    def _following(self, best: EvaluatedSet) -> EvaluatedSet | None:
        """The set to refit next: the best one under the prior of its own derivatives, those of one effect less, the best without
        a refit, and at last the simplest one that an answer can state, and those of one effect less. Far from its fit a quadratic
        predicts badly: it does not show that one of two effects that cancel each other is enough."""
        first = next((p for p in (best, *self._smaller(best)) if self._wants(p)), None)
        if first is not None:
            return first
        left = [
            p for key, p in self.predictions.by_effects.items() if key not in self._fits and self._is_new(p)
        ]
        least = best.weighed.log_evidence + float(np.log(CRITERION.level))
        refitted = {
            k: max(p.weighed.log_evidence for p in every) for k in self._fits if (every := self._of_fit(k))
        }
        expected = self.predictions.expected(left, refitted)
        if expected and max(expected) > least:
            following = left[int(np.argmax(expected))]
            part = self.predictions.part_to_add(following, self._fits)
            if part is None:
                return following
            self.predictions.add_part(expanded(self.sets.problem, _first(self._fits[part]), self.effects))
            return self._following(best)
        logs, evaluated = self._evidence()
        answer = evaluated[simplest(normalised(logs))]
        return next((p for p in (answer, *self._smaller(answer)) if self._wants(p)), None)

    def _smaller(self, answer: EvaluatedSet) -> Iterator[EvaluatedSet]:
        """The sets without one of the effects of the filter, whose refits show that the answer needs each."""
        q, w = answer.quadratic, answer.weighed
        for i in w.columns:
            if q.columns[i].effect is not None:
                less = EvaluatedSet(answer.expansion, q, q.without(w, i))
                if less.in_filter not in self._fits:
                    yield less

    def _wants(self, p: EvaluatedSet) -> bool:
        return self._is_new(p) and (p.explains_derivatives or not p.is_refitted)

    def _is_new(self, p: EvaluatedSet) -> bool:
        return self._row(p) not in self._tried

    @staticmethod
    def _row(p: EvaluatedSet) -> tuple[frozenset[str], Names, tuple[int, ...]]:
        return p.in_filter, p.names, p.weighed.declaration.wrong

    def _refit(self, p: EvaluatedSet) -> None:
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
                own = self.sets.converged(hypothesis, again.point) or again
        self._enter(own)

    def _enter(self, own: PosteriorFit | None) -> PosteriorFit | None:
        """Keep and return a refit, unless it is worse than the null that its set contains: it ended far from its optimum."""
        if own is not None and own.cost <= self.null.cost:
            key = frozenset(e.key for e in own.hypothesis.effects)
            self._fits.setdefault(key, []).append(expanded(self.sets.problem, own))
        return own

    def _start(self, p: EvaluatedSet) -> tuple[Hypothesis, Parameters]:
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
        at = p.expansion.integrated
        point = p.expansion.point(chosen, sizes, dict(zip(at, declared.tolist(), strict=True)))
        effects = tuple(p.expansion.effects[i] for i in chosen)
        total = spread + of_cause
        return replace(self.hypothesis, effects=effects, spread=total if total.any() else None), point

    def _evidence(self) -> tuple[dict[Names, float], dict[Names, EvaluatedSet]]:
        """Names of each set -> log-evidence, and its most probable member; a set without a refit has the predicted evidence."""
        logs: dict[Names, float] = {}
        evaluated: dict[Names, EvaluatedSet] = {}

        def add(p: EvaluatedSet) -> None:
            names, log = p.names, p.weighed.log_evidence
            logs[names] = float(np.logaddexp(logs.get(names, -np.inf), log))
            known = evaluated.get(names)
            if known is None or (p.is_refitted, log) > (known.is_refitted, known.weighed.log_evidence):
                evaluated[names] = p

        for key in self._fits:
            for p in self._compared(key):
                add(p)
        for key, p in self.predictions.by_effects.items():
            if key not in self._fits and self._is_new(p):
                add(p)
        return logs, evaluated


def _first(fits: Sequence[Expansion]) -> PosteriorFit:
    """The most probable fit of a set, under the declaration where it has one."""
    return min((e.last for e in fits), key=lambda f: (f.hypothesis.spread is not None, f.cost))


__all__ = ["best_first"]
