"""Kernels of `airtruth.identification.likelihood.kalman`: innovations and their derivatives along records."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.likelihood.linearise import Matrices

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


class KalmanSignals(NamedTuple):
    """Records of one length.

    Attributes
    ----------
    y : (runs, samples, outputs) measured.
    u : (runs, samples, inputs).
    bend : (runs, samples, inputs) mean of the input over the cell that ends at each sample, less the mean of the two
        samples.
    """

    y: Array
    u: Array
    bend: Array


class Filter(NamedTuple):
    """Steady-state filters of runs.

    Attributes
    ----------
    step : matrices of the step, (runs, ...).
    p : (runs, states, states) prediction covariance P.
    white : (runs, outputs, outputs) lower triangular W with W S W' = I, S the covariance of the innovations.
    logdet : (runs,) log|S|.
    gain, gain_p : (runs, states, outputs) K and phi K.
    """

    step: Matrices
    p: Array
    white: Array
    logdet: Array
    gain: Array
    gain_p: Array


class FilterSlopes(NamedTuple):
    """Derivatives of the filter, the parameter along the last axis, (runs, ..., free)."""

    phi: Array
    early: Array
    late: Array
    c: Array
    d: Array
    gain_p: Array


@njit(cache=True)
def innovate(step: Matrices, white: Array, gain_p: Array, signals: KalmanSignals, rows: Array) -> None:
    """Whitened innovations of the data, and of a unit of each initial mean and bias, into rows.

    Parameters
    ----------
    step, white, gain_p : of the filters.
    rows : (runs, 1 + states + outputs + free, samples outputs), its first 1 + states + outputs written.
    """
    phi, early, late, c, d = step.phi, step.early, step.late, step.c, step.d
    y, u, bend = signals.y, signals.u, signals.bend
    runs, samples, m = y.shape
    n, inputs = phi.shape[1], u.shape[2]
    columns = 1 + n + m
    x, following = np.empty((n, columns)), np.empty((n, columns))
    e = np.empty((m, columns))
    for run in range(runs):
        x[:] = 0.0
        for i in range(n):
            x[i, 1 + i] = 1.0
        for k in range(samples):
            for a in range(m):
                for j in range(columns):
                    e[a, j] = 0.0
                for i in range(n):
                    for j in range(columns):
                        e[a, j] -= c[run, a, i] * x[i, j]
                e[a, 0] += y[run, k, a]
                for i in range(inputs):
                    e[a, 0] -= d[run, a, i] * u[run, k, i]
                e[a, 1 + n + a] -= 1.0
            for a in range(m):
                for j in range(columns):
                    total = 0.0
                    for b in range(a + 1):
                        total += white[run, a, b] * e[b, j]
                    rows[run, j, k * m + a] = total
            if k + 1 == samples:
                break
            for i in range(n):
                for j in range(columns):
                    following[i, j] = 0.0
                for h in range(n):
                    for j in range(columns):
                        following[i, j] += phi[run, i, h] * x[h, j]
                for a in range(m):
                    for j in range(columns):
                        following[i, j] += gain_p[run, i, a] * e[a, j]
                for h in range(inputs):
                    following[i, 0] += early[run, i, h] * (u[run, k, h] + bend[run, k + 1, h])
                    following[i, 0] += late[run, i, h] * (u[run, k + 1, h] + bend[run, k + 1, h])
            x, following = following, x


@njit(cache=True)
def _moved_rows(slope: FilterSlopes, run: int) -> tuple[Bools, Bools, Bools, Bools]:
    """Rows of phi, of early and late, of c and of d that a parameter moves; those of a gust, for example, none does."""
    n, m, inputs, count = slope.phi.shape[1], slope.c.shape[1], slope.d.shape[2], slope.phi.shape[3]
    by_state, by_input = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    out_state, out_input = np.zeros(m, dtype=np.bool_), np.zeros(m, dtype=np.bool_)
    for f in range(count):
        for h in range(n):
            for i in range(n):
                by_state[i] |= slope.phi[run, i, h, f] != 0.0
            for a in range(m):
                out_state[a] |= slope.c[run, a, h, f] != 0.0
        for h in range(inputs):
            for i in range(n):
                by_input[i] |= slope.early[run, i, h, f] != 0.0 or slope.late[run, i, h, f] != 0.0
            for a in range(m):
                out_input[a] |= slope.d[run, a, h, f] != 0.0
    return by_state, by_input, out_state, out_input


@njit(cache=True)
def innovate_slopes(
    steady: Filter, slope: FilterSlopes, nuisance: Array, signals: KalmanSignals, rows: Array
) -> None:
    """Derivatives of the whitened innovations along the trajectory of the estimated means and biases.

    Parameters
    ----------
    steady, slope : filters and their derivatives.
    nuisance : (runs, states + outputs) initial means and biases.
    rows : (runs, 1 + states + outputs + free, samples outputs), its last ``free`` written.
    """
    step = steady.step
    phi, early, late, c, d = step.phi, step.early, step.late, step.c, step.d
    d_early, d_late = slope.early, slope.late
    white, gain_p = steady.white, steady.gain_p
    y, u, bend = signals.y, signals.u, signals.bend
    runs, samples, m = y.shape
    n, inputs, count = phi.shape[1], u.shape[2], slope.phi.shape[3]
    columns = rows.shape[1] - count
    state, ahead, now = np.empty(n), np.empty(n), np.empty(m)
    dx, dx_ahead, de = np.empty((n, count)), np.empty((n, count)), np.empty((m, count))
    for run in range(runs):
        for i in range(n):
            state[i] = nuisance[run, i]
        dx[:] = 0.0
        by_state, by_input, out_state, out_input = _moved_rows(slope, run)
        for k in range(samples):
            for a in range(m):
                total = y[run, k, a] - nuisance[run, n + a]
                for f in range(count):
                    de[a, f] = 0.0
                for i in range(n):
                    total -= c[run, a, i] * state[i]
                    if out_state[a]:
                        for f in range(count):
                            de[a, f] -= c[run, a, i] * dx[i, f] + slope.c[run, a, i, f] * state[i]
                    elif c[run, a, i] != 0.0:
                        for f in range(count):
                            de[a, f] -= c[run, a, i] * dx[i, f]
                for i in range(inputs):
                    total -= d[run, a, i] * u[run, k, i]
                    if out_input[a]:
                        for f in range(count):
                            de[a, f] -= slope.d[run, a, i, f] * u[run, k, i]
                now[a] = total
            for a in range(m):
                for f in range(count):
                    total = 0.0
                    for b in range(a + 1):
                        total += white[run, a, b] * de[b, f]
                    rows[run, columns + f, k * m + a] = total
            if k + 1 == samples:
                break
            for i in range(n):
                total = 0.0
                for f in range(count):
                    dx_ahead[i, f] = 0.0
                for h in range(n):
                    total += phi[run, i, h] * state[h]
                    if by_state[i]:
                        for f in range(count):
                            dx_ahead[i, f] += phi[run, i, h] * dx[h, f] + slope.phi[run, i, h, f] * state[h]
                    elif phi[run, i, h] != 0.0:
                        for f in range(count):
                            dx_ahead[i, f] += phi[run, i, h] * dx[h, f]
                for a in range(m):
                    total += gain_p[run, i, a] * now[a]
                    for f in range(count):
                        dx_ahead[i, f] += gain_p[run, i, a] * de[a, f] + slope.gain_p[run, i, a, f] * now[a]
                for h in range(inputs):
                    first = u[run, k, h] + bend[run, k + 1, h]
                    second = u[run, k + 1, h] + bend[run, k + 1, h]
                    total += early[run, i, h] * first + late[run, i, h] * second
                    if by_input[i]:
                        for f in range(count):
                            dx_ahead[i, f] += d_early[run, i, h, f] * first + d_late[run, i, h, f] * second
                ahead[i] = total
            state, ahead = ahead, state
            dx, dx_ahead = dx_ahead, dx
