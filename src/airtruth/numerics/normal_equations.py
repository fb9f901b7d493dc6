"""Normal equations scaled to a unit diagonal: damped steps, steps without a part of the data, and inverses.

Source: D. W. Marquardt, J. Soc. Indust. Appl. Math. 11 (1963) 431-441, eqs (28) to (30).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Array = NDArray[np.float64]

_LEAST_DIAGONAL: Final = 1e-30
"""Least diagonal element of an information matrix in its scaling; prevents a division by zero."""


def scaled_step(gradient: Array, information: Array, damping: Array | float) -> Array:
    """Solve the damped normal equations, scaled to a unit diagonal (Marquardt, eqs 28 to 30).

    Parameters
    ----------
    gradient, information : (..., n) and (..., n, n) of the cost.
    damping : (...) added to the unit diagonal [-].

    Returns
    -------
    (..., n) step.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the damped information is singular.
    """
    normal, scale = _scaled(information, damping)
    return np.asarray(-np.linalg.solve(normal, (gradient / scale)[..., None])[..., 0] / scale)


def scaled_inverse(information: Array, ridge: float) -> Array:
    """Invert information matrices (..., n, n), scaled to a unit diagonal, with a ridge on it [-]."""
    normal, scale = _scaled(information, ridge)
    return np.asarray(np.linalg.inv(normal) / (scale[..., :, None] * scale[..., None, :]))


def step_without(
    gradient: Array, information: Array, total: Array, ridge: float, least_share: float
) -> Array:
    """The Gauss-Newton step that takes one part of the data out of an estimate.

    Directions in which the other data hold a smaller share of the information than the least do not move.

    Parameters
    ----------
    gradient, information : (n,) and (n, n) of the part's cost at the estimate from all data.
    total : (n, n) information of all data; ridge : on its unit diagonal [-].
    least_share : least share of the other data, between 0 and 1 [-].

    Returns
    -------
    (n,) step.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the total information with its ridge is not positive definite.
    """
    normal, scale = _scaled(total, ridge)
    root = np.linalg.cholesky(normal)
    half = solve_triangular(root, information / (scale[:, None] * scale), lower=True)
    share, directions = np.linalg.eigh(solve_triangular(root, half.T, lower=True))
    along = directions.T @ solve_triangular(root, gradient / scale, lower=True)
    moves = share < 1.0 - least_share
    along = np.divide(along, 1.0 - share, out=np.zeros_like(along), where=moves)
    return np.asarray(solve_triangular(root, directions @ along, lower=True, trans="T") / scale)


def _scaled(information: Array, ridge: Array | float) -> tuple[Array, Array]:
    diagonal = np.diagonal(information, axis1=-2, axis2=-1)
    scale = np.sqrt(np.maximum(diagonal, _LEAST_DIAGONAL))
    eye = np.eye(scale.shape[-1])
    normal = information / (scale[..., :, None] * scale[..., None, :])
    return normal + np.asarray(ridge)[..., None, None] * eye, scale


__all__ = ["scaled_inverse", "scaled_step", "step_without"]
