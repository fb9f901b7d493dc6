"""Matrices of a predictor's exact step, and their derivatives with respect to the parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.likelihood.predictor import LevelLayout
from airtruth.numerics.discretise import assemble, step
from airtruth.numerics.step_slopes import StepSlopes, step_slopes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Matrices(NamedTuple):
    """One step x+ = phi x + early u + late u+ + n of a predictor with outputs y = c x + d u + v.

    Attributes
    ----------
    phi, early, late, noise : (..., states, states), (..., states, inputs) twice, (..., states, states): covariance
        of n. ``early`` and ``late`` belong to the ends of a linear input.
    c, d, variance : (..., outputs, states), (..., outputs, inputs), (..., outputs): variance of v.
    """

    phi: Array
    early: Array
    late: Array
    noise: Array
    c: Array
    d: Array
    variance: Array


class _Terms(NamedTuple):
    """Arrays of a `LevelLayout` that the kernel reads."""

    location: Ints
    coefficient: Array
    logarithmic: Ints
    moves: Ints


def values_of(layout: LevelLayout, z: Array) -> Array:
    """Values of the parameters (runs, parameters) from z, which holds logarithms where the layout has them."""
    with np.errstate(over="ignore"):
        return np.where(layout.logarithmic == 1, np.exp(z), z)


def matrices(layout: LevelLayout, runs: Ints, z: Array, dt_s: float) -> Matrices:
    """Matrices of runs, each with its own row of z; not finite where the step overflows.

    Parameters
    ----------
    layout : predictor.
    runs : (runs,) indices of the runs.
    z : (runs, parameters) values, logarithms where the layout has them.
    dt_s : sample period [s].
    """
    n, inputs, m, _ = layout.sizes
    made = _empty((runs.size,), layout.sizes)
    system, process = np.empty((n + m, n + inputs)), np.empty(n)
    values = values_of(layout, z)
    for b, run in enumerate(runs):
        assemble(values[b], layout.location, layout.coefficient[run], system, process, made.variance[b])
        step(system, process, n, dt_s, made.phi[b], made.early[b], made.late[b], made.noise[b])
        made.c[b], made.d[b] = system[n:, :n], system[n:, n:]
    return made


def slopes(layout: LevelLayout, runs: Ints, z: Array, free: Ints, dt_s: float) -> Matrices:
    """Derivatives of `matrices` with respect to the free parameters, (runs, free, ...).

    Parameters
    ----------
    layout, runs, z, dt_s : as in `matrices`.
    free : indices of the parameters to differentiate for.
    """
    made = _empty((runs.size, free.size), layout.sizes)
    terms = _Terms(layout.location, layout.coefficient[runs], layout.logarithmic, layout.moves)
    _differentiate(values_of(layout, z), free, terms, dt_s, made)
    return made


def _empty(shape: tuple[int, ...], sizes: tuple[int, int, int, int]) -> Matrices:
    n, inputs, m, _ = sizes
    return Matrices(
        phi=np.empty((*shape, n, n)),
        early=np.empty((*shape, n, inputs)),
        late=np.empty((*shape, n, inputs)),
        noise=np.empty((*shape, n, n)),
        c=np.empty((*shape, m, n)),
        d=np.empty((*shape, m, inputs)),
        variance=np.empty((*shape, m)),
    )


@njit(cache=True, error_model="numpy")
def _differentiate(values: Array, free: Ints, terms: _Terms, dt_s: float, made: Matrices) -> None:
    """Fill the derivatives; the step is differentiated only for parameters that act on it."""
    runs, count, n, inputs = made.early.shape
    m = made.variance.shape[2]
    moving = free[terms.moves[free] == 1]
    place, among = np.full(values.shape[1], -1), np.full(count, -1)
    for f in range(count):
        place[free[f]] = f
        for g in range(moving.size):
            if moving[g] == free[f]:
                among[f] = g
    system, process, variance = np.empty((n + m, n + inputs)), np.empty(n), np.empty(m)
    slope = np.empty((n + m, n + inputs, count))
    d_system, d_process = np.zeros((n, n + inputs, moving.size)), np.zeros((n, moving.size))
    square, wide = (n, n, moving.size), (n, inputs, moving.size)
    own = StepSlopes(np.empty(square), np.empty(wide), np.empty(wide), np.empty(square))
    for b in range(runs):
        assemble(values[b], terms.location, terms.coefficient[b], system, process, variance)
        slope[:] = 0.0
        d_process[:] = 0.0
        made.variance[b] = 0.0
        for t in range(terms.location.shape[0]):
            matrix, row, column = terms.location[t, 0], terms.location[t, 1], terms.location[t, 2]
            for side in (3, 4):
                which, other = terms.location[t, side], terms.location[t, 7 - side]
                if which < 0 or place[which] < 0:
                    continue
                factor = terms.coefficient[b, t] * (values[b, other] if other >= 0 else 1.0)
                factor *= values[b, which] if terms.logarithmic[which] == 1 else 1.0
                if matrix == 0:
                    slope[row, column, place[which]] += factor
                elif matrix == 1:
                    d_process[row, among[place[which]]] += factor
                else:
                    made.variance[b, place[which], row] += factor
        for f in range(count):
            for i in range(m):
                for j in range(n):
                    made.c[b, f, i, j] = slope[n + i, j, f]
                for j in range(inputs):
                    made.d[b, f, i, j] = slope[n + i, n + j, f]
            if among[f] >= 0:
                for i in range(n):
                    for j in range(n + inputs):
                        d_system[i, j, among[f]] = slope[i, j, f]
        step_slopes(system, process, d_system, d_process, dt_s, own)
        for f in range(count):
            g = among[f]
            for i in range(n):
                for j in range(n):
                    made.phi[b, f, i, j] = own.phi[i, j, g] if g >= 0 else 0.0
                    made.noise[b, f, i, j] = own.noise[i, j, g] if g >= 0 else 0.0
                for j in range(inputs):
                    made.early[b, f, i, j] = own.early[i, j, g] if g >= 0 else 0.0
                    made.late[b, f, i, j] = own.late[i, j, g] if g >= 0 else 0.0
