"""Covariance of estimates of several equations with the same regressors, by the names of `regression.covariance`.

With B = sum Z X' and residuals e_i of the equations, the covariance of the derivatives of coefficients i and j is
B^-1 M_ij B^-T:

    white      L_ij (sum Z Z')^-1 in its place, L = (1/N) sum e e'; "paper" is N times that: eq. (10) of M. Brunot
    coloured   M_ij = sum_ts Z(t) R_ij(t - s) Z(s)', R_ij(k) = (1/N) sum_t e_i(t + k) e_j(t): E. A. Morelli and V. Klein,
               Journal of Guidance, Control, and Dynamics 20(1), 1997
    corrected  as coloured, with R corrected for the degrees of freedom that the fit removed
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

from airtruth.identification.lateral.problems import Rows
from airtruth.identification.regression.covariance import correction

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _spectral_sums(z: Complex, e: Complex, gain: Array, share: float, transform: int, out: Array) -> None:
    """out[r, i, a, j, b] = sum_ts z_a(t) R_ij(t - s) z_b(s), R by the spectra e of the residuals times gain."""
    runs, width, count = z.shape
    equations = e.shape[1]
    for r in range(runs):
        for f in range(count):
            single = f == 0 or (transform % 2 == 0 and f == count - 1)
            weight = share if single else 2.0 * share
            for i in range(equations):
                for j in range(i + 1):
                    cross = e[r, i, f] * np.conj(e[r, j, f]) * (weight * gain[r, i, f] * gain[r, j, f])
                    for a in range(width):
                        left = np.conj(z[r, a, f]) * cross
                        for b in range(width):
                            out[r, i, a, j, b] += left.real * z[r, b, f].real - left.imag * z[r, b, f].imag
        for i in range(equations):
            for j in range(i):
                for a in range(width):
                    for b in range(width):
                        out[r, j, b, i, a] = out[r, i, a, j, b]


def bread_of(rows: Rows) -> Array:
    """(runs, signals, signals) sum of Z X'."""
    return np.asarray(np.matmul(rows.z, np.swapaxes(rows.x, 1, 2)))


def residuals(rows: Rows, theta: Array) -> Array:
    """(runs, coefficients, samples) residuals at theta (runs, 15)."""
    shape = (theta.shape[0], rows.y.shape[1], rows.x.shape[1])
    return np.asarray(rows.y - np.matmul(theta.reshape(shape), rows.x))


def meat(rows: Rows, theta: Array, name: str, total: Array, samples: int) -> Array:
    """M (runs, 15, 15) of each run; a joint estimate sums it over runs.

    Parameters
    ----------
    rows, theta : regression and estimate (runs, 15).
    name : of the covariance.
    total : (runs, signals, signals) or (1, ...) B of the estimate.
    samples : N of the estimate.
    """
    e = residuals(rows, theta)
    runs, equations, length = e.shape
    width = rows.z.shape[1]
    if name in ("white", "paper"):
        spread = np.matmul(e, np.swapaxes(e, 1, 2)) / length * (samples if name == "paper" else 1.0)
        zz = np.matmul(rows.z, np.swapaxes(rows.z, 1, 2))
        made = np.einsum("rij,rab->riajb", spread, zz)
        return np.asarray(made.reshape(runs, equations * width, equations * width))
    transform = int(next_fast_len(2 * length - 1, real=True))
    spectra, z = rfft(e, transform), rfft(rows.z, transform)
    gain = np.ones(spectra.shape)
    if name == "corrected":
        inverse = np.linalg.inv(total)
        weights = np.concatenate([np.matmul(inverse, rows.z), rows.free], axis=1)
        columns = np.concatenate([rows.x, rows.free], axis=1)
        w, u = rfft(weights, transform), rfft(columns, transform)
        for i in range(equations):
            power = (spectra[:, i].real ** 2 + spectra[:, i].imag ** 2) / length
            gain[:, i] = np.sqrt(correction(weights, w, u, power, transform))
    sums = np.zeros((runs, equations, width, equations, width))
    _spectral_sums(z, spectra, gain, 1.0 / (transform * length), transform, sums)
    return sums.reshape(runs, equations * width, equations * width)


def sandwich(bread: Array, middle: Array, name: str, information: Array) -> Array:
    """Covariance (runs, 15, 15); NaN where B is singular.

    Parameters
    ----------
    bread : (runs, signals, signals) B; middle : (runs, 15, 15) M.
    name : of the covariance; information : (runs, signals, signals) sum of Z Z', which "white" and "paper" invert.
    """
    runs, width = bread.shape[:2]
    equations = middle.shape[1] // width
    inner = information if name in ("white", "paper") else bread
    inverse = np.full_like(inner, np.nan)
    with np.errstate(invalid="ignore"):
        regular = np.asarray(np.isfinite(inner).all(axis=(1, 2)))
        regular[regular] = np.linalg.cond(inner[regular]) < _SINGULAR
    inverse[regular] = np.linalg.inv(inner[regular])
    parts = middle.reshape(runs, equations, width, equations, width)
    made = np.einsum("rac,ricjd,rbd->riajb", inverse, parts, inverse, optimize=True)
    return np.asarray(made.reshape(runs, equations * width, equations * width))


_SINGULAR: Final = 1e12
"""Condition number of the normal equations from which they count as singular [-]; judgement, four digits above rounding."""

__all__ = ["bread_of", "meat", "residuals", "sandwich"]
