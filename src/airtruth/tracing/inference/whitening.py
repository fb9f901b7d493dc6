"""A vector autoregression that whitens innovations; the records choose its order.

Source: H. Luetkepohl, New Introduction to Multiple Time Series Analysis (2005), sections 3.2 (estimation) and 4.3
(Schwarz's criterion for the order).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_UNRESOLVED: Final = 0.5
"""Mean square of whitened innovations below which they are smaller than what the model resolves [-] (judgement: declared
noise is right within 10 %)."""
_ORDERS: Final = 6
"""Highest order tried [samples]; judgement: 0.12 s at 50 Hz, beyond which a misfit is motion."""


@dataclass(frozen=True)
class Whitener:
    """Vector autoregression of whitened innovations: r_k - sum A_j r_(k-j), times the inverse root of its covariance.

    Attributes
    ----------
    coefficients : (order, outputs, outputs); root : (outputs, outputs).
    start : (outputs, outputs) inverse root of the covariance of the innovations themselves, for the first samples, which have
        no past.
    """

    coefficients: Array
    root: Array
    start: Array

    @property
    def order(self) -> int:
        """Number of past samples; 0 for no autoregression."""
        return int(self.coefficients.shape[0])

    def apply(self, x: Array) -> Array:
        """Filter (..., samples, outputs) along the samples.

        The first ones are no residuals of the autoregression. A smooth record has residuals far smaller than its innovations, and
        the first samples would outweigh all others if they were divided by them.
        """
        if self.order == 0:
            return x
        out = x.copy()
        for j, a in enumerate(self.coefficients, start=1):
            out[..., j:, :] -= x[..., :-j, :] @ a.T
        out = out @ self.root.T
        out[..., : self.order, :] = x[..., : self.order, :] @ self.start.T
        return np.asarray(out)


NO_WHITENER: Final = Whitener(np.zeros((0, 0, 0)), np.eye(0), np.eye(0))
"""Leaves innovations as they are."""


def autoregression(innovations: Sequence[Array]) -> Whitener:
    """Vector autoregression of the whitened innovations (samples, outputs) of all records, order by Schwarz's criterion.

    Innovations far smaller than their stated covariance count with the white noise that they lack: a model does not know
    more than it resolves, however smooth its residual is.
    """
    total = sum(r.shape[0] - _ORDERS for r in innovations)
    y = np.concatenate([r[_ORDERS:] for r in innovations])
    square = np.mean(y**2, axis=0)
    lacking = np.where(square < _UNRESOLVED, 1.0 - square, 0.0)
    start = np.linalg.inv(np.linalg.cholesky(y.T @ y / total + np.diag(lacking)))
    outputs = y.shape[1]
    best, least = NO_WHITENER, np.inf
    for order in range(_ORDERS + 1):
        x = np.concatenate([_lagged(r, order) for r in innovations])
        more = np.diag(total * np.tile(lacking, order))
        b = np.linalg.solve(x.T @ x + more, x.T @ y) if order else np.zeros((0, outputs))
        residual = y - x @ b
        sigma = (residual.T @ residual + b.T @ more @ b) / total + np.diag(lacking)
        parameters = outputs * outputs * order
        criterion = total * float(np.linalg.slogdet(sigma)[1]) + np.log(total) * parameters
        if criterion < least:
            least, best = criterion, NO_WHITENER
            if order:
                a = np.ascontiguousarray(b.T.reshape(outputs, order, outputs).transpose(1, 0, 2))
                best = Whitener(a, np.linalg.inv(np.linalg.cholesky(sigma)), start)
    return best


def _lagged(r: Array, order: int) -> Array:
    """(samples - highest order, outputs order) the samples before each."""
    n = r.shape[0]
    if order == 0:
        return np.zeros((n - _ORDERS, 0))
    return np.concatenate([r[_ORDERS - j : n - j] for j in range(1, order + 1)], axis=1)


__all__ = ["NO_WHITENER", "Whitener", "autoregression"]
