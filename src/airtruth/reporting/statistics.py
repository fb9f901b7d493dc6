"""Monte Carlo statistics of an estimator over runs, each with its own Monte Carlo standard error.

Arrays in, arrays out: n runs by k parameters. With too few runs, or where a diverged estimate overflows, a figure is
NaN or infinite, never a warning. Each formula takes sums over the runs, so that the runs may come in parts
(`airtruth.reporting.partial`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAD_TO_STD: Final = 1.482602218505602
"""1/Phi^-1(3/4) [-]: scales the median absolute deviation to the standard deviation of a normal sample."""


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
    """

    value: float
    se: float
    floor: float


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
    aperiodic : used runs whose estimate lacks a modal parameter, such as a non-oscillatory one.
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
    """All statistics of one method over one campaign; arrays follow `Motion.estimated`.

    Attributes
    ----------
    counts : number of runs by outcome.
    mean, std : (estimated,) over the used runs; modal parameters over those that have all of them.
    rmse : (estimated,) root mean square error against the truth of each run.
    coverage : (estimated,) fraction of the used runs with the truth inside the interval [-].
    median, mad : (estimated,) over every finite estimate, converged or not; the median absolute deviation
        is scaled to the standard deviation of a normal sample.
    relerr : relative error of the derivatives that are scored.
    relerr_modal : (modal,) relative error of each modal parameter.
    iterations : () mean number of iterations of the used runs.
    correlation : (derivatives, derivatives) correlation of the estimates over the used runs.
    products : method -> sum over the planned runs of the influence of the run on its RelErr times that on the RelErr of
        this method, see `influence`; this method among them.
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
    products: Mapping[str, float]


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def mean_of(n: Array | int, total: Array, squares: Array) -> Statistic:
    """Return the mean from sums.

    Parameters
    ----------
    n : number of rows.
    total : sum over the rows.
    squares : sum of the squared deviations from the mean.
    """
    rows = np.asarray(n, dtype=np.float64)
    return Statistic(total / rows, np.sqrt(squares / (rows - 1.0)) / np.sqrt(rows))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def standard_deviation_of(n: Array | int, s2: Array, s4: Array) -> Statistic:
    """Return the standard deviation (n - 1) from sums; its standard error holds for any distribution.

    The standard error is sqrt(var(k2))/(2 s), with the unbiased estimate of the variance of the
    sample variance var(k2) = (2 n k2^2 + (n - 1) k4)/(n (n + 1)), k2 and k4 the k-statistics (Kendall
    and Stuart, The Advanced Theory of Statistics, vol. 1, ch. 12). It needs n > 3.

    Parameters
    ----------
    n : number of rows.
    s2, s4 : sums of the second and fourth powers of the deviations from the mean.
    """
    n = np.asarray(n, dtype=np.float64)
    k2 = s2 / (n - 1)
    k4 = (n * (n + 1) * s4 - 3 * (n - 1) * s2**2) / ((n - 1) * (n - 2) * (n - 3))
    s = np.where(n > 1, np.sqrt(k2), np.nan)
    variance = np.maximum((2 * n * k2**2 + (n - 1) * k4) / (n * (n + 1)), 0.0)
    return Statistic(s, np.where(n > 3, np.sqrt(variance) / (2.0 * np.where(s > 0.0, s, np.inf)), np.nan))


def root_of(square: Statistic) -> Statistic:
    """Return the root of a mean square; its standard error follows from that of the mean square (delta method)."""
    value = np.sqrt(square.value)
    return Statistic(value, square.se / (2.0 * np.where(value > 0.0, value, np.inf)))


@np.errstate(invalid="ignore", divide="ignore")
def hit_rate_of(n: Array | int, hits: Array) -> Statistic:
    """Return the fraction of hits.

    The standard error is that of Agresti and Coull (The American Statistician 52, 1998), with two hits and
    two misses added. Unlike sqrt(p (1 - p)/n) it is not 0 where all rows or no rows are hits.

    Parameters
    ----------
    n : number of rows.
    hits : number of hits.
    """
    n = np.asarray(n, dtype=np.float64)
    p = (hits + 2.0) / (n + 4.0)
    return Statistic(hits / n, np.where(n > 0, np.sqrt(p * (1.0 - p) / (n + 4.0)), np.nan))


def relative_error_of(n: int, bias: Array, truth: Array, product: float, squares: float) -> RelativeError:
    """Return RelErr from sums.

    Parameters
    ----------
    n : number of rows.
    bias, truth : (k,) mean error and mean truth.
    product : sum of the squared influences of the rows, see `influence`; it is the squared standard error times (n - 1)/n.
    squares : sum of the squared deviations of all errors from their means.
    """
    size = float(np.linalg.norm(truth))
    value = float(np.linalg.norm(bias)) / size if n else math.nan
    if n < 2:
        return RelativeError(value, math.nan, math.nan)
    return RelativeError(
        value=value,
        se=math.sqrt(product * n / (n - 1)),
        floor=math.sqrt(squares / (n - 1) / n) / size,
    )


def influence(errors: Array, bias: Array, truth: Array, n: int) -> Array:
    """Return the contribution of each row to the deviation of RelErr, (rows,).

    Parameters
    ----------
    errors : (rows, k) errors of some of the runs.
    bias, truth : (k,) mean error and mean truth of all of them.
    n : number of all of them; the influence of a single run is 0.
    """
    size, length = float(np.linalg.norm(truth)), float(np.linalg.norm(bias))
    if n < 2 or length == 0.0:
        return np.zeros(len(errors))
    return np.asarray((errors - bias) @ (bias / length) / (size * n))


@np.errstate(over="ignore", invalid="ignore")
def ratio(numerator: float, denominator: float, products: tuple[float, float, float]) -> tuple[float, float]:
    """Return the ratio of two RelErr over the same runs, and its standard error.

    Both methods see the same noise, therefore the errors are paired run by run (delta method on the
    logarithm). NaN where one RelErr is 0.

    Parameters
    ----------
    numerator, denominator : the two RelErr.
    products : sums over the planned runs of the squared influence on the numerator, of that on the denominator, and
        of the product of both.
    """
    if not (numerator > 0.0 and denominator > 0.0):
        return math.nan, math.nan
    value = numerator / denominator
    own, other, common = products
    paired = own / numerator**2 + other / denominator**2 - 2.0 * common / (numerator * denominator)
    return value, value * math.sqrt(max(paired, 0.0))


@np.errstate(over="ignore", invalid="ignore")
def difference(one: float, other: float, products: tuple[float, float, float], n: int) -> tuple[float, float]:
    """Return the difference of two RelErr over the same runs, and its standard error, paired run by run.

    Parameters
    ----------
    one, other : the two RelErr.
    products : as in `ratio`.
    n : number of runs; the products are (n - 1)/n of the squared errors, see `relative_error_of`.
    """
    own, theirs, common = products
    return one - other, math.sqrt(max(own + theirs - 2.0 * common, 0.0) * n / (n - 1))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def correlation_of(n: int, products: Array) -> Array:
    """Return a correlation matrix from the sums of products of deviations from the means; the identity for n < 2."""
    k = len(products)
    if n < 2:
        return np.eye(k)
    covariance = products / (n - 1)
    std = np.sqrt(np.diag(covariance))
    scale = np.outer(std, std)
    return np.where(scale > 0.0, covariance / np.where(scale > 0.0, scale, 1.0), np.eye(k))
