"""Filtered instruments, regressors and observations of each run; their products and normal equations.

One array (runs, 10, samples) holds, for each run, the elements of eq. (4) of M. Brunot, "An Instrumental
Variable Approach for Aircraft Identification". Z and X share one form, so that three signals of each suffice
for every equation:

    y_lift   = alpha_dot - q   = -(q_bar S/(m V)) (CLalpha alpha + (c/2V) CLq q + CLde de)    [rad/s]
    y_moment = q_dot           = (q_bar S c/Iyy) (Cmalpha alpha + (c/2V) Cmq q + Cmde de)     [rad/s2]
    y_normal = az              = -(q_bar S/(m g)) (CLalpha alpha + (c/2V) CLq q + CLde de)    [g]

TRIM is the column of the free intercept: the constant 1 after the same filter.

Normal equations: eqs (4) to (6) and (9). Z'X is block diagonal: three lift parameters in two equations, three
moment parameters in one. The equations are stacked unweighted, alpha_dot - q in rad/s, q_dot in rad/s2, az in
g, as in the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.options import AuxiliaryModel
from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import inner
from airtruth.physics.short_period import Scale
from airtruth.units import G0

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

Z_ALPHA: Final = 0
"""Row of the instrument of alpha [rad]."""
Z_Q: Final = 1
"""Row of the instrument of q [rad/s]."""
Z_DE: Final = 2
"""Row of the instrument of the elevator [rad]."""
TRIM: Final = 3
"""Row of the intercept [-]."""
X_ALPHA: Final = 4
"""Row of the regressor alpha [rad]."""
X_Q: Final = 5
"""Row of the regressor q [rad/s]."""
X_DE: Final = 6
"""Row of the regressor elevator [rad]."""
Y_LIFT: Final = 7
"""Row of the observation of lift [rad/s]."""
Y_MOMENT: Final = 8
"""Row of the observation of moment [rad/s2]."""
Y_NORMAL: Final = 9
"""Row of the observation of normal force [g]."""
COUNT: Final = 10
"""Number of rows of a run."""

LIFT: Final = 0
"""Index of the lift equation, and of its factor -q_bar S/(m V) [1/s]."""
MOMENT: Final = 1
"""Index of the moment equation, and of its factor q_bar S c/Iyy [1/s2]."""
NORMAL: Final = 2
"""Index of the normal-force equation, and of its factor -q_bar S/(m g) [g]."""
HALF_CHORD: Final = 3
"""Index of the factor c/(2V) of q [s]."""

NO_INSTRUMENTS: Final = np.empty((0, 3, 0))
"""Passed to a kernel that makes the instruments by the linear auxiliary model."""
SINGULAR: Final = 1e-12
"""Determinant over the product of the lengths of the rows below which a 3 by 3 matrix counts as singular [-];
judgement, four digits above rounding."""


@dataclass(frozen=True)
class Equations:
    """A regression y = X theta + nu with instruments Z made by theta, as sums of products.

    Attributes
    ----------
    moments : (theta (active, 6), active) -> (active, 4, 7) sums of products, [Z | TRIM] against
        [X | Y | TRIM], with the instruments and filters that theta makes.
    usable : theta (active, 6), active -> (active,) whether theta makes instruments.
    failed : (runs,) runs that cannot be estimated: no actuator model exists.
    """

    moments: Callable[[Array, Ints], Array]
    usable: Callable[[Array, Ints], Bools]
    failed: Bools


@dataclass(frozen=True)
class Problem(Equations):
    """Equations of runs of one length, with their rows.

    Attributes
    ----------
    rows : (theta (active, 6), active) -> (active, 10, samples), see the module.
    """

    rows: Callable[[Array, Ints], Array]


@dataclass(frozen=True)
class Projected:
    """Instruments, regressors and residuals of filtered equations, orthogonal to the intercept.

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


def row_factors(scale: Scale) -> Array:
    """Factors (runs, 4): of the equations lift, moment and normal (az in g), and c/(2V) [s] of q."""
    return np.stack(
        np.broadcast_arrays(-scale.lift, scale.moment, -scale.normal / G0, scale.half_chord_time), axis=-1
    ).astype(np.float64)


def made_by(
    auxiliary: AuxiliaryModel, theta: Array, u: Array, dt_s: float, scale: Scale, active: Ints
) -> Array:
    """Instruments alpha, q, elevator (active, 3, samples) of a user's auxiliary model.

    Parameters
    ----------
    auxiliary : the model.
    theta : (active, 6) derivatives [-].
    u : (active, samples) input, deviation from trim [rad].
    dt_s, scale, active : sample period [s], factors of all runs, runs to simulate.
    """
    chosen = Scale(*(getattr(scale, name)[active] for name in Scale.__dataclass_fields__))
    made = auxiliary(theta, u, dt_s, chosen)
    return np.stack(made if len(made) == 3 else (*made, u), axis=1)


@partial(inner, fastmath={"reassoc", "contract", "nsz"})
def products(z: Array, x: Array, moments: Array) -> None:
    """Sums over samples of z (4, samples) against x (6, samples) and the last row of z, into (4, 7).

    Reassociation lets the sums run in vector registers; their order is the same for every run.
    """
    samples = z.shape[1]
    for i in range(4):
        m0 = m1 = m2 = m3 = m4 = m5 = m6 = 0.0
        for k in range(samples):
            v = z[i, k]
            m0 += v * x[0, k]
            m1 += v * x[1, k]
            m2 += v * x[2, k]
            m3 += v * x[3, k]
            m4 += v * x[4, k]
            m5 += v * x[5, k]
            m6 += v * z[3, k]
        moments[i, 0], moments[i, 1], moments[i, 2] = m0, m1, m2
        moments[i, 3], moments[i, 4], moments[i, 5] = m3, m4, m5
        moments[i, 6] = m6


@awaited
@njit(cache=True, error_model="numpy")
def _moments(rows: Array, moments: Array) -> None:
    for r in range(rows.shape[0]):
        products(rows[r, :4], rows[r, 4:], moments[r])


def moments_of(rows: Array) -> Array:
    """Sums of products (runs, 4, 7): [Z | TRIM] against [X | Y | TRIM]."""
    moments = np.empty((rows.shape[0], 4, 7))
    _moments(rows, moments)
    return moments


def normal_equations(moments: Array, factors: Array, intercept: bool) -> tuple[Array, Array]:
    """Z'X and Z'y of the lift and of the moment parameters.

    Parameters
    ----------
    moments : (runs, 4, 7) from `moments_of` or `Equations`.
    factors : (runs, 4) from `row_factors`.
    intercept : whether each equation of each run has a free constant.

    Returns
    -------
    matrix, right : (runs, 2, 3, 3) and (runs, 2, 3).
    """
    own = moments[:, :3, :6]
    if intercept:  # the intercept is its own instrument: its column is projected out of Z
        own = own - (moments[:, :3, 6] / moments[:, 3, None, 6])[:, :, None] * moments[:, 3, None, :6]
    by_rate = np.ones((moments.shape[0], 3))
    by_rate[:, 1] = factors[:, HALF_CHORD]
    lift, moment, normal = factors[:, LIFT, None], factors[:, MOMENT, None], factors[:, NORMAL, None]
    product = own[:, :, :3] * by_rate[:, :, None] * by_rate[:, None, :]
    both = lift * lift + normal * normal
    matrix = np.stack([both[:, :, None] * product, (moment * moment)[:, :, None] * product], axis=1)
    right = np.stack(
        [
            by_rate * (lift * own[:, :, 3 + LIFT] + normal * own[:, :, 3 + NORMAL]),
            by_rate * moment * own[:, :, 3 + MOMENT],
        ],
        axis=1,
    )
    return matrix, right


def solve(matrix: Array, right: Array) -> Array:
    """theta (runs, 6) = (Z'X)^-1 Z'y by Cramer's rule; NaN in a block whose matrix is singular (`SINGULAR`).

    Parameters
    ----------
    matrix, right : (runs, 2, 3, 3) and (runs, 2, 3) of the lift and of the moment parameters.
    """
    a, y = (np.ascontiguousarray(np.moveaxis(part, (0, 1), (-2, -1))) for part in (matrix, right))
    solution, det, size = np.zeros_like(y), np.zeros_like(y[0]), np.ones_like(y[0])
    with np.errstate(invalid="ignore", over="ignore"):  # a run without a usable model
        for i in range(3):
            second, third = a[(i + 1) % 3], a[(i + 2) % 3]
            size *= np.sqrt(a[i, 0] ** 2 + a[i, 1] ** 2 + a[i, 2] ** 2)
            for j in range(3):
                k, h = (j + 1) % 3, (j + 2) % 3
                cofactor = second[k] * third[h] - second[h] * third[k]
                solution[j] += cofactor * y[i]
                if i == 0:
                    det += a[i, j] * cofactor
        regular = np.abs(det) > SINGULAR * size
    solution = np.divide(solution, det, out=np.full_like(solution, np.nan), where=regular)
    return np.ascontiguousarray(np.moveaxis(solution, (1, 2), (0, 1))).reshape(-1, 6)


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _remove_trim(rows: Array, trim: Array) -> None:
    """Subtract from each row of each run its part along the run's unit vector trim, in place."""
    for r in range(rows.shape[0]):
        s = trim[r]
        for i in range(rows.shape[1]):
            row = rows[r, i]
            share = 0.0
            for k in range(s.size):
                share += row[k] * s[k]
            for k in range(s.size):
                row[k] -= share * s[k]


def project(rows: Array, theta: Array, factors: Array, intercept: bool) -> Projected:
    """Residuals at theta, and instruments and regressors orthogonal to the intercept's column.

    Parameters
    ----------
    rows : (runs, 10, samples) from a `Problem`.
    theta : (runs, 6) [-].
    factors : (runs, 4) from `row_factors`.
    intercept : whether a constant is free in each equation.
    """
    trim = np.zeros_like(rows[:, TRIM])
    own = rows.copy()
    if intercept:
        length = np.sqrt(np.einsum("rk,rk->r", rows[:, TRIM], rows[:, TRIM]))
        trim = rows[:, TRIM] / length[:, None]
        _remove_trim(own, trim)
    x = own[:, X_ALPHA : X_DE + 1]
    by_equation = np.stack([theta[:, :3], theta[:, 3:], theta[:, :3]], axis=1)
    by_equation = by_equation * factors[:, [LIFT, MOMENT, NORMAL], None]
    by_equation[:, :, 1] *= factors[:, HALF_CHORD, None]
    return Projected(
        z=np.ascontiguousarray(own[:, :TRIM]),
        x=np.ascontiguousarray(x),
        e=own[:, Y_LIFT:] - np.matmul(by_equation, x),
        trim=trim,
    )
