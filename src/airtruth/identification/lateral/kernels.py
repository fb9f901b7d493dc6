"""Compiled loops of the lateral regressions: left sides, response of the linear model, dynamic filter, normal equations."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.numerics.discretise import eliminate, step

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
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


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def respond(systems: Array, dt_s: float, u: Array, bend: Array, runs: Ints, scale: Array, out: Array) -> None:
    """Response from rest of models of four states and two inputs: the first three states, each with its factor.

    Parameters
    ----------
    systems : (active, 4, 6) [A, B].
    dt_s : sample period [s].
    u, bend : (all, 2, samples) input, linear between samples, and its additional mean over the cell that ends at each sample.
    runs : (active,) numbers of the runs among all.
    scale : (active, 3) factors.
    out : (active, 3 or more, samples), its first rows written.
    """
    phi, noise, process = np.empty((4, 4)), np.empty((4, 4)), np.zeros(4)
    early, late = np.empty((4, 2)), np.empty((4, 2))
    for i in range(systems.shape[0]):
        step(systems[i], process, 4, dt_s, phi, early, late, noise)
        first, second, bend0, bend1 = u[runs[i], 0], u[runs[i], 1], bend[runs[i], 0], bend[runs[i], 1]
        s0, s1, s2 = scale[i, 0], scale[i, 1], scale[i, 2]
        x0 = x1 = x2 = x3 = 0.0
        out[i, 0, 0] = out[i, 1, 0] = out[i, 2, 0] = 0.0
        for k in range(1, u.shape[2]):
            a, b = first[k - 1] + bend0[k], first[k] + bend0[k]
            c, d = second[k - 1] + bend1[k], second[k] + bend1[k]
            e0 = (early[0, 0] * a + late[0, 0] * b) + (early[0, 1] * c + late[0, 1] * d)
            e1 = (early[1, 0] * a + late[1, 0] * b) + (early[1, 1] * c + late[1, 1] * d)
            e2 = (early[2, 0] * a + late[2, 0] * b) + (early[2, 1] * c + late[2, 1] * d)
            e3 = (early[3, 0] * a + late[3, 0] * b) + (early[3, 1] * c + late[3, 1] * d)
            y0 = (e0 + phi[0, 0] * x0 + phi[0, 1] * x1) + (phi[0, 2] * x2 + phi[0, 3] * x3)
            y1 = (e1 + phi[1, 0] * x0 + phi[1, 1] * x1) + (phi[1, 2] * x2 + phi[1, 3] * x3)
            y2 = (e2 + phi[2, 0] * x0 + phi[2, 1] * x1) + (phi[2, 2] * x2 + phi[2, 3] * x3)
            x3 = (e3 + phi[3, 0] * x0 + phi[3, 1] * x1) + (phi[3, 2] * x2 + phi[3, 3] * x3)
            x0, x1, x2 = y0, y1, y2
            out[i, 0, k], out[i, 1, k], out[i, 2, k] = s0 * x0, s1 * x1, s2 * x2


@partial(inner, fastmath={"contract"})
def _cubic_pair(x: Array, y: Array, more: Array, phi: Array, early: Array, late: Array, out: Array) -> None:
    """The first state of 1/Delta(p), from rest, for x and y, into out (2, samples).

    The input of a cell is linear, plus the constant that gives it the area of the cubic through four samples, plus ``more``
    (2, samples). Two recursions run side by side because each waits for its own last result.
    """
    g0, g1, g2 = early[0, 0], early[1, 0], early[2, 0]
    h0, h1, h2 = late[0, 0], late[1, 0], late[2, 0]
    x0 = x1 = x2 = y0 = y1 = y2 = 0.0
    out[0, 0] = out[1, 0] = 0.0
    last = x.size - 1
    for k in range(1, x.size):
        before, after = max(k - 2, 0), min(k + 1, last)
        area = (x[k - 1] + x[k] - x[before] - x[after]) * (1.0 / 24.0) + more[0, k]
        a, b = x[k - 1] + area, x[k] + area
        area = (y[k - 1] + y[k] - y[before] - y[after]) * (1.0 / 24.0) + more[1, k]
        c, d = y[k - 1] + area, y[k] + area
        t0 = (g0 * a + h0 * b) + phi[0, 0] * x0 + (phi[0, 1] * x1 + phi[0, 2] * x2)
        t1 = (g1 * a + h1 * b) + phi[1, 0] * x0 + (phi[1, 1] * x1 + phi[1, 2] * x2)
        x2 = (g2 * a + h2 * b) + phi[2, 0] * x0 + (phi[2, 1] * x1 + phi[2, 2] * x2)
        x0, x1 = t0, t1
        t0 = (g0 * c + h0 * d) + phi[0, 0] * y0 + (phi[0, 1] * y1 + phi[0, 2] * y2)
        t1 = (g1 * c + h1 * d) + phi[1, 0] * y0 + (phi[1, 1] * y1 + phi[1, 2] * y2)
        y2 = (g2 * c + h2 * d) + phi[2, 0] * y0 + (phi[2, 1] * y1 + phi[2, 2] * y2)
        y0, y1 = t0, t1
        out[0, k], out[1, k] = x0, y0


@njit(cache=True, error_model="numpy")
def filter_rows(
    cubics: Array, dt_s: float, rows: Array, bend: Array, runs: Ints, own: Array, out: Array
) -> None:
    """Filter rows of runs from rest by 1/Delta(p), Delta a cubic; the first rows are filtered by p/Delta(p).

    Signals are linear between samples plus the area of the cubic through the four nearest.

    Parameters
    ----------
    cubics : (active, 3) c0, c1, c2 of Delta(p) = p^3 + c2 p^2 + c1 p + c0.
    dt_s : sample period [s].
    rows : (all, rows, samples), an even number, the first two for p/Delta, the last two with corners.
    bend : (all, 2, samples) additional mean of the last rows over the cell that ends at each sample.
    runs : (active,) numbers of the runs among all.
    own : (active, instruments, samples) further rows of the active runs, an even number.
    out : (active, rows + instruments, samples), written.
    """
    count, samples = rows.shape[1], rows.shape[2]
    system, process = np.zeros((3, 5)), np.zeros(3)
    phi, noise, still = np.empty((3, 3)), np.empty((3, 3)), np.zeros((2, samples))
    early, late = np.empty((3, 2)), np.empty((3, 2))
    for i in range(cubics.shape[0]):
        system[0, 1] = system[1, 2] = system[2, 3] = 1.0
        system[2, 0], system[2, 1], system[2, 2] = -cubics[i, 0], -cubics[i, 1], -cubics[i, 2]
        system[1, 4], system[2, 4] = 1.0, -cubics[i, 2]  # p/Delta in the first state: A times the other input
        step(system, process, 3, dt_s, phi, early, late, noise)
        given, made = rows[runs[i]], own[i]
        _cubic_pair(given[0], given[1], still, phi, early[:, 1:], late[:, 1:], out[i, :2])
        for row in range(2, count, 2):
            more = still if row + 2 < count else bend[runs[i]]
            _cubic_pair(given[row], given[row + 1], more, phi, early, late, out[i, row : row + 2])
        for row in range(0, made.shape[0], 2):
            to = out[i, count + row : count + row + 2]
            _cubic_pair(made[row], made[row + 1], still, phi, early, late, to)


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


__all__ = ["filter_rows", "left_sides", "remove", "respond", "solve"]
