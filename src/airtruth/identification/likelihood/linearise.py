"""Matrices of a predictor's exact step, and their derivatives with respect to the parameters by complex step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.likelihood.predictor import LevelLayout
from airtruth.numerics.discretise import TINY, assemble, step

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
    """Arrays of a `Layout` that the kernel reads."""

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


@njit(cache=True)
def _differentiate(values: Array, free: Ints, terms: _Terms, dt_s: float, made: Matrices) -> None:
    """Fill the derivatives; the step is differentiated only for parameters that act on it."""
    runs, count, n, inputs = made.early.shape
    m = made.variance.shape[2]
    moved = np.empty(values.shape[1], dtype=np.complex128)
    system = np.empty((n + m, n + inputs), dtype=np.complex128)
    process, variance = np.empty(n, dtype=np.complex128), np.empty(m, dtype=np.complex128)
    phi, noise = np.empty((n, n), dtype=np.complex128), np.empty((n, n), dtype=np.complex128)
    early, late = np.empty((n, inputs), dtype=np.complex128), np.empty((n, inputs), dtype=np.complex128)
    for b in range(runs):
        for f in range(count):
            for i in range(moved.size):
                moved[i] = values[b, i]
            which = free[f]
            moved[which] += 1j * TINY * (values[b, which] if terms.logarithmic[which] == 1 else 1.0)
            assemble(moved, terms.location, terms.coefficient[b], system, process, variance)
            acts = terms.moves[which] == 1
            if acts:
                step(system, process, n, dt_s, phi, early, late, noise)
            for i in range(n):
                for j in range(n):
                    made.phi[b, f, i, j] = phi[i, j].imag / TINY if acts else 0.0
                    made.noise[b, f, i, j] = noise[i, j].imag / TINY if acts else 0.0
                for j in range(inputs):
                    made.early[b, f, i, j] = early[i, j].imag / TINY if acts else 0.0
                    made.late[b, f, i, j] = late[i, j].imag / TINY if acts else 0.0
            for a in range(m):
                for j in range(n):
                    made.c[b, f, a, j] = system[n + a, j].imag / TINY
                for j in range(inputs):
                    made.d[b, f, a, j] = system[n + a, n + j].imag / TINY
                made.variance[b, f, a] = variance[a].imag / TINY
