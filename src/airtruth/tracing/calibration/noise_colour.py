"""Coloured sensor noise: whether part of the noise is slow, tested before anything is traced.

Correlated noise (a Gauss-Markov process beside the white one) costs states and parameters, and most records have none, so
it enters only where the records show it. It is indistinguishable from a model error where the noise levels are not
declared, where it would be as slow as a motion, and where all noise would be slow: then it does not enter.

Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50-57 (the score test), one-sided for the share of each sensor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from airtruth.tracing.inference.direction import eliminated
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import (
    PosteriorFit,
    TraceProblem,
    likelihood_terms,
    marginal_information,
    sensitivities_of,
)
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.prepare import Case

Array = NDArray[np.float64]

LEVEL: Final = 1e-9
"""Significance level of the scores of all outputs together [-] (judgement: half of the variance correlated over 80 ms scores 8 to
17 standard deviations in four records of some seconds; a model error scores too, and less correlated noise than that does no
harm as white noise)."""
TYPICAL: Final = 0.3
"""Score over the root of the samples that a sensor has whose noise is slow for half of its variance, correlated over 80 ms [-];
the mean of 37 flights of one or two fitted records."""
_LATER: Final = 2.0 / 3.0
"""Share of the typical score that is enough beside accepted effects [-] (judgement)."""
LATER_LEVEL: Final = 5e-4
"""Largest significance level of the scores of all outputs together beside accepted effects [-] (judgement)."""
FIRST_SHARE: Final = 0.2
"""Share of correlated noise at which a search begins [-] (judgement; at zero the correlation time has no effect)."""


def with_coloured_noise(case: Case) -> tuple[Case, Parameters]:
    """The case, with correlated noise where its fitted records show some, and the parameters at which its search begins."""
    start = initial_parameters(case.fitted, case.hypothesis)
    null = fit(case.fitted, case.hypothesis, start)
    return (case, start) if null is None or _diverges_nearby(case, null) else beside(case, null)


def _diverges_nearby(case: Case, null: PosteriorFit) -> bool:
    """Whether a fit ended, not converged, where the motion diverges within a step, so that no other fit can begin there."""
    return not null.converged and fit(case.fitted, null.hypothesis, null.point, iterations=0) is None


def later_level(samples: int, outputs: int) -> float:
    """Significance level of the scores of all outputs together beside accepted effects [-].

    The limit of a score is two thirds of the typical one. A short record cannot reach the limit of `LEVEL`, and intervals under
    white noise are then too narrow. From 953 samples on the level is `LEVEL`, because a model error scores too.

    Parameters
    ----------
    samples : of all fitted records; outputs : number of outputs.
    """
    level = outputs * float(ndtr(-(_LATER * TYPICAL * np.sqrt(samples))))
    return min(max(level, LEVEL), LATER_LEVEL)


def beside(case: Case, null: PosteriorFit, level: float = LEVEL) -> tuple[Case, Parameters]:
    """The case, with correlated noise where its fitted records show some beside what a fit explains, and where a refit ends.

    Parameters
    ----------
    null : a fit of the case without correlated noise.
    level : significance level of the scores of all outputs together [-].
    """
    problem, hypothesis = case.fitted, null.hypothesis
    if not problem.settings.noise_is_declared:
        return case, null.point
    settings = replace(problem.settings, coloured=True)
    slow = replace(problem, settings=settings)
    z = scores(slow, null)
    if not (ndtr(-z) < level / len(z)).any():
        return case, null.point
    common = null.point.common.copy()
    common[slow.layout.common.colour_shares] = np.where(z > 0.0, FIRST_SHARE, 0.0)
    again = fit(slow, hypothesis, replace(null.point, common=common))
    entries = slow.layout.common
    if (
        again is None
        or not again.converged
        or any(again.point.common[i] == entries.bounds[i][1] for i in np.r_[entries.colour])
    ):
        return case, null.point
    held = None if case.held is None else replace(case.held, settings=settings)
    return replace(case, fitted=slow, held=held), again.point


def scores(problem: TraceProblem, null: PosteriorFit) -> Array:
    """(outputs,) signed roots of the score of each sensor's share, every parameter but the other shares refitted.

    Parameters
    ----------
    problem : problem with correlated noise; null : a fit without.
    """
    slope, information = share_slopes(problem, null)
    return np.asarray(-slope / np.sqrt(np.diag(information)))


def share_slopes(problem: TraceProblem, null: PosteriorFit) -> tuple[Array, Array]:
    """Slope (outputs,) of the cost in the shares and their information (outputs, outputs), every other parameter refitted.

    Parameters
    ----------
    problem, null : as of `scores`.
    """
    shares = np.r_[problem.layout.common.colour_shares]
    sensitivities = [
        sensitivities_of(problem, i, null.hypothesis, null.point) for i in range(len(problem.records))
    ]
    if any(t is None for t in sensitivities):
        return np.zeros(len(shares)), np.eye(len(shares))
    pieces = [likelihood_terms(t, NO_WHITENER, levels=True) for t in sensitivities if t is not None]
    held = tuple(i for i in null.point.at_bounds if i not in shares)
    gradient, information, _ = marginal_information(
        problem.priors(null.hypothesis), null.point, pieces, levels=True, fixed=held
    )
    return eliminated(gradient, information, shares)
