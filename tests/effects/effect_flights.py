"""Write a change into an aircraft, trim and fly it; and the same motion integrated independently."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import oracle

from airtruth.aircraft import write as writing
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.resolution import LinearPoint, resolved
from airtruth.physics.terms import Change
from airtruth.simulation.flight import Flight, Inputs, LateralInputs
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.resolution import linear_point
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.units import DEG

CHANNELS = ("alpha_rad", "q_rad_s", "az_m_s2", "airspeed_m_s", "theta_rad", "elevator_rad")


_POINTS: dict[tuple[str, Condition], LinearPoint] = {}


def changed(plane, change: Change, folder: Path, at: Condition | None = None, **options):
    """The aircraft with the change; ``at``: condition at which changes of the derivatives are counted."""
    if at is not None and change.derivatives:
        key = (plane.name, at)
        if key not in _POINTS:
            _POINTS[key] = linear_point(plane, at, motion=LATERAL if at.six_axes else LONGITUDINAL)
        change = resolved(change, _POINTS[key])
    return writing.changed(plane, change, folder / plane.name, **options)


def fly(plane, at: Condition, hz=200.0, amplitude=2.0 * DEG, duration=3.0, surface=None, step=0.5):
    """Noise-free channels of a doublet at 0.5 s, or of a replayed surface (deviation from trim)."""
    t = np.arange(round(duration * hz) + 1) / hz
    zero = np.zeros_like(t)
    command = sample(Manoeuvre("doublet", amplitude, start_s=0.5, step_s=step), t)
    start = trim(plane, at, 1.0 / hz)
    flight = Flight(plane, start, 1.0 / hz)
    flown = flight.fly(
        Inputs(command if surface is None else surface, zero, zero, surface=surface is not None)
    )
    return start, flown


def fly_lateral(plane, at: Condition, hz=200.0, amplitude=3.0 * DEG, duration=4.0):
    """Noise-free channels of an aileron doublet at 0.5 s and a rudder doublet of three times its size at 2 s, in six axes."""
    t = np.arange(round(duration * hz) + 1) / hz
    zero = np.zeros_like(t)
    aileron = sample(Manoeuvre("doublet", amplitude, start_s=0.5, step_s=0.4), t)
    rudder = sample(Manoeuvre("doublet", 3.0 * amplitude, start_s=2.0, step_s=0.4), t)
    start = trim(plane, at, 1.0 / hz)
    flown = Flight(plane, start, 1.0 / hz).fly(
        Inputs(zero, zero, zero, lateral=LateralInputs({"aileron": aileron, "rudder": rudder}))
    )
    return start, flown


def integrate(
    start,
    surface: np.ndarray,
    hz: float,
    more: Callable[[dict[str, float], np.ndarray], tuple[float, float]] = lambda signals, x: (0.0, 0.0),
    states: Callable[[dict[str, float], np.ndarray], Sequence[float]] = lambda signals, x: (),
    settled: Callable[[float], Sequence[float]] = lambda alpha: (),
) -> dict[str, np.ndarray]:
    """Rigid-body motion from the GTM's tables by RK4, with increments of CL and Cm added by hand.

    more : (signals, states) -> dCL, dCm; states : (signals, states) -> rates; settled : states at a trim.
    """
    tab, c = oracle.tables(), oracle.C

    def rates(x, elevator):
        u, w, q, theta, h = x[:5]
        v, alpha = np.hypot(u, w), np.arctan2(w, u)
        force = 0.5 * oracle.standard_atmosphere(h)[0] * v**2 * oracle.S
        base = oracle.accelerations(tab, u, w, q, theta, h, elevator, start.controls.throttle)
        signals = {"alpha": alpha, "elevator": elevator, "qhat": q * c / (2 * v), "alpha_dot_hat": 0.0}
        signals["qbar"] = force / oracle.S
        w_dot = base[1]
        for _ in range(6):  # a lift in alpha_dot changes alpha_dot
            signals["alpha_dot_hat"] = (u * w_dot - w * base[0]) / v**2 * c / (2 * v)
            lift, moment = more(signals, x[5:])
            w_dot = base[1] - force * lift / oracle.MASS
        q_dot = base[2] + force * c * moment / oracle.IYY
        climb = u * np.sin(theta) - w * np.cos(theta)
        az = base[4] - force * lift / oracle.MASS
        return np.array([base[0], w_dot, q_dot, q, climb, *states(signals, x[5:])]), az

    v, a = start.airspeed_m_s, start.alpha_rad
    x = np.array([v * np.cos(a), v * np.sin(a), 0.0, a, start.condition.altitude_m, *settled(a)])
    rows, dt = [], 1.0 / hz
    for k, now in enumerate(surface):
        slope, az = rates(x, now)
        rows.append([np.arctan2(x[1], x[0]), x[2], az])
        if k + 1 == len(surface):
            break
        middle = 0.5 * (now + surface[k + 1])
        k2, _ = rates(x + 0.5 * dt * slope, middle)
        k3, _ = rates(x + 0.5 * dt * k2, middle)
        k4, _ = rates(x + dt * k3, surface[k + 1])
        x = x + dt / 6.0 * (slope + 2.0 * k2 + 2.0 * k3 + k4)
    return dict(zip(("alpha_rad", "q_rad_s", "az_m_s2"), np.array(rows).T, strict=True))
