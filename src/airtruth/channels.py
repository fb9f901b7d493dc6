"""The channels of a flight log: name, unit, axis, sign and JSBSim property of each, in one table.

Body axes: x forward, y right, z down; pitch nose-up, right wing down and nose right positive; elevator trailing edge down
positive, aileron (right - left)/2 with each trailing edge down positive, rudder trailing edge left positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Final

from airtruth import units


@dataclass(frozen=True)
class LogChannel:
    """One channel of a flight log.

    Attributes
    ----------
    name : column name; its unit ends it.
    unit : unit in messages and tables.
    dimension : key of `airtruth.units.UNITS`.
    description : the quantity, with axis and sign.
    jsbsim : JSBSim property with the noise-free value, "" if no standard property exists.
    to_si : factor from the JSBSim property to SI.
    limit : largest plausible magnitude [SI]; a larger one is usually a wrong unit (judgement: beyond any aircraft
        that the package models, and below the value of the same motion in degrees or feet).
    """

    name: str
    unit: str
    dimension: str
    description: str
    jsbsim: str = ""
    to_si: float = 1.0
    limit: float = float("inf")

    @property
    def stem(self) -> str:
        """Name without the unit."""
        return self.name.removesuffix("_" + self.unit.replace("/", "_"))


_DENSE: Final = units.SLUG / units.FT**3
"""Unit of a density in JSBSim [kg/m3]."""
_angle = partial(LogChannel, unit="rad", dimension="angle")
_rate = partial(LogChannel, unit="rad/s", dimension="angular_rate", limit=10.0)
_force = partial(LogChannel, unit="m/s2", dimension="acceleration", limit=200.0)


def _deflections(surface: str, what: str, actuators: str, sense: str) -> tuple[LogChannel, LogChannel]:
    """A control surface, and its command."""
    sent = f"{surface} command sent to the {actuators}{sense}"
    return (
        _angle(f"{surface}_rad", description=f"{surface} surface{what}{sense}", limit=1.6),
        _angle(f"{surface}_command_rad", description=sent, limit=1.6),
    )


_LONGITUDINAL = (
    LogChannel("airspeed_m_s", "m/s", "speed", "true airspeed", "velocities/vt-fps", units.FT, 1000.0),
    _angle("alpha_rad", description="angle of attack, nose-up positive", jsbsim="aero/alpha-rad", limit=1.6),
    _angle(
        "theta_rad", description="pitch attitude, nose-up positive", jsbsim="attitude/theta-rad", limit=1.6
    ),
    _rate("q_rad_s", description="body pitch rate, nose-up positive", jsbsim="velocities/q-rad_sec"),
    _force("ax_m_s2", description="specific force along body x (forward)"),
    _force("az_m_s2", description="specific force along body z (down); level flight about -9.8"),
    *_deflections("elevator", ", mean of all", "actuator", "; trailing edge down positive"),
    LogChannel("throttle", "-", "ratio", "throttle lever, 0 to 1", limit=1.0),
    LogChannel("altitude_m", "m", "length", "pressure altitude", "position/h-sl-ft", units.FT, 30000.0),
    LogChannel("density_kg_m3", "kg/m3", "density", "air density", "atmosphere/rho-slugs_ft3", _DENSE, 2.0),
)
_AILERON = _deflections("aileron", "", "actuators", ", (right - left)/2, each trailing edge down positive")
_RUDDER = _deflections("rudder", "", "actuator", ", trailing edge left positive")
_LATERAL = (
    _angle(
        "beta_rad", description="sideslip, wind from the right positive", jsbsim="aero/beta-rad", limit=1.6
    ),
    _rate("p_rad_s", description="body roll rate, right wing down positive", jsbsim="velocities/p-rad_sec"),
    _rate("r_rad_s", description="body yaw rate, nose right positive", jsbsim="velocities/r-rad_sec"),
    # of the angles of bank and heading whole turns are added up where they jump
    _angle("phi_rad", description="bank, right wing down positive", jsbsim="attitude/phi-rad"),
    _angle("psi_rad", description="heading, nose right positive", jsbsim="attitude/psi-rad"),
    _force("ay_m_s2", description="specific force along body y (right)"),
    *(channel for pair in zip(_AILERON, _RUDDER, strict=True) for channel in pair),
)

SIGNALS: Final[dict[str, LogChannel]] = {s.name: s for s in (*_LONGITUDINAL, *_LATERAL)}
"""Column name -> channel, in the order of the columns of a log (contract 1)."""
PITCH_PLANE: Final = tuple(s.name for s in _LONGITUDINAL)
"""Channels of a log in the pitch plane."""
LATERAL: Final = tuple(s.name for s in _LATERAL)
"""Channels of the lateral-directional motion; every log may lack all of them."""
ATTITUDE: Final = ("theta_rad", "phi_rad", "psi_rad")
"""Angles of the attitude."""
BANK: Final = ATTITUDE[1]
"""Bank angle."""

RUN_ID: Final = "run_id"
"""Column with the name of the run."""
TIME: Final = "t_s"
"""Column with the time from the start of the run [s]."""


def shown(channel: str) -> tuple[str, float]:
    """Name of a channel with its display unit, and the factor to this unit from SI."""
    if channel.endswith("_rad"):
        return f"{channel.removesuffix('_rad')} [deg]", 1.0 / units.DEG
    if channel.endswith("_rad_s"):
        return f"{channel.removesuffix('_rad_s')} [deg/s]", 1.0 / units.DEG
    for ending, unit in (("_m_s2", "m/s2"), ("_m_s", "m/s")):
        if channel.endswith(ending):
            return f"{channel.removesuffix(ending)} [{unit}]", 1.0
    return channel, 1.0
