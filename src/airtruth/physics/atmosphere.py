"""The standard atmosphere up to 20 km, and equivalent and true airspeed.

Source: U.S. Standard Atmosphere, 1976 (NOAA-S/T 76-1562), part 1; identical with the ICAO standard
atmosphere (Doc 7488) in this range. Altitude means geopotential pressure altitude throughout, as an
altimeter set to 1013.25 hPa shows it. Two layers are held: the troposphere (-5 to 11 km) and the
isothermal layer (11 to 20 km); outside them every function returns NaN.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airtruth.units import G0

Array = NDArray[np.float64]

P0_PA: Final = 101325.0
"""Pressure at sea level (table 2 of the source) [Pa]."""
T0_K: Final = 288.15
"""Temperature at sea level (table 2) [K]."""
GAS_CONSTANT_J_KG_K: Final = 8314.32 / 28.9644
"""R*/M0 of dry air (table 2) [J/(kg K)]; the 1976 value, not today's."""
RHO0_KG_M3: Final = P0_PA / (GAS_CONSTANT_J_KG_K * T0_K)
"""Density at sea level, eq. (42) [kg/m3]."""

EARTH_RADIUS_M: Final = 6356766.0
"""Effective earth's radius of eq. (18) [m]."""

LOWEST_M: Final = -5000.0
TROPOPAUSE_M: Final = 11000.0
HIGHEST_M: Final = 20000.0

_ROUNDING_M: Final = 1e-6  # keeps a round trip at an end of the range inside it
_LAPSE_K_M: Final = -0.0065  # table 4, b = 0
_T11_K: Final = T0_K + _LAPSE_K_M * TROPOPAUSE_M
_EXPONENT: Final = -G0 / (GAS_CONSTANT_J_KG_K * _LAPSE_K_M)  # 5.2559
_P11_PA: Final = P0_PA * (_T11_K / T0_K) ** _EXPONENT
_RHO11_KG_M3: Final = _P11_PA / (GAS_CONSTANT_J_KG_K * _T11_K)
_SCALE_HEIGHT_M: Final = GAS_CONSTANT_J_KG_K * _T11_K / G0  # of the isothermal layer


def geopotential_m(geometric_m: ArrayLike) -> Array:
    """Geopotential altitude [m] of a geometric altitude above sea level [m], eq. (18).

    JSBSim's position/h-sl-ft is geometric; at 7000 ft it stands 0.7 m above the geopotential altitude.
    """
    z = np.asarray(geometric_m, dtype=np.float64)
    return EARTH_RADIUS_M * z / (EARTH_RADIUS_M + z)


def temperature_k(altitude_m: ArrayLike) -> Array:
    """Temperature [K] at pressure altitude [m], eq. (23); any shape."""
    h = _inside(altitude_m)
    return T0_K + _LAPSE_K_M * np.minimum(h, TROPOPAUSE_M)


def pressure_pa(altitude_m: ArrayLike) -> Array:
    """Pressure [Pa] at pressure altitude [m], eqs (33a) and (33b); any shape."""
    h = _inside(altitude_m)
    return P0_PA * (temperature_k(h) / T0_K) ** _EXPONENT * _isothermal(h)


def density_kg_m3(altitude_m: ArrayLike) -> Array:
    """Density [kg/m3] at pressure altitude [m], eq. (42); any shape."""
    h = _inside(altitude_m)
    return RHO0_KG_M3 * (temperature_k(h) / T0_K) ** (_EXPONENT - 1.0) * _isothermal(h)


def altitude_of_pressure_m(pressure_pa: ArrayLike) -> Array:
    """Pressure altitude [m] of a pressure [Pa]; inverts `pressure_pa`."""
    p = np.asarray(pressure_pa, dtype=np.float64)
    return _inverse(p / P0_PA, 1.0 / _EXPONENT, p / _P11_PA)


def altitude_of_density_m(density_kg_m3: ArrayLike) -> Array:
    """Density altitude [m] of a density [kg/m3]; inverts `density_kg_m3`."""
    rho = np.asarray(density_kg_m3, dtype=np.float64)
    return _inverse(rho / RHO0_KG_M3, 1.0 / (_EXPONENT - 1.0), rho / _RHO11_KG_M3)


def true_airspeed_m_s(equivalent_airspeed_m_s: ArrayLike, density_kg_m3: ArrayLike) -> Array:
    """True airspeed [m/s] of an equivalent airspeed [m/s]: rho0 EAS^2 = rho TAS^2, shapes broadcast."""
    rho = np.asarray(density_kg_m3, dtype=np.float64)
    return np.asarray(equivalent_airspeed_m_s, dtype=np.float64) * np.sqrt(RHO0_KG_M3 / rho)


def equivalent_airspeed_m_s(true_airspeed_m_s: ArrayLike, density_kg_m3: ArrayLike) -> Array:
    """Equivalent airspeed [m/s] of a true airspeed [m/s]; inverts `true_airspeed_m_s`."""
    rho = np.asarray(density_kg_m3, dtype=np.float64)
    return np.asarray(true_airspeed_m_s, dtype=np.float64) * np.sqrt(rho / RHO0_KG_M3)


def _inside(altitude_m: ArrayLike) -> Array:
    h = np.asarray(altitude_m, dtype=np.float64)
    return np.where((h >= LOWEST_M - _ROUNDING_M) & (h <= HIGHEST_M + _ROUNDING_M), h, np.nan)


def _isothermal(h: Array) -> Array:
    return np.exp(-np.maximum(h - TROPOPAUSE_M, 0.0) / _SCALE_HEIGHT_M)


def _inverse(ratio: Array, power: float, ratio_11: Array) -> Array:
    ratio = np.where(ratio > 0.0, ratio, np.nan)
    low = T0_K / _LAPSE_K_M * (ratio**power - 1.0)
    high = TROPOPAUSE_M - _SCALE_HEIGHT_M * np.log(np.where(ratio > 0.0, ratio_11, np.nan))
    return _inside(np.where(ratio_11 > 1.0, low, high))


__all__ = [
    "EARTH_RADIUS_M",
    "GAS_CONSTANT_J_KG_K",
    "HIGHEST_M",
    "LOWEST_M",
    "P0_PA",
    "RHO0_KG_M3",
    "T0_K",
    "TROPOPAUSE_M",
    "altitude_of_density_m",
    "altitude_of_pressure_m",
    "density_kg_m3",
    "equivalent_airspeed_m_s",
    "geopotential_m",
    "pressure_pa",
    "temperature_k",
    "true_airspeed_m_s",
]
