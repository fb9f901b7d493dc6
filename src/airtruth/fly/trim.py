"""Steady flight at a stated airspeed, altitude and flight-path angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import TrimError
from airtruth.fly.engine import Condition, Controls, Executive
from airtruth.units import DEG, FT, KT

Array = NDArray[np.float64]

TOLERANCE: Final = 1e-6
"""Largest residual that counts as trimmed, in u_dot, w_dot [m/s2] and q_dot [rad/s2].

The iteration goes on to `_AIM`; a model with a piston engine or rounded tables of its own stops earlier.
"""
_AIM: Final = 1e-11
_START: Final = ((4.0, 0.0, 0.4), (8.0, 0.0, 0.7), (1.0, 0.0, 0.2), (12.0, 0.0, 0.6))  # deg, rad, -
_STEPS: Final = np.array([1e-5, 1e-5, 1e-4])
_LARGEST_STEP: Final = np.array([4.0 * DEG, 0.2, 0.15])  # an engine's thrust is flat near full throttle
_ITERATIONS: Final = 40
_LIMITS: Final = (np.array([-20.0 * DEG, -1.2, 0.0]), np.array([40.0 * DEG, 1.2, 1.0]))


@dataclass(frozen=True)
class Trim:
    """An equilibrium of the aircraft in JSBSim.

    Attributes
    ----------
    condition : what was asked for.
    alpha_rad, elevator_rad : angle of attack and surface [rad].
    controls : elevator command and throttle.
    airspeed_m_s, density_kg_m3, mass_kg : true airspeed [m/s], air density [kg/m3], mass [kg].
    residual : largest of |u_dot|, |w_dot| [m/s2] and |q_dot| [rad/s2].
    """

    condition: Condition
    alpha_rad: float
    elevator_rad: float
    controls: Controls
    airspeed_m_s: float
    density_kg_m3: float
    mass_kg: float
    residual: float


def trim(
    aircraft: Aircraft, condition: Condition, dt_s: float = 1.0 / 200.0, tolerance: float = TOLERANCE
) -> Trim:
    """Solve u_dot = w_dot = q_dot = 0 for angle of attack, elevator and throttle by Newton's method.

    Parameters
    ----------
    aircraft, condition : what to trim and where.
    dt_s : simulation step of the executive that answers [s].
    tolerance : largest residual that counts as trimmed, in SI.

    Raises
    ------
    TrimError
        If the iteration ends outside the aircraft's limits or above the tolerance; the message says
        how close it came and at which limit.
    """
    executive = Executive(aircraft, dt_s)
    best: tuple[float, Array] | None = None
    for start in _START:
        x = np.array([start[0] * DEG, start[1], start[2]])
        x, size = _newton(executive, condition, x)
        if best is None or size < best[0]:
            best = (size, x)
        if size <= tolerance:
            break
    assert best is not None
    size, x = best
    if not size <= tolerance:
        raise TrimError(_explain(aircraft, condition, x, size, tolerance))
    return _result(executive, condition, x)


def _residual(executive: Executive, condition: Condition, x: Array) -> Array:
    executive = executive.renewed()
    executive.initialise(condition, float(x[0]), Controls(float(x[1]), float(x[2])))
    r = executive.respond()
    return np.array([r.u_dot_m_s2, r.w_dot_m_s2, r.q_dot_rad_s2])


def _newton(executive: Executive, condition: Condition, x: Array) -> tuple[Array, float]:
    """Newton with one-sided differences and step halving; piecewise-linear tables may need the halving."""
    low, high = _LIMITS
    r = _residual(executive, condition, x)
    for _ in range(_ITERATIONS):
        if not np.all(np.isfinite(r)) or np.max(np.abs(r)) <= _AIM:
            break
        steps = np.where(x + _STEPS > high, -_STEPS, _STEPS)
        jacobian = np.column_stack(
            [
                (_residual(executive, condition, x + h) - r) / s
                for h, s in zip(np.diag(steps), steps, strict=True)
            ]
        )
        change = np.linalg.lstsq(jacobian, -r, rcond=1e-12)[0]
        change /= max(1.0, float(np.max(np.abs(change) / _LARGEST_STEP)))
        for _ in range(8):
            tried = np.clip(x + change, low, high)
            r_tried = _residual(executive, condition, tried)
            if np.max(np.abs(r_tried)) < np.max(np.abs(r)):
                break
            change = change / 2.0
        else:
            break
        x, r = tried, r_tried
    return x, float(np.max(np.abs(r)))


def _result(executive: Executive, condition: Condition, x: Array) -> Trim:
    executive = executive.renewed()
    executive.initialise(condition, float(x[0]), Controls(float(x[1]), float(x[2])))
    at = executive.respond()
    airspeed, density, mass = executive.surroundings()
    return Trim(
        condition=condition,
        alpha_rad=float(x[0]),
        elevator_rad=at.elevator_rad,
        controls=Controls(float(x[1]), float(x[2])),
        airspeed_m_s=airspeed,
        density_kg_m3=density,
        mass_kg=mass,
        residual=max(abs(at.u_dot_m_s2), abs(at.w_dot_m_s2), abs(at.q_dot_rad_s2)),
    )


def _explain(aircraft: Aircraft, condition: Condition, x: Array, size: float, tolerance: float) -> str:
    names = ("angle of attack", "elevator command", "throttle")
    at = [n for n, v, lo, hi in zip(names, x, *_LIMITS, strict=True) if v <= lo or v >= hi]
    cause = f"; it ended at the limit of {' and '.join(at)}" if at else ""
    return (
        f"{aircraft.name} cannot be trimmed at EAS {condition.eas_m_s / KT:.1f} kt, {condition.altitude_m / FT:.0f} ft, "
        f"flight path {condition.gamma_rad / DEG:.1f} deg: residual {size:.2e} (allowed {tolerance:.0e} in SI) at "
        f"alpha {x[0] / DEG:.1f} deg, elevator {x[1] / DEG:.1f} deg, throttle {x[2]:.2f}{cause}. "
        "Choose another speed, altitude or flight path."
    )
