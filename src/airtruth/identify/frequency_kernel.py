"""Numerical core of `airtruth.identify.frequency`: weighted complex least squares of one equation."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Ints = NDArray[np.int64]

CORNERS: Final = np.append(0.0, np.geomspace(0.1, 30.0, 12))
"""Candidates for the frequency below which an equation's noise rises [rad/s]."""

FREE: Final = 2
"""Nuisance columns of an equation: what the ends of the record leave, and a linear trend."""


@njit(cache=True)
def _orthogonal(columns: Array, y: Array) -> float:
    """Gram-Schmidt of the columns, y freed of them, both in place; log det of their products."""
    log_det = 0.0
    for i in range(columns.shape[0]):
        for j in range(i):
            columns[i] -= (columns[i] @ columns[j]) * columns[j]
        size = float(columns[i] @ columns[i])
        log_det += float(np.log(max(size, 1e-300)))
        columns[i] /= np.sqrt(max(size, 1e-300))
        y -= (y @ columns[i]) * columns[i]
    return log_det


@njit(cache=True)
def _equation(x: Complex, y: Complex, omega: Array, pole: float, sums: Array) -> None:
    """Choose the colour of the noise, and sum products free of the nuisance columns.

    The noise has the spectrum |j omega + pole|^2 (1 + corner^2/(omega^2 + pole^2)), to a factor; pole is 0
    for an equation without derivative, whose noise is 1 + corner^2/omega^2. The corner is that of greatest
    restricted likelihood.

    Parameters
    ----------
    x : (3, frequencies) regressors; y : left side; omega : [rad/s].
    pole : [1/s].
    sums : (3, 4), filled: X'X | X'y over the variance that the residual has, as a multiple of the spectrum.
        It carries the factor dof/(dof - 2) of Student's distribution.
    """
    count = omega.size
    columns = np.empty((FREE + 3, 2 * count))
    left = np.empty(2 * count)
    freedom = 2 * count - FREE - 3
    best, chosen, variance = np.inf, 0.0, 1.0
    for step in range(CORNERS.size + 1):
        corner = CORNERS[step] if step < CORNERS.size else chosen
        level = 0.0
        for k in range(count):
            square = omega[k] * omega[k]
            spectrum = 1.0 + corner * corner / (square + pole * pole)
            level += 2.0 * np.log(spectrum)
            weight = (1.0 + 0.0j) / np.sqrt(spectrum)
            if pole > 0.0:
                weight /= 1j * omega[k] + pole
            ends, trend = weight, weight * 1j / omega[k]
            columns[0, k], columns[0, count + k] = ends.real, ends.imag
            columns[1, k], columns[1, count + k] = trend.real, trend.imag
            for i in range(3):
                value = weight * x[i, k]
                columns[FREE + i, k], columns[FREE + i, count + k] = value.real, value.imag
            value = weight * y[k]
            left[k], left[count + k] = value.real, value.imag
        if step == CORNERS.size:
            break
        log_det = _orthogonal(columns, left)
        square = float(left @ left)
        if not square > 0.0:
            chosen, variance = corner, 1.0
            continue
        criterion = level + log_det + freedom * np.log(square)
        if criterion < best:
            best, chosen, variance = criterion, corner, square / (freedom - 2)
    regressors = columns[FREE:].copy()
    _orthogonal(columns[:FREE], left)
    for i in range(FREE):
        for j in range(3):
            regressors[j] -= (regressors[j] @ columns[i]) * columns[i]
    for i in range(3):
        for j in range(3):
            sums[i, j] = (regressors[i] @ regressors[j]) / variance
        sums[i, 3] = (regressors[i] @ left) / variance


@njit(cache=True)
def sums_of(
    normal: Complex, moment: Complex, factors: Array, theta: Array, band: Ints, omega: Array, sums: Array
) -> None:
    """Sums of products of normal force and moment equation of each run.

    Parameters
    ----------
    normal, moment : (runs, 4, frequencies) transforms of alpha, q, elevator and the left side.
    factors : (runs, 4) from `airtruth.identify.rows.row_factors`.
    theta : (runs, 6), of which Cmq makes the moment equation's pole.
    band : (runs, 2) first frequency of the band, and the one behind its last.
    omega : (frequencies,) [rad/s].
    sums : (runs, 2, 3, 4), filled: of the lift and of the moment parameters, see `_equation`.
    """
    for r in range(normal.shape[0]):
        first, end = band[r, 0], band[r, 1]
        half = factors[r, 3]
        scaled = normal[r, :3, first:end] * factors[r, 2]
        scaled[1] *= half
        _equation(scaled, normal[r, 3, first:end], omega[first:end], 0.0, sums[r, 0])
        scaled = moment[r, :3, first:end] * factors[r, 1]
        scaled[1] *= half
        pole = abs(factors[r, 1] * half * theta[r, 4])
        _equation(scaled, moment[r, 3, first:end], omega[first:end], max(pole, 1e-3), sums[r, 1])
