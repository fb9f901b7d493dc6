"""The derivatives: their likelihood without what is declared, and whether the records contradict the declaration.

The posterior of a fit is normal in the increments d of the derivatives, with precision C^-1 = I + L: the information I
of the records, all other parameters eliminated, and the precision L of what is declared. The likelihood alone is

    log p(records | d) = constant + g'd - d'I d/2,   g = C^-1 d_m

with d_m the mode.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.robust import inflation, scatter

Array = NDArray[np.float64]

_TOLD: Final = 0.05
"""Share of the declared variance that the records have to determine for a direction to be tested [-] (judgement: the
mode does not move in the others, and the linear theory of a small share is inaccurate)."""


DERIVATIVES_MOVED: Final = "the derivatives"
"""Deviation of the derivatives from those that are declared, or from those that an answer gives."""


@dataclass(frozen=True)
class DerivativeLikelihood:
    """Likelihood of the increments of the derivatives, normal, all other parameters eliminated.

    Attributes
    ----------
    information : (derivatives, derivatives), divided by the square of the robust over the plain standard deviation.
    vector : (derivatives,) slope of the log-likelihood at no increment.
    cost : negative log-likelihood at no increment, by the quadratic, with the priors of all other parameters.
    declared : (derivatives, derivatives) covariance of the increments by what is declared.
    motion : whose derivatives they are.
    """

    information: Array
    vector: Array
    cost: float
    declared: Array
    motion: Motion = LONGITUDINAL


def derivative_likelihood(
    problem: TraceProblem, fitted: PosteriorFit, robust: bool = True
) -> DerivativeLikelihood:
    """The likelihood of the derivatives about the mode of a fit.

    Parameters
    ----------
    robust : whether its standard deviations contain serial correlation of the innovations and scatter between records.
    """
    mode = fitted.point.common[problem.layout.common.derivatives]
    prior, information = _split(problem, fitted)
    ratio = _ratio(problem, fitted) if robust else np.ones(len(mode))
    peak = mode + np.linalg.pinv(information, hermitian=True) @ (prior @ mode)
    wide = information / np.outer(ratio, ratio)
    vector = wide @ peak
    own = fitted.cost - 0.5 * float(mode @ prior @ mode)
    return DerivativeLikelihood(
        information=wide,
        vector=vector,
        cost=own + float(vector @ mode - 0.5 * mode @ wide @ mode),
        declared=problem.declared_covariance,
        motion=problem.layout.motion,
    )


def contradiction(problem: TraceProblem, fitted: PosteriorFit) -> HypothesisTest:
    """Test whether the mode of a fit with the declared prior lies where the declaration lets it lie.

    With a true declaration, the mode d_m = C (I d + e) has the covariance C I S I C + C K C: S of the declared
    derivatives d, K of the slope e of the likelihood. Directions that the records do not determine do not count.

    Where the fit holds released derivatives, the declaration is that of what explains them.

    Source: G. E. P. Box, J. R. Statist. Soc. A 143 (1980), the prior predictive check.
    """
    mode = fitted.point.common[problem.layout.common.derivatives]
    tight = [i for i in range(mode.size) if i not in fitted.hypothesis.unconstrained]
    prior, information = _split(problem, fitted)
    ratio = _ratio(problem, fitted)
    covariance = np.linalg.inv(prior + information)
    gain = covariance @ information
    declared = problem.declared_covariance
    if fitted.hypothesis.spread is not None:
        declared = declared + fitted.hypothesis.spread
    spread = gain @ declared @ gain.T + (covariance @ information @ covariance) * np.outer(ratio, ratio)
    spread, declared = spread[np.ix_(tight, tight)], declared[np.ix_(tight, tight)]
    root = np.linalg.cholesky(declared)
    white = np.linalg.solve(root, np.linalg.solve(root, spread).T)
    values, vectors = np.linalg.eigh(0.5 * (white + white.T))
    told = values > _TOLD
    z = vectors.T @ np.linalg.solve(root, mode[tight])
    statistic = float((z[told] ** 2 / values[told]).sum())
    degrees = int(told.sum())
    p_value = float(chi2.sf(statistic, degrees)) if degrees else 1.0
    return HypothesisTest(DERIVATIVES_MOVED, statistic, degrees, p_value)


def _split(problem: TraceProblem, fitted: PosteriorFit) -> tuple[Array, Array]:
    """Precision of the derivatives by the prior of a fit, and their information in the records."""
    own = problem.layout.common.derivatives
    prior = np.linalg.inv(np.linalg.inv(problem.priors(fitted.hypothesis).common)[own, own])
    information = np.linalg.inv(fitted.covariance[own, own]) - prior
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    return prior, (vectors * np.maximum(values, 0.0)) @ vectors.T


def _ratio(problem: TraceProblem, fitted: PosteriorFit) -> Array:
    """(derivatives,) robust over plain standard deviations of the derivatives."""
    own = problem.layout.common.derivatives
    return np.maximum(inflation(problem, fitted)[own], scatter(problem, fitted)[own])


__all__ = ["DERIVATIVES_MOVED", "DerivativeLikelihood", "contradiction", "derivative_likelihood"]
