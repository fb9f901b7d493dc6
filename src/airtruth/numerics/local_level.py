"""A random walk in white noise: its variances by maximum likelihood, and its optimal smoother.

The differences of n samples have the covariance q I + r T, where T has 2 on its diagonal and -1 beside it. The sine transform
diagonalises T: its eigenvalues are 2 - 2 cos(k pi/n), k = 1 to n - 1. So the likelihood is a sum over k, and exact. The smoother
minimises |y - x|^2/r + |diff(x)|^2/q, and the cosine transform diagonalises it. Its weights are the variances of its
errors over r.

Source: A. C. Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, Cambridge, 1989, section 2.3 (local level
model).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEAST_RATIO: Final = 1e-10
"""Least variance of a step over that of the noise that is distinguished from none [-]: a walk of 10^4 samples then moves by a
thousandth of the noise."""
_MOST_RATIO: Final = 1e4
"""Largest such ratio [-]: the noise is then a hundredth of a step."""


def walk_to_noise(y: Array) -> float:
    """Variance of the steps of a random walk over that of the white noise in its samples, by maximum likelihood [-].

    Parameters
    ----------
    y : (samples,) at least three, not all equal.
    """
    from scipy.fft import dst
    from scipy.optimize import minimize_scalar

    count = len(y)
    power = dst(np.diff(y), type=1, norm="ortho") ** 2
    shape = 2.0 - 2.0 * np.cos(np.pi * np.arange(1, count) / count)

    def deviance(log_ratio: float) -> float:
        spectrum = np.exp(log_ratio) + shape
        return float((count - 1) * np.log(np.mean(power / spectrum)) + np.log(spectrum).sum())

    bounds = np.log(_LEAST_RATIO), np.log(_MOST_RATIO)
    grid = np.linspace(*bounds, 33)
    best = int(np.argmin([deviance(x) for x in grid]))
    near = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    return float(np.exp(minimize_scalar(deviance, bounds=near, method="bounded").x))


def smoothed(y: Array, ratio: float) -> Array:
    """The most probable random walk behind samples with white noise (samples,) [as ``y``].

    Parameters
    ----------
    y : (samples,).
    ratio : variance of a step over that of the noise [-], positive.
    """
    from scipy.fft import dct, idct

    return np.asarray(idct(dct(y, norm="ortho") * error_variances(len(y), ratio), norm="ortho"))


def error_variances(count: int, ratio: float) -> Array:
    """Variance of the error of each cosine of `smoothed` over that of the noise (count,) [-].

    The cosines are those of the orthonormal transform (type 2), and their errors are independent.

    Parameters
    ----------
    count : number of samples.
    ratio : variance of a step over that of the noise [-], positive.
    """
    return np.asarray(1.0 / (1.0 + _cosine_shape(count) / ratio))


def _cosine_shape(count: int) -> Array:
    return np.asarray(2.0 - 2.0 * np.cos(np.pi * np.arange(count) / count))


__all__ = ["error_variances", "smoothed", "walk_to_noise"]
