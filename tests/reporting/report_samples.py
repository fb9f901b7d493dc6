"""Statistics of samples that are held whole, from the sums of `airtruth.reporting.statistics`."""

import numpy as np
from numpy.typing import NDArray

from airtruth.reporting import statistics

Array = NDArray[np.float64]


def mean(x: Array) -> statistics.Statistic:
    """Return the mean over the rows; its standard error is s/sqrt(n)."""
    n, total = len(x), np.sum(x, axis=0)
    return statistics.mean_of(n, total, np.sum((x - total / max(n, 1)) ** 2, axis=0))


def standard_deviation(x: Array) -> statistics.Statistic:
    """Return the standard deviation (n - 1) over the rows, see `standard_deviation_of`."""
    n = len(x)
    d = x - np.sum(x, axis=0) / max(n, 1)
    return statistics.standard_deviation_of(n, np.sum(d**2, axis=0), np.sum(d**4, axis=0))


def rms(errors: Array) -> statistics.Statistic:
    """Return the root mean square over the rows, see `root_of`."""
    return statistics.root_of(mean(errors**2))


def hit_rate(hits: Array) -> statistics.Statistic:
    """Return the fraction of rows that are 1 and not 0, see `hit_rate_of`."""
    return statistics.hit_rate_of(len(hits), np.sum(hits, axis=0))


def relative_error(errors: Array, truth: Array) -> statistics.RelativeError:
    """Return RelErr, the norm of the mean error over the norm of the truth.

    Parameters
    ----------
    errors : (n, k) estimate - truth of each run.
    truth : (k,) truth; its mean over the runs where it differs between runs.
    """
    n = len(errors)
    bias = np.sum(errors, axis=0) / max(n, 1)
    own = statistics.influence(errors, bias, truth, n)
    return statistics.relative_error_of(
        n, bias, truth, float(np.sum(own**2)), float(np.sum((errors - bias) ** 2))
    )
