"""Compiled loops of the lateral regressions: left sides, response of the linear model, dynamic filter, normal equations."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.numerics.discretise import eliminate, multiply, step
from airtruth.numerics.prefilter import LANES

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
def _product(a: Array, b: Array) -> float:
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
                sums[run, a, b] = _product(z[run, a], x[run, b])
            for b in range(y.shape[1]):
                sums[run, a, x.shape[1] + b] = _product(z[run, a], y[run, b])


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


@partial(inner, fastmath={"contract"})
def _states(phi: Array, early: Array, late: Array, u: Array, bend: Array, scale: Array, out: Array) -> None:
    """Four states from rest into out (4 or more, samples), the first three with their factors; inputs as in `respond`."""
    first, second, bend0, bend1 = u[0], u[1], bend[0], bend[1]
    for i in range(4):
        to, a0, a1, b0, b1 = out[i], early[i, 0], early[i, 1], late[i, 0], late[i, 1]
        for k in range(1, u.shape[1]):
            to[k] = (a0 * (first[k - 1] + bend0[k]) + b0 * (first[k] + bend0[k])) + (
                a1 * (second[k - 1] + bend1[k]) + b1 * (second[k] + bend1[k])
            )
    p00, p01, p02, p03 = phi[0, 0], phi[0, 1], phi[0, 2], phi[0, 3]
    p10, p11, p12, p13 = phi[1, 0], phi[1, 1], phi[1, 2], phi[1, 3]
    p20, p21, p22, p23 = phi[2, 0], phi[2, 1], phi[2, 2], phi[2, 3]
    p30, p31, p32, p33 = phi[3, 0], phi[3, 1], phi[3, 2], phi[3, 3]
    s0, s1, s2 = scale[0], scale[1], scale[2]
    x0 = x1 = x2 = x3 = 0.0
    out[0, 0] = out[1, 0] = out[2, 0] = out[3, 0] = 0.0
    for k in range(1, u.shape[1]):
        y0 = (out[0, k] + p00 * x0 + p01 * x1) + (p02 * x2 + p03 * x3)
        y1 = (out[1, k] + p10 * x0 + p11 * x1) + (p12 * x2 + p13 * x3)
        y2 = (out[2, k] + p20 * x0 + p21 * x1) + (p22 * x2 + p23 * x3)
        x3 = (out[3, k] + p30 * x0 + p31 * x1) + (p32 * x2 + p33 * x3)
        x0, x1, x2 = y0, y1, y2
        out[0, k], out[1, k], out[2, k] = s0 * x0, s1 * x1, s2 * x2


@njit(cache=True, error_model="numpy")
def respond(systems: Array, dt_s: float, u: Array, bend: Array, runs: Ints, scale: Array, out: Array) -> None:
    """Response from rest of models of four states and two inputs: the first three states, each with its factor.

    Parameters
    ----------
    systems : (active, 4, 6) [A, B].
    dt_s : sample period [s].
    u, bend : (all, 2, samples) input, linear between samples, and its additional mean over the cell that ends at each sample.
    runs : (active,) numbers of the runs among all.
    scale : (all, 3 or more) factors.
    out : (active, 4 or more, samples), its first four rows written, the last of them with the fourth state.
    """
    phi, noise, process = np.empty((4, 4)), np.empty((4, 4)), np.zeros(4)
    early, late = np.empty((4, 2)), np.empty((4, 2))
    for i in range(systems.shape[0]):
        step(systems[i], process, 4, dt_s, phi, early, late, noise)
        _states(phi, early, late, u[runs[i]], bend[runs[i]], scale[runs[i]], out[i])


@njit(cache=True, error_model="numpy")
def response_sums(
    systems: Array,
    dt_s: float,
    u: Array,
    bend: Array,
    runs: Ints,
    scale: Array,
    x: Array,
    y: Array,
    sums: Array,
) -> None:
    """Sums of products of the states of `respond` with rows of the runs, without materialising the states.

    Parameters
    ----------
    x, y : (all, signals, inside) and (all, coefficients, inside), without as many samples at the start as at the end.
    sums : (active, 3 or more, signals + coefficients), its first rows written.
    """
    phi, noise, process = np.empty((4, 4)), np.empty((4, 4)), np.zeros(4)
    early, late = np.empty((4, 2)), np.empty((4, 2))
    states, inside = np.empty((4, u.shape[2])), x.shape[2]
    first = (u.shape[2] - inside) // 2
    for i in range(systems.shape[0]):
        run = runs[i]
        step(systems[i], process, 4, dt_s, phi, early, late, noise)
        _states(phi, early, late, u[run], bend[run], scale[run], states)
        for a in range(3):
            own = states[a, first : first + inside]
            for b in range(x.shape[1]):
                sums[i, a, b] = _product(own, x[run, b])
            for b in range(y.shape[1]):
                sums[i, a, x.shape[1] + b] = _product(own, y[run, b])


@partial(inner, fastmath={"contract"})
def _cubic_lanes(x: Array, corners: Array, cornered: int, phi: Array, hold: Array, out: Array) -> None:
    """The first state of 1/Delta(p), from rest, for each lane of x (samples, `LANES`), into out (`LANES`, samples).

    The input of a cell is linear, plus the constant that gives it the area of the cubic through four samples, plus corners (2,
    samples) in two lanes. The lanes run side by side because each waits for its own last result.

    Parameters
    ----------
    hold : (10 `LANES`,) states, gains of the states by the early and by the late end of a cell, room for a row: in one array,
        because the compiler cannot tell that several do not overlap.
    """
    p00, p01, p02, p10, p11 = phi[0, 0], phi[0, 1], phi[0, 2], phi[1, 0], phi[1, 1]
    p12, p20, p21, p22 = phi[1, 2], phi[2, 0], phi[2, 1], phi[2, 2]
    for lane in range(LANES):
        hold[lane] = hold[LANES + lane] = hold[2 * LANES + lane] = out[lane, 0] = 0.0
    last = x.shape[0] - 1
    for k in range(1, x.shape[0]):
        before, after = max(k - 2, 0), min(k + 1, last)
        for lane in range(LANES):
            area = x[k - 1, lane] + x[k, lane] - x[before, lane] - x[after, lane]
            hold[9 * LANES + lane] = area * (1.0 / 24.0)
        for row in range(2):
            if 0 <= cornered + row < LANES:
                hold[9 * LANES + cornered + row] += corners[row, k]
        for lane in range(LANES):
            area = hold[9 * LANES + lane]
            a, b = x[k - 1, lane] + area, x[k, lane] + area
            x0, x1, x2 = hold[lane], hold[LANES + lane], hold[2 * LANES + lane]
            t0 = hold[3 * LANES + lane] * a + hold[6 * LANES + lane] * b
            t1 = hold[4 * LANES + lane] * a + hold[7 * LANES + lane] * b
            t2 = hold[5 * LANES + lane] * a + hold[8 * LANES + lane] * b
            hold[lane] = t0 + p00 * x0 + (p01 * x1 + p02 * x2)
            hold[LANES + lane] = t1 + p10 * x0 + (p11 * x1 + p12 * x2)
            hold[2 * LANES + lane] = t2 + p20 * x0 + (p21 * x1 + p22 * x2)
        for lane in range(LANES):
            out[lane, k] = hold[lane]


@njit(cache=True, error_model="numpy")
def filter_rows(
    systems: Array,
    dt_s: float,
    u: Array,
    bend: Array,
    corners: Array,
    runs: Ints,
    scale: Array,
    rows: Array,
    chosen: Ints,
    out: Array,
    sums: Array,
) -> None:
    """Filter rows and instruments of runs from rest by 1/Delta(p), Delta = |p I - A| of the first three states.

    Signals are linear between samples plus the area of the cubic through the four nearest.

    Parameters
    ----------
    systems, dt_s, u, bend, runs, scale : as in `respond`, whose states are the instruments.
    corners : (all, 2, samples) additional mean of the last two rows over the cell that ends at each sample.
    rows : (all, rows, samples); the first two are filtered by p/Delta instead. The instruments follow the rows.
    chosen : numbers of rows and instruments, for the sums.
    out : (active, blocks, `LANES`, samples), written; the first two rows are also added to those three further on. One entry
        serves all runs in turn where the sums alone are wanted.
    sums : (active, chosen, rows - 2), written: products of the chosen rows with the third and further ones.
    """
    phi, noise, process = np.empty((4, 4)), np.empty((4, 4)), np.zeros(4)
    early, late = np.empty((4, 2)), np.empty((4, 2))
    system, slow = np.zeros((3, 5)), np.empty((3, 3))
    first, second, spread = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 3))
    hold, states = np.empty(10 * LANES), np.empty((4, rows.shape[2]))
    instruments, lanes = rows.shape[1], np.zeros((out.shape[1], rows.shape[2], LANES))
    for i in range(systems.shape[0]):
        run, a, made = runs[i], systems[i], out[i % out.shape[0]]
        step(a, process, 4, dt_s, phi, early, late, noise)
        _states(phi, early, late, u[run], bend[run], scale[run], states)
        for j in range(instruments + 3):
            block, lane = divmod(j, LANES)
            row = rows[run, j] if j < instruments else states[j - instruments]
            for k in range(row.size):
                lanes[block, k, lane] = row[k]
        trace = a[0, 0] + a[1, 1] + a[2, 2]
        minors = (a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]) + (a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0])
        minor = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
        determinant = a[0, 0] * minor - a[0, 1] * (a[1, 0] * a[2, 2] - a[1, 2] * a[2, 0])
        determinant += a[0, 2] * (a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0])
        system[0, 1] = system[1, 2] = system[2, 3] = 1.0
        system[2, 0], system[2, 1], system[2, 2] = determinant, -(minors + minor), trace
        system[1, 4], system[2, 4] = 1.0, trace  # p/Delta in the first state: A times the other input
        step(system, process, 3, dt_s, slow, first, second, spread)
        for block in range(lanes.shape[0]):
            for lane in range(LANES):
                which = 1 if block == 0 and lane < 2 else 0
                for j in range(3):
                    hold[(3 + j) * LANES + lane] = first[j, which]
                    hold[(6 + j) * LANES + lane] = second[j, which]
            cornered = instruments - 2 - block * LANES
            _cubic_lanes(lanes[block], corners[run], cornered, slow, hold, made[block])
        for j in range(2):
            for k in range(states.shape[1]):
                made[0, 3 + j, k] += made[0, j, k]
        for row in range(chosen.size):
            block, lane = divmod(chosen[row], LANES)
            for j in range(2, instruments):
                sums[i, row, j - 2] = _product(made[block, lane], made[j // LANES, j % LANES])


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
    "LANES",
    "filter_rows",
    "grow_less",
    "left_sides",
    "orthonormal",
    "products",
    "remove",
    "respond",
    "response_sums",
    "solve",
    "systems_of",
]
