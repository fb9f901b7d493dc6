"""A refit that begins at the declared aircraft and not at the null, which may have absorbed the effect."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.parameters import Common, Parameters, PerRecord
from airtruth.tracing.selection.score_test import Score

_ITERATIONS: Final = 6
"""Iterations with gusts taken as strong [-] (judgement)."""


def from_declared(
    problem: TraceProblem,
    null: PosteriorFit,
    s: Score,
    size: float,
    rival: float,
    *,
    only_better: bool = False,
) -> PosteriorFit | None:
    """A refit of an effect beside a null, with the levels of noise and gusts of the null; options as of `fit`.

    From strong gusts the levels would fall for many steps far behind a rival, and the search would be given up.

    Parameters
    ----------
    s, size : score of the effect, and the size at which it begins.
    """
    hypothesis = null.hypothesis.plus(s.effect)
    start = initial_parameters(problem, hypothesis, at(null, s, size).sizes, _ITERATIONS)
    common = start.common.copy()
    common[Common.noise] = null.point.common[Common.noise]
    per_record = start.per_record.copy()
    per_record[:, PerRecord.log_gust] = null.point.per_record[:, PerRecord.log_gust]
    start = replace(start, common=common, per_record=per_record)
    return fit(problem, hypothesis, start, rival=rival, only_better=only_better, near=null)


def at(null: PosteriorFit, s: Score, size: float) -> Parameters:
    """The parameters of a null with an effect of a size beside them."""
    low, high = s.effect.parameters[0].reach
    sizes = s.direction.sizes(min(max(size, low), high))
    return replace(null.point, sizes=np.concatenate([null.point.sizes, sizes]))


__all__ = ["at", "from_declared"]
