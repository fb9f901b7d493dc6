"""Flights of three aircraft with known truth, for the corpus of `validation.guess_corpus`: a 3 kg model, a 1100 kg single, a jet.

The truth is a longitudinal simulation of its own: lift and moment linear in angle of attack, pitch rate and elevator, a parabolic
polar, constant thrust, the standard atmosphere, and Runge-Kutta steps of 2.5 ms. The elevator moves in a 3211 and two doublets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

G0: Final = 9.80665
"""Standard gravity [m/s2]."""
STEP_S: Final = 0.0025
"""Step of the simulation [s]."""
DURATION_S: Final = 26.0
"""Length of a record [s]."""


@dataclass(frozen=True)
class Craft:
    """An aircraft and its condition, SI: coefficients at zero, over alpha, q c/(2 V), elevator; size of the elevator's step."""

    mass: float
    inertia: float
    area: float
    chord: float
    speed: float
    altitude: float
    lift: tuple[float, float, float, float]
    moment: tuple[float, float, float, float]
    step_rad: float
    slow: float


CRAFT: Final = {
    "model": Craft(
        3.0, 0.19, 0.55, 0.26, 16.0, 310.0, (0.25, 4.9, 6.5, 0.40), (0.03, -0.8, -12.0, -0.95), 0.055, 1.0
    ),
    "single": Craft(
        1100.0,
        1825.0,
        16.2,
        1.49,
        58.0,
        1650.0,
        (0.31, 5.1, 3.9, 0.43),
        (0.02, -0.89, -12.4, -1.28),
        0.035,
        1.3,
    ),
    "jet": Craft(
        6000.0,
        31000.0,
        30.0,
        2.06,
        150.0,
        5200.0,
        (0.20, 5.4, 8.0, 0.40),
        (0.02, -1.1, -19.0, -1.45),
        0.03,
        1.6,
    ),
}
"""The three aircraft (round figures of the kind)."""


def air(altitude_m: Array) -> tuple[Array, Array]:
    """Density [kg/m3] and static pressure [Pa] of the standard atmosphere's troposphere (ISO 2533)."""
    ratio = 1.0 - 0.0065 * altitude_m / 288.15
    return 1.225 * ratio**4.255876, 101325.0 * ratio**5.255876


@cache
def flown(name: str) -> dict[str, Array]:
    """Exact channels (samples,) in SI at 400 Hz, with t_s."""
    c = CRAFT[name]
    alpha, elevator, thrust = _trimmed(c)
    t = STEP_S * np.arange(round(DURATION_S / STEP_S) + 1)
    command = elevator + c.step_rad * _sequence(t, c.slow)
    surface = np.empty_like(command)
    surface[0] = elevator
    for k in range(1, len(t)):  # a servo of 6 Hz
        surface[k] = surface[k - 1] + (1.0 - np.exp(-2.0 * np.pi * 6.0 * STEP_S)) * (
            command[k] - surface[k - 1]
        )
    states = np.empty((len(t), 5))
    states[0] = [c.speed * np.cos(alpha), c.speed * np.sin(alpha), 0.0, alpha, c.altitude]
    for k in range(len(t) - 1):
        middle = 0.5 * (surface[k] + surface[k + 1])
        k1 = _rates(c, states[k], surface[k], thrust)
        k2 = _rates(c, states[k] + 0.5 * STEP_S * k1, middle, thrust)
        k3 = _rates(c, states[k] + 0.5 * STEP_S * k2, middle, thrust)
        k4 = _rates(c, states[k] + STEP_S * k3, surface[k + 1], thrust)
        states[k + 1] = states[k] + STEP_S / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    u, w, q, theta, altitude = states.T
    forces = np.array([_forces(c, s, e, thrust) for s, e in zip(states, surface, strict=True)])
    speed, angle = np.hypot(u, w), np.arctan2(w, u)
    density, pressure = air(altitude)
    return {
        "t_s": t,
        "airspeed_m_s": speed,
        "alpha_rad": angle,
        "theta_rad": theta,
        "q_rad_s": q,
        "ax_m_s2": forces[:, 0],
        "az_m_s2": forces[:, 1],
        "elevator_rad": surface,
        "elevator_command_rad": command,
        "altitude_m": altitude,
        "density_kg_m3": density,
        "pressure_pa": pressure,
        "u_m_s": u,
        "w_m_s": w,
        "ias_m_s": speed * np.sqrt(density / 1.225),
        "climb_m_s": u * np.sin(theta) - w * np.cos(theta),
        "throttle": 0.6 + 0.0 * t,
        "norm_acc": -forces[:, 1] / G0 - 1.0,
    }


NOISE: Final = {
    "airspeed_m_s": 0.004,
    "ias_m_s": 0.004,
    "alpha_rad": 0.0015,
    "theta_rad": 0.0008,
    "q_rad_s": 0.003,
    "ax_m_s2": 0.06,
    "az_m_s2": 0.12,
    "elevator_rad": 0.0003,
    "elevator_command_rad": 0.0,
    "altitude_m": 0.15,
    "density_kg_m3": 0.0,
    "pressure_pa": 1.5,
    "u_m_s": 0.004,
    "w_m_s": 0.0015,
    "climb_m_s": 0.05,
    "throttle": 0.0,
    "norm_acc": 0.012,
}
"""Standard deviation of the noise [SI]; of speeds it is a share of the airspeed."""


def measured(name: str, channel: str, t_s: Array, seed: int) -> Array:
    """Noisy samples of a channel at some times."""
    truth = flown(name)
    rng = np.random.default_rng([seed, sorted(NOISE).index(channel)])
    scale = CRAFT[name].speed if channel in ("airspeed_m_s", "ias_m_s", "u_m_s", "w_m_s") else 1.0
    exact = np.interp(t_s, truth["t_s"], truth[channel])
    return np.asarray(exact + NOISE[channel] * scale * rng.standard_normal(len(t_s)))


def _sequence(t: Array, slow: float) -> Array:
    """3211 at 3 s and doublets at 12 and 18 s, of unit size; ``slow`` stretches the steps."""
    x = np.zeros_like(t)
    for start, steps in (
        (3.0, ((1, 0.9), (-1, 0.6), (1, 0.3), (-1, 0.3))),
        (12.0, ((1, 0.5), (-1, 0.5))),
        (18.0, ((-1, 0.8), (1, 0.8))),
    ):
        for sign, length in steps:
            x[(t >= start) & (t < start + slow * length)] = sign
            start += slow * length
    return x


def _forces(c: Craft, state: Array, elevator: float, thrust: float) -> Array:
    u, w, q, _, altitude = state
    speed, alpha = np.hypot(u, w), np.arctan2(w, u)
    given = np.array([1.0, alpha, q * c.chord / (2.0 * speed), elevator])
    lift, moment = float(np.dot(c.lift, given)), float(np.dot(c.moment, given))
    drag = 0.028 + 0.045 * lift**2
    pressure = 0.5 * float(air(np.asarray(altitude))[0]) * speed**2 * c.area
    x = pressure * (lift * np.sin(alpha) - drag * np.cos(alpha)) + thrust
    z = -pressure * (lift * np.cos(alpha) + drag * np.sin(alpha))
    return np.array([x / c.mass, z / c.mass, pressure * c.chord * moment / c.inertia])


def _rates(c: Craft, state: Array, elevator: float, thrust: float) -> Array:
    ax, az, turning = _forces(c, state, elevator, thrust)
    u, w, q, theta, _ = state
    return np.array(
        [
            ax - G0 * np.sin(theta) - q * w,
            az + G0 * np.cos(theta) + q * u,
            turning,
            q,
            u * np.sin(theta) - w * np.cos(theta),
        ]
    )


def _trimmed(c: Craft) -> tuple[float, float, float]:
    x = np.array([0.04, 0.0, 0.1 * c.mass * G0])
    scale = np.array([1e-6, 1e-6, 1e-3])

    def rest(x: Array) -> Array:
        state = np.array([c.speed * np.cos(x[0]), c.speed * np.sin(x[0]), 0.0, x[0], c.altitude])
        return _rates(c, state, float(x[1]), float(x[2]))[:3]

    for _ in range(20):
        slope = np.stack([(rest(x + d) - rest(x - d)) / (2.0 * d.sum()) for d in np.diag(scale)], axis=1)
        x = x - np.linalg.solve(slope, rest(x))
    return float(x[0]), float(x[1]), float(x[2])


__all__ = ["CRAFT", "NOISE", "air", "flown", "measured"]
