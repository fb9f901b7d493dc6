"""Round numbers on a scale."""

from __future__ import annotations

import math
from typing import Final

_STEPS: Final = (1.0, 2.0, 5.0, 10.0)
"""Distances between ticks, times a power of ten [-] (convention)."""


def ticks(low: float, high: float, most: int = 5) -> list[float]:
    """Return round numbers between two ends, in order.

    Parameters
    ----------
    low, high : ends of the scale, ``low`` below ``high``.
    most : largest number of ticks, less one.
    """
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s for s in _STEPS if s * power >= rough * (1.0 - 1e-9)) * power
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # a single tick gives no scale
    return [k * step for k in range(first, last + 1)] if last > first else ticks(low, high, 2 * most)


def log_ticks(low: float, high: float) -> list[float]:
    """Return log10 of the numbers 1, 2 and 5 times a power of ten between two ends, which are log10 as well."""
    powers = range(math.floor(low), math.ceil(high) + 1)
    found = (k + math.log10(s) for k in powers for s in _STEPS[:3])
    return [at for at in found if low - 1e-9 <= at <= high + 1e-9]


def label(value: float, step: float) -> str:
    """Return a tick as text, with the decimals that tell neighbours apart.

    Parameters
    ----------
    value : the tick.
    step : distance to its neighbour.
    """
    size = max(abs(value), step)
    if not 1e-4 <= size < 1e5:
        return f"{value:.1e}" if value else "0"
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    words = f"{value:.{decimals}f}"
    return words.replace("-0", "0", 1) if float(words) == 0.0 else words
