"""Monte Carlo statistics of an estimator over runs, each with its own Monte Carlo standard error.

Arrays in, arrays out: n runs by k parameters. With too few runs, or where a diverged estimate overflows, a figure is
NaN or infinite, never a warning.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics import short_period

Array = NDArray[np.float64]

MAD_TO_STD: Final = 1.482602218505602
"""1/Phi^-1(3/4) [-]: scales the median absolute deviation to the standard deviation of a normal sample."""

_SIX: Final = slice(0, len(short_period.PARAMETERS))
"""Columns of the six derivatives."""

_MODAL: Final = slice(len(short_period.PARAMETERS), None)
"""Columns of wn and zeta."""


@dataclass(frozen=True)
class Statistic:
    """Values and their Monte Carlo standard errors, arrays of the same shape."""

    value: Array
    se: Array


@dataclass(frozen=True)
class RelativeError:
    """RelErr = ||mean error||/||truth|| over the parameters [-].

    Attributes
    ----------
    value, se : RelErr and its standard error (delta method).
    floor : root mean square of the RelErr of an unbiased estimator with the same covariance and number of
        runs [-]; a RelErr near it is no evidence of a bias.
    influence : (n,) contribution of each run to the deviation of RelErr; their sum of squares is the
        squared standard error times (n - 1)/n.
    """

    value: float
    se: float
    floor: float
    influence: Array


@dataclass(frozen=True)
class Counts:
    """Number of runs by outcome; total = failed_to_fly + used + not_converged + diverged.

    Attributes
    ----------
    total : planned runs.
    failed_to_fly : runs without a log.
    used : runs with a converged, finite estimate; only these enter means, standard deviations, RMSE and RelErr.
    not_converged : runs with a finite estimate that did not converge.
    diverged : runs without a finite estimate.
    aperiodic : used runs with a non-oscillatory estimate, which has no modal parameters.
    reasons : status of the runs that flew but are not used -> number of runs.
    """

    total: int
    failed_to_fly: int
    used: int
    not_converged: int
    diverged: int
    aperiodic: int
    reasons: Mapping[str, int]


@dataclass(frozen=True)
class MethodStatistics:
    """All statistics of one method over one campaign; arrays follow the eight estimated parameters.

    Attributes
    ----------
    counts : number of runs by outcome.
    mean, std : (8,) over the used runs; wn and zeta over the oscillatory ones.
    rmse : (8,) root mean square error against the truth of each run.
    coverage : (8,) fraction of the used runs with the truth inside the interval [-].
    median, mad : (8,) over every finite estimate, converged or not; the median absolute deviation
        is scaled to the standard deviation of a normal sample.
    relerr : relative error of the six derivatives.
    relerr_modal : (2,) relative error of wn and of zeta.
    iterations : () mean number of iterations of the used runs.
    correlation : (6, 6) correlation of the six estimates over the used runs.
    influence : (runs,) influence of each planned run on RelErr, 0 where the run is not used.
    """

    counts: Counts
    mean: Statistic
    std: Statistic
    rmse: Statistic
    coverage: Statistic
    median: Array
    mad: Array
    relerr: RelativeError
    relerr_modal: Statistic
    iterations: Statistic
    correlation: Array
    influence: Array


def mean(x: Array) -> Statistic:
    """Return the mean over the rows; its standard error is s/sqrt(n)."""
    n = len(x)
    if n == 0:
        return _unknown(x)
    se = np.std(x, axis=0, ddof=1) / math.sqrt(n) if n > 1 else np.full(x.shape[1:], np.nan)
    return Statistic(np.mean(x, axis=0), np.asarray(se))


def standard_deviation(x: Array) -> Statistic:
    """Return the standard deviation (n - 1) over the rows; its standard error holds for any distribution.

    The standard error is sqrt(var(k2))/(2 s), with the unbiased estimate of the variance of the
    sample variance var(k2) = (2 n k2^2 + (n - 1) k4)/(n (n + 1)), k2 and k4 the k-statistics (Kendall
    and Stuart, The Advanced Theory of Statistics, vol. 1, ch. 12). It needs n > 3.
    """
    n = len(x)
    if n < 2:
        return _unknown(x)
    s = np.std(x, axis=0, ddof=1)
    if n < 4:
        return Statistic(s, np.full_like(s, np.nan))
    d = x - np.mean(x, axis=0)
    s2, s4 = np.sum(d**2, axis=0), np.sum(d**4, axis=0)
    k2 = s2 / (n - 1)
    k4 = (n * (n + 1) * s4 - 3 * (n - 1) * s2**2) / ((n - 1) * (n - 2) * (n - 3))
    variance = np.maximum((2 * n * k2**2 + (n - 1) * k4) / (n * (n + 1)), 0.0)
    return Statistic(s, np.sqrt(variance) / (2.0 * np.where(s > 0.0, s, np.inf)))


def rms(errors: Array) -> Statistic:
    """Return the root mean square over the rows; its standard error follows from that of the mean square (delta method)."""
    square = mean(errors**2)
    value = np.sqrt(square.value)
    return Statistic(value, square.se / (2.0 * np.where(value > 0.0, value, np.inf)))


def hit_rate(hits: Array) -> Statistic:
    """Return the fraction of rows that are 1 and not 0.

    The standard error is that of Agresti and Coull (The American Statistician 52, 1998), with two hits and
    two misses added. Unlike sqrt(p (1 - p)/n) it is not 0 where all rows or no rows are hits.
    """
    n = len(hits)
    if n == 0:
        return _unknown(hits)
    p = (np.sum(hits, axis=0) + 2.0) / (n + 4.0)
    return Statistic(np.mean(hits, axis=0), np.sqrt(p * (1.0 - p) / (n + 4.0)))


def relative_error(errors: Array, truth: Array) -> RelativeError:
    """Return RelErr, the norm of the mean error over the norm of the truth.

    Parameters
    ----------
    errors : (n, k) estimate - truth of each run.
    truth : (k,) truth; its mean over the runs where it differs between runs.
    """
    n = len(errors)
    size = float(np.linalg.norm(truth))
    if n < 2:
        value = float(np.linalg.norm(errors[0])) / size if n else math.nan
        return RelativeError(value, math.nan, math.nan, np.zeros(n))
    bias = np.mean(errors, axis=0)
    centred = errors - bias
    length = float(np.linalg.norm(bias))
    direction = bias / length if length > 0.0 else np.zeros_like(bias)
    influence = centred @ direction / (size * n)
    return RelativeError(
        value=length / size,
        se=math.sqrt(float(np.sum(influence**2)) * n / (n - 1)),
        floor=math.sqrt(float(np.sum(centred**2)) / (n - 1) / n) / size,
        influence=influence,
    )


@np.errstate(over="ignore", invalid="ignore")
def ratio(
    numerator: float, numerator_influence: Array, denominator: float, denominator_influence: Array
) -> tuple[float, float]:
    """Return the ratio of two RelErr over the same runs, and its standard error.

    Both methods see the same noise, therefore the errors are paired run by run (delta method on the
    logarithm). Both influences have one entry per planned run. NaN where one RelErr is 0.
    """
    if not (numerator > 0.0 and denominator > 0.0):
        return math.nan, math.nan
    value = numerator / denominator
    paired = numerator_influence / numerator - denominator_influence / denominator
    return value, value * float(np.linalg.norm(paired))


@np.errstate(over="ignore", invalid="ignore")
def method_statistics(
    truth: Array,
    flown: NDArray[np.bool_],
    values: Array,
    lower: Array,
    upper: Array,
    converged: NDArray[np.bool_],
    iterations: Array,
    status: tuple[str, ...],
) -> MethodStatistics:
    """Return the statistics of one method over the runs of a campaign.

    Parameters
    ----------
    truth : (runs, 8) six derivatives [-], wn [rad/s], zeta [-].
    flown : (runs,) whether the run has a log.
    values, lower, upper : (runs, 8) estimates and the bounds of their intervals.
    converged, iterations, status : (runs,) how the estimation of each run ended.
    """
    finite = flown & np.isfinite(values[:, _SIX]).all(axis=1)
    used = finite & converged
    oscillates = used & np.isfinite(values[:, _MODAL]).all(axis=1)
    errors = values - truth
    held = (lower <= truth) & (truth <= upper)

    def over_used(function: Callable[[Array], Statistic], x: Array) -> Statistic:
        six, modal = function(x[used, _SIX]), function(x[oscillates, _MODAL])
        return Statistic(np.concatenate([six.value, modal.value]), np.concatenate([six.se, modal.se]))

    coverage = over_used(hit_rate, held.astype(np.float64))
    stated = ~np.isnan(lower[used]).all(axis=0)
    relerr = relative_error(errors[used, _SIX], mean(truth[used, _SIX]).value)
    modal_bias = mean(errors[oscillates, _MODAL])
    modal_truth = np.abs(mean(truth[oscillates, _MODAL]).value)
    influence = np.zeros(len(truth))
    influence[used] = relerr.influence
    median, mad = _robust(values[finite])
    return MethodStatistics(
        counts=Counts(
            total=len(truth),
            failed_to_fly=int(np.sum(~flown)),
            used=int(np.sum(used)),
            not_converged=int(np.sum(finite & ~converged)),
            diverged=int(np.sum(flown & ~finite)),
            aperiodic=int(np.sum(used & ~oscillates)),
            reasons=dict(Counter(status[run] for run in np.flatnonzero(flown & ~used)).most_common()),
        ),
        mean=over_used(mean, values),
        std=over_used(standard_deviation, values),
        rmse=over_used(rms, errors),
        coverage=Statistic(np.where(stated, coverage.value, np.nan), np.where(stated, coverage.se, np.nan)),
        median=median,
        mad=mad,
        relerr=relerr,
        relerr_modal=Statistic(np.abs(modal_bias.value) / modal_truth, modal_bias.se / modal_truth),
        iterations=mean(iterations[used]),
        correlation=_correlation(values[used, _SIX]),
        influence=influence,
    )


def _unknown(x: Array) -> Statistic:
    nan = np.full(x.shape[1:], np.nan)
    return Statistic(nan, nan)


def _robust(x: Array) -> tuple[Array, Array]:
    """Median and scaled median absolute deviation of each column, over its finite rows."""
    out = np.full((2, x.shape[1]), np.nan)
    for j, column in enumerate(x.T):
        column = column[np.isfinite(column)]
        if len(column):
            centre = np.median(column)
            out[:, j] = centre, MAD_TO_STD * np.median(np.abs(column - centre))
    return out[0], out[1]


def _correlation(x: Array) -> Array:
    """Correlation matrix of the columns; the identity where there are too few rows."""
    k = x.shape[1]
    if len(x) < 2:
        return np.eye(k)
    covariance = np.atleast_2d(np.cov(x, rowvar=False))
    std = np.sqrt(np.diag(covariance))
    scale = np.outer(std, std)
    return np.where(scale > 0.0, covariance / np.where(scale > 0.0, scale, 1.0), np.eye(k))
