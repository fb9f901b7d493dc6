"""Covariance of a fit whose innovations are not white: information, long-run variance of the slopes, information.

    V = J^-1 K J^-1,  K = sum over records of the long-run variance of the log-likelihood's slope

with J the information and both with the records' own parameters eliminated. Where the model is right K = J and
V = J^-1; where a model that is nobody's leaves motion in the innovations J^-1 alone is too small.

Source: H. White, Econometrica 50 (1982), theorem 3.2; long-run variance: W. K. Newey and K. D. West,
Econometrica 55 (1987), eq. (5).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.trace.fit import Fit, Problem, parts, reduced
from airtruth.trace.model import L, S

Array = NDArray[np.float64]

_SEVERAL: Final = 3
MEMORY_S: Final = 1.0
"""Lag up to which slopes are taken to depend on one another [s]."""


def inflation(problem: Problem, found: Fit) -> Array:
    """Robust over plain standard deviation of shared parameters and sizes, by the slopes within records.

    Parameters
    ----------
    found : a fit to the problem's records, at its optimum.

    Returns
    -------
    (17 + k,) ratios [-], not below one. A long-run variance from few seconds scatters and is short on average, so
    it is never taken to narrow anything.
    """
    m = S + len(found.point.sizes)
    total = np.zeros((m, m))
    total[:S, :S] = problem.shared_precision(found.hypothesis)
    for record, (slopes, own, across) in zip(problem.records, _slopes(problem, found), strict=True):
        free = slopes[:, m : m + own.shape[0]]
        z = slopes[:, :m] - free @ np.linalg.solve(own, across.T)
        total += long_run(z - z.mean(axis=0), round(MEMORY_S / record.signals.dt_s))
    return _ratio(problem, found, total)


def scatter(problem: Problem, found: Fit) -> Array:
    """The same by the slopes of whole records: what they disagree by is more than each knows of itself.

    K is n/(n - 1) times the sum of squares of the records' slopes about their mean; ones of fewer than three.

    Source: C. B. Hansen, J. Econometrics 141 (2007), eq. (3), for few clusters.
    """
    m = S + len(found.point.sizes)
    n = len(problem.records)
    if n < _SEVERAL:
        return np.ones(m)
    # own parameters are at their best, so that a record's slope is that of its profile
    x = np.array([slopes[:, :m].sum(axis=0) for slopes, _, _ in _slopes(problem, found)])
    off = x - x.mean(axis=0)
    total = n / (n - 1.0) * off.T @ off
    total[:S, :S] += problem.shared_precision(found.hypothesis)
    return _ratio(problem, found, total)


def _slopes(problem: Problem, found: Fit) -> list[tuple[Array, Array, Array]]:
    """Of each record: slopes of every sample (samples, parameters), the information of its own parameters with their
    prior, and what that shares with the others'.
    """
    levels = found.whitener.coefficients.shape[0] == 0
    m = S + len(found.point.sizes)
    result = []
    for (_, precision), tangent in zip(problem.own_priors(found.hypothesis), found.tangents, strict=True):
        _, _, h = parts(tangent, found.whitener, levels)
        r, t = found.whitener.apply(tangent.r), found.whitener.apply(tangent.t)
        slopes = np.einsum("pki,ki->kp", t, r)
        if levels:
            spread = np.trace(tangent.w, axis1=1, axis2=2)
            slopes += 0.5 * (spread - np.einsum("pij,ki,kj->kp", tangent.w, r, r))
        own = h[m:, m:] + precision
        across = h[:m, m:]
        if not levels:
            own, across = own[: L - 1, : L - 1], across[:, : L - 1]
        result.append((slopes, own, across))
    return result


def _ratio(problem: Problem, found: Fit, middle: Array) -> Array:
    levels = found.whitener.coefficients.shape[0] == 0
    pieces = [parts(t, found.whitener, levels) for t in found.tangents]
    _, information, _ = reduced(
        problem, found.hypothesis, found.point, len(found.point.sizes), pieces, levels
    )
    scale = np.sqrt(np.maximum(np.diag(information), 1e-30))
    inverse = np.linalg.inv(information / np.outer(scale, scale) + 1e-12 * np.eye(len(scale)))
    robust = inverse @ (middle / np.outer(scale, scale)) @ inverse
    return np.asarray(np.sqrt(np.maximum(np.diag(robust) / np.diag(inverse), 1.0)))


def long_run(x: Array, lags: int) -> Array:
    """Variance (p, p) of the sum of a serially dependent series (samples, p) of mean zero, Bartlett weights."""
    total = x.T @ x
    for j in range(1, min(lags, len(x) - 1) + 1):
        product = x[j:].T @ x[:-j]
        total += (1.0 - j / (lags + 1.0)) * (product + product.T)
    return total


__all__ = ["MEMORY_S", "inflation", "long_run", "scatter"]
