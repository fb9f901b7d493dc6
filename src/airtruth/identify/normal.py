"""Normal equations of LS and IV, from sums of products; their solution.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (4) to (6) and
(9). Z'X is block diagonal: three lift parameters in two equations, three moment parameters in one; the
equations are stacked unweighted, alpha_dot - q in rad/s, q_dot in rad/s2, az in g, as in the paper.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def _equations(moments: Array, factors: Array, intercept: bool, matrix: Array, right: Array) -> None:
    for r in range(moments.shape[0]):
        m = moments[r]
        lift, moment, normal, half = factors[r, 0], factors[r, 1], factors[r, 2], factors[r, 3]
        for i in range(3):
            di = half if i == 1 else 1.0
            # the intercept is its own instrument: its column is projected out of Z
            share = m[i, 6] / m[3, 6] if intercept else 0.0
            for j in range(3):
                dj = half if j == 1 else 1.0
                product = (m[i, j] - share * m[3, j]) * di * dj
                matrix[r, 0, i, j] = (lift * lift + normal * normal) * product
                matrix[r, 1, i, j] = moment * moment * product
            right[r, 0, i] = di * (lift * (m[i, 3] - share * m[3, 3]) + normal * (m[i, 5] - share * m[3, 5]))
            right[r, 1, i] = di * moment * (m[i, 4] - share * m[3, 4])


def normal_equations(moments: Array, factors: Array, intercept: bool) -> tuple[Array, Array]:
    """Z'X and Z'y of the lift and of the moment parameters.

    Parameters
    ----------
    moments : (runs, 4, 7) from `airtruth.identify.rows`.
    factors : (runs, 4) from `airtruth.identify.rows.row_factors`.
    intercept : whether each equation of each run has a free constant.

    Returns
    -------
    matrix, right : (runs, 2, 3, 3) and (runs, 2, 3).
    """
    matrix = np.empty((moments.shape[0], 2, 3, 3))
    right = np.empty((moments.shape[0], 2, 3))
    _equations(moments, factors, intercept, matrix, right)
    return matrix, right


@njit(cache=True)
def _solve(matrix: Array, right: Array, floor: float, theta: Array) -> None:
    for r in range(matrix.shape[0]):
        for block in range(2):
            a = matrix[r, block]
            c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
            c01 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
            c02 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
            det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
            size = 1.0
            for i in range(3):
                size *= np.sqrt(a[i, 0] ** 2 + a[i, 1] ** 2 + a[i, 2] ** 2)
            if not abs(det) > floor * size:
                theta[r, 3 * block : 3 * block + 3] = np.nan
                continue
            b0, b1, b2 = right[r, block, 0] / det, right[r, block, 1] / det, right[r, block, 2] / det
            theta[r, 3 * block] = (
                c00 * b0
                + (a[0, 2] * a[2, 1] - a[0, 1] * a[2, 2]) * b1
                + (a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]) * b2
            )
            theta[r, 3 * block + 1] = (
                c01 * b0
                + (a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0]) * b1
                + (a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2]) * b2
            )
            theta[r, 3 * block + 2] = (
                c02 * b0
                + (a[0, 1] * a[2, 0] - a[0, 0] * a[2, 1]) * b1
                + (a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]) * b2
            )


def solve(matrix: Array, right: Array) -> Array:
    """theta (runs, 6) = (Z'X)^-1 Z'y; NaN in a block whose matrix is singular.

    Singular: the determinant is below 1e-12 of the product of the lengths of the rows.
    """
    theta = np.empty((matrix.shape[0], 6))
    _solve(matrix, right, 1e-12, theta)
    return theta
