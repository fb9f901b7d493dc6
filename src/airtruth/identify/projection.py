"""Residuals at an estimate, and what is left of instruments and regressors without the intercept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify import rows as layout

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Projected:
    """Instruments, regressors and residuals of filtered equations, free of the intercept.

    Attributes
    ----------
    z : (runs, 3, samples) instruments of alpha, q and elevator.
    x : (runs, 3, samples) regressors.
    e : (runs, 3, samples) residuals of [lift, moment, normal].
    trim : (runs, samples) column of the intercept, of unit length; zero if there is none.
    """

    z: Array
    x: Array
    e: Array
    trim: Array


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _project(
    rows: Array, theta: Array, factors: Array, intercept: bool, z: Array, x: Array, e: Array, trim: Array
) -> None:
    for r in range(rows.shape[0]):
        w = rows[r]
        s = trim[r]
        s[:] = 0.0
        if intercept:
            length = 0.0
            for k in range(s.size):
                length += w[layout.TRIM, k] * w[layout.TRIM, k]
            length = np.sqrt(length)
            for k in range(s.size):
                s[k] = w[layout.TRIM, k] / length
        for i in range(9):
            row = w[i] if i < 3 else w[i + 1]
            out = z[r, i] if i < 3 else (x[r, i - 3] if i < 6 else e[r, i - 6])
            share = 0.0
            for k in range(s.size):
                share += row[k] * s[k]
            for k in range(s.size):
                out[k] = row[k] - share * s[k]
        for equation in range(3):
            first = 3 if equation == 1 else 0
            factor = factors[r, equation]
            t0 = theta[r, first] * factor
            t1 = theta[r, first + 1] * factors[r, 3] * factor
            t2 = theta[r, first + 2] * factor
            out = e[r, equation]
            x0, x1, x2 = x[r, 0], x[r, 1], x[r, 2]
            for k in range(s.size):
                out[k] -= t0 * x0[k] + t1 * x1[k] + t2 * x2[k]


def project(rows: Array, theta: Array, factors: Array, intercept: bool) -> Projected:
    """Residuals at theta, and everything orthogonal to the intercept's column.

    Parameters
    ----------
    rows : (runs, 10, samples) from a `Problem`.
    theta : (runs, 6) [-].
    factors : (runs, 4) from `airtruth.identify.rows.row_factors`.
    intercept : whether a constant is free in each equation.
    """
    runs, _, samples = rows.shape
    z, x, e = (np.empty((runs, 3, samples)) for _ in range(3))
    trim = np.empty((runs, samples))
    _project(rows, theta, factors, intercept, z, x, e, trim)
    return Projected(z, x, e, trim)
