"""Kernels of `airtruth.identification.likelihood.kalman`: innovations and their derivatives along records."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.likelihood.linearise import Matrices
from airtruth.numerics.compiled import inner

Array = NDArray[np.float64]


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


class Drive(NamedTuple):
    """Inputs of runs and what they add.

    Attributes
    ----------
    u : (runs, samples, 3 inputs) the inputs at a sample, and at both ends of the cell that begins with it, with their bend.
    drive, shown : as in `predict`.
    """

    u: Array
    drive: Array
    shown: Array

    def of(self, good: NDArray[np.bool_]) -> Drive:
        """Those of some runs."""
        return Drive(*(part[good] for part in self))


def drive_of(step: Matrices, signals: KalmanSignals) -> Drive:
    """Inputs of a step and what they add."""
    y, u, bend = signals
    inputs = u.shape[2]
    every = np.zeros((*u.shape[:2], 3 * inputs))
    every[:, :, :inputs] = u
    np.add(u[:, :-1], bend[:, 1:], out=every[:, :-1, inputs : 2 * inputs])
    np.add(u[:, 1:], bend[:, 1:], out=every[:, :-1, 2 * inputs :])
    ends = np.concatenate([step.early, step.late], axis=2)
    return Drive(
        every,
        np.matmul(every[:, :, inputs:], np.swapaxes(ends, 1, 2)),
        y - np.matmul(u, np.swapaxes(step.d, 1, 2)),
    )


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def predict(
    phi: Array,
    c: Array,
    gain_p: Array,
    drive: Array,
    shown: Array,
    nuisance: Array,
    states: Array,
    errors: Array,
) -> None:
    """States and innovations along the records.

    Parameters
    ----------
    phi, c, gain_p : of the filters.
    drive : (runs, samples, states) what the inputs add to the state from each sample to the next.
    shown : (runs, samples, outputs) outputs less what the inputs add to them.
    nuisance : (runs, states + outputs) initial means and biases.
    states, errors : (runs, samples, states) and (runs, samples, outputs), written.
    """
    runs, samples, m = shown.shape
    n = phi.shape[1]
    for run in range(runs):
        for i in range(n):
            states[run, 0, i] = nuisance[run, i]
        for k in range(samples):
            for a in range(m):
                total = shown[run, k, a] - nuisance[run, n + a]
                for i in range(n):
                    total -= c[run, a, i] * states[run, k, i]
                errors[run, k, a] = total
            if k + 1 == samples:
                break
            for i in range(n):
                total = drive[run, k, i]
                for h in range(n):
                    total += phi[run, i, h] * states[run, k, h]
                for a in range(m):
                    total += gain_p[run, i, a] * errors[run, k, a]
                states[run, k + 1, i] = total


@partial(inner, fastmath={"contract"})
def _add(factors: Array, x: Array, out: Array) -> None:
    """Add the rows of x, a multiple of three, times their factors to out."""
    for h in range(0, x.shape[0], 3):
        first, second, third = factors[h], factors[h + 1], factors[h + 2]
        a, b, c = x[h], x[h + 1], x[h + 2]
        for f in range(x.shape[1]):
            out[f] += first * a[f] + second * b[f] + third * c[f]


@njit(cache=True, error_model="numpy")
def propagate(
    closed: Array, seen: Array, driven: Array, by_error: Array, shown: Array, tangents: Array
) -> None:
    """Derivatives of the whitened innovations of a run from what moves them at each sample.

    With the derivative x of the state, 0 at the first sample: x+ = F x + [driven, by_error], and the derivative of the
    innovations is [shown, 0] + H x. The first parameters move the model, the others its gain alone.

    Parameters
    ----------
    closed, seen : (states, width) F and (outputs, width) H, whitened; the width is that of the states, filled up with zeros to
        a multiple of three.
    driven, shown : (samples, states, first) and (samples, outputs, first).
    by_error : (samples, states, others).
    tangents : (samples, outputs, free or more), the first of them written.
    """
    samples, n, first = driven.shape
    count = first + by_error.shape[2]
    x, following = np.zeros((closed.shape[1], count)), np.zeros((closed.shape[1], count))
    for k in range(samples):
        for a in range(seen.shape[0]):
            to, source = tangents[k, a], shown[k, a]
            for f in range(first):
                to[f] = source[f]
            for f in range(first, count):
                to[f] = 0.0
            _add(seen[a], x, to)
        for i in range(n):
            to, source, other = following[i], driven[k, i], by_error[k, i]
            for f in range(first):
                to[f] = source[f]
            for f in range(count - first):
                to[first + f] = other[f]
            _add(closed[i], x, to)
        x, following = following, x


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def costates(closed: Array, seen: Array, white: Array, behind: Array) -> None:
    """Slope of half the sum of squares of the whitened innovations with respect to what is added to each prediction.

    l = F' l+ + H' e, with l+ = 0 behind the last sample: the adjoint of `propagate`.

    Parameters
    ----------
    closed, seen : (runs, states, states) F and (runs, outputs, states) H, whitened.
    white : (runs, samples, outputs) e.
    behind : (runs, samples, states), written: l+ at each sample.
    """
    runs, samples, m = white.shape
    n = closed.shape[1]
    for run in range(runs):
        for i in range(n):
            behind[run, samples - 1, i] = 0.0
        for k in range(samples - 1, 0, -1):
            for i in range(n):
                total = 0.0
                for h in range(n):
                    total += closed[run, h, i] * behind[run, k, h]
                for a in range(m):
                    total += seen[run, a, i] * white[run, k, a]
                behind[run, k - 1, i] = total
