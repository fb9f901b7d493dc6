"""Channels that are computed from others on import: air data from what was measured, alpha without a vane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.importers.mapping import AIRSPEEDS, Reconstruct
from airtruth.physics.atmosphere import (
    GAS_CONSTANT_J_KG_K,
    air_density,
    altitude_of_density_m,
    altitude_of_pressure_m,
    geopotential_m,
    pressure_pa,
    true_airspeed_m_s,
    true_airspeed_of_calibrated_m_s,
)
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import COLUMNS, NEEDED, ReconstructionPriors, reconstruct
from airtruth.units import DEG

Array = NDArray[np.float64]

PRESSURE: Final = "dynamic_pressure_pa"
"""Quantity of a mapping that replaces airspeed_m_s."""


def with_air_data(where: str, channels: Mapping[str, Array]) -> dict[str, Array]:
    """Replace quantities of the air by the channels of a log: altitude, then density, then true airspeed.

    - height_m, above sea level, is taken as a geometric altitude in the standard atmosphere; static_pressure_pa gives the
      pressure altitude.
    - air_temperature_k gives the density of dry air, rho = p/(R T) (U.S. Standard Atmosphere, 1976, eq. 42).
    - dynamic_pressure_pa gives V = sqrt(2 q_bar/rho), equivalent_airspeed_m_s sqrt(rho0/rho) EAS;
      calibrated_airspeed_m_s, and indicated_airspeed_m_s as if it were calibrated, `true_airspeed_of_calibrated_m_s`.

    Raises
    ------
    LogError
        If a quantity that the formula needs is missing, or a value is outside its range.
    """
    made = dict(channels)
    if "height_m" in made:
        height = made.pop("height_m")
        made["altitude_m"] = geopotential_m(height)
        _require(where, "height_m", np.isfinite(pressure_pa(made["altitude_m"])), "between -5 and 20 km")
    pressure = made.pop("static_pressure_pa", None)
    if pressure is not None:
        made["altitude_m"] = altitude_of_pressure_m(pressure)
        within = np.isfinite(made["altitude_m"])
        _require(where, "static_pressure_pa", within, "between 55 and 1776 hPa (20 and -5 km)")
    elif "altitude_m" in made:
        pressure = pressure_pa(made["altitude_m"])
    if "air_temperature_k" in made:
        temperature = made.pop("air_temperature_k")
        if pressure is None:
            raise LogError(
                f"{where}: air_temperature_k needs static_pressure_pa, altitude_m or height_m for the density; map one of them"
            )
        _require(where, "air_temperature_k", temperature > 0.0, "above 0 K")
        made["density_kg_m3"] = pressure / (GAS_CONSTANT_J_KG_K * temperature)
    for name in AIRSPEEDS:
        if name in made:
            made = {"airspeed_m_s": _true_airspeed(where, name, made, pressure), **made}
            del made[name]
    return made


def _true_airspeed(where: str, name: str, channels: Mapping[str, Array], pressure: Array | None) -> Array:
    """True airspeed [m/s] of one of `AIRSPEEDS`."""
    if "density_kg_m3" not in channels and "altitude_m" not in channels:
        raise LogError(f"{where}: {name} needs density_kg_m3 or altitude_m for the airspeed; map one of them")
    values, density = channels[name], air_density(channels)
    _require(where, name, values > 0.0, "positive")
    if name == PRESSURE:
        return np.sqrt(2.0 * values / density)
    if name == "equivalent_airspeed_m_s":
        return true_airspeed_m_s(values, density)
    if pressure is None:
        pressure = pressure_pa(altitude_of_density_m(density))
    return true_airspeed_of_calibrated_m_s(values, pressure, density)


def _require(where: str, name: str, good: NDArray[np.bool_], allowed: str) -> None:
    bad = np.flatnonzero(~good)
    if len(bad):
        raise LogError(
            f"{where}: {name} is not {allowed} in {len(bad)} samples, the first is number {int(bad[0]) + 1}; correct its "
            "unit, sign and offset, or cut a [[manoeuvre]] in flight"
        )


def with_alpha(
    where: str, channels: Mapping[str, Array], dt_s: float, stated: Reconstruct
) -> tuple[dict[str, Array], float]:
    """Add a reconstructed alpha and the columns with the directions of its errors; also the std of its drift [rad].

    Raises
    ------
    LogError
        If a channel that the reconstruction needs is missing.
    """
    missing = [name for name in NEEDED if name not in channels]
    if missing:
        raise LogError(f"{where}: [reconstruct] alpha needs {', '.join(missing)}; map a column")
    q_std = stated.q_bias_deg_s * DEG
    made = reconstruct(
        channels, dt_s, ReconstructionPriors(stated.az_bias_m_s2, q_std, stated.airspeed_error)
    )
    errors = dict(zip(COLUMNS, made.directions_rad, strict=True))
    return {**channels, LONGITUDINAL.vane: made.alpha_rad, **errors}, made.drift_std_rad


__all__ = ["PRESSURE", "with_air_data", "with_alpha"]
