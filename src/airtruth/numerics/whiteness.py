"""Whether samples are nothing but a constant and white noise, and how large the noise of a signal is where it rests."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_STD: Final = 3.0
"""Standard deviations of von Neumann's ratio below 1 up to which samples count as white [-] (convention)."""

_REST: Final = 0.2
"""Quantile of the variance over windows that is one of a signal at rest [-] (judgement: a manoeuvre begins and ends at rest)."""
_AS_QUIET: Final = 4.0
"""Variance over that quantile up to which a window is one of rest too [-] (judgement: white noise in 8 samples exceeds it once
in two hundred)."""


def is_white(x: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(...,) whether series (..., samples) are constants and white noise, by the mean square of their differences.

    Source: J. von Neumann, Ann. Math. Statist. 12 (1941) 367-395: of white noise its ratio to twice the variance has a mean of
    about 1 and a standard deviation of about 1/sqrt(samples).
    """
    differences = 0.5 * (np.diff(x, axis=-1) ** 2).mean(axis=-1)
    return np.asarray(differences >= _least_ratio(x.shape[-1]) * x.var(axis=-1, ddof=1))


def _least_ratio(samples: int) -> float:
    """Von Neumann's ratio from which so many samples count as white [-]."""
    return float(1.0 - _STD / np.sqrt(samples))


def noise_at_rest(x: NDArray[np.float64], samples: int) -> float:
    """Standard deviation of the white noise of a signal where it rests, in its unit; 0 where it shows none.

    Windows of rest are those of least variance. The signal has no noise if it is constant in one of them. It moves if von
    Neumann's ratio of all of them together is below that of white noise.

    Parameters
    ----------
    x : (n,) the signal; samples : of a window.
    """
    windows = x[: x.size // samples * samples].reshape(-1, samples)
    if not windows.size:
        return 0.0
    variance = windows.var(axis=1, ddof=1)
    rest = variance <= _AS_QUIET * np.quantile(variance, _REST)
    mean = float(variance[rest].mean())
    differences = 0.5 * float((np.diff(windows[rest], axis=1) ** 2).mean())
    moves = differences < _least_ratio(windows[rest].size) * mean
    return 0.0 if moves or not variance[rest].all() else float(np.sqrt(mean))


__all__ = ["is_white", "noise_at_rest"]
