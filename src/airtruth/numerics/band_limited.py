"""Signals whose recorder takes out the band above half its rate: they ring about a step, and their samples determine them."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TOP: Final = (0.48, 0.5)
"""Band in which the power of a band-limited signal is small, as shares of the sample rate [-] (judgement: filters against
aliasing have reached their attenuation there)."""
_BELOW: Final = (0.2, 0.35)
"""Band below the edge of such filters, as shares of the sample rate [-] (judgement)."""
_DROP: Final = 0.01
"""Power density in the upper over that in the lower band below which a spectrum ends [-] (judgement: three lags in series,
however slow, leave a tenth)."""
_STEP: Final = 0.2
"""Least increment that is a step, over the largest one [-] (judgement)."""
_RING: Final = 0.005
"""Least increment that belongs to ringing, over the range [-] (judgement: above rounding)."""
_RINGS: Final = 2.0
"""Changes of sign between neighbouring increments for each step above which a signal rings [-] (judgement: a lag makes one,
where a step follows before it has settled)."""


def is_band_limited(x: Array) -> bool:
    """Whether a signal rings about its steps and its spectrum ends below half the sample rate.

    Increments of steps have a flat spectrum. Lags make it fall by little between both bands, and noise of the samples fills it.
    Steps an even number of samples apart cancel at half the rate too, and do not ring.

    Parameters
    ----------
    x : (samples,) in any unit.
    """
    change = np.diff(x)
    power = np.abs(np.fft.rfft(change * np.hanning(change.size))) ** 2
    share = np.fft.rfftfreq(change.size)
    top, below = (power[(share >= low) & (share <= high)] for low, high in (_TOP, _BELOW))
    if not (top.size and below.size and top.mean() < _DROP * below.mean()):
        return False
    size = np.abs(change)
    steps = (size[1:-1] > _STEP * size.max()) & (size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])
    rings = (change[1:] * change[:-1] < 0.0) & (np.minimum(size[1:], size[:-1]) > _RING * np.ptp(x))
    return bool(rings.sum() > _RINGS * steps.sum())


def band_limited(x: Array, cells: int) -> Array:
    """The band-limited signal through the samples, which its mirror image continues at both ends.

    Parameters
    ----------
    x : (samples,) two or more; cells : cells of the fine grid per sample.

    Returns
    -------
    ((samples - 1) cells + 1,)
    """
    from scipy.signal import resample

    period = np.concatenate([x, x[-2:0:-1]])
    return np.asarray(resample(period, period.size * cells)[: (x.size - 1) * cells + 1])


__all__ = ["band_limited", "is_band_limited"]
