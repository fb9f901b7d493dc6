"""The filter where the surface between two samples is uncertain: a corner that the samples do not show.

Within such a cell the error of the surface is a parabola that vanishes at the samples, and its mean over the cell has the
stated variance. The covariance of the prediction grows by it, and returns to the steady one through the updates that
follow. The innovations are scaled to the steady covariance, so that one whitener serves all samples.

Source: B. D. O. Anderson and J. B. Moore, *Optimal Filtering* (1979), section 3.1, for the recursion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import allocating, inner
from airtruth.numerics.discretise import congruence, multiply, step, whitener
from airtruth.tracing.model.by_motion import output_count, outputs, rates, shifted
from airtruth.tracing.model.kernel_input import AnyPoint, FilterModel
from airtruth.tracing.model.linearise import (
    FirstUpdate,
    covariance_of,
    delay_system,
    first_update,
    update_gain,
)
from airtruth.tracing.model.parameters import DELAY_ORDER

Array = NDArray[np.float64]

STEP_RAD: Final = 0.01
"""Half width of the central difference in the surface [rad]; judgement: as for the other angles of the linearisation."""
_SETTLED: Final = 1e-6
"""Relative distance of the innovations' covariance from the steady one at which the gain is steady again [-].

Judgement: small against the differences that the sensitivities are made of.
"""


class Corners(NamedTuple):
    """The recursion of the covariance about the steady filter.

    Attributes
    ----------
    phi, noise : (states, states) transition and process noise of a sample.
    spread : (controls, states, states) what a unit variance of the mean of each surface over a cell adds.
    steady : (states, states) covariance of the prediction; c : (outputs, states).
    variance : (outputs,) of the white noise; covariance : (outputs, outputs) of the steady innovations.
    root : (outputs, outputs) inverse of the steady whitener; logdet : log|covariance|.
    """

    phi: Array
    noise: Array
    spread: Array
    steady: Array
    c: Array
    variance: Array
    covariance: Array
    root: Array
    logdet: float


class CornerNodes(NamedTuple):
    """`Corners` of each flight condition of a record, stacked: (nodes, ...); the variance is that of all."""

    phi: Array
    noise: Array
    spread: Array
    steady: Array
    c: Array
    variance: Array
    covariance: Array
    root: Array
    logdet: Array


def stack(arrays: Sequence[Array]) -> Array:
    """Arrays of equal shape with a leading axis; a single one is not copied."""
    return arrays[0][None] if len(arrays) == 1 else np.array(arrays)


def stacked(corners: Sequence[Corners]) -> CornerNodes:
    """Corners of several flight conditions with the same sensors."""
    return CornerNodes(
        phi=stack([own.phi for own in corners]),
        noise=stack([own.noise for own in corners]),
        spread=stack([own.spread for own in corners]),
        steady=stack([own.steady for own in corners]),
        c=stack([own.c for own in corners]),
        variance=corners[0].variance,
        covariance=stack([own.covariance for own in corners]),
        root=stack([own.root for own in corners]),
        logdet=np.array([own.logdet for own in corners]),
    )


def input_columns(x: Array, at: AnyPoint, model: FilterModel, controls: int) -> Array:
    """(controls, states) slopes of x' in each surface [1/rad], late sensors included."""
    columns, direct = np.zeros((controls, x.size)), np.empty(model.sensors.scale.size)
    for number, column in enumerate(columns):
        _input_differences(x, at, number, model, column, direct)
    return columns


@allocating
def drive_sensors(direct: Array, model: FilterModel, column: Array) -> None:
    """Slopes of the rates of late sensors into ``column``, by those of the outputs (outputs,)."""
    for i in range(direct.size):
        lag, delay = model.states.lag[i], model.states.delay[i]
        if lag >= 0:
            column[lag] = direct[i] / model.sensors.lag_s[i]
        elif delay >= 0:
            system = delay_system(model.sensors.delay_s[i])
            for row in range(DELAY_ORDER):
                column[delay + row] = system[row, DELAY_ORDER] * direct[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _input_differences(
    x: Array, at: AnyPoint, control: int, model: FilterModel, column: Array, direct: Array
) -> None:
    """Slopes in a surface of the rates of the motion and of the outputs, and of the rates of late sensors."""
    count = output_count(model)
    rate, y = np.zeros((2, x.size)), np.empty((2, count))
    for side in range(2):
        moved = shifted(at, control, STEP_RAD if side == 0 else -STEP_RAD)
        az = rates(x, moved, model, rate[side])
        outputs(x, rate[side], az, moved, model, y[side])
    for i in range(model.states.motion):
        column[i] = (rate[0, i] - rate[1, i]) / (2.0 * STEP_RAD)
    for i in range(count):
        direct[i] = (y[0, i] - y[1, i]) / (2.0 * STEP_RAD)
    drive_sensors(direct, model, column)


@njit(cache=True, nogil=True, error_model="numpy")
def spread_of(a: Array, column: Array, dt_s: float) -> Array:
    """Covariance after a cell of a surface error whose mean has a unit variance and which is zero at both ends.

    The error is a parabola, 6 s (1 - s) over the cell, as in the interpolation of the surface: the samples are known. Its
    two derivatives are states of a system in discrete time, so that the response is exact for lags of any length.
    """
    n = a.shape[0]
    wide = n + 3
    system, phi, noise = np.zeros((wide, wide + 1)), np.empty((wide, wide)), np.empty((wide, wide))
    early, late, spread = np.empty((wide, 1)), np.empty((wide, 1)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            system[i, j] = a[i, j]
        system[i, n] = column[i]
    system[n, n + 1] = system[n + 1, n + 2] = 1.0
    step(system, np.zeros(wide), wide, dt_s, phi, early, late, noise)
    after = np.empty(n)
    for i in range(n):
        after[i] = phi[i, n + 1] * (6.0 / dt_s) - phi[i, n + 2] * (12.0 / (dt_s * dt_s))
    for i in range(n):
        for j in range(n):
            spread[i, j] = after[i] * after[j]
    return spread


@allocating
def corrected(p: Array, k_gain: Array, c: Array) -> Array:
    """Covariance after an update, (I - K C) P, symmetric."""
    n = p.shape[0]
    read, out = np.empty((c.shape[0], n)), np.empty((n, n))
    multiply(c, p, read)
    multiply(k_gain, read, out)
    for i in range(n):
        for j in range(i + 1):
            out[i, j] = 0.5 * (p[i, j] - out[i, j] + p[j, i] - out[j, i])
            out[j, i] = out[i, j]
    return out


@inner
def is_uncertain(corner_rad2: Array, sample: int) -> bool:
    """Whether a surface is uncertain in the cell that ends at a sample."""
    found = False
    for c in range(corner_rad2.shape[0]):
        found = found or corner_rad2[c, sample] > 0.0
    return found


@allocating
def predicted(p: Array, corners: CornerNodes, node: int, corner_rad2: Array, sample: int) -> Array:
    """Covariance of the prediction of a sample, with the corners of the cell before it."""
    n = p.shape[0]
    work, out = np.empty((n, n)), np.empty((n, n))
    congruence(corners.phi[node], p, work, out)
    for i in range(n):
        for j in range(n):
            more = corners.noise[node, i, j]
            for c in range(corner_rad2.shape[0]):
                more += corner_rad2[c, sample] * corners.spread[node, c, i, j]
            out[i, j] += more
    return out


@allocating
def gain_at(
    p: Array, corners: CornerNodes, node: int, k_gain: Array, first: FirstUpdate, scale: Array
) -> tuple[float, float]:
    """Gain of a prediction's covariance, the first update, and the matrix that scales to the steady covariance.

    Returns
    -------
    log|S| less the steady one (nan where S is no covariance), and the largest relative distance of S from it.
    """
    count = k_gain.shape[1]
    pc, s = np.empty((p.shape[0], count)), np.empty((count, count))
    covariance_of(p, corners.c[node], corners.variance, pc, s)
    away = 0.0
    for i in range(count):
        away = max(away, abs(s[i, i] / corners.covariance[node, i, i] - 1.0))
    white = np.zeros((count, count))
    logdet = whitener(s, white)
    update_gain(pc, white, k_gain)
    first_update(pc, s, first)
    multiply(corners.root[node], white, scale)
    return logdet - corners.logdet[node], away


@inner
def settled(away: float) -> bool:
    """Whether the gain is the steady one again."""
    return away < _SETTLED


__all__ = [
    "STEP_RAD",
    "CornerNodes",
    "Corners",
    "corrected",
    "drive_sensors",
    "gain_at",
    "input_columns",
    "is_uncertain",
    "predicted",
    "settled",
    "spread_of",
    "stack",
    "stacked",
]
