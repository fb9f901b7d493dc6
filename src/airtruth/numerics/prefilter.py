"""The low-pass pre-filter of the differencing methods.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", III.C: a Butterworth
filter run forward and backward, which has no lag.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner

Array = NDArray[np.float64]


LANES: Final = 16
"""Rows that are filtered side by side: four vectors, because each recursion waits for its own last result."""
LEFT: Final = 0.04
"""Part of the slowest mode of the filter that remains at the end of an extension [-] (judgement: 0.3 s at 5 Hz)."""


@lru_cache(maxsize=32)
def butterworth(cutoff_hz: float, order: int, dt_s: float) -> Array:
    """Second-order sections (sections, 6) of a low-pass Butterworth filter.

    Parameters
    ----------
    cutoff_hz : frequency where one pass attenuates by 3 dB [Hz], below half the sample rate.
    order : order of one pass.
    dt_s : sample period [s].

    Notes
    -----
    The analogue poles lie on a circle; the bilinear transformation with a warped frequency keeps the cutoff (A. V.
    Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, 3rd ed., 2010, 7.2.2). The first section has the gain, the
    last one the slowest poles. scipy.signal.butter makes the same filter, and its import takes longer than an
    identification.
    """
    angle = np.pi * (np.arange(order // 2) + 0.5) / order  # from the imaginary axis, the slowest pole first
    half = math.tan(math.pi * cutoff_hz * dt_s)
    poles = half * (-np.sin(angle[::-1]) + 1j * np.cos(angle[::-1]))
    z = (1.0 + poles) / (1.0 - poles)
    pairs = np.stack(
        [
            np.ones_like(angle),
            np.full_like(angle, 2.0),
            np.ones_like(angle),
            np.ones_like(angle),
            -2.0 * z.real,
            np.abs(z) ** 2,
        ],
        axis=-1,
    )
    alone = [[1.0, 1.0, 0.0, 1.0, -(1.0 - half) / (1.0 + half), 0.0]] if order % 2 else []
    sos = np.array([*alone, *pairs])
    sos[0, :3] *= np.prod(sos[:, 3:].sum(axis=-1) / sos[:, :3].sum(axis=-1))
    sos.flags.writeable = False
    return sos


def edge_samples(sos: Array) -> int:
    """Samples by which each end is extended; a record must be longer than this.

    Three times the number of coefficients of the filter, as scipy's ``sosfiltfilt`` has it, or, if that is longer, the time
    in which the slowest mode of the filter decays to `LEFT`: a number of samples alone is no time at a high rate.
    """
    taps = 2 * int(sos.shape[0]) + 1 - min(int(np.sum(sos[:, 2] == 0.0)), int(np.sum(sos[:, 5] == 0.0)))
    a1, a2 = sos[:, 4], sos[:, 5]
    real = np.sqrt(np.maximum(a1**2 - 4.0 * a2, 0.0))
    radius = float(np.maximum(np.sqrt(np.maximum(a2, 0.0)), 0.5 * (np.abs(a1) + real)).max())
    return max(3 * taps, math.ceil(math.log(LEFT) / math.log(radius)))


@inner
def _pass(rows: Array, sos: Array, first: int, step: int, last: Array, before: Array) -> None:
    """Run the sections along rows in place, from sample ``first`` in direction ``step``.

    Direct form II; the state starts where a constant equal to the first sample would have left it. The sections follow one
    another at each sample, because the recursion of each waits for its own last result.

    Parameters
    ----------
    rows : (samples, `LANES`): a sample of all rows is contiguous, so that they are filtered side by side.
    last, before : (sections, `LANES`) room for the states.
    """
    for lane in range(LANES):
        x = rows[first, lane]
        for i in range(sos.shape[0]):
            b0, b1, b2, a1, a2 = sos[i, 0], sos[i, 1], sos[i, 2], sos[i, 4], sos[i, 5]
            state = x * (1.0 / (1.0 + a1 + a2))
            last[i, lane] = before[i, lane] = state
            x = b0 * ((x - a2 * state) - a1 * state) + (b1 * state + b2 * state)
    k = first
    for _ in range(rows.shape[0]):
        for i in range(sos.shape[0]):
            b0, b1, b2, a1, a2 = sos[i, 0], sos[i, 1], sos[i, 2], sos[i, 4], sos[i, 5]
            for lane in range(LANES):
                s = (rows[k, lane] - a2 * before[i, lane]) - a1 * last[i, lane]
                rows[k, lane] = b0 * s + (b1 * last[i, lane] + b2 * before[i, lane])
                before[i, lane] = last[i, lane]
                last[i, lane] = s
        k += step


@njit(cache=True, error_model="numpy")
def _zero_phase(x: Array, sos: Array, edge: int, work: Array, out: Array) -> None:
    rows, samples = x.shape
    padded = samples + 2 * edge
    last, before = np.empty((sos.shape[0], LANES)), np.empty((sos.shape[0], LANES))
    for start in range(0, rows, LANES):
        lanes = min(LANES, rows - start)
        for lane in range(lanes):
            row = x[start + lane]
            for i in range(edge):
                work[i, lane] = 2.0 * row[0] - row[edge - i]
                work[edge + samples + i, lane] = 2.0 * row[samples - 1] - row[samples - 2 - i]
            for i in range(samples):
                work[edge + i, lane] = row[i]
        for way in range(2):
            _pass(work, sos, (padded - 1) * way, 1 - 2 * way, last, before)
        for lane in range(lanes):
            for i in range(samples):
                out[start + lane, i] = work[edge + i, lane]


def zero_phase(x: Array, sos: Array, *, in_place: bool = False) -> Array:
    """Filter forward and backward along the last axis: twice the attenuation, no lag.

    Each end is extended by `edge_samples` samples of the record mirrored through its end point (odd
    extension), and each pass starts in equilibrium with its first sample, as scipy's ``sosfiltfilt``
    does; a constant passes unchanged. Within about 1/cutoff of an end the result therefore depends on the
    assumed continuation.

    Parameters
    ----------
    x : (..., samples), more samples than `edge_samples`.
    sos : (sections, 6) from `butterworth`.
    in_place : write into x, which is contiguous.
    """
    rows = np.ascontiguousarray(x, dtype=np.float64).reshape(-1, x.shape[-1])
    out = rows if in_place else np.empty_like(rows)
    edge = edge_samples(sos)
    _zero_phase(rows, sos, edge, np.zeros((rows.shape[1] + 2 * edge, LANES)), out)
    return out.reshape(x.shape)
