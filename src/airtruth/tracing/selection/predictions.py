"""Predictions of sets of effects that have no refit, by the quadratics about some fits."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Final

from airtruth.tracing.inference.causes import Cause
from airtruth.tracing.selection.evidence import Quadratic
from airtruth.tracing.selection.expansion import Expansion
from airtruth.tracing.selection.posterior import EvaluatedSet
from airtruth.tracing.selection.set_table import SetTable

Keys = frozenset[str]
"""Keys of the effects of the filter that a set holds."""

MOST_EFFECTS: Final = 3
"""Number of effects up to which a quadratic predicts every set; larger ones grow from its fit [-] (judgement: computing time)."""
LARGEST: Final = 4
"""Largest number of effects of a set [-] (judgement: more in a few records have not been separable)."""
_SCALE: Final = 2.0
"""Largest gain over the predicted one that is allowed for [-] (judgement: a quadratic that errs by more tells nothing)."""


class Predictions:
    """Expansions about fits, and the sets that they predict.

    Parameters
    ----------
    sets : fits of the search; causes : what changes the derivatives beside effects of the filter.
    wrong_allowed : whether declarations of derivatives may be wrong.
    """

    def __init__(self, sets: SetTable, causes: Sequence[Cause], wrong_allowed: bool) -> None:
        self._sets, self._causes, self._wrong_allowed = sets, causes, wrong_allowed
        self._expansions: list[Expansion] = []
        self._parts: list[Expansion] = []
        self._told: dict[tuple[int, float], dict[Keys, EvaluatedSet]] = {}
        self.temper = 1.0
        self.by_effects: dict[Keys, EvaluatedSet] = {}

    def quadratic(self, expansion: Expansion) -> Quadratic:
        """The evidence of sets about a fit, under the present ratio of variances."""
        return expansion.quadratic(self._sets.problem, self._causes, self.temper, self._wrong_allowed)

    def add(self, expansion: Expansion) -> None:
        """Enter a quadratic that may predict every set."""
        self._expansions.append(expansion)
        self.combine()

    def add_part(self, expansion: Expansion) -> None:
        """Enter a quadratic that predicts only sets with all effects of its fit and more."""
        self._parts.append(expansion)
        self.combine()

    def combine(self) -> None:
        """Predict each set by the quadratic whose fit differs from it by the fewest effects, the better of two with as many.

        A part of the set that has more effects than this fit predicts it instead. What that quadratic neglects is left out.
        """
        told = [(x.effects_of_fit, self._of(x)) for x in self._expansions]
        parts = sorted(((x.effects_of_fit, self._of(x)) for x in self._parts), key=lambda own: -len(own[0]))
        self.by_effects = {}
        for key in dict.fromkeys(key for _, every in told for key in every):
            least = min(len(own ^ key) for own, _ in told)
            by_nearest = (every.get(key) for own, every in told if len(own ^ key) == least)
            best = max((p for p in by_nearest if p is not None), key=_log_evidence, default=None)
            if best is None:
                continue
            fitted = best.expansion.effects_of_fit
            best = next((every.get(key) for own, every in parts if fitted < own < key), best)
            if best is not None:
                self.by_effects[key] = best

    def part_to_add(self, p: EvaluatedSet, fitted: Collection[Keys]) -> Keys | None:
        """The largest refitted part of a set that has more effects than the fit that predicts the set, and no quadratic yet.

        A quadratic about a distant fit promises a gain to every set with two given effects, also where the refit of these two has
        disproved it.

        Parameters
        ----------
        fitted : the sets with a refit.
        """
        made = {x.effects_of_fit for x in (*self._expansions, *self._parts)}
        parts = [key for key in fitted if p.expansion.effects_of_fit < key < p.in_filter and key not in made]
        return max(parts, key=len, default=None)

    def expected(self, sets: Sequence[EvaluatedSet], refitted: Mapping[Keys, float]) -> list[float]:
        """Log-evidence of sets without a refit if their gain is as much larger than predicted as that of other sets.

        Far from its fit a quadratic errs by a share of the gain, and by the same share for effects that look alike.

        Parameters
        ----------
        refitted : largest log-evidence of the refits of each set.
        """
        scales = {id(x): self._scale(x, refitted) for x in (*self._expansions, *self._parts)}
        found = []
        for p in sets:
            base = self._of(p.expansion).get(p.expansion.effects_of_fit)
            log = p.weighed.log_evidence
            gain = 0.0 if base is None else max(log - base.weighed.log_evidence, 0.0)
            found.append(log + (scales[id(p.expansion)] - 1.0) * gain)
        return found

    def _scale(self, expansion: Expansion, refitted: Mapping[Keys, float]) -> float:
        """Largest gain in log-evidence that refits have shown, over the one that a quadratic predicted: 1 to `_SCALE`."""
        told, ratios = self._of(expansion), [1.0]
        base = told.get(expansion.effects_of_fit)
        for key, log in refitted.items():
            if base is None or told.get(key, base) is base:
                continue
            predicted = told[key].weighed.log_evidence - base.weighed.log_evidence
            if predicted > 1.0:
                ratios.append((log - base.weighed.log_evidence) / predicted)
        return min(max(ratios), _SCALE)

    def _of(self, expansion: Expansion) -> dict[Keys, EvaluatedSet]:
        """The sets that a quadratic predicts."""
        at = id(expansion), self.temper
        if at not in self._told:
            q = self.quadratic(expansion)
            own = range(len(expansion.last.hypothesis.effects))
            every = q.sets(MOST_EFFECTS) + (q.grown(own) if MOST_EFFECTS <= len(own) < LARGEST else [])
            every.sort(key=lambda w: w.log_evidence)
            self._told[at] = {q.in_filter(w): EvaluatedSet(expansion, q, w) for w in every}
        return self._told[at]


def _log_evidence(p: EvaluatedSet) -> float:
    return p.weighed.log_evidence


__all__ = ["LARGEST", "MOST_EFFECTS", "Keys", "Predictions"]
