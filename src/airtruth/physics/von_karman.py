"""Spectrum of the vertical von Karman gust: what Dryden's falls short of by omega^(1/3) beyond its corner."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_CORNER: Final = 1.339


def vertical(sigma_m_s: float, length_m: float, airspeed_m_s: float, omega_rad_s: ArrayLike) -> Array:
    """One-sided spectrum over angular frequency; it integrates from 0 to infinity to the variance.

    Phi_w = sigma^2 (L/(pi V)) (1 + 8/3 (1.339 L omega/V)^2) / (1 + (1.339 L omega/V)^2)^(11/6)
    (MIL-F-8785C, 3.7.1.1).

    Parameters
    ----------
    omega_rad_s : (...) angular frequency [rad/s].

    Returns
    -------
    (...) [m2/s2 per rad/s].
    """
    x = np.square(_CORNER * length_m / airspeed_m_s * np.asarray(omega_rad_s, dtype=np.float64))
    unit = sigma_m_s**2 * length_m / (np.pi * airspeed_m_s)
    return np.asarray(unit * (1.0 + 8.0 / 3.0 * x) / (1.0 + x) ** (11.0 / 6.0))


__all__ = ["vertical"]
