"""Records with known sensor errors for `studies.check_study`: a plant, gusts and sensors of their own.

The plant integrates u, w, q and theta of a rigid aircraft at 500 Hz (classical Runge-Kutta). Aircraft from a model of
0.3 m chord to a transport of 6 m are drawn at random. Nothing of `airtruth.checks` or of `airtruth.physics.sensors`
enters, so that a common mistake cannot cancel.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.logs.flight_log import FlightLog

Array = NDArray[np.float64]

G = 9.80665
FINE_S = 0.002
RATES_HZ = (20.0, 25.0, 50.0, 100.0)
MANOEUVRES = ("3211", "doublet", "multisine")
GUSTS = {"calm": 0.05, "light": 0.3, "moderate": 1.0}
"""Standard deviation of the vertical gust as a share of a MIL-F-8785C light gust of 1.5 m/s [-]."""
NOISE = {
    "alpha_rad": 8e-4,
    "q_rad_s": 1.5e-3,
    "theta_rad": 6e-4,
    "az_m_s2": 0.05,
    "ax_m_s2": 0.02,
    "airspeed_m_s": 0.1,
    "elevator_rad": 4e-4,
}
"""Standard deviations of white noise of ordinary flight-test instruments [SI]."""


@dataclass(frozen=True)
class Plant:
    """Short-period figures of one aircraft about its trim [SI]."""

    chord_m: float
    speed_m_s: float
    alpha_rad: float
    lift_1_s: float
    lift_elevator_1_s: float
    stiffness_1_s2: float
    damping_1_s: float
    elevator_1_s2: float
    frequency_rad_s: float


@dataclass(frozen=True)
class Flight:
    """True motion at `FINE_S`, one array per channel, q' included."""

    plant: Plant
    channels: dict[str, Array]


@dataclass(frozen=True)
class Trial:
    """One record and its truth."""

    log: FlightLog
    errors: dict[str, float]
    plant: Plant
    label: str = ""
    channels: dict[str, Array] = field(default_factory=dict)


def plant(rng: np.random.Generator, chord_m: float | None = None) -> Plant:
    """Draw an aircraft: speed and frequency follow the chord, as those of real aircraft do."""
    chord = float(chord_m or np.exp(rng.uniform(np.log(0.3), np.log(6.0))))
    speed = 40.0 * (chord / 0.3) ** 0.5 * rng.uniform(0.8, 1.25)
    frequency = 6.5 * (chord / 0.3) ** -0.42 * rng.uniform(0.8, 1.25)
    damping_ratio = rng.uniform(0.35, 0.8)
    lift = frequency * rng.uniform(0.3, 0.55)
    damping = max(2.0 * damping_ratio * frequency - lift, 0.3 * lift)
    stiffness = max(frequency**2 - damping * lift, 0.2 * frequency**2)
    return Plant(
        chord_m=chord,
        speed_m_s=speed,
        alpha_rad=rng.uniform(0.02, 0.12),
        lift_1_s=lift,
        lift_elevator_1_s=rng.uniform(0.03, 0.1) * lift,
        stiffness_1_s2=stiffness,
        damping_1_s=damping,
        elevator_1_s2=stiffness * rng.uniform(0.8, 1.6),
        frequency_rad_s=frequency,
    )


def elevator(
    kind: str, one: Plant, duration_s: float, amplitude_rad: float, rng: np.random.Generator
) -> Array:
    """Surface deflection at `FINE_S` behind a servo of 20 rad/s, timed for the short period of the aircraft."""
    t = np.arange(round(duration_s / FINE_S)) * FINE_S
    command = np.zeros_like(t)
    step = 1.6 / one.frequency_rad_s * rng.uniform(0.7, 1.3)
    if kind == "multisine":
        low, high = 0.3 * one.frequency_rad_s, 2.5 * one.frequency_rad_s
        for frequency in np.linspace(low, high, 8):
            command += 0.35 * np.sin(frequency * (t - 1.0) + rng.uniform(0.0, 2.0 * np.pi))
        ramp = np.clip((t - 1.0) / 0.5, 0.0, 1.0) * np.clip((duration_s - 0.5 - t) / 0.5, 0.0, 1.0)
        command *= ramp
    else:
        edges = np.cumsum([1.0, 3.0 * step, 2.0 * step, step, step] if kind == "3211" else [1.0, step, step])
        for i, (a, b) in enumerate(pairwise(edges)):
            command[(t >= a) & (t < b)] = (-1.0) ** i
    return amplitude_rad * lagged(command, 0.05)


@njit(cache=True)
def _rates(s: Array, surface: float, ug: float, wg: float, f: Array) -> tuple[Array, Array]:
    theta, q, u, w = s[0], s[1], s[2], s[3]
    speed0, alpha0, lift, lift_elevator, stiffness, damping, power = f[0], f[1], f[2], f[3], f[4], f[5], f[6]
    ua, wa = u - ug, w - wg
    speed = np.sqrt(ua * ua + wa * wa)
    alpha = np.arctan2(wa, ua)
    ratio = (speed / speed0) ** 2
    load = lift * speed0 * (alpha - alpha0) + lift_elevator * speed0 * surface
    az = -ratio * (9.80665 * np.cos(alpha0) + load)
    ax = ratio * 9.80665 * np.sin(alpha0) - 0.02 * (speed - speed0) - 0.05 * load * (alpha - alpha0)
    out = np.empty(4)
    out[0] = q
    out[1] = ratio * (-stiffness * (alpha - alpha0) - power * surface) - speed / speed0 * damping * q
    out[2] = ax - 9.80665 * np.sin(theta) - q * w
    out[3] = az + 9.80665 * np.cos(theta) + q * u
    read = np.array([theta, q, out[1], ax, az, alpha, speed])
    return out, read


@njit(cache=True)
def _integrate(surface: Array, ug: Array, wg: Array, f: Array, dt: float) -> Array:
    n = len(surface)
    s = np.array([f[1], 0.0, f[0] * np.cos(f[1]), f[0] * np.sin(f[1])])
    result = np.empty((7, n))
    for k in range(n):
        one, read = _rates(s, surface[k], ug[k], wg[k], f)
        result[:, k] = read
        j = min(k + 1, n - 1)
        de, du, dw = 0.5 * (surface[k] + surface[j]), 0.5 * (ug[k] + ug[j]), 0.5 * (wg[k] + wg[j])
        two = _rates(s + 0.5 * dt * one, de, du, dw, f)[0]
        three = _rates(s + 0.5 * dt * two, de, du, dw, f)[0]
        four = _rates(s + dt * three, surface[j], ug[j], wg[j], f)[0]
        s = s + dt / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    return result


def gust(sigma: float, length_m: float, speed_m_s: float, samples: int, rng: np.random.Generator) -> Array:
    """First-order Gauss-Markov gust in equilibrium [m/s]."""
    pole = np.exp(-FINE_S * speed_m_s / length_m)
    drive = sigma * np.sqrt(1.0 - pole**2) * rng.standard_normal(samples)
    drive[0] = sigma * rng.standard_normal()
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], [1.0, -pole], drive))


def fly(
    one: Plant, kind: str, duration_s: float, amplitude_rad: float, gust_m_s: float, rng: np.random.Generator
) -> Flight:
    """Fly one manoeuvre in gusts."""
    surface = elevator(kind, one, duration_s, amplitude_rad, rng)
    n = len(surface)
    length = np.clip(60.0 * one.chord_m, 60.0, 530.0)
    wg, ug = (gust(gust_m_s, length, one.speed_m_s, n, rng) for _ in range(2))
    figures = np.array(
        [one.speed_m_s, one.alpha_rad, one.lift_1_s, one.lift_elevator_1_s, one.stiffness_1_s2, one.damping_1_s,
         one.elevator_1_s2]
    )  # fmt: skip
    names = ("theta_rad", "q_rad_s", "q_dot_rad_s2", "ax_m_s2", "az_m_s2", "alpha_rad", "airspeed_m_s")
    motion = _integrate(surface, ug, wg, figures, FINE_S)
    return Flight(one, {**dict(zip(names, motion, strict=True)), "elevator_rad": surface})


def lagged(x: Array, tau_s: float) -> Array:
    """First-order lag by the trapezoidal rule at `FINE_S`."""
    if tau_s <= 0.0:
        return x
    out = np.empty_like(x)
    k = FINE_S / (2.0 * tau_s)
    out[0] = x[0]
    a, b = (1.0 - k) / (1.0 + k), k / (1.0 + k)
    return _first_order(x, a, b)


@njit(cache=True)
def _first_order(x: Array, a: float, b: float) -> Array:
    out = np.empty_like(x)
    out[0] = x[0]
    for i in range(1, len(x)):
        out[i] = a * out[i - 1] + b * (x[i] + x[i - 1])
    return out


def late(x: Array, delay_s: float) -> Array:
    """Delay by linear interpolation at `FINE_S`; before the record the first value."""
    t = np.arange(len(x)) * FINE_S
    return np.interp(t - delay_s, t, x)


def read(
    flight: Flight, errors: dict[str, float], rate_hz: float, noise: float, rng: np.random.Generator
) -> dict[str, Array]:
    """Channels of a log: arm, lag, delay, scale, bias at `FINE_S`, then samples with white noise."""
    true = dict(flight.channels)
    q_dot = true.pop("q_dot_rad_s2")
    v = true["airspeed_m_s"]
    true["alpha_rad"] = true["alpha_rad"] - errors.get("vane_arm", 0.0) * true["q_rad_s"] / v
    true["az_m_s2"] = true["az_m_s2"] - errors.get("accelerometer_arm", 0.0) * q_dot
    prefixes = {
        "alpha_rad": "vane",
        "q_rad_s": "gyro",
        "az_m_s2": "accelerometer",
        "airspeed_m_s": "airspeed",
        "theta_rad": "attitude",
    }
    every = round(1.0 / (rate_hz * FINE_S))
    result = {}
    for name, x in true.items():
        prefix = prefixes.get(name, "none")
        x = lagged(x, errors.get(f"{prefix}_lag", 0.0))
        x = late(x, errors.get(f"sensor_delay:{name}", 0.0))
        x = x * errors.get(f"{prefix}_scale", 1.0) + errors.get(f"{prefix}_bias", 0.0)
        x = x[::every]
        result[name] = x + noise * NOISE[name] * rng.standard_normal(len(x))
    return result


def as_log(parts: list[dict[str, Array]], rate_hz: float) -> FlightLog:
    """Runs of one rate as one log."""
    lengths = [len(p["q_rad_s"]) for p in parts]
    channels = {n: np.concatenate([p[n] for p in parts]) for n in parts[0]}
    channels["density_kg_m3"] = np.full(sum(lengths), 1.0)
    return FlightLog(
        metadata={},
        run_ids=tuple(f"r{i}" for i in range(len(parts))),
        offsets=np.cumsum([0, *lengths]).astype(np.int64),
        t_s=np.concatenate([np.arange(n) / rate_hz for n in lengths]),
        channels=channels,
    )


ERRORS = (
    "vane_lag", "vane_arm", "vane_scale", "vane_bias", "gyro_lag", "gyro_scale", "gyro_bias", "accelerometer_arm",
    "accelerometer_scale", "accelerometer_bias", "airspeed_scale", "attitude_lag", "sensor_delay:alpha_rad",
    "sensor_delay:q_rad_s", "sensor_delay:az_m_s2", "sensor_delay:theta_rad", "sensor_delay:airspeed_m_s",
)  # fmt: skip
"""Errors that a record may have, each as likely."""


SAME = ({"vane_arm", "accelerometer_arm"}, {"accelerometer_scale", "airspeed_scale"})
"""Pairs of which a record has one at most: only the difference of the arms and the ratio of the scales can be seen."""


def draw(count: int, rng: np.random.Generator) -> list[str]:
    """Draw different errors, no pair of `SAME` among them."""
    while True:
        names = {str(n) for n in rng.choice(ERRORS, size=count, replace=False)}
        if not any(pair <= names for pair in SAME):
            return sorted(names)


def size(name: str, one: Plant, rng: np.random.Generator) -> float:
    """Draw the size of an error: from hardly visible to large."""
    sign = rng.choice([-1.0, 1.0])
    period = 1.0 / one.frequency_rad_s
    if name.endswith("_lag"):
        return float(np.exp(rng.uniform(np.log(0.1), np.log(1.0))) * period)
    if name.startswith("sensor_delay"):
        return float(np.exp(rng.uniform(np.log(0.05), np.log(0.6))) * period)
    if name.endswith("_arm"):
        return float(sign * rng.uniform(0.3, 4.5) * one.chord_m)
    if name.endswith("_scale"):
        return float(1.0 + sign * rng.uniform(0.02, 0.15))
    return float(
        sign
        * {"vane_bias": 0.01, "gyro_bias": 0.004, "accelerometer_bias": 0.2}[name]
        * rng.uniform(0.3, 1.5)
    )


def trial(seed: int, errors: dict[str, float] | int, runs: int = 1) -> Trial:
    """One record (or several of one aircraft) with given errors, or with so many drawn at random."""
    rng = np.random.default_rng([17, seed])
    one = plant(rng)
    kind = MANOEUVRES[rng.integers(len(MANOEUVRES))]
    level = list(GUSTS)[rng.integers(len(GUSTS))]
    rate = float(rng.choice(RATES_HZ))
    duration = float(np.clip(rng.uniform(25.0, 60.0) / one.frequency_rad_s, 6.0, 30.0))
    amplitude = rng.uniform(0.5, 1.0) * (0.05 if kind != "multisine" else 0.04)
    if isinstance(errors, int):
        names = draw(errors, rng)
        errors = {str(n): size(str(n), one, rng) for n in names}
    # a small aircraft flies low, where gusts are weaker
    gust_m_s = 1.5 * GUSTS[level] * min(1.0, one.speed_m_s / 80.0)
    parts = [
        read(fly(one, kind, duration, amplitude, gust_m_s, rng), errors, rate, 1.0, rng) for _ in range(runs)
    ]
    label = f"{kind} {level} {rate:g} Hz {duration:.0f} s, chord {one.chord_m:.2f} m, {one.speed_m_s:.0f} m/s"
    return Trial(as_log(parts, rate), errors, one, label)
