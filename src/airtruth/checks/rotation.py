"""Rates of attitude and flow angles in general motion, of which the wings-level ones are the special case.

Body axes, air at rest, specific forces ax, ay, az (B. L. Stevens and F. L. Lewis, *Aircraft Control and Simulation*, 2nd ed.,
2003; with u, v, w in polar form):

    phi'   = p + (q sin phi + r cos phi) tan theta
    theta' = q cos phi - r sin phi
    psi'   = (q sin phi + r cos phi)/cos theta
    alpha' = q - (p cos a + r sin a) tan b
             + (az cos a - ax sin a + g (cos a cos theta cos phi + sin a sin theta))/(V cos b)
    beta'  = p sin a - r cos a + (ay + g cos theta sin phi - V' sin b)/(V cos b)

All angles are in rad, rates in rad/s, specific forces in m/s2; arrays broadcast.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK
from airtruth.checks.spectra import integral
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.units import G0

Array = NDArray[np.float64]
Channels = Mapping[str, Array]
(_PITCH,), (_ROLL, _YAW) = LONGITUDINAL.gyros, LATERAL.gyros


def bank_coupling(q: Array, r: Array, phi: Array, theta: Array) -> Array:
    """Rate of bank less the roll rate, (q sin phi + r cos phi) tan theta [rad/s]."""
    return np.asarray(heading_rate(q, r, phi, theta) * np.sin(theta))


def heading_rate(q: Array, r: Array, phi: Array, theta: Array) -> Array:
    """Rate of heading [rad/s]."""
    return np.asarray((q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta))


def pitch_coupling(q: Array, r: Array, phi: Array) -> Array:
    """Rate of pitch attitude less the pitch rate [rad/s]."""
    return np.asarray(q * (np.cos(phi) - 1.0) - r * np.sin(phi))


def alpha_coupling(p: Array, r: Array, alpha: Array, beta: Array) -> Array:
    """Part of the rate of alpha that roll and yaw make, -(p cos a + r sin a) tan b [rad/s]."""
    return np.asarray(-(p * np.cos(alpha) + r * np.sin(alpha)) * np.tan(beta))


def alpha_gravity(alpha: Array, theta: Array, phi: Array) -> Array:
    """Gravity across the path in a bank less that with level wings, g cos a cos theta (cos phi - 1) [m/s2]."""
    return np.asarray(G0 * np.cos(alpha) * np.cos(theta) * (np.cos(phi) - 1.0))


def sideslip_turn(p: Array, r: Array, alpha: Array) -> Array:
    """Part of the rate of beta that rotation makes, p sin a - r cos a [rad/s]."""
    return np.asarray(p * np.sin(alpha) - r * np.cos(alpha))


def side_gravity(theta: Array, phi: Array) -> Array:
    """Gravity along body y, g cos theta sin phi [m/s2]."""
    return np.asarray(G0 * np.cos(theta) * np.sin(phi))


def across_flow(az: Array, ax: Array | float, alpha: Array, theta: Array) -> Array:
    """Specific force and gravity across the path, az cos a - ax sin a + g cos(theta - a) [m/s2]."""
    return np.asarray(az * np.cos(alpha) - ax * np.sin(alpha) + G0 * np.cos(theta - alpha))


def given(c: Channels, name: str) -> Array:
    """A channel of a log with roll and yaw, or zero where the log has none."""
    return c[name] if name in c else np.zeros_like(c[_ROLL])


def rates(c: Channels) -> tuple[Array, Array, Array, Array, Array]:
    """p, q, r, phi, theta of a log with roll and yaw; zero where the log has none."""
    p, q, r, phi, theta = (given(c, n) for n in (_ROLL, _PITCH, _YAW, BANK, "theta_rad"))
    return p, q, r, phi, theta


def pitched(c: Channels, dt_s: float) -> Array:
    """Change of pitch attitude by the rates [rad]; wings level where no bank is known."""
    q = c[_PITCH]
    turned = integral(q, dt_s)
    if BANK not in c or _YAW not in c:
        return turned
    return turned + integral(pitch_coupling(q, c[_YAW], c[BANK]), dt_s)


def banked(c: Channels, dt_s: float) -> Array:
    """Change of bank by the rates [rad]."""
    p, q, r, phi, theta = rates(c)
    return integral(p + bank_coupling(q, r, phi, theta), dt_s)


def headed(c: Channels, dt_s: float) -> Array:
    """Change of heading by the rates [rad]."""
    _, q, r, phi, theta = rates(c)
    return integral(heading_rate(q, r, phi, theta), dt_s)


__all__ = [
    "across_flow",
    "alpha_coupling",
    "alpha_gravity",
    "bank_coupling",
    "banked",
    "given",
    "headed",
    "heading_rate",
    "pitch_coupling",
    "pitched",
    "rates",
    "side_gravity",
    "sideslip_turn",
]
