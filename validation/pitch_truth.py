"""Independent longitudinal simulation: a rigid body, linear lift and moment, a parabolic drag polar and Dryden gusts.

The steps are Runge-Kutta steps of 2.5 ms, of all records of a flight at once. It shares nothing with the
simulation of airtruth or with the model of its tracer. `validation.small_aircraft` and `validation.jet_records` fly it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.units import G0

Array = NDArray[np.float64]

STEP_S: Final = 0.0025
"""Step of the simulation [s]."""
_WARM: Final = 4000
"""Steps of the gusts before a record."""


@dataclass(frozen=True)
class Body:
    """An aircraft in the air of its flights.

    Attributes
    ----------
    mass_kg, inertia_kg_m2, area_m2, chord_m : of the aircraft.
    density_kg_m3, airspeed_m_s : air density, and trim.
    lift, moment : coefficient at zero, and slopes over alpha, q c/(2 V) and elevator [1/rad].
    drag : coefficient at zero lift, and over the lift coefficient squared.
    effectiveness : of the elevator [-]; fade : share that it loses over its deflection [1/rad].
    moment_break : change of the slope of the moment [1/rad] above an angle of attack [rad].
    """

    mass_kg: float
    inertia_kg_m2: float
    area_m2: float
    chord_m: float
    density_kg_m3: float
    airspeed_m_s: float
    lift: tuple[float, ...]
    moment: tuple[float, ...]
    drag: tuple[float, float]
    effectiveness: float = 1.0
    fade: float = 0.0
    moment_break: tuple[float, float] = (0.0, 0.0)


def flown(body: Body, state: Array, elevator: Array, thrust: float, gusts: Array) -> tuple[Array, Array]:
    """States u, w, q, theta and altitude in SI, and specific forces along x and z, q', airspeed and angle of attack.

    Parameters
    ----------
    state : (5, records) at the start; elevator : (records, steps) acting [rad]; thrust : [N].
    gusts : (steps, 2, records) along x and z [m/s].

    Returns
    -------
    (steps, 5, records) each.
    """
    steps = elevator.shape[1]
    states, forces = np.empty((steps, 5, state.shape[1])), np.empty((steps, 5, state.shape[1]))
    for k in range(steps):
        states[k], forces[k] = state, _forces(body, state, elevator[:, k], thrust, gusts[k])
        if k < steps - 1:
            state = _stepped(body, state, elevator[:, k : k + 2], thrust, gusts[k : k + 2])
    return states, forces


def _forces(body: Body, state: Array, elevator: Array, thrust: Array | float, gust: Array) -> Array:
    """(5, records) specific forces along x and z, q', airspeed and angle of attack."""
    u, w, q = state[0] + gust[0], state[1] + gust[1], state[2]
    airspeed, alpha = np.hypot(u, w), np.arctan2(w, u)
    elevator = body.effectiveness * elevator
    elevator = elevator * (1.0 - body.fade * np.abs(elevator))
    given = np.stack(
        [np.ones_like(alpha), alpha, q * body.chord_m / (2.0 * airspeed), elevator + 0.0 * alpha]
    )
    lift, moment = np.array(body.lift) @ given, np.array(body.moment) @ given
    slope, angle = body.moment_break
    moment = moment + slope * np.maximum(alpha - angle, 0.0)
    drag = body.drag[0] + body.drag[1] * lift**2
    pressure = 0.5 * body.density_kg_m3 * airspeed**2 * body.area_m2
    x = pressure * (lift * np.sin(alpha) - drag * np.cos(alpha)) + thrust
    z = -pressure * (lift * np.cos(alpha) + drag * np.sin(alpha))
    turning = pressure * body.chord_m * moment / body.inertia_kg_m2
    return np.stack([x / body.mass_kg, z / body.mass_kg, turning, airspeed, alpha])


def _rates(body: Body, state: Array, elevator: Array, thrust: Array | float, gust: Array) -> Array:
    u, w, q, theta = state[:4]
    ax, az, q_dot = _forces(body, state, elevator, thrust, gust)[:3]
    climb = u * np.sin(theta) - w * np.cos(theta)
    return np.stack([ax - G0 * np.sin(theta) - q * w, az + G0 * np.cos(theta) + q * u, q_dot, q, climb])


def _stepped(body: Body, state: Array, elevator: Array, thrust: float, gust: Array) -> Array:
    """The state after a step of the classical Runge-Kutta method; inputs are linear over it."""
    middle, between = elevator.mean(axis=1), gust.mean(axis=0)
    k1 = _rates(body, state, elevator[:, 0], thrust, gust[0])
    k2 = _rates(body, state + 0.5 * STEP_S * k1, middle, thrust, between)
    k3 = _rates(body, state + 0.5 * STEP_S * k2, middle, thrust, between)
    k4 = _rates(body, state + STEP_S * k3, elevator[:, 1], thrust, gust[1])
    return np.asarray(state + STEP_S / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


def trimmed(body: Body) -> tuple[float, float, float]:
    """Angle of attack [rad], elevator [rad] and thrust [N] of level flight, by Newton's method."""
    speed = body.airspeed_m_s
    scale = np.array([1.0, 1.0, body.mass_kg * G0])
    x = np.array([0.04, 0.0, 0.07])

    def residual(x: Array) -> Array:
        state = np.array([speed * np.cos(x[0]), speed * np.sin(x[0]), 0.0, x[0], 0.0])
        return _rates(body, state, np.asarray(x[1]), float(x[2] * scale[2]), np.zeros(2))[:3]

    for _ in range(20):
        jacobian = np.stack([(residual(x + d) - residual(x - d)) / 2e-6 for d in 1e-6 * np.eye(3)], axis=1)
        x = x - np.linalg.solve(jacobian, residual(x))
    return float(x[0]), float(x[1]), float(x[2] * scale[2])


def gusts(
    rng: np.random.Generator, shape: tuple[int, int], std: float, lengths_m: tuple[float, float], speed: float
) -> Array:
    """(steps, 2, records) gusts along x and z [m/s] of Dryden's spectra (MIL-F-8785C, section 3.7.1.2), by Euler steps.

    Parameters
    ----------
    shape : steps and records; std : of the vertical gust [m/s], that of the horizontal one is 1.2 times as large.
    lengths_m : scales of both [m]; speed : airspeed [m/s].
    """
    steps, records = shape
    made = np.zeros((steps, 2, records))
    if std == 0.0:
        return made
    white = rng.standard_normal((steps + _WARM, 2, records)) / np.sqrt(STEP_S)
    time_u, time_w = (length / speed for length in lengths_m)
    u, x, rate = (np.zeros(records) for _ in range(3))
    for k in range(steps + _WARM):
        u = u + STEP_S * (-u / time_u + 1.2 * std * np.sqrt(2.0 / time_u) * white[k, 0])
        x, rate = x + STEP_S * rate, rate + STEP_S * (-x / time_w**2 - 2.0 * rate / time_w + white[k, 1])
        if k >= _WARM:
            made[k - _WARM] = u, std * time_w**-1.5 * (x + np.sqrt(3.0) * time_w * rate)
    return made
