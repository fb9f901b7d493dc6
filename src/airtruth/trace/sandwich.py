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
from airtruth.trace.model import L, S, local_prior, shared_prior

Array = NDArray[np.float64]

MEMORY_S: Final = 1.0
"""Lag up to which slopes are taken to depend on one another [s]."""


def inflation(problem: Problem, found: Fit) -> Array:
    """Robust over plain standard deviation of shared parameters and sizes, not below one.

    Parameters
    ----------
    found : a fit to the problem's records, at its optimum.

    Returns
    -------
    (11 + k,) ratios [-]. A long-run variance from few seconds scatters and is short on average, so it is never
    taken to narrow anything.
    """
    levels = found.whitener.coefficients.shape[0] == 0
    k = len(found.point.sizes)
    m = S + k
    pieces = [parts(t, found.whitener, levels) for t in found.tangents]
    _, information, _ = reduced(problem, found.point, k, pieces, levels)
    total = np.zeros((m, m))
    total[:S, :S] = shared_prior(problem.records[0], problem.settings)
    for record, tangent, (_, _, h) in zip(problem.records, found.tangents, pieces, strict=True):
        r, t = found.whitener.apply(tangent.r), found.whitener.apply(tangent.t)
        slopes = np.einsum("pki,ki->kp", t, r)
        if levels:
            spread = np.trace(tangent.w, axis1=1, axis2=2)
            slopes += 0.5 * (spread - np.einsum("pij,ki,kj->kp", tangent.w, r, r))
        own = h[m:, m:] + local_prior(record, problem.settings)[1]
        across = h[:m, m:]
        if not levels:
            own, across = own[: L - 1, : L - 1], across[:, : L - 1]
        free = slopes[:, m : m + own.shape[0]]
        z = slopes[:, :m] - free @ np.linalg.solve(own, across.T)
        total += long_run(z - z.mean(axis=0), round(MEMORY_S / record.signals.dt_s))
    scale = np.sqrt(np.maximum(np.diag(information), 1e-30))
    inverse = np.linalg.inv(information / np.outer(scale, scale) + 1e-12 * np.eye(m))
    robust = inverse @ (total / np.outer(scale, scale)) @ inverse
    return np.asarray(np.sqrt(np.maximum(np.diag(robust) / np.diag(inverse), 1.0)))


def long_run(x: Array, lags: int) -> Array:
    """Variance (p, p) of the sum of a serially dependent series (samples, p) of mean zero, Bartlett weights."""
    total = x.T @ x
    for j in range(1, min(lags, len(x) - 1) + 1):
        product = x[j:].T @ x[:-j]
        total += (1.0 - j / (lags + 1.0)) * (product + product.T)
    return total


__all__ = ["MEMORY_S", "inflation", "long_run"]
