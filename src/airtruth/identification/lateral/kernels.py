"""Compiled loops of the lateral regressions: left sides, free constants, linear models, normal equations."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.numerics.discretise import eliminate, multiply

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Seven = tuple[float, float, float, float, float, float, float]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def left_sides(
    force: Array, half: Array, motion: Array, constants: Seven, rates: Array, slopes: Array, added: Array
) -> None:
    """Dimensionless rates and left sides of runs.

    Parameters
    ----------
    force : (runs, samples) q_bar S [N]; half : (runs, samples) b/(2V) [s].
    motion : (4, runs, samples) p, q, r [rad/s], ay [m/s2].
    constants : sample period [s], mass [kg], span [m], Ixx, Iyy, Izz, Ixz [kg m2].
    rates : (runs, 2 or more, samples), its first two rows written: p b/(2V), r b/(2V).
    slopes, added : (runs, 3, samples), written, as in `airtruth.identification.lateral.observation.Observation`; slopes count
        from the first sample.
    """
    dt_s, mass, span, ixx, iyy, izz, ixz = constants
    runs, samples = force.shape
    by = np.empty(samples)
    for run in range(runs):
        p, q, r, ay = motion[0, run], motion[1, run], motion[2, run], motion[3, run]
        for k in range(samples):
            by[k] = 1.0 / (force[run, k] * span)
        roll0, yaw0 = (ixx * p[0] - ixz * r[0]) * by[0], (izz * r[0] - ixz * p[0]) * by[0]
        for k in range(samples):
            first, last = max(k - 1, 0), min(k + 1, samples - 1)
            change = (by[last] - by[first]) / ((last - first) * dt_s)
            roll, yaw = ixx * p[k] - ixz * r[k], izz * r[k] - ixz * p[k]
            rates[run, 0, k], rates[run, 1, k] = p[k] * half[run, k], r[k] * half[run, k]
            slopes[run, 0, k], slopes[run, 1, k] = 0.0, roll * by[k] - roll0
            slopes[run, 2, k] = yaw * by[k] - yaw0
            added[run, 0, k] = mass * ay[k] * span * by[k]
            added[run, 1, k] = q[k] * (-ixz * p[k] + (izz - iyy) * r[k]) * by[k] - change * roll
            added[run, 2, k] = q[k] * (ixz * r[k] + (iyy - ixx) * p[k]) * by[k] - change * yaw


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def remove(basis: Array, rows: Array) -> None:
    """Subtract from rows (runs, rows, samples), in place, their parts along orthonormal rows (runs, columns, samples)."""
    runs, count, samples = rows.shape
    for run in range(runs):
        for i in range(count):
            for j in range(basis.shape[1]):
                part = 0.0
                for k in range(samples):
                    part += rows[run, i, k] * basis[run, j, k]
                for k in range(samples):
                    rows[run, i, k] -= part * basis[run, j, k]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def orthonormal(columns: Array, least: float, basis: Array) -> None:
    """Orthonormal rows (runs, columns, samples) of the space of ``columns``, by the modified Gram-Schmidt process, done twice.

    A column is zero whose square outside those before it is at most ``least`` of its own.
    """
    runs, count, samples = columns.shape
    for run in range(runs):
        for i in range(count):
            before = 0.0
            for k in range(samples):
                basis[run, i, k] = columns[run, i, k]
                before += columns[run, i, k] ** 2
            for _ in range(2):
                for j in range(i):
                    part = 0.0
                    for k in range(samples):
                        part += basis[run, i, k] * basis[run, j, k]
                    for k in range(samples):
                        basis[run, i, k] -= part * basis[run, j, k]
            after = 0.0
            for k in range(samples):
                after += basis[run, i, k] ** 2
            size = 1.0 / math.sqrt(after) if after > least * before else 0.0
            for k in range(samples):
                basis[run, i, k] *= size


@partial(inner, fastmath={"reassoc", "contract", "nsz"})
def product(a: Array, b: Array) -> float:
    total = 0.0
    for k in range(a.size):
        total += a[k] * b[k]
    return total


@njit(cache=True, error_model="numpy")
def products(z: Array, x: Array, y: Array, sums: Array) -> None:
    """Sums (runs, rows of z, rows of x and y) of products of rows (runs, rows, samples)."""
    for run in range(z.shape[0]):
        for a in range(z.shape[1]):
            for b in range(x.shape[1]):
                sums[run, a, b] = product(z[run, a], x[run, b])
            for b in range(y.shape[1]):
                sums[run, a, x.shape[1] + b] = product(z[run, a], y[run, b])


@njit(cache=True, error_model="numpy")
def swept(sums: Array, coefficients: int, constants: int, least: float, made: Array) -> None:
    """Sums of products of rows orthogonal to the free constants, from those of rows that are not: sums is changed.

    Parameters
    ----------
    sums : (runs, signals + constants, coefficients + constants + signals) products Z and constants by Y, constants and X.
    least : square of a constant outside those before it, over its own, from which it counts as another [-].
    made : (runs, signals, signals + coefficients), written: Z X' and Z Y'.
    """
    signals = made.shape[1]
    own = np.empty(constants)
    for run in range(sums.shape[0]):
        of = sums[run]
        for i in range(constants):
            own[i] = of[signals + i, coefficients + i]
        for i in range(constants):
            row, column = signals + i, coefficients + i
            if not of[row, column] > least * own[i]:
                continue
            for a in range(of.shape[0]):
                share = of[a, column] / of[row, column]
                if a != row:
                    for b in range(of.shape[1]):
                        of[a, b] -= share * of[row, b]
        for a in range(signals):
            for b in range(signals):
                made[run, a, b] = of[a, coefficients + constants + b]
            for b in range(coefficients):
                made[run, a, signals + b] = of[a, b]


@njit(cache=True, error_model="numpy")
def systems_of(
    theta: Array, runs: Ints, kinematics: Array, forces: Array, rates: Array, columns: Ints, made: Array
) -> None:
    """[A, B] (active, states, states + controls) of theta (active, derivatives).

    Parameters
    ----------
    runs : (active,) numbers of the runs among all.
    kinematics, forces, rates : of all runs, as of `airtruth.identification.lateral.problems.LinearModels`.
    columns : columns of [A, B] of the signals.
    """
    for i in range(runs.size):
        run = runs[i]
        for row in range(made.shape[1]):
            for column in range(made.shape[2]):
                made[i, row, column] = kinematics[run, row, column]
            for signal in range(columns.size):
                total = 0.0
                for j in range(forces.shape[2]):
                    total += forces[run, row, j] * (theta[i, j * columns.size + signal] * rates[run, signal])
                made[i, row, columns[signal]] += total


@njit(cache=True, error_model="numpy")
def grow_less(a: Array, rate: float, less: Bools) -> None:
    """Whether every root of the motions x' = a x of four states, (runs, 4, 4), has a real part below a rate [1/s], into (runs,).

    The criterion of Routh and Hurwitz for a - rate I, whose characteristic polynomial follows from the traces of its powers:
    eigenvalues take many times as long. A matrix that is not finite has no such roots.
    """
    one, two = np.empty((4, 4)), np.empty((4, 4))
    for run in range(a.shape[0]):
        for i in range(4):
            for j in range(4):
                one[i, j] = a[run, i, j] - (rate if i == j else 0.0)
        multiply(one, one, two)
        t1 = t2 = t3 = t4 = 0.0
        for i in range(4):
            t1 += one[i, i]
            t2 += two[i, i]
            for j in range(4):
                t3 += two[i, j] * one[j, i]
                t4 += two[i, j] * two[j, i]
        c3 = -t1
        c2 = -0.5 * (c3 * t1 + t2)
        c1 = -(c2 * t1 + c3 * t2 + t3) / 3.0
        c0 = -0.25 * (c1 * t1 + c2 * t2 + c3 * t3 + t4)
        first = c3 * c2 - c1
        less[run] = c3 > 0.0 and c0 > 0.0 and first > 0.0 and first * c1 > c3**2 * c0


@njit(cache=True, error_model="numpy")
def solve(matrix: Array, right: Array, limit: float, theta: Array) -> None:
    """Solve equations (runs, n, n), (runs, n, m) into (runs, n, m); NaN where their matrix is near singular.

    Parameters
    ----------
    limit : product of the Frobenius norms of the matrix, its rows of unit length, and of its inverse, from which there is no
        solution [-].
    """
    runs, n, m = right.shape
    a, both = np.empty((n, n)), np.empty((n, n + m))
    for run in range(runs):
        for i in range(n):
            size = 0.0
            for j in range(n):
                size += matrix[run, i, j] ** 2
            size = 1.0 / math.sqrt(size)
            for j in range(n):
                a[i, j] = matrix[run, i, j] * size
                both[i, j] = 1.0 if i == j else 0.0
            for j in range(m):
                both[i, n + j] = right[run, i, j] * size
        eliminate(a, both)
        inverse = 0.0
        for i in range(n):
            for j in range(n):
                inverse += both[i, j] ** 2
        sound = math.sqrt(n * inverse) < limit  # rows of unit length: the norm of the matrix is the root of n
        for i in range(n):
            for j in range(m):
                theta[run, i, j] = both[i, n + j] if sound and math.isfinite(both[i, n + j]) else np.nan


__all__ = [
    "grow_less",
    "left_sides",
    "orthonormal",
    "product",
    "products",
    "remove",
    "solve",
    "swept",
    "systems_of",
]
