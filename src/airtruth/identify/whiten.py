"""Autoregressive whitening of the residuals of one equation of one record.

Source of the recursion: J. P. Burg, "Maximum Entropy Spectral Analysis", PhD thesis, Stanford, 1975, as in
P. Stoica and R. Moses, "Spectral Analysis of Signals", 2005, section 3.9.3; of the criterion: G. Schwarz,
"Estimating the Dimension of a Model", Annals of Statistics 6(2), 1978.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_ORDER: Final = 12


@njit(cache=True)
def burg(e: Array, largest: int, reflection: Array) -> int:
    """Reflection coefficients of e by Burg's recursion, and the order that Schwarz's criterion chooses.

    Parameters
    ----------
    e : (samples,) of mean zero, more than ``largest`` of them.
    largest : greatest order allowed.
    reflection : (largest,), filled; the first ``order`` of them are the model.

    Returns
    -------
    order : that of the least samples log(variance) + order log(samples).
    """
    samples = e.size
    forward, backward = e.copy(), e.copy()
    level = best = 0.0
    order = 0
    reflection[:] = 0.0
    for m in range(largest):
        product = square = 0.0
        for k in range(m + 1, samples):
            product += forward[k] * backward[k - 1]
            square += forward[k] * forward[k] + backward[k - 1] * backward[k - 1]
        if not square > 0.0:
            break
        gamma = -2.0 * product / square
        if not abs(gamma) < 1.0:
            break
        reflection[m] = gamma
        for k in range(samples - 1, m, -1):
            f, b = forward[k], backward[k - 1]
            forward[k] = f + gamma * b
            backward[k] = b + gamma * f
        level += samples * np.log1p(-gamma * gamma)
        criterion = level + (m + 1) * np.log(samples)
        if criterion < best:
            best, order = criterion, m + 1
    return order


@njit(cache=True)
def whiten(rows: Array, reflection: Array, order: int) -> None:
    """Replace each row by its one-step prediction errors, all of one variance, in place.

    Sample k < order is predicted from the k samples before it, by the predictor of that order, and its
    larger error variance is scaled down: the whole transformation is the inverse of the Cholesky factor of
    the autoregressive covariance, and no sample is lost.

    Parameters
    ----------
    rows : (..., samples).
    reflection, order : from `burg`.
    """
    if order == 0:
        return
    predictor = np.zeros((order + 1, order + 1))
    gain = np.ones(order + 1)
    predictor[0, 0] = 1.0
    for m in range(order):
        gamma = reflection[m]
        for i in range(m + 2):
            before = predictor[m, i] if i <= m else 0.0
            mirrored = predictor[m, m + 1 - i] if i >= 1 else 0.0
            predictor[m + 1, i] = before + gamma * mirrored
        gain[m + 1] = gain[m] * (1.0 - gamma * gamma)
    for r in range(rows.shape[0]):
        row = rows[r]
        for k in range(row.size - 1, -1, -1):
            m = min(k, order)
            total = 0.0
            for i in range(m + 1):
                total += predictor[m, i] * row[k - i]
            row[k] = total * np.sqrt(gain[order] / gain[m])
