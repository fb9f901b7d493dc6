"""Rates of measured series."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def smooth_rate(x: Array, width_s: float, dt_s: float) -> Array:
    """(samples,) rate of a uniformly sampled series behind a centred mean, which is exact for a straight line away from its ends.

    Parameters
    ----------
    x : (samples,) [unit]; width_s : width of the mean [s]; dt_s : sample period [s].

    Examples
    --------
    >>> smooth_rate(np.arange(8.0), 0.03, 0.01)[3:5].round(9).tolist()
    [100.0, 100.0]
    """
    width = max(round(width_s / dt_s), 1)
    smooth = np.convolve(np.pad(x, width, mode="edge"), np.ones(width) / width, mode="same")[width:-width]
    return np.asarray(np.gradient(smooth, dt_s))


__all__ = ["smooth_rate"]
