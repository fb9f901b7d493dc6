"""A refit that begins at the declared aircraft and not at the null, which may have absorbed the effect."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.score_test import Score
from airtruth.tracing.selection.set_table import SetTable

Array = NDArray[np.float64]

_ITERATIONS: Final = 6
"""Iterations with gusts taken as strong [-] (judgement)."""


def from_declared(
    sets: SetTable,
    null: PosteriorFit,
    hypothesis: Hypothesis,
    sizes: Array,
    rival: float = np.inf,
    *,
    only_better: bool = False,
) -> PosteriorFit | None:
    """A refit with the levels of noise and gusts of a null; None and options as of `fit`.

    From strong gusts the levels would fall for many steps far behind a rival, and the search would be given up.

    Parameters
    ----------
    hypothesis, sizes : what is refitted, and the sizes of its effects at which the search begins.
    """
    start = initial_parameters(sets.problem, hypothesis, sizes, _ITERATIONS).with_levels(null.point)
    return sets.fit_from(hypothesis, start, rival=rival, only_better=only_better, near=null)


def with_effect(
    sets: SetTable,
    null: PosteriorFit,
    s: Score,
    size: float,
    rival: float,
    *,
    only_better: bool = False,
) -> PosteriorFit | None:
    """`from_declared` of a null's effects and one more.

    Parameters
    ----------
    s, size : score of the further effect, and the size at which it begins.
    """
    hypothesis = null.hypothesis.plus(s.effect)
    sizes = at(null, s, size).sizes
    return from_declared(sets, null, hypothesis, sizes, rival, only_better=only_better)


def at(null: PosteriorFit, s: Score, size: float) -> Parameters:
    """The parameters of a null with an effect of a size beside them."""
    low, high = s.effect.parameters[0].reach
    sizes = s.direction.sizes(min(max(size, low), high))
    return replace(null.point, sizes=np.concatenate([null.point.sizes, sizes]))


__all__ = ["at", "from_declared", "with_effect"]
