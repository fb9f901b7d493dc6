"""Attitude of an aircraft that flies straight with sideslip and bank."""

from __future__ import annotations

import math
from typing import NamedTuple


class Attitude(NamedTuple):
    """Pitch attitude and heading [rad], and the velocity of unit length in body axes [-]."""

    theta_rad: float
    psi_rad: float
    velocity: tuple[float, float, float]


def straight_attitude(alpha_rad: float, beta_rad: float, phi_rad: float, gamma_rad: float) -> Attitude:
    """Return the attitude in which the flight path has a given angle and leads north.

    Stevens, Lewis and Johnson, Aircraft Control and Simulation, 3rd ed., 2016, the rate-of-climb constraint.

    Parameters
    ----------
    alpha_rad, beta_rad : angle of attack and sideslip [rad].
    phi_rad, gamma_rad : bank and flight-path angle [rad].

    Examples
    --------
    >>> straight_attitude(0.1, 0.0, 0.0, 0.05).theta_rad
    0.15000000000000002
    """
    u, v, w = (
        math.cos(alpha_rad) * math.cos(beta_rad),
        math.sin(beta_rad),
        math.sin(alpha_rad) * math.cos(beta_rad),
    )
    across = v * math.sin(phi_rad) + w * math.cos(phi_rad)  # of the velocity, in the vertical plane
    climb = math.sin(gamma_rad)
    rest = u * u - climb * climb
    theta = math.atan2(u * across + climb * math.sqrt(rest + across * across), rest)
    north = u * math.cos(theta) + across * math.sin(theta)
    east = v * math.cos(phi_rad) - w * math.sin(phi_rad)
    return Attitude(theta, -math.atan2(east, north), (u, v, w))


__all__ = ["Attitude", "straight_attitude"]
