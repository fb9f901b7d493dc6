"""Delays, lags, rate limits and play between the measured surface and the surface that the air sees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.physics.terms import SurfaceTerm

Array = NDArray[np.float64]


_EXTREME: Final = 1.4
"""Standard deviations by which noise pushes a play beyond the turning points of its input [-] (measured)."""


def through(terms: Sequence[SurfaceTerm], de: Array, dt_s: float, noise_rad: float = 0.0) -> Array:
    """The surface after delays, lags, rate limits and backlash, in the order given; each starts in equilibrium.

    A delay is linear between the points of the grid; a lag is exact for a signal linear between them.

    Parameters
    ----------
    terms : terms in the order in which they act.
    de : (points,) surface [rad], every ``dt_s`` [s].
    noise_rad : standard deviation of its noise, whose extremes would pass a backlash for motion.
    """
    for term in terms:
        if term.kind == "delay":
            de = _delayed(de, term.value / dt_s)
        elif term.kind == "lag" and term.value > 0.0:
            de = _lagged(de, dt_s / term.value)
        elif term.kind == "rate_limit" and math.isfinite(term.value):
            de = _limited(de, term.value * dt_s)
        elif term.kind == "backlash" and term.value > 0.0:
            half = 0.5 * term.value
            allowance = _EXTREME * noise_rad * half / (half + noise_rad) if noise_rad > 0.0 else 0.0
            de = play(de, half + allowance)
    return de


@njit(cache=True, nogil=True)
def _delayed(x: Array, points: float) -> Array:
    out = np.empty_like(x)
    last = x.size - 1
    for k in range(x.size):
        at = min(max(k - points, 0.0), float(last))
        low = min(int(at), last - 1)
        out[k] = x[low] + (at - low) * (x[low + 1] - x[low])
    return out


@njit(cache=True, nogil=True)
def _lagged(x: Array, r: float) -> Array:
    out = np.empty_like(x)
    decay = math.exp(-r)
    mean = -math.expm1(-r) / r
    out[0] = x[0]
    for k in range(1, x.size):
        out[k] = decay * out[k - 1] + (mean - decay) * x[k - 1] + (1.0 - mean) * x[k]
    return out


@njit(cache=True, nogil=True)
def _limited(x: Array, most: float) -> Array:
    out = np.empty_like(x)
    out[0] = x[0]
    for k in range(1, x.size):
        out[k] = out[k - 1] + min(max(x[k] - out[k - 1], -most), most)
    return out


@njit(cache=True, nogil=True)
def play(x: Array, half: float) -> Array:
    """Follow (points,) ``x`` with a play of half width ``half`` [unit of x]: hold until the distance exceeds it."""
    out = np.empty_like(x)
    out[0] = x[0]
    for k in range(1, x.size):
        out[k] = min(max(out[k - 1], x[k] - half), x[k] + half)
    return out
