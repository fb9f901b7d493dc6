"""Test of the spectrum of the innovations: a lightly damped mode that the model lacks.

Source: P. Whittle, J. R. Statist. Soc. B 19 (1957), for the power in bands of a white series: 2 I/s^2 is chi-square with
two degrees of freedom per frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from airtruth.tracing.inference.hypothesis_test import HypothesisTest

Array = NDArray[np.float64]

_BAND_HZ: Final = 0.5
"""Width of a band of the spectrum [Hz] (judgement: a mode with 2 % damping at 10 Hz lies in one)."""
_LOWEST_HZ: Final = 1.0
"""Lowest frequency of the spectral test [Hz]; gust level, biases and correlated noise are free below (judgement)."""


def lines(residuals: Sequence[Array], dt_s: Sequence[float], channels: Sequence[str]) -> HypothesisTest:
    """Test the power of the innovations in bands: a lightly damped mode raises it in one.

    Each channel is whitened by an autoregression of first order, which absorbs the colour of a sensor's noise. A
    higher order or a vector autoregression would absorb a mode as well.

    Parameters
    ----------
    residuals : of each record (samples, channels).
    dt_s : of each record [s].
    channels : names.
    """
    residuals = _whitened(residuals)
    top = 0.5 / max(dt_s)
    edges = np.arange(_LOWEST_HZ, top + 1e-9, _BAND_HZ)
    bands = max(len(edges) - 1, 0)
    power, degrees = np.zeros((bands, len(channels))), np.zeros(bands)
    square = np.maximum(np.mean(np.concatenate(residuals) ** 2, axis=0), 1e-300)
    for r, dt in zip(residuals, dt_s, strict=True):
        f = np.fft.rfftfreq(len(r), dt)
        ordinates = 2.0 * np.abs(np.fft.rfft(r, axis=0)) ** 2 / (len(r) * square)
        for b in range(bands):
            inside = (f > edges[b]) & (f <= edges[b + 1]) & (f < 0.5 / dt * (1.0 - 1e-9))
            power[b] += ordinates[inside].sum(axis=0)
            degrees[b] += 2.0 * np.count_nonzero(inside)
    seen = degrees > 0.0
    if not seen.any():
        return HypothesisTest(channels[0], 0.0, 1, 1.0)
    p = np.ones_like(power)
    p[seen] = chdtrc(degrees[seen][:, None], power[seen])
    excess = np.sqrt(2.0 * power) - np.sqrt(2.0 * degrees)[:, None]
    # among p-values that underflow to zero, the band with the most power
    b, channel = divmod(int(np.lexsort((-excess.ravel(), p.ravel()))[0]), p.shape[1])
    where = f"{channels[channel]} at {edges[b]:.1f} to {edges[b + 1]:.1f} Hz"
    return HypothesisTest(
        where,
        float(power[b, channel]),
        int(degrees[b]),
        min(1.0, float(len(channels)) * int(np.count_nonzero(seen)) * float(p[b, channel])),
    )


def _whitened(residuals: Sequence[Array]) -> list[Array]:
    """Residuals whitened by a first-order autoregression of each channel, the same for all records."""
    product = sum((r[1:] * r[:-1]).sum(axis=0) for r in residuals)
    square = sum((r[:-1] ** 2).sum(axis=0) for r in residuals)
    pole = product / np.maximum(square, 1e-300)
    return [
        np.concatenate([r[:1] * np.sqrt(np.maximum(1.0 - pole**2, 0.0)), r[1:] - pole * r[:-1]])
        for r in residuals
    ]


__all__ = ["lines"]
