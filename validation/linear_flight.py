"""Flight records of the linear short period, exact to rounding, for tests, benchmarks and studies.

The elevator is a 5 Hz first-order servo behind a held command; air moves in Dryden gusts; the dynamic
pressure is constant, so that the model of the estimators is true. Everything is stepped by the matrix
exponential of the whole system, inputs held (command) or linear (gusts) over a step. With ``acting`` the
dynamic pressure follows the u gust in every term instead, in fourth-order Runge-Kutta steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.physics import dryden
from airtruth.physics.short_period import Scale, scale, system
from airtruth.units import DEG, G0

# Derivatives printed as true in the paper (table 1); GTM geometry and condition (NASA GTM_DesignSim).
THETA = np.array([4.793, 30.79, 0.480, -1.789, -41.41, -1.787])
AIRSPEED_M_S = 42.85
DENSITY_KG_M3 = 0.9931
SERVO_RAD_S = 2.0 * np.pi * 5.0
# One sigma of the GTM's sensors: alpha, q, az, elevator.
NOISE = (0.031 * DEG, 0.3857 * DEG, 0.0082 * G0, 0.01 * DEG)
# GTM's figures for light gusts at 7000 ft: sigma_u, sigma_w [m/s], Lu, Lw [m].
LIGHT = (1.166, 0.812, 911.0, 840.0)


@dataclass(frozen=True)
class Constants:
    wing_area_m2: float = 0.54830
    chord_m: float = 0.27898
    mass_kg: float = 26.195
    inertia_yy_kg_m2: float = 6.314


GTM = Constants()


def gtm_scale(shape: tuple[int, ...] = ()) -> Scale:
    return scale(
        GTM.wing_area_m2,
        GTM.chord_m,
        GTM.mass_kg,
        GTM.inertia_yy_kg_m2,
        np.full(shape, AIRSPEED_M_S),
        np.full(shape, DENSITY_KG_M3),
    )


def doublet(t_s, start_s=1.0, step_s=0.5):
    """One up and down, from a slightly early clock so that a step belongs to the sample it falls on."""
    t = t_s + 1e-9
    up = (t >= start_s) & (t < start_s + step_s)
    down = (t >= start_s + step_s) & (t < start_s + 2.0 * step_s)
    return up.astype(float) - down.astype(float)


def fly(
    runs=1,
    rate_hz=50,
    duration_s=5.0,
    theta=THETA,
    amplitude_rad=2.0 * DEG,
    delay_s=0.0,
    gust=0.0,
    u_gust=True,
    noise=0.0,
    seed=0,
    shape=doublet,
    alpha_trim_rad=5.56 * DEG,
    first_s=0.0,
    acting=False,
    airspeed_std_m_s=None,
    wind=None,
) -> Batch:
    """Runs of a record; ``gust`` times the light level, ``noise`` times the sensors' own.

    ``first_s`` cuts the start of the record away, so that it begins in motion. ``acting``: the pressure
    follows the gust. ``airspeed_std_m_s``: the airspeed is measured, with this noise; None logs its mean.
    ``wind``: t [s] -> head wind [m/s] that builds up besides the gusts; it needs ``acting`` and is measured.
    """
    fine = 200 if 200 % rate_hz == 0 else rate_hz
    dt = 1.0 / fine
    t = np.arange(round(duration_s * fine)) * dt
    s = gtm_scale()
    rng = np.random.default_rng(seed)
    air = _gusts(rng, runs, t.size, dt, gust, u_gust)
    if wind is not None:
        air[:, :, 0] += wind(t)
        airspeed_std_m_s = airspeed_std_m_s or 0.0
    command = np.broadcast_to(amplitude_rad * shape(t - delay_s), (runs, t.size))
    state = _stepped(theta, s, command, air, dt)
    q, de = state[:, :, 1], state[:, :, 2]
    if acting:
        alpha, q, az = _acting(theta, s, de, air, dt)
    else:
        alpha = state[:, :, 0] + air[:, :, 1] / AIRSPEED_M_S
        force = theta[0] * alpha + s.half_chord_time * theta[1] * q + theta[2] * de
        az = -s.normal * force - G0 * (1.0 + 2.0 * air[:, :, 0] / AIRSPEED_M_S)
    sigma = [noise * n for n in NOISE]
    signals = [alpha + alpha_trim_rad, q, az, de + 0.1 * DEG]
    alpha, q, az, de = (x + n * rng.normal(size=x.shape) for x, n in zip(signals, sigma, strict=True))
    airspeed = np.full_like(alpha, AIRSPEED_M_S)
    if airspeed_std_m_s is not None:
        # a stream of its own: the other channels do not depend on it
        airspeed += air[:, :, 0] + airspeed_std_m_s * np.random.default_rng([seed, 1]).normal(
            size=alpha.shape
        )
    keep = slice(round(first_s * fine), None, fine // rate_hz)
    channels = {
        "airspeed_m_s": airspeed,
        "alpha_rad": alpha,
        "q_rad_s": q,
        "az_m_s2": az,
        "elevator_rad": de,
        "elevator_command_rad": amplitude_rad * shape(t) + np.full_like(alpha, 0.1 * DEG),
        "density_kg_m3": np.full_like(alpha, DENSITY_KG_M3),
    }
    channels = {name: np.ascontiguousarray(values[:, keep]) for name, values in channels.items()}
    t = np.tile(t[keep] - t[keep][0], (runs, 1))
    return Batch(tuple(f"run-{i:04d}" for i in range(runs)), 1.0 / rate_hz, t, channels)


def _gusts(rng, runs, samples, dt, gust, u_gust):
    """Gusts u and w [m/s], (runs, samples, 2), from rest."""
    if gust <= 0.0:
        return np.zeros((runs, samples, 2))
    model = dryden.Dryden(
        LIGHT[0] * gust * u_gust + 1e-9, LIGHT[1] * gust, LIGHT[2], LIGHT[3], AIRSPEED_M_S, None
    )
    discrete = dryden.discretise(model, dt)
    return dryden.simulate(discrete, rng.normal(size=(runs, samples, discrete.phi.shape[-1])), "rest")


def _stepped(theta, s, command, air, dt):
    """States alpha of the path, q and elevator, (runs, samples, 3), of the linear model."""
    a, b = system(theta, s)
    matrix = np.zeros((3, 3))
    matrix[:2, :2], matrix[:2, 2], matrix[2, 2] = a, b, -SERVO_RAD_S
    inputs = np.zeros((3, 3))  # command, alpha of the gust, u gust
    inputs[2, 0] = SERVO_RAD_S
    inputs[:2, 1] = a[:, 0]
    inputs[0, 2] = -2.0 * G0 / AIRSPEED_M_S**2
    big = np.zeros((9, 9))
    big[:3, :3], big[:3, 3:6], big[3:6, 6:] = matrix * dt, inputs * dt, np.eye(3)
    exponential = expm(big)
    step, held, late = exponential[:3, :3], exponential[:3, 3:6], exponential[:3, 6:]
    drive = np.stack([command, air[:, :, 1] / AIRSPEED_M_S, air[:, :, 0]], axis=2)
    state = np.zeros((*command.shape, 3))
    for k in range(command.shape[1] - 1):
        now, then = drive[:, k], drive[:, k + 1].copy()
        then[:, 0] = now[:, 0]
        state[:, k + 1] = state[:, k] @ step.T + now @ (held - late).T + then @ late.T
    return state


def _acting(theta, s, de, air, dt):
    """alpha at the vane, q and az with dynamic pressure (V + u)^2 rho/2 in every term, elevator given.

    The elevator between samples is that of the servo: its value in the middle of a step lies
    exp(-dt/2 tau) of the way back from the command, which follows from the ends of the step.
    """
    rho = np.exp(-SERVO_RAD_S * dt)
    command = (de[:, 1:] - rho * de[:, :-1]) / (1.0 - rho)
    middle = command + np.sqrt(rho) * (de[:, :-1] - command)

    def coefficients(x, u, w, elevator):
        v = AIRSPEED_M_S + u
        alpha, half = x[0] + w / v, GTM.chord_m / (2.0 * v) * x[1]
        return (
            (v / AIRSPEED_M_S) ** 2,
            theta[0] * alpha + theta[1] * half + theta[2] * elevator,
            theta[3] * alpha + theta[4] * half + theta[5] * elevator,
        )

    def rate(x, u, w, elevator):
        ratio, lift, moment = coefficients(x, u, w, elevator)
        surplus = ratio * (G0 + s.normal * lift) - G0
        return np.stack([x[1] - surplus / AIRSPEED_M_S, ratio * s.moment * moment])

    runs, samples = de.shape
    x = np.zeros((2, runs, samples))
    for k in range(samples - 1):
        now, then = (air[:, k, 0], air[:, k, 1]), (air[:, k + 1, 0], air[:, k + 1, 1])
        between = tuple(0.5 * (a + b) for a, b in zip(now, then, strict=True))
        k1 = rate(x[:, :, k], *now, de[:, k])
        k2 = rate(x[:, :, k] + 0.5 * dt * k1, *between, middle[:, k])
        k3 = rate(x[:, :, k] + 0.5 * dt * k2, *between, middle[:, k])
        k4 = rate(x[:, :, k] + dt * k3, *then, de[:, k + 1])
        x[:, :, k + 1] = x[:, :, k] + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    ratio, lift, _ = coefficients(x, air[:, :, 0], air[:, :, 1], de)
    return x[0] + air[:, :, 1] / (AIRSPEED_M_S + air[:, :, 0]), x[1], -ratio * (G0 + s.normal * lift)


def as_log(*parts: Batch) -> FlightLog:
    """Batches as one log, runs renamed so that no two share a name."""
    names = tuple(f"b{i}-{name}" for i, part in enumerate(parts) for name in part.run_ids)
    lengths = [part.t_s.shape[1] for part in parts for _ in part.run_ids]
    return FlightLog(
        metadata={},
        run_ids=names,
        offsets=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        t_s=np.concatenate([part.t_s.ravel() for part in parts]),
        channels={
            name: np.concatenate([part.channels[name].ravel() for part in parts])
            for name in parts[0].channels
        },
    )


def with_channel(batch: Batch, name: str, values) -> Batch:
    return replace(batch, channels={**batch.channels, name: np.ascontiguousarray(values)})
