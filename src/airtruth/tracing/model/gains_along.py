"""Derivatives of the gains along a record: between flight conditions, and where the surface is uncertain.

Every step of a parameter has a recursion of its own; that of none decides where the gains are steady again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.discretise import multiply
from airtruth.tracing.model.corners import CornerNodes, corrected, gain_at, is_uncertain, predicted, settled
from airtruth.tracing.model.gain_slopes import Conditions, Moves
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.sensor_slopes import GainSlopes, width_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


_ONE: Final = 2
"""Dimensions of `_Gains.direct` where all samples have the same gains [-]."""


class _Gains(NamedTuple):
    """Gains after one step of a parameter at each sample; see `airtruth.tracing.model.filter.Path`."""

    k_gain: Array
    first: FirstUpdate
    direct: Array
    scale: Array


G = TypeVar("G", _Gains, GainSlopes)


@njit(cache=True, nogil=True, error_model="numpy")
def _recursion(
    gains: _Gains,
    corners: CornerNodes,
    scale: Array,
    node: Ints,
    corner_rad2: Array,
    uncertain: NDArray[np.bool_],
    decides: bool,
) -> float:
    """Replace the settled gains where the surface is uncertain; the sum of log|S| beyond the common one.

    Parameters
    ----------
    scale : (nodes, outputs, outputs) of the settled filter at each condition; node : (samples,) the nearest condition.
    uncertain : (samples,) where the gains are not the settled ones, written if the row ``decides``.
    """
    samples, count, total, p = node.size, scale.shape[1], 0.0, corners.steady[0].copy()
    own = np.empty((count, count))
    for k in range(samples):
        at, lasts = node[k], False
        if uncertain[k]:
            first = FirstUpdate(gains.first.gain[k], gains.first.share[k])
            more, away = gain_at(p, corners, at, gains.k_gain[k], first, own)
            multiply(scale[at], own, gains.scale[k])
            total += more
            lasts = not settled(away)
            for i in range(count):
                total -= 2.0 * math.log(scale[at, i, i])
        else:
            for i in range(count):
                total -= 2.0 * math.log(gains.scale[k, i, i])
        if k + 1 == samples or corner_rad2.size == 0:
            continue
        if decides:
            uncertain[k + 1] = lasts or is_uncertain(corner_rad2, k + 1)
        if uncertain[k + 1]:
            if not uncertain[k]:
                p = corners.steady[at].copy()
            p = predicted(corrected(p, gains.k_gain[k], corners.c[at]), corners, at, corner_rad2, k + 1)
    return total


def slopes_along(
    nodes: Sequence[Conditions], common: int, moves: Moves, lower: Ints, share: Array, corner_rad2: Array
) -> tuple[GainSlopes, Array]:
    """Derivatives of the gains at each sample, or of all samples at once, and (parameters,) of the log|S| beyond the common one.

    Parameters
    ----------
    nodes : the filter at each flight condition after each step of the parameters; common : number of the common one.
    lower, share : see `airtruth.tracing.model.schedule.Schedule`; empty with a single node.
    corner_rad2 : (controls, samples) see `airtruth.tracing.model.kernel_input.KernelInput`.
    """
    rows, count = moves.h.size, nodes[0].white.shape[1]
    if lower.size == 0 and corner_rad2.size == 0:
        own = nodes[0]
        steady = _Gains(own.k_gain, own.first, own.direct, np.zeros((rows, count, count)))
        return _divided(steady, moves), np.zeros(rows - 1)
    samples = lower.size or corner_rad2.shape[1]
    node = lower + (share > 0.5) if lower.size else np.zeros(samples, dtype=np.int64)
    uncertain, places = np.zeros(samples, dtype=np.bool_), np.empty(0, dtype=np.int64)
    more = np.zeros(rows)
    corners = _corners(nodes, moves)
    scale = np.tril(np.linalg.inv(corners.white[:, common, None]) @ corners.white)
    scale[:, common] = np.eye(count)
    every = _Gains(corners.k_gain, corners.first, corners.direct, scale)
    made: list[_Gains] = []
    for row in range(rows):
        if row > 0 and moves.h[row] == 0.0:
            made.append(made[0])
            more[row] = more[0]
            continue
        gains = _each(lambda x, row=row: _along(x[row], samples, lower, share), every)
        more[row] = _recursion(gains, corners.row(row), scale[row], node, corner_rad2, uncertain, row == 0)
        if row == 0:
            places = np.flatnonzero(uncertain)
        made.append(_each(lambda x, at=places: x[at], gains))
    h = np.where(moves.h[1:] == 0.0, 1.0, moves.h[1:])
    # where the surface is certain, the gains are the settled ones
    slopes = _each(lambda x: _along(x, samples, lower, share), _divided(every, moves))
    _each(partial(_put, places), slopes, _divided(_each(lambda *x: np.stack(x), *made), moves))
    return slopes, (more[1:] - more[0]) / h


def _each(function: Callable[..., Array], *gains: G) -> G:
    """Apply a function to each array of gains, or of several gains together."""
    k_gain, first, direct, scale = zip(*gains, strict=True)
    by_first = FirstUpdate(*(function(*x) for x in zip(*first, strict=True)))
    return type(gains[0])(function(*k_gain), by_first, function(*direct), function(*scale))


def _put(places: Ints, whole: Array, part: Array) -> Array:
    """Replace some rows."""
    whole[places] = part
    return whole


def _along(every: Array, samples: int, lower: Ints, share: Array) -> Array:
    """(samples, ...) values along a record from those at its flight conditions (conditions, ...)."""
    if not lower.size:
        return np.repeat(every[:1], samples, axis=0)
    low, by = every[lower], share.reshape(-1, *[1] * (every.ndim - 1))
    return np.ascontiguousarray(low + by * (every[lower + 1] - low))


class _Nodes(NamedTuple):
    """The filter at the flight conditions after each step, (rows, nodes, ...)."""

    k_gain: Array
    first: FirstUpdate
    direct: Array
    white: Array
    corners: CornerNodes

    def row(self, row: int) -> CornerNodes:
        """The recursion after one step."""
        own = self.corners
        return CornerNodes._make(x[row] for x in own)


def _corners(nodes: Sequence[Conditions], moves: Moves) -> _Nodes:
    """Stack the flight conditions."""

    def stacked(x: Sequence[Array]) -> Array:
        return np.ascontiguousarray(np.stack(x, axis=1))

    white = stacked([own.white for own in nodes])
    # a step of none leaves no whitener
    white[moves.h == 0.0] = white[0]
    corners = CornerNodes(
        phi=stacked([own.phi for own in nodes]),
        noise=stacked([own.noise for own in nodes]),
        spread=stacked([own.spread for own in nodes]),
        steady=stacked([own.steady for own in nodes]),
        c=stacked([own.c for own in nodes]),
        variance=moves.variance,
        covariance=stacked([own.covariance for own in nodes]),
        root=np.asarray(np.linalg.inv(white)),
        logdet=stacked([own.logdet for own in nodes]),
    )
    first = FirstUpdate(
        stacked([own.first.gain for own in nodes]), stacked([own.first.share for own in nodes])
    )
    return _Nodes(
        stacked([own.k_gain for own in nodes]), first, stacked([own.direct for own in nodes]), white, corners
    )


def _divided(rows: _Gains, moves: Moves) -> GainSlopes:
    """Differences from the first row over the steps, with the parameters as the last axis.

    Parameters
    ----------
    rows : (rows, samples, ...), or (rows, ...) where all samples have the same gains.
    """
    h, each = moves.h[1:], rows.direct.ndim > _ONE
    by = np.where(h == 0.0, 0.0, 1.0 / np.where(h == 0.0, 1.0, h))

    def slope(x: Array) -> Array:
        out = np.zeros((*x.shape[1:], width_of(h.size)))
        out[..., : h.size] = np.moveaxis(x[1:] - x[0], 0, -1) * by
        return out if each else out[None]

    first = FirstUpdate(slope(rows.first.gain), slope(rows.first.share))
    return GainSlopes(slope(rows.k_gain), first, slope(rows.direct), slope(rows.scale))


__all__ = ["slopes_along"]
