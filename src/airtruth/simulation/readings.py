"""JSBSim's properties of a flight as channels in SI, at the centre of gravity and without sensors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import ATTITUDE, LATERAL, PITCH_PLANE, SIGNALS
from airtruth.errors import FlightError
from airtruth.physics import atmosphere
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import FT, SLUG

Array = NDArray[np.float64]

_STATE: Final = tuple(name for name in PITCH_PLANE if SIGNALS[name].jsbsim)
"""Channels with a JSBSim property of their own, see `airtruth.channels.LogChannel.jsbsim`."""
READ: Final = (
    *(SIGNALS[name].jsbsim for name in _STATE),
    "forces/fbx-total-lbs",
    "forces/fbz-total-lbs",
    "accelerations/qdot-rad_sec2",
)
"""Properties that `channels` takes, in its order; the surface's own property follows them."""
_LATERAL_STATE: Final = tuple(name for name in LATERAL if SIGNALS[name].jsbsim)
"""Lateral channels with a JSBSim property of their own."""
READ_LATERAL: Final = (
    *(SIGNALS[name].jsbsim for name in _LATERAL_STATE),
    "forces/fby-total-lbs",
    "accelerations/pdot-rad_sec2",
    "accelerations/rdot-rad_sec2",
)
"""Properties that `lateral_channels` takes, in its order; those of aileron and rudder follow them."""
MOST_ALPHA_RAD: Final = 1.5
"""Largest angle of attack of a sound flight [rad] (judgement: 86 deg, beyond any table)."""


def channels(columns: Array, mass_kg: float, surface_rad: float) -> dict[str, Array]:
    """Convert properties to the channels of a log that exist without sensors, and q_dot_rad_s2.

    Parameters
    ----------
    columns : (10, records) values of `READ` and of the surface's property [JSBSim's units].
    mass_kg : mass of the aircraft [kg].
    surface_rad : radians per unit of the surface's property.

    Returns
    -------
    dict
        Channel -> (records,) values at the centre of gravity [SI].
    """
    *state, fx, fz, q_dot, surface = columns
    result = {name: column * SIGNALS[name].to_si for name, column in zip(_STATE, state, strict=True)}
    result["altitude_m"] = atmosphere.geopotential_m(result["altitude_m"])
    acceleration = SLUG * FT / mass_kg
    return result | {
        "ax_m_s2": fx * acceleration,
        LONGITUDINAL.outputs[-1].channel: fz * acceleration,
        "q_dot_rad_s2": q_dot,
        LONGITUDINAL.surfaces[0]: surface * surface_rad,
    }


def lateral_channels(columns: Array, mass_kg: float, surfaces_rad: Sequence[float]) -> dict[str, Array]:
    """Convert properties to the lateral channels of a log that exist without sensors, p_dot_rad_s2 and r_dot_rad_s2.

    Parameters
    ----------
    columns : (10, records) values of `READ_LATERAL` and of the properties of the surfaces [JSBSim's units].
    mass_kg : mass of the aircraft [kg].
    surfaces_rad : radians per unit of each surface's property.

    Returns
    -------
    dict
        Channel -> (records,) values at the centre of gravity [SI]; bank and heading without jumps of a turn.
    """
    *state, fy, p_dot, r_dot = columns[: len(READ_LATERAL)]
    surfaces = zip(MOTION.surfaces, columns[len(READ_LATERAL) :], surfaces_rad, strict=True)
    result = {name: column * SIGNALS[name].to_si for name, column in zip(_LATERAL_STATE, state, strict=True)}
    for name in ATTITUDE[1:]:
        start = np.remainder(result[name][:1] + np.pi, 2.0 * np.pi) - np.pi
        result[name] = np.unwrap(np.concatenate([start, result[name]]))[1:]
    return result | {
        MOTION.outputs[-1].channel: fy * (SLUG * FT / mass_kg),
        "p_dot_rad_s2": p_dot,
        "r_dot_rad_s2": r_dot,
        **{name: column * scale for name, column, scale in surfaces},
    }


def require_sound(columns: Array, record_s: float, flight: str) -> None:
    """Refuse a flight that left the range in which the simulation has a meaning.

    Parameters
    ----------
    columns : (10 or more, records) as in `channels`.
    record_s : time between two records [s].
    flight : subject of the message.

    Raises
    ------
    FlightError
        If a value is not finite, the airspeed is not positive or the angle of attack exceeds `MOST_ALPHA_RAD`.
    """
    airspeed, alpha = columns[0], columns[1]
    with np.errstate(over="ignore", invalid="ignore"):
        sound = np.isfinite(columns).all(axis=0) & (airspeed > 0.0) & (np.abs(alpha) < MOST_ALPHA_RAD)
    if not sound.all():
        first = int(np.flatnonzero(~sound)[0])
        raise FlightError(
            f"{flight} left the simulation's range at {first * record_s:.3f} s "
            f"(airspeed {airspeed[first] * FT:.3g} m/s, alpha {alpha[first]:.3g} rad)"
        )


__all__ = ["MOST_ALPHA_RAD", "READ", "READ_LATERAL", "channels", "lateral_channels", "require_sound"]
