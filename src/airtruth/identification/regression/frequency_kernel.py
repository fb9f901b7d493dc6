"""Kernels of the methods in the frequency domain: weighted complex regression of one equation, with instruments or none."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.regression.rows import HALF_CHORD, LIFT, MOMENT, NORMAL
from airtruth.physics.short_period import CM_Q

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Ints = NDArray[np.int64]

CORNERS: Final = np.append(0.0, np.geomspace(0.1, 30.0, 12))
"""Candidate frequencies below which an equation's noise rises [rad/s]; judgement: a factor of 1.7 between
neighbours."""

FREE: Final = 2
"""Nuisance columns of an equation [-]: error at the ends of the record, and a linear trend."""
SLOWEST: Final = 1e-3
"""Smallest pole of the moment equation's noise [1/s]; judgement: a time constant above any record."""


@njit(cache=True)
def _orthogonal(columns: Array, y: Array) -> float:
    """Orthonormalise the columns and make y orthogonal to them, in place; return log det of their products."""
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
def _weighted(
    x: Complex, y: Complex, omega: Array, pole: float, corner: float, columns: Array, left: Array
) -> float:
    """Fill the nuisance columns, those of x and the left side, over the noise's spectrum; return log det of it.

    Parameters
    ----------
    x : (regressors, frequencies); y : (frequencies,); omega, pole, corner : see `_equation`.
    columns : (FREE + regressors, 2 frequencies), written: real and imaginary parts.
    left : (2 frequencies,), written.
    """
    count = omega.size
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
        for i in range(x.shape[0]):
            value = weight * x[i, k]
            columns[FREE + i, k], columns[FREE + i, count + k] = value.real, value.imag
        value = weight * y[k]
        left[k], left[count + k] = value.real, value.imag
    return level


@njit(cache=True)
def _equation(x: Complex, y: Complex, omega: Array, pole: float, sums: Array) -> None:
    """Choose the colour of the noise, and sum products orthogonal to the nuisance columns.

    The noise has the spectrum |j omega + pole|^2 (1 + corner^2/(omega^2 + pole^2)), to a factor; pole is 0
    for an equation without derivative, whose noise is 1 + corner^2/omega^2. The corner has the
    greatest restricted likelihood.

    Parameters
    ----------
    x : (3, frequencies) regressors; y : left side; omega : [rad/s].
    pole : [1/s].
    sums : (3, 4), written: X'X | X'y over the variance of the residual, as a multiple of the spectrum, times
        the factor dof/(dof - 2) of Student's distribution.
    """
    count = omega.size
    columns = np.empty((FREE + 3, 2 * count))
    left = np.empty(2 * count)
    freedom = 2 * count - FREE - 3
    best, chosen, variance = np.inf, 0.0, 1.0
    for step in range(CORNERS.size + 1):
        corner = CORNERS[step] if step < CORNERS.size else chosen
        level = _weighted(x, y, omega, pole, corner, columns, left)
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
    factors : (runs, 4) from `airtruth.identification.regression.rows.row_factors`.
    theta : (runs, 6), of which Cmq makes the moment equation's pole.
    band : (runs, 2) indices of the first frequency of the band, and of the one after its last.
    omega : (frequencies,) [rad/s].
    sums : (runs, 2, 3, 4), written: of the lift and of the moment parameters, see `_equation`.
    """
    for r in range(normal.shape[0]):
        first, end = band[r, 0], band[r, 1]
        half = factors[r, HALF_CHORD]
        scaled = normal[r, :3, first:end] * factors[r, NORMAL]
        scaled[1] *= half
        _equation(scaled, normal[r, 3, first:end], omega[first:end], 0.0, sums[r, LIFT])
        scaled = moment[r, :3, first:end] * factors[r, MOMENT]
        scaled[1] *= half
        pole = abs(factors[r, MOMENT] * half * theta[r, CM_Q])
        _equation(scaled, moment[r, 3, first:end], omega[first:end], max(pole, SLOWEST), sums[r, MOMENT])


@njit(cache=True)
def _instrumented(both: Complex, y: Complex, theta: Array, omega: Array, pole: float, sums: Array) -> None:
    """Choose the colour of the residual at theta, and sum products with the instruments.

    Parameters
    ----------
    both : (6, frequencies) three instruments, then three regressors; y : left side; theta : (3,) last estimate.
    omega, pole : see `_equation`.
    sums : (3, 7), written: Z'X | Z'y | Z'Z over the variance of the residual, as in `_equation`.
    """
    count = omega.size
    columns = np.empty((FREE + 6, 2 * count))
    left = np.empty(2 * count)
    freedom = 2 * count - FREE - 3
    best, chosen, variance = np.inf, 0.0, 1.0
    for step in range(CORNERS.size):
        level = _weighted(both, y, omega, pole, CORNERS[step], columns, left)
        for i in range(3):
            left -= theta[i] * columns[FREE + 3 + i]
        log_det = _orthogonal(columns[:FREE], left)
        square = float(left @ left)
        if not square > 0.0:
            chosen, variance = CORNERS[step], 1.0
            continue
        criterion = level + log_det + (2 * count - FREE) * np.log(square)
        if criterion < best:
            best, chosen, variance = criterion, CORNERS[step], square / (freedom - 2)
    _weighted(both, y, omega, pole, chosen, columns, left)
    _orthogonal(columns[:FREE], left)
    for i in range(FREE):
        for j in range(FREE, FREE + 6):
            columns[j] -= (columns[j] @ columns[i]) * columns[i]
    for i in range(3):
        z = columns[FREE + i]
        for j in range(3):
            sums[i, j] = (z @ columns[FREE + 3 + j]) / variance
            sums[i, 4 + j] = (z @ columns[FREE + j]) / variance
        sums[i, 3] = (z @ left) / variance


@njit(cache=True)
def instrumented_sums(
    instruments: Complex,
    normal: Complex,
    moment: Complex,
    factors: Array,
    theta: Array,
    band: Ints,
    omega: Array,
    sums: Array,
) -> None:
    """Sums of products of both equations with their instruments, of each run.

    Parameters
    ----------
    instruments : (runs, 2, frequencies) transforms of the instruments of alpha and q; the elevator is its own.
    normal, moment, factors, theta, band, omega : as in `sums_of`.
    sums : (runs, 2, 3, 7), written, see `_instrumented`.
    """
    for r in range(normal.shape[0]):
        first, end = band[r, 0], band[r, 1]
        half = factors[r, HALF_CHORD]
        both = np.empty((6, end - first), dtype=np.complex128)
        for equation in range(2):
            sides = normal[r] if equation == 0 else moment[r]
            factor = factors[r, NORMAL] if equation == 0 else factors[r, MOMENT]
            both[:2] = instruments[r, :, first:end] * factor
            both[2] = sides[2, first:end] * factor
            both[3:] = sides[:3, first:end] * factor
            both[1] *= half
            both[4] *= half
            pole = 0.0
            if equation == 1:
                pole = max(abs(factor * half * theta[r, CM_Q]), SLOWEST)
            own = theta[r, 3 * equation : 3 * equation + 3]
            _instrumented(both, sides[3, first:end], own, omega[first:end], pole, sums[r, equation])
