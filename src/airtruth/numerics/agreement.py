"""Agreement of a simulation with a measurement: R2, and Theil's inequality coefficient with its proportions.

Sources: H. Theil, Applied Economic Forecasting, North-Holland, 1966, chapter 2; R. V. Jategaonkar, Flight Vehicle System
Identification, AIAA, 2nd ed., 2015, the chapter on model validation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Agreement:
    """Agreement of one simulated signal with its measurement; NaN where a figure is not defined.

    Attributes
    ----------
    r2 : 1 - sum (z - y)^2 / sum (z - mean z)^2 [-], z measured and y simulated.
    theil : inequality coefficient, 0 for a perfect match, 1 for the worst [-].
    bias, variance, covariance : shares of the mean square error that a difference of the means, a difference of the
        standard deviations, and a lack of correlation make [-]; their sum is 1.
    """

    r2: float
    theil: float
    bias: float
    variance: float
    covariance: float


def agreement(measured: Array, simulated: Array, about: float = 0.0) -> Agreement:
    """Compare a simulated signal with its measurement.

    With z the measurement and y the simulation, both less ``about``, and e^2 = mean (z - y)^2::

        theil      = e / (sqrt(mean z^2) + sqrt(mean y^2))
        bias       = (mean z - mean y)^2 / e^2
        variance   = (std z - std y)^2 / e^2
        covariance = 2 (1 - r) std z std y / e^2

    Parameters
    ----------
    measured, simulated : (samples,) values in one unit.
    about : value from which the coefficient counts both, in the same unit. A steady part that both have, such as the
        weight in az, otherwise makes every coefficient small. The other figures do not depend on it.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        z, y = measured - about, simulated - about
        square = float(np.mean((z - y) ** 2))
        total = float(np.mean((z - z.mean()) ** 2))
        size = math.sqrt(float(np.mean(z**2))) + math.sqrt(float(np.mean(y**2)))
        if not (math.isfinite(square) and math.isfinite(size) and total > 0.0):
            return Agreement(math.nan, math.nan, math.nan, math.nan, math.nan)
        r2, theil = 1.0 - square / total, math.sqrt(square) / size
        if square == 0.0:
            return Agreement(r2, theil, math.nan, math.nan, math.nan)
        sz, sy = float(z.std()), float(y.std())
        common = float(np.mean((z - z.mean()) * (y - y.mean())))
        return Agreement(
            r2=r2,
            theil=theil,
            bias=float(z.mean() - y.mean()) ** 2 / square,
            variance=(sz - sy) ** 2 / square,
            covariance=2.0 * (sz * sy - common) / square,
        )


__all__ = ["Agreement", "agreement"]
