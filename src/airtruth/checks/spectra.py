"""Linear regression between channels in the frequency domain, all runs of a batch at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.recursion import low_pass

Array = NDArray[np.float64]

BAND_HZ: Final = 4.0
"""Upper edge of the band of comparison [Hz]: short-period motion lies below it (judgement: noise against motion)."""
BAND_RATE: Final = 0.4
"""Upper edge of the same band as a share of the sample rate [-]; 0.5 is the Nyquist frequency."""
LAGS_S: Final = (0.1, 0.3, 0.8)
"""Time constants of the low-passes whose outputs are the instruments [s].

With three of them the factors of the clean logs average 1; with six they fall to 0.8 in moderate gusts,
because each further instrument takes up a share of the gusts (weak-instrument bias).
"""


ROUNDING: Final = 1e-9
"""Share of a signal's change below which its departure from a line is rounding [-]."""
CONDITION: Final = 1e10
"""Condition number above which regressors count as one [-]: half the digits of a double are left."""


@dataclass(frozen=True)
class Factors:
    """Regression factors of each run and, in the last row, of all runs together.

    Attributes
    ----------
    value : (runs + 1, k) factors; NaN where the regressors do not move, or the lines are too few.
    covariance : (runs + 1, k, k) covariance of the factors.
    share : (runs + 1,) squared multiple correlation.
    strength : (runs + 1,) smallest first-stage F over the regressors; infinite without instruments.
    """

    value: Array
    covariance: Array
    share: Array
    strength: Array


def integral(x: Array, dt_s: float) -> Array:
    """Trapezoidal integral from the first sample along the last axis."""
    steps = np.cumsum(0.5 * dt_s * (x[..., 1:] + x[..., :-1]), axis=-1)
    return np.concatenate([np.zeros_like(x[..., :1]), steps], axis=-1)


def spectrum(x: Array, dt_s: float) -> Array:
    """Real and imaginary parts of the spectrum of (..., samples) below the band's edge, line and mean removed."""
    n = x.shape[-1]
    trend, lines_in_band = _trend_and_band(n, dt_s)
    x = x - x[..., :1]  # so that a constant is exactly zero
    rest = x - (x @ trend) @ trend.T
    size = np.abs(x).max(axis=-1, keepdims=True)
    rest = np.where(np.abs(rest).max(axis=-1, keepdims=True) > ROUNDING * size, rest, 0.0)
    lines = np.fft.rfft(rest, axis=-1)[..., 1 : 1 + lines_in_band] / np.sqrt(n)
    return np.concatenate([lines.real, lines.imag], axis=-1)


@lru_cache(maxsize=64)
def _trend_and_band(n: int, dt_s: float) -> tuple[Array, int]:
    """Orthonormal basis (samples, 2) of constant and line, and the number of lines above zero in the band."""
    trend = np.linalg.qr(np.stack([np.ones(n), np.linspace(-1.0, 1.0, n)], axis=1))[0]
    trend.flags.writeable = False
    f = np.fft.rfftfreq(n, dt_s)
    inside = np.count_nonzero((f > 0.0) & (f <= min(BAND_HZ, BAND_RATE / dt_s)))
    return trend, int(inside)


def instruments(elevator: Array, dt_s: float) -> Array:
    """Spectra (runs, 3, lines) of the elevator (runs, samples) through low-passes of `LAGS_S`."""
    moved = elevator - elevator[..., :1]
    rows = []
    for lag in LAGS_S:
        pole = float(np.exp(-dt_s / lag))
        rows.append(low_pass(pole, moved))
    return spectrum(np.stack(rows, axis=-2), dt_s)


def regress(y: Array, x: Array, z: Array | None = None, lines: NDArray[np.int64] | None = None) -> Factors:
    """Factors of y on x by least squares, or with instruments z by two-stage least squares.

    The covariance allows for any spectrum of the residual (H. White, *Econometrica* 48(4), 1980, eq. 1, on the
    lines of the spectrum, which are nearly independent).

    Parameters
    ----------
    y : (runs, lines) spectra of the left side, as `spectrum` returns them.
    x : (runs, k, lines) spectra of the regressors.
    z : (runs, m, lines) spectra of the instruments; None uses the regressors.
    lines : (runs,) numbers that each spectrum has of its own, the others being zero; None for all of them.
    """
    projected = x if z is None else _projected(x, z)
    own = np.full(len(y), y.shape[-1]) if lines is None else lines
    normal = projected @ np.swapaxes(projected, 1, 2)
    moment = np.einsum("rkn,rn->rk", projected, y)
    normal = np.concatenate([normal, normal.sum(axis=0, keepdims=True)])
    moment = np.concatenate([moment, moment.sum(axis=0, keepdims=True)])
    degrees = np.append(own, own.sum())
    inverse = _inverse(normal)
    inverse[degrees < x.shape[1] + 2] = np.nan  # too few lines to leave a residual
    value = np.einsum("rkl,rl->rk", inverse, moment)
    each = _meat(y - np.einsum("rk,rkn->rn", value[:-1], x), projected, own)
    pooled = _meat(y - np.einsum("k,rkn->rn", value[-1], x), projected, own).sum(axis=0, keepdims=True)
    correction = degrees / np.maximum(degrees - x.shape[1] - 1.0, 1.0)
    covariance = inverse @ np.concatenate([each, pooled]) @ inverse * correction[:, None, None]
    rest = np.append(_power(y - np.einsum("rk,rkn->rn", value[:-1], x)), 0.0)
    rest[-1] = _power(y - np.einsum("k,rkn->rn", value[-1], x)).sum()
    power = _power(y)
    share = 1.0 - rest / np.maximum(np.append(power, power.sum()), 1e-300)
    strength = np.full(len(y) + 1, np.inf) if z is None else _strength(x, projected, z.shape[1], own)
    return Factors(value, covariance, share, strength)


def _power(x: Array) -> Array:
    return np.asarray(np.einsum("rn,rn->r", x, x))


def _strength(x: Array, projected: Array, count: int, lines: NDArray[np.int64]) -> Array:
    """Smallest F of the instruments in each regressor, the others' share taken out of its projection."""
    smallest = np.full(len(x) + 1, np.inf)
    for i in range(x.shape[1]):
        others = np.delete(projected, i, axis=1)
        normal, moment = others @ np.swapaxes(others, 1, 2), others @ projected[:, i, :, None]
        normal, moment = (np.concatenate([a, a.sum(axis=0, keepdims=True)]) for a in (normal, moment))
        own = _power(projected[:, i])
        own = np.append(own, own.sum())
        if others.shape[1]:
            weight = np.nan_to_num(_inverse(normal)) @ moment
            own = own - np.einsum("rkl,rkl->r", weight, moment)
        noise = _power(x[:, i] - projected[:, i])
        noise = np.append(noise, noise.sum())
        degrees = np.append(lines - count, (lines - count).sum())
        counts = np.append(np.full(len(x), count), len(x) * count)
        f = (own / counts) / np.maximum(noise / np.maximum(degrees, 1), 1e-300)
        smallest = np.minimum(smallest, f)
    return smallest


def _projected(x: Array, z: Array) -> Array:
    left, size, right = np.linalg.svd(z, full_matrices=False)
    del left
    span = np.where((size > 1e-6 * size[:, :1])[..., None], right, 0.0)
    return np.asarray((x @ np.swapaxes(span, 1, 2)) @ span)


def _inverse(normal: Array) -> Array:
    """Inverse of each matrix after scaling to a unit diagonal; NaN for one that is singular or not finite."""
    size = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 0.0))
    ok: NDArray[np.bool_] = np.asarray((size > 0.0).all(axis=1))
    scale = np.where(size > 0.0, size, 1.0)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # products that underflow
        unit = normal / (scale[:, :, None] * scale[:, None, :])
    ok &= np.isfinite(unit).all(axis=(1, 2))
    unit = np.where(ok[:, None, None], unit, np.eye(unit.shape[1]))
    ok = np.asarray(ok & (np.linalg.cond(unit) < CONDITION))
    safe = np.where(ok[:, None, None], unit, np.eye(unit.shape[1]))
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        result = np.linalg.inv(safe) / (scale[:, :, None] * scale[:, None, :])
    return np.where(ok[:, None, None], result, np.nan)


def _meat(residual: Array, projected: Array, lines: NDArray[np.int64]) -> Array:
    """Sum over the lines of the squared residual, averaged over three lines, times the regressors' products."""
    half = residual.shape[1] // 2
    power = 0.5 * (residual[:, :half] ** 2 + residual[:, half:] ** 2)
    last = np.minimum(np.arange(half + 1), np.maximum(lines[:, None] // 2 - 1, 0))
    edge = np.concatenate([power[:, :1], np.take_along_axis(power, last, axis=1)], axis=1)
    power = (edge[:, :-2] + edge[:, 1:-1] + edge[:, 2:]) / 3.0
    weighted = projected * np.concatenate([power, power], axis=1)[:, None, :]
    return np.asarray(weighted @ np.swapaxes(projected, 1, 2))


__all__ = ["BAND_HZ", "BAND_RATE", "LAGS_S", "Factors", "instruments", "integral", "regress", "spectrum"]
