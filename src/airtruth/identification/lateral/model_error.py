"""Model error in the estimates of the lateral filter error: nonlinear terms of unknown size, noise of the moments that repeats.

Terms that are not free are random: their factors f are normal about zero with a covariance of g times that of their estimates,
and g is estimated from all of them. With k factors and the statistic W of Rao's test of f = 0, the derivatives move by the share
s = 1 - k/W, at least 0, of what free terms would move them, and their covariance grows by that share. A linear aircraft has W
of about k, so that little changes; a curved one has s near 1.

The noise of p' and r' is what the linear moments do not explain. It repeats with a manoeuvre, so that a joint estimate does not
average it: the part of a variance that this noise causes is that of one record.

Sources: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50-57; B. Efron and C. Morris, J. Am. Stat. Assoc. 68 (1973) 117-130, eq.
(1.11) for the share, the positive part of Stein's rule.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.lateral.predictor import factor_names
from airtruth.identification.likelihood.scoring import RIDGE, Maxima, Scored
from airtruth.identification.options import TERMS, Options
from airtruth.numerics import normal_equations
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_OWN: Final = slice(len(LATERAL.parameters))
"""Derivatives among the parameters."""


class RandomTerms(NamedTuple):
    """Places of a fit among the parameters of one in which every nonlinear term is free.

    Attributes
    ----------
    places : positions of the parameters of the fit; factors : positions of the factors that are random.
    """

    places: Ints
    factors: Ints

    def point(self, z: Array) -> Array:
        """Parameters (groups, all) of a fit (groups, its own), the random factors at zero."""
        made = np.zeros((len(z), self.places.size + self.factors.size))
        made[:, self.places] = z
        return made


def random_terms(options: Options, parameters: int) -> RandomTerms:
    """Terms that ``options.terms`` leaves out of a fit with so many parameters."""
    every = (*LATERAL.parameters, *factor_names(TERMS))
    own = [every.index(name) for name in (*LATERAL.parameters, *factor_names(options.terms))]
    places = np.array([*own, *(len(every) + i for i in range(parameters - len(own)))])
    return RandomTerms(places, np.setdiff1d(np.arange(len(every)), own))


def with_random_terms(maxima: Maxima, score: Scored, weight: Array, random: RandomTerms) -> Maxima:
    """Maxima whose derivatives and their covariances hold random terms, by one step of scoring.

    Parameters
    ----------
    maxima : maxima of the likelihood without these terms, of groups of runs; each has one.
    score : cost, gradient and information of the groups at `RandomTerms.point` of them.
    weight : inverse variances of the prior of the parameters of the fit.
    random : the terms.
    """
    _, gradient, likelihood = score
    prior = random.point(weight[None])[0]
    information = likelihood + np.diag(prior)
    slope = gradient[:, random.factors, None]
    known = np.einsum("gii->gi", information)[:, random.factors] > 0.0
    full = normal_equations.scaled_inverse(information, RIDGE)
    to_factors = full[:, :, random.factors]
    statistic = np.sum(slope * np.matmul(to_factors[:, random.factors], slope), axis=(1, 2))
    share = np.maximum(1.0 - known.sum(axis=1) / np.maximum(statistic, np.finfo(float).tiny), 0.0)
    z, covariance = maxima.z.copy(), maxima.covariance.copy()
    z[:, _OWN] -= share[:, None] * np.matmul(to_factors[:, _OWN], slope)[..., 0]
    covariance[:, _OWN, _OWN] += share[:, None, None] * (full[:, _OWN, _OWN] - covariance[:, _OWN, _OWN])
    return replace(maxima, z=z, covariance=covariance)


def with_repeated_noise(maxima: Maxima, total: Array, each: Array, quiet: Array) -> Maxima:
    """Maximum of all records whose derivatives have the deviations that noise of the moments causes if it repeats.

    Parameters
    ----------
    maxima : of one group, all records.
    total : (free, free) covariance without random terms.
    each : (records, free, free) information of each record.
    quiet : (free, free) joint information without that noise, with the prior, of the parameters but its levels.
    """
    variance = np.diag(total)[_OWN]
    shares = np.einsum("ij,rjk,ki->ri", total[_OWN], each, total[:, _OWN]) / variance
    # as many records of equal information: 1 where a single one determines the derivative
    records = shares.sum(axis=0) ** 2 / np.square(shares).sum(axis=0)
    least = np.diag(normal_equations.scaled_inverse(quiet, RIDGE))[_OWN]
    by_noise = np.clip(1.0 - least / variance, 0.0, 1.0)
    factor = np.sqrt(1.0 + (records - 1.0) * by_noise)
    covariance = maxima.covariance.copy()
    covariance[:, _OWN, _OWN] *= factor[:, None] * factor
    return replace(maxima, covariance=covariance)


__all__ = ["RandomTerms", "random_terms", "with_random_terms", "with_repeated_noise"]
