"""Channels whose values pass the log's gate and yet cannot be what they are named: another unit or sign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.units import G0, UNITS

LOWEST_M: Final = -2000.0
HIGHEST_M: Final = 20000.0
"""Altitudes between which a record may lie."""


def plausible(logs: Sequence[FlightLog]) -> None:
    """Refuse validated logs in which a record's mean is not that of an aircraft in flight.

    Raises
    ------
    LogError
        Naming the run, the channel, its value, what is plausible and what to do.
    """
    for log in logs:
        for run, run_id in enumerate(log.run_ids):
            if "density_kg_m3" in log.channels:
                check_density(_mean(log, run, "density_kg_m3"), f"run {run_id}: ")
            _check_gravity(_mean(log, run, "az_m_s2"), run_id)


def check_density(mean_kg_m3: float, where: str = "") -> None:
    """Refuse a mean density [kg/m3] that no altitude of the standard atmosphere has.

    Raises
    ------
    LogError
        With the plausible range, and the unit that the value seems to have.
    """
    low, high = (float(density_kg_m3(h)) for h in (HIGHEST_M, LOWEST_M))
    if low <= mean_kg_m3 <= high:
        return
    step = "state its unit in the import mapping, or leave the channel out and give altitude_m"
    for unit, factor in UNITS["density"].items():
        if low <= mean_kg_m3 * factor <= high:
            step = f"it looks like {unit}: state the unit {unit} in the import mapping"
    raise LogError(
        f"{where}density_kg_m3 is {mean_kg_m3:.4g} kg/m3 on average, outside {low:.3g} to {high:.3g} kg/m3 "
        f"(standard atmosphere, {LOWEST_M:g} to {HIGHEST_M:g} m); {step}"
    )


def _check_gravity(mean_m_s2: float, run_id: str) -> None:
    if mean_m_s2 <= 0.0:
        return
    # near zero it is no sign error but an acceleration without gravity
    step = (
        "turn its sign round (sign = -1 under [channels.az_m_s2] in the import mapping)"
        if mean_m_s2 > 0.5 * G0
        else "it has to be the specific force that an accelerometer feels, gravity included"
    )
    raise LogError(
        f"run {run_id}: az_m_s2 is {mean_m_s2:+.3g} m/s2 on average, and must be negative: "
        f"body z points down, so level flight has about {-G0:.1f} m/s2; {step}"
    )


def _mean(log: FlightLog, run: int, channel: str) -> float:
    return float(np.mean(log.channels[channel][log.rows(run)], dtype=np.float64))
