"""Robust covariance of a fit whose innovations are not white.

    V = J^-1 K J^-1,  K = sum over records of the long-run variance of the log-likelihood's slope

with J the information, both with the records' own parameters eliminated. If the model is right, K = J and V = J^-1. If
a misspecified model leaves motion in the innovations, J^-1 alone is too small.

Sources: H. White, Econometrica 50 (1982), theorem 3.2; long-run variance, W. K. Newey and K. D. West, Econometrica 55
(1987), eq. (5), and its share that is lost with the mean of a short record, N. M. Kiefer and T. J. Vogelsang, Econometric
Theory 21 (2005) 1130-1164; few clusters, C. B. Hansen, J. Econometrics 141 (2007), eq. (3).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from airtruth.numerics.normal_equations import scaled_inverse
from airtruth.tracing.inference.posterior import (
    PosteriorFit,
    TraceProblem,
    likelihood_terms,
    marginal_information,
)

Array = NDArray[np.float64]

_SEVERAL: Final = 3
"""Least number of records whose scatter is estimated [-]; judgement: two have one degree of freedom."""
MEMORY_S: Final = 1.0
"""Lag up to which slopes are correlated [s]; judgement: the correlation time of the gusts and of a short period."""
_RIDGE: Final = 1e-12
"""Ridge on the scaled information before it is inverted [-]; far above rounding, far below any information."""


def inflation(problem: TraceProblem, fitted: PosteriorFit, unbiased: bool = False) -> Array:
    """Robust over plain standard deviation of common parameters and sizes, from the slopes within records.

    Parameters
    ----------
    fitted : a fit to the problem's records, at its optimum.
    unbiased : whether long-run variances are divided by `mean_share`: an interval needs it, and so does a test on one or two
        records; a test whose threshold is calibrated with more records does not.

    Returns
    -------
    (common and sizes,) ratios [-], at least one: a long-run variance from few seconds scatters and is short on
    average, so that it never narrows an interval.
    """
    marginal = fitted.layout.marginal
    total = _prior_information(problem, fitted)
    for record, (slopes, own, mixed) in zip(problem.records, _slopes(problem, fitted), strict=True):
        z, _ = _without_own(marginal, slopes, own, mixed)
        lags = round(MEMORY_S / record.signals.dt_s)
        total += long_run(z - z.mean(axis=0), lags) / (mean_share(len(z), lags) if unbiased else 1.0)
    return _ratio(problem, fitted, total)


def scatter(problem: TraceProblem, fitted: PosteriorFit) -> Array:
    """Robust over plain standard deviation from the slopes of whole records: how far the records disagree.

    K is n/(n - 1) times the sum of squares of the records' slopes about their mean; all ratios are one for fewer than
    three records.
    """
    marginal = fitted.layout.marginal
    n = len(problem.records)
    if n < _SEVERAL:
        return np.ones(marginal.stop)
    # own parameters are at their best, so that a record's slope is that of its profile
    x = np.array([slopes[:, marginal].sum(axis=0) for slopes, _, _ in _slopes(problem, fitted)])
    off = x - x.mean(axis=0)
    total = n / (n - 1.0) * off.T @ off + _prior_information(problem, fitted)
    return _ratio(problem, fitted, total)


class MarginalSlope(NamedTuple):
    """Slope (parameters,) of the negative log-likelihood of one record, and information (parameters, parameters).

    The parameters are common parameters and sizes. The record's own are eliminated: ``own`` (per-record, parameters) times a step
    of the others is the step that they take.
    """

    slope: Array
    information: Array
    own: Array


def marginal_slopes(problem: TraceProblem, fitted: PosteriorFit) -> list[MarginalSlope]:
    """Slope and information of common parameters and sizes in each record; no prior of theirs counts."""
    marginal = fitted.layout.marginal
    levels = fitted.whitener.order == 0
    found = []
    for at, (slopes, own, mixed) in zip(fitted.sensitivities, _slopes(problem, fitted), strict=True):
        z, follow = _without_own(marginal, slopes, own, mixed)
        plain = likelihood_terms(at, fitted.whitener, levels).information[marginal, marginal]
        found.append(MarginalSlope(z.sum(axis=0), plain - mixed @ follow, -follow))
    return found


def _without_own(marginal: slice, slopes: Array, own: Array, mixed: Array) -> tuple[Array, Array]:
    """Slopes (samples, parameters) with the record's own parameters eliminated, and what the elimination multiplies those by."""
    follow = np.asarray(np.linalg.solve(own, mixed.T))
    free = slopes[:, marginal.stop : marginal.stop + own.shape[0]]
    return slopes[:, marginal] - free @ follow, follow


def _prior_information(problem: TraceProblem, fitted: PosteriorFit) -> Array:
    """Variance of the slopes of the priors on common parameters and sizes."""
    priors = problem.priors(fitted.hypothesis)
    sizes = np.diag(priors.sizes)
    if (
        priors.kinematics is not None
    ):  # a slope that counts several times varies with the square of their number
        told = priors.kinematics
        sizes += told.likelihood.weight * told.terms(fitted.point.sizes).information
    return np.asarray(block_diag(priors.common, sizes))


def robust_covariance(problem: TraceProblem, fitted: PosteriorFit) -> Array:
    """(common and sizes, common and sizes) covariance of a fit, widened by the larger of `inflation` and `scatter`."""
    ratio = np.maximum(inflation(problem, fitted, unbiased=True), scatter(problem, fitted))
    return np.asarray(fitted.covariance * np.outer(ratio, ratio))


def _slopes(problem: TraceProblem, fitted: PosteriorFit) -> list[tuple[Array, Array, Array]]:
    """For each record: the slope of every sample (samples, parameters), the information of its own parameters with
    their prior, and the mixed information of the others with them.
    """
    levels = fitted.whitener.order == 0
    layout = fitted.layout
    entries = problem.layout.per_record
    kept = np.arange(entries.size) if levels else np.delete(np.arange(entries.size), entries.log_gust)
    priors = problem.priors(fitted.hypothesis)
    result = []
    for (_, precision), at in zip(priors.per_record, fitted.sensitivities, strict=True):
        information = likelihood_terms(at, fitted.whitener, levels).information
        r, t = fitted.whitener.apply(at.r), fitted.whitener.apply(at.t)
        slopes = np.einsum("pki,ki->kp", t, r)
        if levels:
            spread = np.trace(at.w, axis1=1, axis2=2)
            slopes += 0.5 * (spread - np.einsum("pij,ki,kj->kp", at.w, r, r))
        own = information[layout.per_record, layout.per_record] + precision
        mixed = information[layout.marginal, layout.per_record]
        result.append((slopes, own[np.ix_(kept, kept)], mixed[:, kept]))
    return result


def _ratio(problem: TraceProblem, fitted: PosteriorFit, middle: Array) -> Array:
    """Square roots of the diagonals of J^-1 K J^-1 over those of J^-1, at least one."""
    levels = fitted.whitener.order == 0
    terms = [likelihood_terms(t, fitted.whitener, levels) for t in fitted.sensitivities]
    priors = problem.priors(fitted.hypothesis)
    information = marginal_information(priors, fitted.point, terms, levels=levels).information
    inverse = scaled_inverse(information, _RIDGE)
    robust = inverse @ middle @ inverse
    return np.asarray(np.sqrt(np.maximum(np.diag(robust) / np.diag(inverse), 1.0)))


def long_run(x: Array, lags: int) -> Array:
    """Variance (p, p) of the sum of a serially dependent series (samples, p) of mean zero, Bartlett weights."""
    total = x.T @ x
    for j in range(1, min(lags, len(x) - 1) + 1):
        product = x[j:].T @ x[:-j]
        total += (1.0 - j / (lags + 1.0)) * (product + product.T)
    return total


def mean_share(samples: int, lags: int) -> float:
    """Share of `long_run` that a white series keeps on average when its mean is subtracted; about 1 - b + b^2/3, b the
    lags over the samples.

    Source: the trace of M W over the samples, with the Bartlett weights W and the removal M of the mean; N. M. Kiefer and
    T. J. Vogelsang, Econometric Theory 21 (2005), section 3.
    """
    j = np.arange(1, min(lags, samples - 1) + 1)
    every = samples + 2.0 * float(((samples - j) * (1.0 - j / (lags + 1.0))).sum())
    return 1.0 - every / samples**2


__all__ = [
    "MEMORY_S",
    "inflation",
    "long_run",
    "marginal_slopes",
    "mean_share",
    "robust_covariance",
    "scatter",
]
