"""Compiled recursions along records: response of a linear model, and filters of any order, for general sizes."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.discretise import step

Array = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def steps(systems: Array, dt_s: float, phi: Array, early: Array, late: Array) -> None:
    """Exact steps x+ = phi x + early u + late u+ of [A, B] (runs, states, states + inputs), input linear in between."""
    runs, n = systems.shape[0], systems.shape[1]
    process, noise = np.zeros(n), np.empty((n, n))
    for run in range(runs):
        step(systems[run], process, n, dt_s, phi[run], early[run], late[run], noise)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def respond(phi: Array, early: Array, late: Array, u: Array, bend: Array, out: Array) -> None:
    """Response from rest of runs (runs, states, samples) to u (runs, inputs, samples), with the areas that ``bend`` adds."""
    runs, n, samples = out.shape
    inputs = u.shape[1]
    x, following = np.empty(n), np.empty(n)
    for run in range(runs):
        x[:] = 0.0
        for i in range(n):
            out[run, i, 0] = 0.0
        for k in range(1, samples):
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += phi[run, i, j] * x[j]
                for j in range(inputs):
                    more = bend[run, j, k]
                    total += early[run, i, j] * (u[run, j, k - 1] + more) + late[run, i, j] * (
                        u[run, j, k] + more
                    )
                following[i] = total
            for i in range(n):
                x[i] = following[i]
                out[run, i, k] = following[i]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def filter_rows(
    phi: Array, early: Array, late: Array, u: Array, bend: Array, taps: Array, out: Array
) -> None:
    """Filter rows (runs, rows, samples) of every run from rest by its filter, in place of ``out``.

    Parameters
    ----------
    phi, early, late : (runs, n, n), (runs, n) and (runs, n): exact step of the run's filter.
    u : input, linear between samples; bend : (runs, rows, samples) additional mean over the cell that ends at each sample.
    taps : (rows,) number of the state that is the output of each row.
    """
    runs, rows, samples = u.shape
    n = phi.shape[1]
    x, following = np.empty((n, rows)), np.empty((n, rows))
    for run in range(runs):
        x[:] = 0.0
        for row in range(rows):
            out[run, row, 0] = 0.0
        for k in range(1, samples):
            for i in range(n):
                for row in range(rows):
                    more = bend[run, row, k]
                    following[i, row] = early[run, i] * (u[run, row, k - 1] + more) + late[run, i] * (
                        u[run, row, k] + more
                    )
                for j in range(n):
                    factor = phi[run, i, j]
                    for row in range(rows):
                        following[i, row] += factor * x[j, row]
            for i in range(n):
                for row in range(rows):
                    x[i, row] = following[i, row]
            for row in range(rows):
                out[run, row, k] = x[taps[row], row]


__all__ = ["filter_rows", "respond", "steps"]
