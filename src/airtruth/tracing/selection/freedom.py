"""What the freedom alone is worth that an effect gives to derivatives and trim coefficients.

A curvature of unknown vertex releases a slope and a constant from their declaration
(`airtruth.tracing.inference.hypothesis.unconstrained_by`). The gain of its refit contains that of this release.
"""

from __future__ import annotations

from dataclasses import replace

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.parameters import Parameters


class Freedom:
    """What a null gains by the freedom alone that an effect gives to derivatives and trim coefficients.

    Effects that give the same freedom share the fit that begins at the null.
    """

    def __init__(self, problem: TraceProblem, null: PosteriorFit) -> None:
        self._problem = problem
        self._null = null
        self._from_null: dict[tuple[int, ...], PosteriorFit | None] = {}

    def correction(self, effect: Effect, best: PosteriorFit) -> float:
        """Log L gained beside an effect whose refit is ``best``."""
        problem, null = self._problem, self._null
        free = null.hypothesis.plus(effect).unconstrained
        if free == null.hypothesis.unconstrained:
            return 0.0
        hypothesis = replace(null.hypothesis, also_unconstrained=free)
        if free not in self._from_null:
            self._from_null[free] = fit(problem, hypothesis, null.point, near=null)
        ends = (self._from_null[free], fit(problem, hypothesis, without_last_effect(null, best), near=best))
        return max([null.cost - end.cost for end in ends if end is not None], default=0.0)


def without_last_effect(null: PosteriorFit, best: PosteriorFit) -> Parameters:
    """The parameters of a refit without those of its last effect."""
    return replace(best.point, sizes=best.point.sizes[: len(null.point.sizes)])


__all__ = ["Freedom", "without_last_effect"]
