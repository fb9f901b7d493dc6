"""Whether samples are nothing but a constant and white noise."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_STD: Final = 3.0
"""Standard deviations of von Neumann's ratio below 1 up to which samples count as white [-] (convention)."""


def is_white(x: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(...,) whether series (..., samples) are constants and white noise, by the mean square of their differences.

    Source: J. von Neumann, Ann. Math. Statist. 12 (1941) 367-395: of white noise its ratio to twice the variance has a mean of
    about 1 and a standard deviation of about 1/sqrt(samples).
    """
    differences = 0.5 * (np.diff(x, axis=-1) ** 2).mean(axis=-1)
    return np.asarray(differences >= (1.0 - _STD / np.sqrt(x.shape[-1])) * x.var(axis=-1, ddof=1))


__all__ = ["is_white"]
