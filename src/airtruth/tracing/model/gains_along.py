"""Derivatives of the gains along a record: between flight conditions, and where the surface is uncertain.

Every step of a parameter has a recursion of its own; that of none decides where the gains are steady again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.corner_lanes import CornerLanes, CornerSlopes, SmallSteps, corner_gains
from airtruth.tracing.model.corners import CornerNodes
from airtruth.tracing.model.gain_slopes import Conditions, Moves
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.sensor_slopes import GainSlopes, width_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def slopes_along(
    nodes: Sequence[Conditions],
    common: int,
    moves: Moves,
    samples: int,
    lower: Ints,
    share: Array,
    corner_rad2: Array,
) -> tuple[GainSlopes, Array]:
    """Derivatives of the gains along a record, and (parameters,) of the log|S| beyond the common one.

    Parameters
    ----------
    nodes : the filter at each flight condition after each step of the parameters; common : number of the common one.
    samples : of the record; lower, share : see `airtruth.tracing.model.schedule.Schedule`; empty with a single node.
    corner_rad2 : (controls, samples) see `airtruth.tracing.model.kernel_input.KernelInput`.
    """
    moved = np.append(0, np.flatnonzero(moves.h[1:]) + 1)
    h, parameters = moves.h[moved[1:]], moves.h.size - 1

    def steps(x: Sequence[Array]) -> Array:
        """(conditions, ..., steps) of those that move the gains."""
        return np.ascontiguousarray(np.moveaxis(np.stack([own[moved] for own in x]), 1, -1))

    def slope(x: Array) -> Array:
        """Differences from no step, with all parameters as the last axis."""
        out = np.zeros((*x.shape[:-1], width_of(parameters)))
        out[..., moved[1:] - 1] = (x[..., 1:] - x[..., :1]) / h
        return out

    own = _lanes(nodes, common, moves.variance[moved].T, steps)
    first = FirstUpdate(steps([n.first.gain for n in nodes]), steps([n.first.share for n in nodes]))
    row_of, more = np.zeros(samples, dtype=np.int64), np.zeros(parameters)
    slopes = _each(slope, CornerSlopes(own.k_gain, first, own.scale))
    direct = slope(steps([n.direct for n in nodes]))
    if lower.size:
        row_of = np.arange(samples)
        slopes, direct = _each(partial(_along, lower, share), slopes), _along(lower, share, direct)
    if lower.size or corner_rad2.size:
        node = lower + (share > 0.5) if lower.size else np.zeros(samples, dtype=np.int64)
        recursion = partial(corner_gains, node=node, lower=lower, share=share, corner_rad2=corner_rad2)
        uncertain, own_steps = (
            np.zeros(samples, dtype=np.bool_),
            SmallSteps(moved - 1, np.append(0.0, 1.0 / h)),
        )
        part = _each(lambda x: np.zeros((0, *x.shape[1:])), slopes)
        none = CornerLanes(
            CornerNodes._make(_first(x) for x in own.corners), _first(own.scale), _first(own.k_gain)
        )
        recursion(none, uncertain=uncertain, decides=True, steps=own_steps, slopes=part, more=np.zeros(1))
        places, total = np.flatnonzero(uncertain), np.zeros(moved.size)
        part = _each(lambda x: np.zeros((places.size, *x.shape[1:])), slopes)
        recursion(own, uncertain=uncertain, decides=False, steps=own_steps, slopes=part, more=total)
        more[moved[1:] - 1] = (total[1:] - total[0]) / h
        if lower.size:
            _each(partial(_put, places), slopes, part)
        else:
            slopes = _each(lambda *x: np.concatenate(x), slopes, part)
            direct = np.repeat(direct, places.size + 1, axis=0)
            row_of[places] = np.arange(1, places.size + 1)
    return GainSlopes(slopes.k_gain, slopes.first, direct, slopes.scale, row_of), more


def _each(function: Callable[..., Array], *gains: CornerSlopes) -> CornerSlopes:
    """Apply a function to each array of gains, or of several gains together."""
    k_gain, first, scale = zip(*gains, strict=True)
    by_first = FirstUpdate(*(function(*x) for x in zip(*first, strict=True)))
    return CornerSlopes(function(*k_gain), by_first, function(*scale))


def _put(places: Ints, whole: Array, part: Array) -> Array:
    """Replace some rows."""
    whole[places] = part
    return whole


def _along(lower: Ints, share: Array, every: Array) -> Array:
    """(samples, ...) values along a record from those at its flight conditions (conditions, ...)."""
    low, by = every[lower], share.reshape(-1, *[1] * (every.ndim - 1))
    return np.ascontiguousarray(low + by * (every[lower + 1] - low))


def _lanes(
    nodes: Sequence[Conditions], common: int, variance: Array, steps: Callable[[Sequence[Array]], Array]
) -> CornerLanes:
    """The flight conditions after each step that moves the gains."""
    white = np.moveaxis(steps([own.white for own in nodes]), -1, 0)
    scale = np.tril(np.linalg.inv(white[:, common, None]) @ white)
    scale[:, common] = np.eye(white.shape[-1])
    corners = CornerNodes(
        phi=steps([own.phi for own in nodes]),
        noise=steps([own.noise for own in nodes]),
        spread=steps([own.spread for own in nodes]),
        steady=steps([own.steady for own in nodes]),
        c=steps([own.c for own in nodes]),
        variance=np.ascontiguousarray(variance),
        covariance=steps([own.covariance for own in nodes]),
        root=_last(np.linalg.inv(white)),
        logdet=steps([own.logdet for own in nodes]),
    )
    return CornerLanes(corners, _last(scale), steps([own.k_gain for own in nodes]))


def _first(x: Array) -> Array:
    """The first step alone."""
    return np.ascontiguousarray(x[..., :1])


def _last(x: NDArray[np.floating]) -> Array:
    """The first axis as the last one."""
    return np.ascontiguousarray(np.moveaxis(x, 0, -1), dtype=np.float64)


__all__ = ["slopes_along"]
