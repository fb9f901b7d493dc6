"""Angles of the attitude from a quaternion, and of the air from a velocity in body axes."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_NORM: Final = 0.5
"""Least norm of a quaternion of an attitude [-], 1 by definition (judgement: rounding of an integer keeps far more)."""


def euler_angles(
    quaternion: Array,
    *,
    frame: Literal["ned", "enu"] = "ned",
    rotates: Literal["body_to_earth", "earth_to_body"] = "body_to_earth",
) -> tuple[Array, Array, Array]:
    """Roll phi, pitch theta and heading psi [rad] of unit quaternions.

    With the rotation matrix R from body axes (forward, right, down) to north, east, down, tan phi = R32/R33, sin theta =
    -R31 and tan psi = R21/R11 (B. L. Stevens and F. L. Lewis, *Aircraft Control and Simulation*, 2nd ed., 2003). A
    quaternion and its negative have the same angles.

    Parameters
    ----------
    quaternion : (4, samples) scalar first; it is normalised. One whose norm is below `LEAST_NORM` gives NaN.
    frame : "ned" for the axes above; "enu" for body axes forward, left, up, and east, north, up.
    rotates : "earth_to_body" for the conjugate.

    Returns
    -------
    phi and psi within -pi and pi, theta within -pi/2 and pi/2; each (samples,).

    Examples
    --------
    >>> half = np.deg2rad(5.0)
    >>> phi, theta, psi = euler_angles(np.array([[np.cos(half)], [0.0], [np.sin(half)], [0.0]]))
    >>> np.rad2deg(theta).round(12).tolist()
    [10.0]
    """
    norm = np.sqrt((quaternion**2).sum(axis=0))
    with np.errstate(invalid="ignore", divide="ignore"):
        w, x, y, z = np.where(norm >= LEAST_NORM, quaternion / norm, np.nan)
    if rotates == "earth_to_body":
        x, y, z = -x, -y, -z
    phi = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    theta = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    psi = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    if frame == "enu":  # body y and z point the other way, and the heading counts from north, clockwise
        theta, psi = -theta, np.remainder(1.5 * np.pi - psi, 2.0 * np.pi) - np.pi
    return phi, theta, psi


def air_angles(u_m_s: Array, v_m_s: Array, w_m_s: Array) -> tuple[Array, Array, Array]:
    """Airspeed [m/s], angle of attack and angle of sideslip [rad] of a velocity relative to the air in body axes.

    V = sqrt(u^2 + v^2 + w^2), tan alpha = w/u, sin beta = v/V (Stevens and Lewis).

    Parameters
    ----------
    u_m_s, v_m_s, w_m_s : (samples,) components forward, to the right and down [m/s].

    Examples
    --------
    >>> speed, alpha, beta = air_angles(np.array([12.0]), np.array([5.0]), np.array([0.0]))
    >>> speed.tolist(), alpha.tolist(), np.sin(beta).round(6).tolist()
    ([13.0], [0.0], [0.384615])
    """
    speed = np.sqrt(u_m_s**2 + v_m_s**2 + w_m_s**2)
    with np.errstate(invalid="ignore", divide="ignore"):  # an airspeed of zero is refused by name later
        beta = np.where(speed > 0.0, np.arctan2(v_m_s, np.hypot(u_m_s, w_m_s)), 0.0)
    return speed, np.arctan2(w_m_s, u_m_s), beta


def continuous(angle: Array, turn: float = 2.0 * np.pi) -> Array:
    """An angle without its jumps of a turn; one that jumps then counts from the turn of its median.

    Parameters
    ----------
    angle : (samples,) in any unit, finite. turn : a turn in this unit.

    Examples
    --------
    >>> continuous(np.array([1.0, 0.0, 359.0, 358.0, 359.0]), 360.0).tolist()
    [1.0, 0.0, -1.0, -2.0, -1.0]
    """
    unwrapped = np.unwrap(angle, period=turn)
    if np.array_equal(unwrapped, angle):
        return angle
    return np.asarray(unwrapped - turn * np.round(np.median(unwrapped) / turn))


__all__ = ["LEAST_NORM", "air_angles", "continuous", "euler_angles"]
