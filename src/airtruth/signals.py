"""The vocabulary of channels: one table binds name, unit, axis, sign and JSBSim property.

Body axes: x forward, z down, pitch nose-up positive; elevator trailing edge down positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from airtruth import units


@dataclass(frozen=True)
class Signal:
    """One channel of a flight log.

    Attributes
    ----------
    name : column name, ends in the unit.
    unit : unit as shown to people.
    dimension : key of `airtruth.units.UNITS`.
    description : what it is, with axis and sign.
    jsbsim : JSBSim property that holds the noise-free value, "" if there is no standard one.
    to_si : factor from the JSBSim property to SI.
    limit : largest magnitude that is plausible in SI, for spotting wrong units.
    """

    name: str
    unit: str
    dimension: str
    description: str
    jsbsim: str = ""
    to_si: float = 1.0
    limit: float = float("inf")


_ALL: Final = (
    Signal("airspeed_m_s", "m/s", "speed", "true airspeed", "velocities/vt-fps", units.FT, 1000.0),
    Signal("alpha_rad", "rad", "angle", "angle of attack, nose-up positive", "aero/alpha-rad", 1.0, 1.6),
    Signal("theta_rad", "rad", "angle", "pitch attitude, nose-up positive", "attitude/theta-rad", 1.0, 1.6),
    Signal(
        "q_rad_s",
        "rad/s",
        "angular_rate",
        "body pitch rate, nose-up positive",
        "velocities/q-rad_sec",
        1.0,
        10.0,
    ),
    Signal("ax_m_s2", "m/s2", "acceleration", "specific force along body x (forward)", "", 1.0, 200.0),
    Signal(
        "az_m_s2",
        "m/s2",
        "acceleration",
        "specific force along body z (down); level flight about -9.8",
        "",
        1.0,
        200.0,
    ),
    Signal(
        "elevator_rad",
        "rad",
        "angle",
        "elevator surface, mean of all; trailing edge down positive",
        "",
        1.0,
        1.6,
    ),
    Signal(
        "elevator_command_rad",
        "rad",
        "angle",
        "elevator command sent to the actuator; trailing edge down positive",
        "",
        1.0,
        1.6,
    ),
    Signal("throttle", "-", "ratio", "throttle lever, 0 to 1", "", 1.0, 1.0),
    Signal("altitude_m", "m", "length", "pressure altitude", "position/h-sl-ft", units.FT, 30000.0),
    Signal(
        "density_kg_m3",
        "kg/m3",
        "density",
        "air density",
        "atmosphere/rho-slugs_ft3",
        units.SLUG / units.FT**3,
        2.0,
    ),
)

SIGNALS: Final[dict[str, Signal]] = {s.name: s for s in _ALL}

RUN_ID: Final = "run_id"
TIME: Final = "t_s"
REQUIRED: Final = ("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad")
"""Channels that every log holds; besides them density_kg_m3 or altitude_m."""
