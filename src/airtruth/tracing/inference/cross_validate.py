"""Records left out of a fit: each is assessed with common parameters and sizes to which it did not contribute."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.normal_equations import step_without
from airtruth.tracing.inference.assess import Assessment, assess
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import (
    PosteriorFit,
    Priors,
    TraceProblem,
    likelihood_terms,
    marginal_information,
)
from airtruth.tracing.inference.whitening import NO_WHITENER

Array = NDArray[np.float64]

_RIDGE: Final = 1e-9
"""Ridge on the scaled information of all records [-]; they may say nothing of a size (judgement)."""
_TOLD: Final = 0.05
"""Share of the information that the other records have to hold for an estimate to move to theirs [-] (judgement: below it their
standard error is more than four times that of all records, and its loss would hide what an effect gains)."""
_MOST_STEP: Final = 1.0
"""Largest step of a common parameter that is no derivative [-]: a factor of e for levels (judgement)."""


class LeftOut(NamedTuple):
    """Records left out: negative log-likelihoods (records,), and the assessments."""

    likelihood: Array
    assessments: list[Assessment]


def leave_one_out(problem: TraceProblem, fitted: PosteriorFit) -> LeftOut:
    """Assess each fitted record without its own contribution.

    One step of scoring takes a record out of the fit: exact where the posterior is quadratic. Directions in which the other
    records hold less than `_TOLD` of the information keep their estimate: a break that one record alone flies through has no size
    in the others.
    """
    hypothesis, point, layout = fitted.hypothesis, fitted.point, fitted.layout
    terms = [likelihood_terms(s, NO_WHITENER, levels=True) for s in fitted.sensitivities]
    fixed = point.at_bounds
    priors = problem.priors(hypothesis)
    total = marginal_information(priors, point, terms, levels=True, fixed=fixed).information
    nothing = np.zeros_like(priors.common)

    def one(i: int) -> Assessment:
        alone = Priors(
            nothing, np.zeros_like(priors.sizes), np.zeros_like(priors.pull), priors.per_record[i : i + 1]
        )
        there = replace(point, common=np.zeros(point.of.common.size), per_record=point.per_record[i : i + 1])
        gradient, information, _ = marginal_information(
            alone, there, terms[i : i + 1], levels=True, fixed=fixed
        )
        move = step_without(gradient, information, total, _RIDGE, _TOLD)
        nuisance = point.of.common.nuisance
        move[nuisance] = np.clip(move[nuisance], -_MOST_STEP, _MOST_STEP)
        sizes = point.sizes + _within_range(hypothesis, point.sizes, move[layout.sizes])
        return assess(problem, i, hypothesis, point.common + move[layout.common], sizes, point.per_record[i])

    assessed = problem.each(one, range(len(problem.records)))
    return LeftOut(np.array([a.likelihood for a in assessed]), assessed)


def one_by_the_other(problem: TraceProblem, fitted: PosteriorFit) -> LeftOut:
    """`leave_one_out` of two records, each assessed with a refit to the other.

    Without half of the data one step of scoring can be too long; and a refit can be led astray by what the model lacks
    besides.
    """
    assessed = []
    for i, other in ((0, 1), (1, 0)):
        alone = TraceProblem((problem.records[other],), problem.settings)
        there = replace(fitted.point, per_record=fitted.point.per_record[other : other + 1])
        point = (fit(alone, fitted.hypothesis, there) or fitted).point
        own = fitted.point.per_record[i]
        assessed.append(assess(problem, i, fitted.hypothesis, point.common, point.sizes, own))
    return LeftOut(np.array([a.likelihood for a in assessed]), assessed)


def _within_range(hypothesis: Hypothesis, sizes: Array, step: Array) -> Array:
    """The step, ended where a parameter would leave its range."""
    ended = step.copy()
    for k, size in enumerate(sizes):
        low, high = hypothesis.parameter(k).reach
        ended[k] = min(max(size + step[k], low), high) - size
    return ended


__all__ = ["LeftOut", "leave_one_out", "one_by_the_other"]
