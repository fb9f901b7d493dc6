"""First-order recursion without scipy.signal, whose import takes longer than most commands' own work."""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_banded

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@overload
def recursion(pole: float, driven: Array, before: ArrayLike = 0.0) -> Array: ...
@overload
def recursion(pole: complex, driven: Array, before: ArrayLike = 0.0) -> Complex: ...
def recursion(pole: complex, driven: Array, before: ArrayLike = 0.0) -> Array | Complex:
    """Solve y[k] = pole y[k-1] + driven[k] as a bidiagonal system of equations.

    Parameters
    ----------
    pole : of the recursion [-].
    driven : (..., samples) right side; the recursion runs along the last axis.
    before : (...) y before the first sample.

    Returns
    -------
    (..., samples) solution, complex with a complex pole.
    """
    samples = driven.shape[-1]
    right = driven.astype(np.result_type(driven, pole), copy=True)
    if samples == 0:
        return right
    right[..., 0] += pole * np.asarray(before)
    band = np.repeat([[1.0], [-pole]], samples, axis=1)
    solved = solve_banded((1, 0), band, right.reshape(-1, samples).T, check_finite=False)
    return np.asarray(solved.T.reshape(right.shape))


def low_pass(pole: float, x: Array) -> Array:
    """(..., samples) first-order low-pass of gain 1 at rest, y[k] = pole y[k-1] + (1 - pole) x[k] from y = 0."""
    return recursion(pole, (1.0 - pole) * x)


__all__ = ["low_pass", "recursion"]
