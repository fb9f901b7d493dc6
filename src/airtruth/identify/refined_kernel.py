"""Numerical core of `airtruth.identify.refined`: one record, its two equations, their whitening."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify.whiten import LARGEST_ORDER, burg, whiten

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

RATIOS: Final = np.append(0.0, np.geomspace(0.01, 1.0, 11))
"""Candidates for the noise that drives the moment equation over the gyro's, per sample."""

FLAT: Final = 1e-18
"""A column whose part free of the others is this much smaller (in squares) counts as one of them."""


@njit(cache=True)
def lag(u: Array, pole: float, bend: Array, dt_s: float, out: Array) -> None:
    """u/(p - pole) from rest, into out.

    The input of a cell is linear plus the constant that gives it the area of the cubic through the four
    nearest samples, plus ``bend``.

    Parameters
    ----------
    u, out : (samples,).
    pole : not 0 [1/s].
    bend : (samples,) further constant of the cell that ends at a sample, in the unit of u.
    dt_s : sample period [s].
    """
    decay = np.exp(pole * dt_s)
    rise = np.expm1(pole * dt_s)
    late = (rise - pole * dt_s) / (pole * pole * dt_s)
    early = rise / pole - late
    last = u.size - 1
    x = 0.0
    out[0] = 0.0
    for k in range(1, u.size):
        shift = (u[k - 1] + u[k] - u[max(k - 2, 0)] - u[min(k + 1, last)]) / 24.0 + bend[k]
        x = decay * x + early * (u[k - 1] + shift) + late * (u[k] + shift)
        out[k] = x


@njit(cache=True)
def remove(columns: Array, rows: Array) -> None:
    """Take the columns out of the rows by least squares, in place; the columns become orthonormal."""
    for i in range(columns.shape[0]):
        c = columns[i]
        whole = c @ c
        for j in range(i):
            c -= (c @ columns[j]) * columns[j]
        size = c @ c
        if not size > FLAT * whole:
            c[:] = 0.0
            continue
        c /= np.sqrt(size)
        for r in range(rows.shape[0]):
            rows[r] -= (rows[r] @ c) * c


@njit(cache=True)
def balance(row: Array, pole: float, zero: float) -> None:
    """Apply (1 - pole z^-1)/(1 - zero z^-1) from rest, in place."""
    before = x = 0.0
    for k in range(row.size):
        now = row[k]
        x = now - pole * before + zero * x
        before = now
        row[k] = x


@njit(cache=True)
def _zero_of(pole: float, ratio: float) -> float:
    """Zero of the innovations form of white noise plus, ratio^2 times as strong, noise driven through pole."""
    middle = 1.0 + pole * pole + ratio * ratio
    return float((middle - np.sqrt(middle * middle - 4.0 * pole * pole)) / (2.0 * pole))


@njit(cache=True)
def drive(design: Array, e: Array, pole: float, ratios: Array) -> float:
    """The ratio of greatest restricted likelihood.

    Residuals of a fit with m columns D are free of what lies in D, mostly low frequencies; the likelihood of
    what is left, (N - m) log(e'e) + log det D'D of the whitened, accounts for it (D. A. Harville, "Maximum
    Likelihood Approaches to Variance Component Estimation", JASA 72, 1977).

    Parameters
    ----------
    design : (m, samples); e : (samples,) residual; pole : per sample; ratios : candidates.
    """
    best, chosen = np.inf, 0.0
    for ratio in ratios:
        zero = _zero_of(pole, ratio)
        d, rest = design.copy(), e.copy().reshape(1, -1)
        balance(rest[0], pole, zero)
        criterion = 0.0
        for i in range(d.shape[0]):
            balance(d[i], pole, zero)
        sizes = np.empty(d.shape[0])
        for i in range(d.shape[0]):
            for j in range(i):
                d[i] -= (d[i] @ d[j]) / sizes[j] * d[j]
            sizes[i] = max(d[i] @ d[i], 1e-300)
            criterion += np.log(sizes[i])
            rest[0] -= (rest[0] @ d[i]) / sizes[i] * d[i]
        square = rest[0] @ rest[0]
        if not square > 0.0:
            return 0.0
        criterion += (e.size - d.shape[0]) * np.log(square)
        if criterion < best:
            best, chosen = criterion, ratio
    return chosen


@njit(cache=True)
def equation(
    rows: Array, columns: Array, theta: Array, pole: float, settled: bool, colour: Array, sums: Array
) -> None:
    """Whiten one equation by its residuals at theta, and sum its products.

    Parameters
    ----------
    rows : (7, samples) instruments, regressors, left side; overwritten.
    columns : (c, samples) free constants and transients; overwritten.
    theta : (3,).
    pole : per sample, of noise that drives the equation; 0 for none.
    settled : whether ``colour`` is taken as it is, or found.
    colour : (2 + LARGEST_ORDER,) ratio of driving noise, order and reflection coefficients.
    sums : (3, 7), filled: Z'X | Z'y | Z'Z, all over the variance of the whitened residual.
    """
    e = (rows[6] - theta[0] * rows[3] - theta[1] * rows[4] - theta[2] * rows[5]).copy()
    if pole > 0.0:
        if not settled:
            colour[0] = drive(np.concatenate((columns, rows[:3])), e, pole, RATIOS)
        zero = _zero_of(pole, colour[0])
        balance(e, pole, zero)
        for i in range(7):
            balance(rows[i], pole, zero)
        for i in range(columns.shape[0]):
            balance(columns[i], pole, zero)
    if not settled:
        rest = e.reshape(1, -1).copy()
        remove(columns.copy(), rest)
        colour[1] = burg(rest[0], LARGEST_ORDER, colour[2:])
    reflection, order = colour[2:], int(colour[1])
    whiten(rows, reflection, order)
    whiten(columns, reflection, order)
    remove(columns, rows)
    freedom = e.size - 3 - columns.shape[0] - order
    square = 0.0
    for k in range(e.size):
        left = rows[6, k] - theta[0] * rows[3, k] - theta[1] * rows[4, k] - theta[2] * rows[5, k]
        square += left * left
    variance = square / freedom
    for i in range(3):
        for j in range(3):
            sums[i, j] = (rows[i] @ rows[3 + j]) / variance
            sums[i, 4 + j] = (rows[i] @ rows[j]) / variance
        sums[i, 3] = (rows[i] @ rows[6]) / variance


@njit(cache=True)
def _record(
    signals: Array,
    smooth: Array,
    bend: Array,
    v: Array,
    p: Array,
    factors: Array,
    theta: Array,
    intercept: bool,
    dt_s: float,
    settled: bool,
    colour: Array,
    sums: Array,
) -> None:
    alpha, q, az, elevator = signals[0], signals[1], signals[2], signals[3]
    samples = alpha.size
    moment, normal, half = factors[1], factors[2], factors[3]
    pole = -max(abs(moment * half * theta[4]), 1.0 / (samples * dt_s))
    rows = np.empty((7, samples))
    columns = np.empty((2, samples))
    nothing = np.zeros(samples)
    rate = np.empty(samples)

    lag(p * alpha, pole, nothing, dt_s, rows[3])
    lag(p * q / v, pole, nothing, dt_s, rows[4])
    lag(p * elevator, pole, bend, dt_s, rows[5])
    lag(q, pole, nothing, dt_s, rate)
    lag(p, pole, nothing, dt_s, columns[0])
    columns[1] = np.exp(pole * dt_s * np.arange(samples))
    rows[6] = q - q[0] * columns[1] + pole * rate
    # q as alpha and the elevator move it, with the constant and the start that fit it best
    made = moment * (theta[3] * rows[3] + theta[5] * rows[5])
    own = columns.copy() if intercept else columns[1:].copy()
    rest = (q - made).reshape(1, -1)
    remove(own, rest)
    made = q - rest[0]
    lag(p * made / v, pole, nothing, dt_s, rows[1])
    rows[3] *= moment
    rows[4] *= moment * half
    rows[5] *= moment
    rows[0], rows[2] = rows[3], rows[5]
    rows[1] *= moment * half
    free = columns if intercept else columns[1:]
    equation(rows, free, theta[3:], np.exp(pole * dt_s), settled, colour[1], sums[1])

    rows[0], rows[1], rows[2] = normal * smooth, normal * half * made / v, normal * elevator
    rows[3], rows[4], rows[5] = normal * alpha, normal * half * q / v, normal * elevator
    rows[6] = az
    constant = np.ones((1, samples))
    free = constant if intercept else constant[1:]
    equation(rows, free, theta[:3], 0.0, settled, colour[0], sums[0])


@njit(cache=True)
def whitened_sums(
    signals: Array,
    smooth: Array,
    bend: Array,
    v: Array,
    p: Array,
    factors: Array,
    theta: Array,
    active: Ints,
    intercept: bool,
    dt_s: float,
    settled: bool,
    colour: Array,
    sums: Array,
) -> None:
    """Sums of products of normal force and moment equation of each active run.

    Parameters
    ----------
    signals : (runs, 4, samples) alpha [rad], q [rad/s], az over p [g], elevator [rad], deviations.
    smooth : (runs, samples) low-passed alpha [rad], the instrument of the normal force.
    bend : (runs, samples) from `airtruth.identify.intersample.servo_bend` [rad].
    v, p : (runs, samples) measured airspeed and dynamic pressure over those of the flight condition.
    factors : (runs, 4) from `airtruth.identify.rows.row_factors`.
    theta : (active, 6).
    active : runs to work on.
    intercept : whether a constant is free in each equation.
    dt_s : sample period [s].
    settled : whether the whitening is that of ``colour``, or found anew.
    colour : (runs, 2, 2 + LARGEST_ORDER) whitening of normal force and moment, see `equation`.
    sums : (active, 2, 3, 7), filled: of the lift and of the moment parameters, see `equation`.
    """
    for i in range(active.size):
        r = active[i]
        _record(
            signals[r],
            smooth[r],
            bend[r],
            v[r],
            p[r],
            factors[r],
            theta[i],
            intercept,
            dt_s,
            settled,
            colour[r],
            sums[i],
        )
