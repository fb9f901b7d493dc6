"""Kernels of `airtruth.identification.regression.refined`: the two equations of a record and their whitening.

Sources: J. P. Burg, "Maximum Entropy Spectral Analysis", PhD thesis, Stanford, 1975, as in P. Stoica and
R. Moses, "Spectral Analysis of Signals", 2005, section 3.9.3, for the recursion; G. Schwarz, "Estimating the
Dimension of a Model", Annals of Statistics 6(2), 1978, for its order; D. A. Harville, "Maximum Likelihood
Approaches to Variance Component Estimation", JASA 72, 1977, for the restricted likelihood.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.regression.rows import HALF_CHORD, LIFT, MOMENT, NORMAL
from airtruth.identification.signals import ALPHA, AZ, ELEVATOR, Q
from airtruth.physics.short_period import CL_ALPHA, CM_ALPHA, CM_DE, CM_Q

Array = NDArray[np.float64]

RATIOS: Final = np.append(0.0, np.geomspace(0.01, 1.0, 11))
"""Candidate ratios of the noise that drives the moment equation to that of the gyro, per sample [-]; judgement:
a factor of 1.6 between neighbours."""

LARGEST_ORDER: Final = 12
"""Largest order of the autoregressive model of the residuals [-]; judgement."""

FLAT: Final = 1e-18
"""Share of a column's square that is orthogonal to the others, below which it depends on them [-]; judgement,
above rounding."""
RATIO: Final = 0
"""Index of the ratio of driving noise [-] in the whitening of an equation."""
ORDER: Final = 1
"""Index of the autoregressive order in the whitening."""
REFLECTION: Final = 2
"""Index of the first reflection coefficient [-] in the whitening."""
WHITENING: Final = REFLECTION + LARGEST_ORDER
"""Length of the whitening of an equation."""


class RefinedRun(NamedTuple):
    """Signals of one run.

    Attributes
    ----------
    signals : (4, samples) alpha [rad], q [rad/s], az over p [g], elevator [rad], deviations from trim.
    smooth : (samples,) low-passed alpha [rad], the instrument of the normal force.
    bend : (samples,) from `airtruth.numerics.intersample.servo_bend` [rad].
    v, p : (samples,) measured airspeed and dynamic pressure over those of the flight condition [-].
    factors : (4,) from `airtruth.identification.regression.rows.row_factors`.
    dt_s : sample period [s].
    known : (samples,) part of q' that another motion causes [rad/s2].
    """

    signals: Array
    smooth: Array
    bend: Array
    v: Array
    p: Array
    factors: Array
    dt_s: float
    known: Array


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
    """Make the rows orthogonal to the columns, in place; the columns become orthonormal."""
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
    """Zero of the innovations form of white noise plus ratio^2 times as strong noise through the pole."""
    middle = 1.0 + pole * pole + ratio * ratio
    return float((middle - np.sqrt(middle * middle - 4.0 * pole * pole)) / (2.0 * pole))


@njit(cache=True)
def drive(design: Array, e: Array, pole: float, ratios: Array) -> float:
    """Return the ratio of greatest restricted likelihood.

    Residuals of a fit with m columns D are orthogonal to D, whose power is mostly at low frequencies. The
    restricted likelihood, (N - m) log(e'e) + log det D'D of the whitened columns, accounts for that (Harville).

    Parameters
    ----------
    design : (m, samples); e : (samples,) residual; pole : per sample; ratios : candidates.
    """
    best, chosen = np.inf, 0.0
    for ratio in ratios:
        zero = _zero_of(pole, ratio)
        d, rest = design.copy(), e.copy()
        balance(rest, pole, zero)
        criterion = 0.0
        for i in range(d.shape[0]):
            balance(d[i], pole, zero)
        sizes = np.empty(d.shape[0])
        for i in range(d.shape[0]):
            for j in range(i):
                d[i] -= (d[i] @ d[j]) / sizes[j] * d[j]
            sizes[i] = max(d[i] @ d[i], 1e-300)
            criterion += np.log(sizes[i])
            rest -= (rest @ d[i]) / sizes[i] * d[i]
        square = rest @ rest
        if not square > 0.0:
            return 0.0
        criterion += (e.size - d.shape[0]) * np.log(square)
        if criterion < best:
            best, chosen = criterion, ratio
    return chosen


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


@njit(cache=True)
def equation(
    rows: Array, columns: Array, theta: Array, pole: float, settled: bool, whitening: Array, sums: Array
) -> None:
    """Whiten one equation by its residuals at theta, and sum its products.

    Parameters
    ----------
    rows : (7, samples) three instruments, three regressors, left side; overwritten.
    columns : (c, samples) free constants and transients; overwritten.
    theta : (3,) derivatives [-].
    pole : per sample, of noise that drives the equation; 0 for none.
    settled : whether ``whitening`` is kept, or chosen from the residuals and written.
    whitening : (WHITENING,) ratio of driving noise, order and reflection coefficients.
    sums : (3, 7), written: Z'X | Z'y | Z'Z, all over the variance of the whitened residual.
    """
    z, x, y = rows[:3], rows[3:6], rows[6]
    e = y - theta[0] * x[0] - theta[1] * x[1] - theta[2] * x[2]
    if pole > 0.0:
        if not settled:
            design = np.empty((columns.shape[0] + 3, e.size))
            design[: columns.shape[0]] = columns
            design[columns.shape[0] :] = z
            whitening[RATIO] = drive(design, e, pole, RATIOS)
        zero = _zero_of(pole, whitening[RATIO])
        balance(e, pole, zero)
        for i in range(7):
            balance(rows[i], pole, zero)
        for i in range(columns.shape[0]):
            balance(columns[i], pole, zero)
    reflection = whitening[REFLECTION:]
    if not settled:
        rest = np.empty((1, e.size))
        rest[0] = e
        remove(columns.copy(), rest)
        whitening[ORDER] = burg(rest[0], LARGEST_ORDER, reflection)
    order = int(whitening[ORDER])
    whiten(rows, reflection, order)
    whiten(columns, reflection, order)
    remove(columns, rows)
    freedom = e.size - 3 - columns.shape[0] - order
    square = 0.0
    for k in range(e.size):
        residual = y[k] - theta[0] * x[0, k] - theta[1] * x[1, k] - theta[2] * x[2, k]
        square += residual * residual
    variance = square / freedom
    for i in range(3):
        for j in range(3):
            sums[i, j] = (z[i] @ x[j]) / variance
            sums[i, 4 + j] = (z[i] @ z[j]) / variance
        sums[i, 3] = (z[i] @ y) / variance


@njit(cache=True)
def record_sums(
    record: RefinedRun, theta: Array, intercept: bool, settled: bool, whitening: Array, sums: Array
) -> None:
    """Sums of products of the normal-force and the moment equation of one run.

    Parameters
    ----------
    record : signals of the run.
    theta : (6,) derivatives [-].
    intercept : whether a constant is free in each equation.
    settled : whether ``whitening`` is kept, or chosen from the residuals and written.
    whitening : (2, WHITENING) of normal force and moment, see `equation`.
    sums : (2, 3, 7), written: of the lift and of the moment parameters, see `equation`.
    """
    alpha, q = record.signals[ALPHA], record.signals[Q]
    elevator, v, p, dt_s = record.signals[ELEVATOR], record.v, record.p, record.dt_s
    samples = alpha.size
    moment, half = record.factors[MOMENT], record.factors[HALF_CHORD]
    pole = -max(abs(moment * half * theta[CM_Q]), 1.0 / (samples * dt_s))
    rows = np.empty((7, samples))
    z_alpha, z_q, z_de, x_alpha, x_q, x_de, y = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]
    columns = np.empty((2, samples))
    nothing = np.zeros(samples)
    rate = np.empty(samples)

    lag(p * alpha, pole, nothing, dt_s, x_alpha)
    lag(p * q / v, pole, nothing, dt_s, x_q)
    lag(p * elevator, pole, record.bend, dt_s, x_de)
    lag(q, pole, nothing, dt_s, rate)
    lag(p, pole, nothing, dt_s, columns[0])
    columns[1] = np.exp(pole * dt_s * np.arange(samples))
    y[:] = q - q[0] * columns[1] + pole * rate
    lag(record.known, pole, nothing, dt_s, rate)
    y -= rate
    # q as alpha, the elevator and the known part move it, with the constant and the initial value that fit it best
    made = moment * (theta[CM_ALPHA] * x_alpha + theta[CM_DE] * x_de) + rate
    own = columns.copy() if intercept else columns[1:].copy()
    rest = np.empty((1, samples))
    rest[0] = q - made
    remove(own, rest)
    made = q - rest[0]
    lag(p * made / v, pole, nothing, dt_s, z_q)
    x_alpha *= moment
    x_q *= moment * half
    x_de *= moment
    z_alpha[:] = x_alpha
    z_de[:] = x_de
    z_q *= moment * half
    free = columns if intercept else columns[1:]
    per_sample = np.exp(pole * dt_s)
    equation(rows, free, theta[CM_ALPHA:], per_sample, settled, whitening[MOMENT], sums[MOMENT])

    normal = record.factors[NORMAL]
    z_alpha[:] = normal * record.smooth
    z_q[:] = normal * half * made / v
    z_de[:] = normal * elevator
    x_alpha[:] = normal * alpha
    x_q[:] = normal * half * q / v
    x_de[:] = normal * elevator
    y[:] = record.signals[AZ]
    constant = np.ones((1, samples))
    free = constant if intercept else constant[1:]
    equation(rows, free, theta[CL_ALPHA:CM_ALPHA], 0.0, settled, whitening[LIFT], sums[LIFT])
