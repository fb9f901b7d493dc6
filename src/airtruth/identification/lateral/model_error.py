"""Model error in the estimates of the lateral filter error: nonlinear terms of unknown size, noise of the moments that repeats.

Terms that are not free are random: the factor of a derivative is normal about zero, and its deviation is g times the size of the
derivative. Each kind of term has one g, whose logarithm is uniform over `LOG_SPREADS`; the derivatives and their covariance are
those of the posterior. The size of a moment's derivative is the norm over both moments, and over both rates: a change of alpha
turns the axes, which mixes them.

The derivatives hold at the angle of attack of the steady flight, which turbulence hides: its variance, times the square of the
change of the derivatives with alpha, is part of their covariance.

The noise of p' and r' is what the linear moments do not explain. It repeats with a manoeuvre, so that a joint estimate does not
average it: the part of a variance that this noise causes is that of one record.

Source: D. V. Lindley and A. F. M. Smith, J. R. Statist. Soc. B 34 (1972) 1-41, the lemma, for random factors of a linear model.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
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
_BY_ATTACK: Final = [
    (*LATERAL.parameters, *factor_names(TERMS)).index(f"{name}_{TERMS[0]}") for name in LATERAL.parameters
]
"""Position of the change of each derivative with alpha, where every nonlinear term is free."""
_MOMENTS: Final = slice(1, None)
"""Rows of the derivatives that are those of moments."""
_RATES: Final = [signal.length is not None for signal in LATERAL.signals]
"""Signals that are rates."""
LOG_SPREADS: Final = np.arange(-5.0, 3.5)
"""Logarithms of the change of a derivative per radian, over its size [-]; judgement: below the least, a change of the angle by
.1 rad moves it by less than .1 %; above the most, the linear model means nothing."""


class WithTerms(NamedTuple):
    """Maxima with random terms, and the change (groups, derivatives) of the derivatives with alpha [1/rad]."""

    maxima: Maxima
    by_attack: Array


class RandomTerms(NamedTuple):
    """Places of a fit among the parameters of one in which every nonlinear term is free.

    Attributes
    ----------
    places : positions of the parameters of the fit; factors : positions of the factors that are random.
    derivatives : numbers of the derivatives that these factors change; of_attack : whether with alpha, else with sideslip.
    """

    places: Ints
    factors: Ints
    derivatives: Ints
    of_attack: NDArray[np.bool_]

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
    factors = np.setdiff1d(np.arange(len(every)), own)
    of = [every[i].rpartition("_")[::2] for i in factors]
    derivatives = np.array([LATERAL.index(name) for name, _ in of], dtype=np.int64)
    return RandomTerms(
        places, factors, derivatives, np.array([term == TERMS[0] for _, term in of], dtype=np.bool_)
    )


def with_random_terms(maxima: Maxima, score: Scored, weight: Array, random: RandomTerms) -> WithTerms:
    """Maxima whose derivatives and their covariances hold random terms, from one step of scoring.

    Parameters
    ----------
    maxima : maxima of the likelihood without these terms, of groups of runs; each has one.
    score : cost, gradient and information of the groups at `RandomTerms.point` of them.
    weight : inverse variances of the prior of the parameters of the fit.
    random : the terms.
    """
    _, gradient, likelihood = score
    full = normal_equations.scaled_inverse(likelihood + np.diag(random.point(weight[None])[0]), RIDGE)
    z, covariance, every = maxima.z.copy(), maxima.covariance.copy(), random.point(maxima.z)
    pairs = product(np.exp(2.0 * LOG_SPREADS), repeat=2)
    squares = np.array([np.where(random.of_attack, *pair) for pair in pairs])
    diagonal = np.arange(random.factors.size)
    for group, inverse in enumerate(full):
        by_factors = inverse[:, random.factors]
        free = -by_factors @ gradient[group, random.factors]
        inner = np.repeat(by_factors[random.factors][None], len(squares), axis=0)
        inner[:, diagonal, diagonal] += squares * _sizes(maxima.z[group, _OWN])[random.derivatives] ** 2
        precision = np.linalg.inv(inner)
        pull = precision @ free[random.factors]
        logarithm = -0.5 * (np.linalg.slogdet(inner)[1] + pull @ free[random.factors])
        share = np.exp(logarithm - logarithm.max())
        share /= share.sum()
        mean = share @ pull
        less = np.tensordot(share, precision, 1) - (share[:, None] * (pull - mean)).T @ (pull - mean)
        every[group] += free - by_factors @ mean
        derivatives = by_factors[_OWN]
        covariance[group, _OWN, _OWN] = inverse[_OWN, _OWN] - derivatives @ less @ derivatives.T
    z[:, _OWN] = every[:, _OWN]
    return WithTerms(replace(maxima, z=z, covariance=covariance), every[:, _BY_ATTACK])


def _sizes(theta: Array) -> Array:
    """(15,) sizes of the derivatives (15,) that scale their random factors."""
    size = np.square(theta.reshape(LATERAL.shape))
    size[_MOMENTS] = size[_MOMENTS].sum(axis=0)
    size[:, _RATES] = size[:, _RATES].sum(axis=1, keepdims=True)
    return np.sqrt(size).reshape(-1)


def with_uncertain_attack(made: WithTerms, variance: Array) -> Maxima:
    """Maxima whose derivatives hold at an angle of attack of that variance (groups,) [rad2]."""
    covariance = made.maxima.covariance.copy()
    moved = made.by_attack * np.sqrt(variance)[:, None]
    covariance[:, _OWN, _OWN] += moved[:, :, None] * moved[:, None, :]
    return replace(made.maxima, covariance=covariance)


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


__all__ = [
    "RandomTerms",
    "WithTerms",
    "random_terms",
    "with_random_terms",
    "with_repeated_noise",
    "with_uncertain_attack",
]
