"""Channels that are computed from others on import: airspeed from dynamic pressure, alpha without a vane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.importers.mapping import Reconstruct
from airtruth.physics.atmosphere import air_density
from airtruth.physics.reconstruction import COLUMNS, NEEDED, Priors, reconstruct
from airtruth.units import DEG

Array = NDArray[np.float64]

PRESSURE: Final = "dynamic_pressure_pa"
"""Quantity of a mapping that replaces airspeed_m_s."""


def airspeed_from_pressure(where: str, channels: Mapping[str, Array]) -> dict[str, Array]:
    """Replace the dynamic pressure by the true airspeed, V = sqrt(2 q_bar/rho).

    Raises
    ------
    LogError
        If density and altitude are missing, or the pressure is not positive.
    """
    if PRESSURE not in channels:
        return dict(channels)
    if "density_kg_m3" not in channels and "altitude_m" not in channels:
        raise LogError(
            f"{where}: {PRESSURE} needs density_kg_m3 or altitude_m for the airspeed; map one of them"
        )
    pressure, density = channels[PRESSURE], air_density(channels)
    low = np.flatnonzero(~(pressure > 0.0))
    if len(low):
        raise LogError(
            f"{where}: {PRESSURE} is not positive in {len(low)} samples, the first is number {int(low[0]) + 1}; correct "
            "its sign and offset, or cut a [[manoeuvre]] in flight"
        )
    rest = {name: values for name, values in channels.items() if name != PRESSURE}
    return {"airspeed_m_s": np.sqrt(2.0 * pressure / density), **rest}


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
    made = reconstruct(channels, dt_s, Priors(stated.az_bias_m_s2, q_std, stated.airspeed_error))
    errors = dict(zip(COLUMNS, made.directions_rad, strict=True))
    return {**channels, "alpha_rad": made.alpha_rad, **errors}, made.drift_std_rad


__all__ = ["PRESSURE", "airspeed_from_pressure", "with_alpha"]
