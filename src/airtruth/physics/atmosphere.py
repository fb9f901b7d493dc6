"""The standard atmosphere up to 20 km, and calibrated, equivalent and true airspeed.

Source: U.S. Standard Atmosphere, 1976 (NOAA-S/T 76-1562), part 1; identical to the ICAO standard atmosphere
(Doc 7488) in this range. Altitude is geopotential pressure altitude, as an altimeter set to 1013.25 hPa shows it. Two
layers are modelled: the troposphere (-5 to 11 km) and the isothermal layer (11 to 20 km). Outside them every function
returns NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
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

HEAT_RATIO: Final = 1.4
"""Ratio of the specific heats of air (table 2) [-]."""

EARTH_RADIUS_M: Final = 6356766.0
"""Effective earth's radius of eq. (18) [m]."""

LOWEST_M: Final = -5000.0
"""Lowest altitude of the tables of the source [m]."""
TROPOPAUSE_M: Final = 11000.0
"""Top of the troposphere (table 4) [m]."""
HIGHEST_M: Final = 20000.0
"""Top of the isothermal layer (table 4) [m]."""

_ROUNDING_M: Final = 1e-6
"""Tolerance at the ends of the range [m]: a round trip at an end stays inside."""
_LAPSE_K_M: Final = -0.0065
"""Temperature gradient of the troposphere (table 4) [K/m]."""
_T11_K: Final = T0_K + _LAPSE_K_M * TROPOPAUSE_M
"""Temperature of the isothermal layer, eq. (23) [K]."""
_EXPONENT: Final = -G0 / (GAS_CONSTANT_J_KG_K * _LAPSE_K_M)
"""Exponent of the temperature ratio in the pressure, eq. (33a) [-]; 5.2559."""
_P11_PA: Final = P0_PA * (_T11_K / T0_K) ** _EXPONENT
"""Pressure at the tropopause, eq. (33a) [Pa]."""
_RHO11_KG_M3: Final = _P11_PA / (GAS_CONSTANT_J_KG_K * _T11_K)
"""Density at the tropopause, eq. (42) [kg/m3]."""
_SCALE_HEIGHT_M: Final = GAS_CONSTANT_J_KG_K * _T11_K / G0
"""Scale height of the isothermal layer, eq. (33b) [m]."""


def geopotential_m(geometric_m: ArrayLike) -> Array:
    """Geopotential altitude [m] of a geometric altitude above sea level [m], eq. (18).

    JSBSim's position/h-sl-ft is geometric; at 7000 ft it exceeds the geopotential altitude by 0.7 m.
    """
    z = np.asarray(geometric_m, dtype=np.float64)
    return EARTH_RADIUS_M * z / (EARTH_RADIUS_M + z)


def geometric_m(geopotential_m: ArrayLike) -> Array:
    """Geometric altitude above sea level [m] of a geopotential altitude [m]; the inverse of eq. (18)."""
    h = np.asarray(geopotential_m, dtype=np.float64)
    return EARTH_RADIUS_M * h / (EARTH_RADIUS_M - h)


def temperature_k(altitude_m: ArrayLike) -> Array:
    """Temperature [K] at pressure altitude [m], eq. (23); any shape."""
    h = _inside(altitude_m)
    return T0_K + _LAPSE_K_M * np.minimum(h, TROPOPAUSE_M)


def pressure_pa(altitude_m: ArrayLike) -> Array:
    """Pressure [Pa] at pressure altitude [m], eqs (33a) and (33b); any shape."""
    h = _inside(altitude_m)
    return P0_PA * (temperature_k(h) / T0_K) ** _EXPONENT * _isothermal(h)


def density_kg_m3(altitude_m: ArrayLike) -> Array:
    """Density [kg/m3] at pressure altitude [m], eq. (42); any shape.

    Examples
    --------
    >>> density_kg_m3([0.0, 11000.0]).round(4).tolist()
    [1.225, 0.3639]
    """
    h = _inside(altitude_m)
    return RHO0_KG_M3 * (temperature_k(h) / T0_K) ** (_EXPONENT - 1.0) * _isothermal(h)


def air_density(channels: Mapping[str, Array]) -> Array:
    """Air density [kg/m3] of a record: as measured, or else that of its pressure altitude.

    Parameters
    ----------
    channels : columns of a flight log; density_kg_m3 or altitude_m, of any shape.

    Returns
    -------
    Density, of the shape of the channel.

    Raises
    ------
    KeyError
        If both channels are absent; the log's validation excludes that.

    Examples
    --------
    >>> air_density({"altitude_m": np.array([0.0])}).round(4).tolist()
    [1.225]
    """
    if "density_kg_m3" in channels:
        return channels["density_kg_m3"]
    return density_kg_m3(channels["altitude_m"])


def altitude_of_density_m(density_kg_m3: ArrayLike) -> Array:
    """Density altitude [m] of a density [kg/m3]; the inverse of `density_kg_m3` in closed form, any shape."""
    rho = np.asarray(density_kg_m3, dtype=np.float64)
    rho = np.where(rho > 0.0, rho, np.nan)
    troposphere = T0_K / _LAPSE_K_M * ((rho / RHO0_KG_M3) ** (1.0 / (_EXPONENT - 1.0)) - 1.0)
    isothermal = TROPOPAUSE_M - _SCALE_HEIGHT_M * np.log(rho / _RHO11_KG_M3)
    return _inside(np.where(rho > _RHO11_KG_M3, troposphere, isothermal))


def altitude_of_pressure_m(pressure_pa: ArrayLike) -> Array:
    """Pressure altitude [m] of a static pressure [Pa]; the inverse of `pressure_pa` in closed form, any shape."""
    p = np.asarray(pressure_pa, dtype=np.float64)
    p = np.where(p > 0.0, p, np.nan)
    troposphere = T0_K / _LAPSE_K_M * ((p / P0_PA) ** (1.0 / _EXPONENT) - 1.0)
    isothermal = TROPOPAUSE_M - _SCALE_HEIGHT_M * np.log(p / _P11_PA)
    return _inside(np.where(p > _P11_PA, troposphere, isothermal))


def true_airspeed_of_calibrated_m_s(
    calibrated_airspeed_m_s: ArrayLike, pressure_pa: ArrayLike, density_kg_m3: ArrayLike
) -> Array:
    """True airspeed [m/s] of a calibrated airspeed [m/s] at a static pressure [Pa] and a density [kg/m3].

    The impact pressure is that of the calibrated airspeed at sea level, and that of the true airspeed at the static
    pressure: q_c = p ((1 + (k - 1)/2 M^2)^(k/(k - 1)) - 1), isentropic and below Mach 1 (NACA Report 1135, 1953),
    with M^2 = V^2 rho/(k p). At small M it becomes rho0 CAS^2 = rho TAS^2. Shapes broadcast.
    """
    half, power = 0.5 * (HEAT_RATIO - 1.0), HEAT_RATIO / (HEAT_RATIO - 1.0)
    p = np.asarray(pressure_pa, dtype=np.float64)
    square = np.square(np.asarray(calibrated_airspeed_m_s, dtype=np.float64))
    impact = P0_PA * np.expm1(power * np.log1p(half * square * RHO0_KG_M3 / (HEAT_RATIO * P0_PA)))
    mach_square = np.expm1(np.log1p(impact / p) / power) / half
    return np.sqrt(mach_square * HEAT_RATIO * p / np.asarray(density_kg_m3, dtype=np.float64))


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


__all__ = [
    "EARTH_RADIUS_M",
    "GAS_CONSTANT_J_KG_K",
    "HEAT_RATIO",
    "HIGHEST_M",
    "LOWEST_M",
    "P0_PA",
    "RHO0_KG_M3",
    "T0_K",
    "TROPOPAUSE_M",
    "air_density",
    "altitude_of_density_m",
    "altitude_of_pressure_m",
    "density_kg_m3",
    "equivalent_airspeed_m_s",
    "geometric_m",
    "geopotential_m",
    "pressure_pa",
    "temperature_k",
    "true_airspeed_m_s",
    "true_airspeed_of_calibrated_m_s",
]
