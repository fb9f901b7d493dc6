"""Compiled response of the linear models of lateral runs, and the dynamic filter that they make."""

from __future__ import annotations

from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.lateral.kernels import product
from airtruth.numerics.compiled import inner
from airtruth.numerics.discretise import step
from airtruth.numerics.prefilter import LANES

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_FAST: Final = 3
"""States that are instruments, and order of the dynamic filter: beta, p and r."""


class Driven(NamedTuple):
    """Linear models of runs and what drives them.

    Attributes
    ----------
    systems : (active, 4, 6) [A, B].
    runs : (active,) numbers of the runs among all.
    u, bend : (all, 2, samples) input, linear between samples, and its additional mean over the cell that ends at each sample.
    scale : (all, 3 or more) factors of the states.
    dt_s : sample period [s].
    """

    systems: Array
    runs: Ints
    u: Array
    bend: Array
    scale: Array
    dt_s: float


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
def respond(driven: Driven, out: Array) -> None:
    """Response from rest of models of four states and two inputs: the first three states, each with its factor.

    Parameters
    ----------
    out : (active, 4 or more, samples), its first four rows written, the last of them with the fourth state.
    """
    phi, noise, process = np.empty((4, 4)), np.empty((4, 4)), np.zeros(4)
    early, late = np.empty((4, 2)), np.empty((4, 2))
    for i in range(driven.runs.size):
        run = driven.runs[i]
        step(driven.systems[i], process, 4, driven.dt_s, phi, early, late, noise)
        _states(phi, early, late, driven.u[run], driven.bend[run], driven.scale[run], out[i])


@njit(cache=True, error_model="numpy")
def response_sums(driven: Driven, x: Array, y: Array, sums: Array) -> None:
    """Sums of products of the states of `respond` with rows of the runs, without materialising the states.

    Parameters
    ----------
    x, y : (all, signals, inside) and (all, coefficients, inside), without as many samples at the start as at the end.
    sums : (active, 3 or more, signals + coefficients), its first rows written.
    """
    phi, noise, process = np.empty((4, 4)), np.empty((4, 4)), np.zeros(4)
    early, late = np.empty((4, 2)), np.empty((4, 2))
    samples, inside = driven.u.shape[2], x.shape[2]
    states, first = np.empty((4, samples)), (samples - inside) // 2
    for i in range(driven.runs.size):
        run = driven.runs[i]
        step(driven.systems[i], process, 4, driven.dt_s, phi, early, late, noise)
        _states(phi, early, late, driven.u[run], driven.bend[run], driven.scale[run], states)
        for a in range(_FAST):
            own = states[a, first : first + inside]
            for b in range(x.shape[1]):
                sums[i, a, b] = product(own, x[run, b])
            for b in range(y.shape[1]):
                sums[i, a, x.shape[1] + b] = product(own, y[run, b])


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
def filter_rows(driven: Driven, corners: Array, rows: Array, chosen: Ints, out: Array, sums: Array) -> None:
    """Filter rows and instruments of runs from rest by 1/Delta(p), Delta = |p I - A| of the first three states.

    Signals are linear between samples plus the area of the cubic through the four nearest.

    Parameters
    ----------
    driven : models, whose states are the instruments.
    corners : (all, 2, samples) additional mean of the last two rows over the cell that ends at each sample.
    rows : (all, rows, samples); the first two are filtered by p/Delta instead. The instruments follow the rows.
    chosen : numbers of rows and instruments, for the sums.
    out : (active, blocks, `LANES`, samples), written; the first two rows are also added to those three further on. One entry
        serves all runs in turn where the sums alone are wanted.
    sums : (active, chosen, rows - 2), written: products of the chosen rows with the third and further ones.
    """
    phi, noise, process = np.empty((4, 4)), np.empty((4, 4)), np.zeros(4)
    early, late = np.empty((4, 2)), np.empty((4, 2))
    system, slow = np.zeros((_FAST, _FAST + 2)), np.empty((_FAST, _FAST))
    first, second, spread = np.empty((_FAST, 2)), np.empty((_FAST, 2)), np.empty((_FAST, _FAST))
    hold, states = np.empty(10 * LANES), np.empty((4, rows.shape[2]))
    instruments, lanes = rows.shape[1], np.zeros((out.shape[1], rows.shape[2], LANES))
    for i in range(driven.runs.size):
        run, a, made = driven.runs[i], driven.systems[i], out[i % out.shape[0]]
        step(a, process, 4, driven.dt_s, phi, early, late, noise)
        _states(phi, early, late, driven.u[run], driven.bend[run], driven.scale[run], states)
        for j in range(instruments + _FAST):
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
        step(system, process, _FAST, driven.dt_s, slow, first, second, spread)
        for block in range(lanes.shape[0]):
            for lane in range(LANES):
                which = 1 if block == 0 and lane < 2 else 0
                for j in range(_FAST):
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
                sums[i, row, j - 2] = product(made[block, lane], made[j // LANES, j % LANES])


__all__ = ["LANES", "Driven", "filter_rows", "respond", "response_sums"]
