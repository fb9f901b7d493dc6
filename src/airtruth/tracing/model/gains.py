"""Gains of the filter at a sample, between those of two flight conditions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.steady import SteadyFilter

Array = NDArray[np.float64]


class Gains(NamedTuple):
    """Gains of the settled filter at a sample; see `SteadyFilter`.

    Attributes
    ----------
    k_gain, first, direct : (states, outputs), (states, early) and (early,), (states,).
    scale : (1, outputs, outputs), from the innovation to that of the common covariance.
    """

    k_gain: Array
    first: FirstUpdate
    direct: Array
    scale: Array


@inner
def interpolate(steady: SteadyFilter, k: int, now: Gains) -> None:
    """Gains at the airspeed of a sample, linear in log V between two flight conditions."""
    lower, share = steady.lower[k], steady.share[k]
    count, early = now.k_gain.shape[1], now.first.share.size
    for i in range(now.k_gain.shape[0]):
        for m in range(count):
            low, high = steady.k_gain[lower, i, m], steady.k_gain[lower + 1, i, m]
            now.k_gain[i, m] = low + share * (high - low)
        for m in range(early):
            low, high = steady.first.gain[lower, i, m], steady.first.gain[lower + 1, i, m]
            now.first.gain[i, m] = low + share * (high - low)
        low, high = steady.direct[lower, i], steady.direct[lower + 1, i]
        now.direct[i] = low + share * (high - low)
    for m in range(early):
        low, high = steady.first.share[lower, m], steady.first.share[lower + 1, m]
        now.first.share[m] = low + share * (high - low)
    for i in range(count):
        for m in range(count):
            low, high = steady.scale[lower, i, m], steady.scale[lower + 1, i, m]
            now.scale[0, i, m] = low + share * (high - low)


@inner
def scaled(scale: Array, node: int, raw: Array, e: Array, k: int) -> float:
    """Write the innovation of a sample times a scale (nodes, outputs, outputs); the log|S| that the scale takes away."""
    taken = 0.0
    for i in range(raw.size):
        e[k, i] = 0.0
        for m in range(raw.size):
            e[k, i] += scale[node, i, m] * raw[m]
        taken -= 2.0 * math.log(scale[node, i, i])
    return taken


__all__ = ["Gains", "interpolate", "scaled"]
