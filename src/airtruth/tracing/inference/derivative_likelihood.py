"""The derivatives: their likelihood without what is declared, and whether the records contradict the declaration.

The posterior of a fit is normal in the increments d of the derivatives, with precision C^-1 = I + L: the information I
of the records, all other parameters eliminated, and the precision L of what is declared. The likelihood alone is

    log p(records | d) = constant + g'd - d'I d/2,   g = C^-1 d_m

with d_m the mode.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

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


@dataclass(frozen=True)
class Contradiction(HypothesisTest):
    """Test of the declared derivatives against the records: the stronger of that of all directions and that of one derivative.

    Attributes
    ----------
    directions, derivatives : numbers of directions and of single derivatives that the records determine [-].
    """

    directions: int
    derivatives: int


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


def size_along(likelihood: DerivativeLikelihood, direction: Array) -> tuple[float, float]:
    """Size of a cause alone, without its prior, and its standard deviation.

    The derivatives keep their declared uncertainty, so that size over standard deviation is standard normal where they are
    right. Generalised least squares of the peak of the likelihood, covariance I^-1 + D, on the direction.

    Parameters
    ----------
    direction : (derivatives,) change of the derivatives per unit of size.
    """
    turned = np.eye(len(likelihood.vector)) + likelihood.information @ likelihood.declared
    seen = np.linalg.solve(turned, likelihood.vector)
    information = float(direction @ np.linalg.solve(turned, likelihood.information) @ direction)
    if not information > 0.0:
        return 0.0, math.inf
    return float(direction @ seen) / information, information**-0.5


def contradiction(problem: TraceProblem, fitted: PosteriorFit) -> Contradiction:
    """Test whether the mode of a fit with the declared prior lies where the declaration lets it lie.

    With a true declaration, the mode d_m = C (I d + e) has the covariance C I S I C + C K C: S of the declared
    derivatives d, K of the slope e of the likelihood. Directions that the records do not determine do not count. The joint
    test is chi-square over the others. It has little power against one wrong derivative among fifteen, so each derivative
    is also tested by the score along the shift of the mode that its own error brings. The level of the largest of these
    scores is Sidak's, exact for independent scores and an upper bound for others, and both tests share the level.

    Where the fit holds released derivatives, the declaration is that of what explains them.

    Sources: G. E. P. Box, J. R. Statist. Soc. A 143 (1980), the prior predictive check; Z. Sidak, J. Am. Statist. Assoc. 62
    (1967), theorem 1, the bound.
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
    own = np.ix_(tight, tight)
    return against_declaration(mode[tight], declared[own], spread[own], gain[own])


def against_declaration(mode: Array, declared: Array, spread: Array, gain: Array) -> Contradiction:
    """Test a mode against its distribution where the declaration is right.

    Parameters
    ----------
    mode : (derivatives,); declared, spread : covariance of the declared derivatives, and of the mode.
    gain : shift of the mode by a unit error of each declared derivative, one column each.
    """
    root = np.linalg.cholesky(declared)
    white = np.linalg.solve(root, np.linalg.solve(root, spread).T)
    values, vectors = np.linalg.eigh(0.5 * (white + white.T))
    told = values > _TOLD
    normal = (vectors[:, told] / np.sqrt(values[told])).T
    z = normal @ np.linalg.solve(root, mode)
    statistic, degrees = float(z @ z), int(told.sum())
    if not degrees:
        return Contradiction(DERIVATIVES_MOVED, 0.0, 0, 1.0, 0, 0)
    joint = float(chdtrc(degrees, statistic))
    shifts = normal @ np.linalg.solve(root, gain * np.sqrt(np.diag(declared)))
    power = (shifts**2).sum(axis=0)
    shown = power > _TOLD
    if not shown.any():
        return Contradiction(DERIVATIVES_MOVED, statistic, degrees, joint, degrees, 0)
    count, largest = int(shown.sum()), float(((shifts.T @ z)[shown] ** 2 / power[shown]).max())
    alone = -math.expm1(count * math.log1p(-float(chdtrc(1, largest)))) if largest > 0.0 else 1.0
    if alone < joint:
        statistic, degrees = largest, 1
    p_value = min(1.0, 2.0 * min(joint, alone))
    return Contradiction(DERIVATIVES_MOVED, statistic, degrees, p_value, int(told.sum()), count)


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


__all__ = [
    "DERIVATIVES_MOVED",
    "Contradiction",
    "DerivativeLikelihood",
    "against_declaration",
    "contradiction",
    "derivative_likelihood",
    "size_along",
]
