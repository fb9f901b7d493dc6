"""The recursion of `airtruth.tracing.model.corners` after every small step of the parameters at once.

SmallSteps are the last axis of each array, which the inner loops run along; the first step is none.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import allocating, inner
from airtruth.tracing.model.corners import CornerNodes, is_uncertain, settled
from airtruth.tracing.model.linearise import FirstUpdate

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class CornerLanes(NamedTuple):
    """The recursion and the settled filter of each flight condition after each step.

    Attributes
    ----------
    corners : (conditions, ..., steps); the variance (outputs, steps).
    scale : (conditions, outputs, outputs, steps) the matrix that scales settled innovations to the common covariance.
    k_gain : (conditions, states, outputs, steps) of the settled filter.
    """

    corners: CornerNodes
    scale: Array
    k_gain: Array


class CornerSlopes(NamedTuple):
    """Derivatives of the gains where the surface is uncertain, a row for each such sample; see
    `airtruth.tracing.model.sensor_slopes.GainSlopes`.
    """

    k_gain: Array
    first: FirstUpdate
    scale: Array


class SmallSteps(NamedTuple):
    """Small steps: of which parameter each is, and the inverse of its size; those of none are not used."""

    parameter: Ints
    by: Array


@inner
def _product(a: Array, b: Array, out: Array) -> None:
    """out = a b in each lane."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            for r in range(out.shape[2]):
                out[i, j, r] = 0.0
            for k in range(b.shape[0]):
                for r in range(out.shape[2]):
                    out[i, j, r] += a[i, k, r] * b[k, j, r]


@inner
def _by_transpose(a: Array, b: Array, out: Array) -> None:
    """out = a b' in each lane."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            for r in range(out.shape[2]):
                out[i, j, r] = 0.0
            for k in range(b.shape[1]):
                for r in range(out.shape[2]):
                    out[i, j, r] += a[i, k, r] * b[j, k, r]


@allocating
def _predicted(p: Array, k_gain: Array, own: CornerNodes, at: int, corner_rad2: Array, sample: int) -> None:
    """The covariance of the prediction of a sample from that of the sample before, in place."""
    n, lanes = p.shape[0], p.shape[2]
    read, work = np.empty((k_gain.shape[1], n, lanes)), np.empty((n, n, lanes))
    _product(own.c[at], p, read)
    _product(k_gain, read, work)
    for i in range(n):
        for j in range(i + 1):
            for r in range(lanes):
                p[i, j, r] = 0.5 * (p[i, j, r] - work[i, j, r] + p[j, i, r] - work[j, i, r])
                p[j, i, r] = p[i, j, r]
    _product(own.phi[at], p, work)
    _by_transpose(work, own.phi[at], p)
    for i in range(n):
        for j in range(n):
            for r in range(lanes):
                p[i, j, r] += own.noise[at, i, j, r]
            for control in range(corner_rad2.shape[0]):
                by = corner_rad2[control, sample]
                for r in range(lanes):
                    p[i, j, r] += by * own.spread[at, control, i, j, r]


@allocating
def _whitener(s: Array, white: Array, logdet: Array) -> None:
    """The inverse of the Cholesky factor of each lane, and log|S|; nan where S is no covariance."""
    count, lanes = s.shape[0], s.shape[2]
    root = np.zeros((count, count, lanes))
    for r in range(lanes):
        logdet[r] = 0.0
    for i in range(count):
        for j in range(i + 1):
            for r in range(lanes):
                left = s[i, j, r]
                for k in range(j):
                    left -= root[i, k, r] * root[j, k, r]
                root[i, j, r] = math.sqrt(left) if i == j else left / root[j, j, r]
        for r in range(lanes):
            logdet[r] += 2.0 * math.log(root[i, i, r])
            white[i, i, r] = 1.0 / root[i, i, r]
        for j in range(count):
            for r in range(lanes):
                if j > i:
                    white[i, j, r] = 0.0
                elif j < i:
                    total = 0.0
                    for k in range(j, i):
                        total += root[i, k, r] * white[k, j, r]
                    white[i, j, r] = -total / root[i, i, r]


@allocating
def _weighted(pc: Array, white: Array, count: int, out: Array) -> None:
    """out = X W' W with the leading block of a whitener."""
    lanes = pc.shape[2]
    for i in range(out.shape[0]):
        for j in range(count):
            for r in range(lanes):
                out[i, j, r] = 0.0
        for m in range(count):
            for r in range(lanes):
                shown = 0.0
                for k in range(m + 1):
                    shown += pc[i, k, r] * white[m, k, r]
                for j in range(m + 1):
                    out[i, j, r] += shown * white[m, j, r]


@inner
def _differences(x: Array, steps: SmallSteps, out: Array) -> None:
    """Derivatives (n, m, parameters) by the differences of lanes (n, m, steps) from the first one."""
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            for r in range(1, x.shape[2]):
                out[i, j, steps.parameter[r]] = (x[i, j, r] - x[i, j, 0]) * steps.by[r]


@allocating
def _gains(
    p: Array,
    own: CornerLanes,
    at: int,
    steps: SmallSteps,
    logdet: Array,
    k_gain: Array,
    slopes: CornerSlopes,
    place: int,
) -> float:
    """Gain of a prediction's covariance; the largest relative distance of that of the innovations from the steady one."""
    corners, n, lanes, count = own.corners, p.shape[0], p.shape[2], own.corners.variance.shape[0]
    pc, s = np.empty((n, count, lanes)), np.empty((count, count, lanes))
    white = np.empty((count, count, lanes))
    _by_transpose(p, corners.c[at], pc)
    _product(corners.c[at], pc, s)
    away = 0.0
    for i in range(count):
        for r in range(lanes):
            s[i, i, r] += corners.variance[i, r]
        away = max(away, abs(s[i, i, 0] / corners.covariance[at, i, i, 0] - 1.0))
    _whitener(s, white, logdet)
    _weighted(pc, white, count, k_gain)
    if lanes > 1:
        early, share = np.empty((n, count - 1, lanes)), np.empty((1, count - 1, lanes))
        scaled, scale = np.empty((count, count, lanes)), np.empty((count, count, lanes))
        _weighted(pc, white, count - 1, early)
        _weighted(s[count - 1 :], white, count - 1, share)
        _product(corners.root[at], white, scaled)
        _product(own.scale[at], scaled, scale)
        _differences(k_gain, steps, slopes.k_gain[place])
        _differences(early, steps, slopes.first.gain[place])
        _differences(share, steps, slopes.first.share[place : place + 1])
        _differences(scale, steps, slopes.scale[place])
    return away


@inner
def _between(every: Array, k: int, lower: Ints, share: Array, out: Array) -> None:
    """The matrices of a sample from those of the flight conditions (conditions, n, m, steps)."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            for r in range(out.shape[2]):
                out[i, j, r] = every[0, i, j, r]
                if lower.size > 0:
                    low, high = every[lower[k], i, j, r], every[lower[k] + 1, i, j, r]
                    out[i, j, r] = low + share[k] * (high - low)


@njit(cache=True, nogil=True, error_model="numpy")
def corner_gains(
    own: CornerLanes,
    node: Ints,
    lower: Ints,
    share: Array,
    corner_rad2: Array,
    uncertain: NDArray[np.bool_],
    decides: bool,
    steps: SmallSteps,
    slopes: CornerSlopes,
    more: Array,
) -> None:
    """Write derivatives of the gains where the surface is uncertain, and the sum of log|S| beyond the common one of each step.

    Parameters
    ----------
    node : (samples,) the nearest condition; lower, share : see `airtruth.tracing.model.schedule.Schedule`.
    uncertain : (samples,) where the gains are not the settled ones, written by the first step if the call ``decides``.
    slopes : a row for each such sample, in their order, or none where no step but the first is given; more : (steps,).
    """
    corners, samples, count, lanes = own.corners, node.size, own.corners.variance.shape[0], more.size
    p, k_gain = corners.steady[0].copy(), own.k_gain[0].copy()
    scale, logdet = own.scale[0].copy(), np.zeros(lanes)
    place = 0
    for k in range(samples):
        at, lasts = node[k], False
        if uncertain[k]:
            lasts = not settled(_gains(p, own, at, steps, logdet, k_gain, slopes, place))
            place += 1
            for r in range(lanes):
                more[r] += logdet[r] - corners.logdet[at, r]
        elif lower.size > 0:
            _between(own.scale, k, lower, share, scale)
        for i in range(count):
            for r in range(lanes):
                more[r] -= 2.0 * math.log(own.scale[at, i, i, r] if uncertain[k] else scale[i, i, r])
        if k + 1 < samples and decides and corner_rad2.size > 0:
            uncertain[k + 1] = lasts or is_uncertain(corner_rad2, k + 1)
        if k + 1 < samples and uncertain[k + 1]:
            if not uncertain[k]:
                p = corners.steady[at].copy()
                _between(own.k_gain, k, lower, share, k_gain)
            _predicted(p, k_gain, corners, at, corner_rad2, k + 1)


__all__ = ["CornerLanes", "CornerSlopes", "SmallSteps", "corner_gains"]
