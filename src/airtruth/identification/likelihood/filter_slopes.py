"""Derivatives of steady-state filters with respect to the parameters, all parameters of a run in one product."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.likelihood.kalman_kernel import Filter
from airtruth.identification.likelihood.linearise import Matrices
from airtruth.numerics.discretise import DOUBLINGS

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

FADED: Final = 1e-9
"""Largest element of a power of the closed loop that counts as zero [-]; judgement: its square is below rounding."""


def transposed(matrix: Array) -> Array:
    """Transpose (..., b, a) of matrices (..., a, b)."""
    return np.swapaxes(matrix, -1, -2)


def closed_loop(steady: Filter) -> Array:
    """phi - phi K C (runs, states, states)."""
    return np.asarray(steady.step.phi - np.matmul(steady.gain_p, steady.step.c))


def differentiated(steady: Filter, moved: Matrices) -> tuple[Array, Array]:
    """Derivatives W dS W' (runs, free, outputs, outputs) and of phi K (runs, free, states, outputs)."""
    phi, c, p, white, gain = steady.step.phi, steady.step.c, steady.p, steady.white, steady.gain
    # the parameters in the middle: a product with all of them at once
    d_phi, d_noise, d_c = (np.swapaxes(part, 1, 2) for part in (moved.phi, moved.noise, moved.c))
    closed, pc = closed_loop(steady), p @ transposed(c)
    # the gain is stationary for the filtered covariance: its derivative does not enter here
    half = _right(d_phi, (p - gain @ transposed(pc)) @ transposed(phi))
    half -= _left(steady.gain_p, _right(d_c, p @ transposed(closed)))
    d_p = _right(steady.gain_p[:, :, None] * moved.variance[:, None], transposed(steady.gain_p))
    d_p = _lyapunov(closed, d_p + half + half.swapaxes(1, 3) + d_noise, np.asarray(p.any(axis=(1, 2))))
    cross = _right(d_c, pc)
    d_s = cross + cross.swapaxes(1, 3) + _left(c, _right(d_p, transposed(c)))
    outputs = np.arange(d_s.shape[1])
    d_s[:, outputs, :, outputs] += np.moveaxis(moved.variance, 2, 0)
    slope = _right(d_p, transposed(c)) + _left(p, d_c.swapaxes(1, 3)) - _left(gain, d_s)
    d_gain_p = _right(d_phi, gain) + _left(phi, _right(slope, transposed(white) @ white))
    return np.swapaxes(_left(white, _right(d_s, transposed(white))), 1, 2), np.swapaxes(d_gain_p, 1, 2)


def _left(matrix: Array, x: Array) -> Array:
    """Products (runs, a, free, c) of a matrix (runs, a, b) and derivatives (runs, b, free, c)."""
    return np.asarray(np.matmul(matrix, x.reshape(*x.shape[:2], -1)).reshape(len(x), -1, *x.shape[2:]))


def _right(x: Array, matrix: Array) -> Array:
    """Products (runs, a, free, c) of derivatives (runs, a, free, b) and a matrix (runs, b, c)."""
    return np.asarray(
        np.matmul(x.reshape(len(x), -1, x.shape[3]), matrix).reshape(*x.shape[:3], matrix.shape[2])
    )


def _lyapunov(closed: Array, x: Array, filtering: Bools) -> Array:
    """Solution of X = F X F' + x by doubling.

    Parameters
    ----------
    closed : (runs, n, n) F.
    x : (runs, n, free, n) symmetric.
    filtering : (runs,) False where P = 0: nothing is filtered and X = x.
    """
    power = np.where(filtering[:, None, None], closed, 0.0)
    powers = []
    for _ in range(DOUBLINGS):
        powers.append(power)
        going = np.abs(power).max(axis=(1, 2)) > FADED
        if not going.any():
            break
        power = np.where(going[:, None, None], power @ power, 0.0)
    for part in powers:
        x = x + _right(_left(part, x), transposed(part))
    return x
