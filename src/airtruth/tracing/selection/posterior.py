"""Sets of effects with their evidence, and the posterior of all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.selection.evidence import Quadratic, Weighed
from airtruth.tracing.selection.expansion import Expansion
from airtruth.tracing.selection.explanation import ExplainedDerivatives, shares, simplest
from airtruth.tracing.selection.predictive import Soundness

Names = tuple[str, ...]
"""Names of a set, sorted."""


@dataclass(frozen=True)
class EvaluatedSet:
    """A set with its evidence.

    Attributes
    ----------
    expansion : about the fit that tells; quadratic, weighed : the set in it.
    """

    expansion: Expansion
    quadratic: Quadratic
    weighed: Weighed

    @cached_property
    def names(self) -> Names:
        """Names of the set."""
        return self.quadratic.names(self.weighed)

    @cached_property
    def in_filter(self) -> frozenset[str]:
        """Keys of the effects of the set that the filter holds."""
        return self.quadratic.in_filter(self.weighed)

    @property
    def explains_derivatives(self) -> bool:
        """Whether it holds wrong declarations, or causes that the filter does not carry."""
        return bool(self.weighed.declaration.wrong) or any(
            self.quadratic.columns[i].cause for i in self.weighed.columns
        )

    @property
    def is_refitted(self) -> bool:
        """Whether the fit has the effects of the set, and its own prior of the derivatives."""
        fitted = self.expansion.last.hypothesis
        own = {e.key for e in fitted.effects} == self.in_filter
        return own and (fitted.spread is not None) == self.explains_derivatives

    @property
    def explanation(self) -> ExplainedDerivatives | None:
        """The derivatives by this set; None where it leaves them as they are declared."""
        if not self.explains_derivatives:
            return None
        q, w = self.quadratic, self.weighed
        sizes, std = q.alone(w)
        at = [k for k, i in enumerate(w.columns) if q.columns[i].cause is not None]
        motion = self.expansion.last.hypothesis.motion
        return ExplainedDerivatives(
            tuple(q.columns[w.columns[k]].key for k in at),
            tuple(motion.parameters[i] for i in w.declaration.wrong),
            tuple(float(sizes[k]) for k in at),
            tuple(float(std[k]) for k in at),
        )


@dataclass(frozen=True)
class Posterior:
    """Outcome of a search.

    Attributes
    ----------
    weights : names of each set -> its posterior probability among all sets, the most probable first.
    evaluated : names of each set -> its most probable member, refitted where one was.
    fits : keys of the effects of the filter -> their most probable fit under the declaration.
    null : fit without any effect.
    refits : number of refits, that without any effect included.
    temper : long-run variance of the slopes of the likelihood over that of white innovations [-].
    is_sound : the tests that a fit of an answer has to pass.
    """

    weights: Mapping[Names, float]
    evaluated: Mapping[Names, EvaluatedSet]
    fits: Mapping[frozenset[str], PosteriorFit]
    null: PosteriorFit
    refits: int
    temper: float
    is_sound: Soundness

    @property
    def simplest(self) -> Names:
        """The set of an answer, see `airtruth.tracing.selection.explanation.simplest`."""
        return simplest(self.weights)

    @property
    def best(self) -> PosteriorFit:
        """Fit of the most probable set."""
        return self.evaluated[next(iter(self.weights))].expansion.last


def normalised(logs: Mapping[Names, float]) -> dict[Names, float]:
    """Posterior probabilities, the largest first."""
    top = max(logs.values())
    order = sorted(logs, key=lambda names: (-logs[names], names))
    return shares({names: float(np.exp(logs[names] - top)) for names in order})


__all__ = ["EvaluatedSet", "Names", "Posterior", "normalised"]
