"""Normal equations scaled to a unit diagonal: damped steps and inverses, of one problem or of a batch.

Source: D. W. Marquardt, J. Soc. Indust. Appl. Math. 11 (1963) 431-441, eqs (28) to (30).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

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


def _scaled(information: Array, ridge: Array | float) -> tuple[Array, Array]:
    diagonal = np.diagonal(information, axis1=-2, axis2=-1)
    scale = np.sqrt(np.maximum(diagonal, _LEAST_DIAGONAL))
    eye = np.eye(scale.shape[-1])
    normal = information / (scale[..., :, None] * scale[..., None, :])
    return normal + np.asarray(ridge)[..., None, None] * eye, scale


__all__ = ["scaled_inverse", "scaled_step"]
