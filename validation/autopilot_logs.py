"""Logs of a 3 kg aircraft with an autopilot, without a vane, whose servo is late: PX4 ULog, ArduPilot DataFlash and CSV.

The truth is a longitudinal simulation of its own: a rigid body, lift and moment linear in angle of attack, pitch rate and
elevator, a parabolic drag polar, vertical gusts of a first-order spectrum, Runge-Kutta steps of 2.5 ms. The autopilot holds the
attitude between the manoeuvres and the stick is free of it during them. The log holds what an autopilot has: gyro, accelerometer,
attitude, airspeed, barometer and the command of the servo, each at a rate and with noise of its own.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin

from airtruth.units import DEG, G0
from validation.recorders import Topic, dataflash

Array = NDArray[np.float64]

MASS_KG, INERTIA_KG_M2, AREA_M2, CHORD_M, SPAN_M = 3.0, 0.18, 0.42, 0.22, 1.9
TAIL_AREA_M2, TAIL_ARM_M = 0.075, 0.75
DERIVATIVES: Final = {"CLalpha": 4.9, "CLq": 6.5, "CLde": 0.38, "Cmalpha": -1.05, "Cmq": -17.0, "Cmde": -1.25}
"""Truth about the CG [1/rad]."""
LIFT_0, MOMENT_0, DRAG = 0.28, 0.03, (0.035, 0.06)
AIRSPEED_M_S, DENSITY_KG_M3, ALTITUDE_M = 17.0, 1.2133, 100.0
SEA_LEVEL_KG_M3: Final = 1.225
"""Density to which an indicated airspeed refers [kg/m3]."""
DELAY_S: Final = 0.06
"""From the command to the surface as the air sees it [s]; nothing declares it."""
STEP_S, FIRST_S, EACH_S, MANOEUVRES = 0.0025, 12.0, 14.0, 9
RECORDS: Final = 6
"""Manoeuvres of the flight that the pages use [-]."""
GUST_M_S, GUST_LENGTH_M = 0.15, 50.0
SETTLED_S: Final = 0.1
"""From the last command of the autopilot to the start of a record [s]: longer than the delay, so that the air sees none of it."""
LOW_PASS: Final = firwin(161, 20.0, fs=1.0 / STEP_S)
"""Filter of a recorder at 50 Hz, before it samples: half the amplitude at 20 Hz."""
INSTRUMENTS: Final = {
    "imu": (
        100.0,
        {"q": ("q_rad_s", 0.15 * DEG), "ax": ("ax_m_s2", 0.015 * G0), "az": ("az_m_s2", 0.015 * G0)},
    ),
    "attitude": (50.0, {"theta": ("theta_rad", 0.1 * DEG)}),
    "airspeed": (50.0, {"airspeed": ("airspeed_m_s", 0.2)}),
    "baro": (50.0, {"altitude": ("altitude_m", 0.15)}),
    "servo": (100.0, {"command": ("command_rad", 0.0)}),
}
"""Topic -> rate [Hz], and of each channel the signal of the flight and the standard deviation of its noise at this rate [SI]."""
FULL_DEG: Final = 25.0
"""Surface at full servo travel, 400 us from the centre [deg]."""


@dataclass(frozen=True)
class Flight:
    """One continuous flight, (steps,) each in SI: what the instruments would read without noise."""

    t_s: Array
    airspeed_m_s: Array
    theta_rad: Array
    q_rad_s: Array
    ax_m_s2: Array
    az_m_s2: Array
    altitude_m: Array
    command_rad: Array


def command_windows() -> list[tuple[float, float]]:
    """Start and end of the records [s]: the stick is free of the autopilot from a second before the input."""
    return [(FIRST_S + EACH_S * k, FIRST_S + EACH_S * k + 8.0) for k in range(MANOEUVRES)]


def fly(seed: int = 1) -> Flight:
    """The flight; its gusts depend on the seed."""
    rng = np.random.default_rng(seed)
    alpha, elevator, thrust = _trim()
    steps = round((FIRST_S + EACH_S * MANOEUVRES) / STEP_S)
    t = STEP_S * np.arange(steps)
    inputs, free = _inputs(t)
    late = round(DELAY_S / STEP_S)
    decay = np.exp(-STEP_S * AIRSPEED_M_S / GUST_LENGTH_M)
    shocks = GUST_M_S * np.sqrt(1.0 - decay**2) * rng.standard_normal(steps)
    command = np.full(steps + late, elevator)
    state = np.array([AIRSPEED_M_S * np.cos(alpha), AIRSPEED_M_S * np.sin(alpha), 0.0, alpha, 0.0])
    rows, gust, held = np.empty((steps, 7)), 0.0, elevator
    for k in range(steps):
        if not free[k]:
            held = elevator + 0.5 * (state[3] - alpha + 0.01 * state[4]) + 0.1 * state[2]
        elif k and not free[k - 1]:
            held = elevator
        command[k + late] = held + inputs[k]
        gust = decay * gust + shocks[k]
        acting = command[k : k + 2] if k + 1 < steps else command[[k, k]]
        force = _forces(state, acting[0], thrust, gust)
        rows[k] = [force[3], state[3], state[2], force[0], force[1], state[4], command[k + late]]
        middle = acting.mean()
        k1 = _rates(state, acting[0], thrust, gust)
        k2 = _rates(state + 0.5 * STEP_S * k1, middle, thrust, gust)
        k3 = _rates(state + 0.5 * STEP_S * k2, middle, thrust, gust)
        k4 = _rates(state + STEP_S * k3, acting[1], thrust, gust)
        state = state + STEP_S / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    airspeed, theta, q, ax, az, height, surface = rows.T
    return Flight(t, airspeed, theta, q, ax, az, ALTITUDE_M + height, surface)


def topics(flight: Flight, seed: int = 2) -> dict[str, tuple[Array, dict[str, Array]]]:
    """Topic -> times [s] and noisy series [SI], each topic at its own rate."""
    rng = np.random.default_rng(seed)

    made = {}
    for topic, (rate_hz, channels) in INSTRUMENTS.items():
        t = np.arange(flight.t_s[0] + 0.001, flight.t_s[-1], 1.0 / rate_hz)
        made[topic] = (
            t,
            {
                name: np.interp(t, flight.t_s, getattr(flight, signal)) + std * rng.standard_normal(t.size)
                for name, (signal, std) in channels.items()
            },
        )
    return made


def write_px4(path: Path, flight: Flight) -> None:
    """A ULog with the topics of PX4 from 1.13 on."""
    made = topics(flight)
    (t_imu, imu), (t_att, attitude) = made["imu"], made["attitude"]
    (t_air, air), (t_baro, baro), (t_servo, servo) = made["airspeed"], made["baro"], made["servo"]
    half = 0.5 * attitude["theta"]
    zero = np.zeros_like
    written = [
        ("vehicle_angular_velocity", "float[3] xyz", t_imu, [zero(t_imu), imu["q"], zero(t_imu)]),
        ("vehicle_acceleration", "float[3] xyz", t_imu, [imu["ax"], zero(t_imu), imu["az"]]),
        ("vehicle_attitude", "float[4] q", t_att, [np.cos(half), zero(half), np.sin(half), zero(half)]),
        ("airspeed_validated", "float true_airspeed_m_s", t_air, [air["airspeed"]]),
        (
            "vehicle_air_data",
            "float baro_alt_meter;float rho",
            t_baro,
            [baro["altitude"], np.full(t_baro.size, DENSITY_KG_M3)],
        ),
        (
            "actuator_servos",
            "float[3] control",
            t_servo,
            [zero(t_servo), servo["command"] / (FULL_DEG * DEG), zero(t_servo)],
        ),
    ]
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + _message(b"B", bytes(40))
    for name, field, _, _ in written:
        data += _message(b"F", f"{name}:uint64_t timestamp;{field};".encode())
    body, times = [], []
    for number, (name, _, t, columns) in enumerate(written):
        data += _message(b"A", struct.pack("<BH", 0, number) + name.encode())
        rows = np.column_stack(columns).astype("<f4")
        for stamp, row in zip(np.round(1e6 * t).astype(np.uint64).tolist(), rows, strict=True):
            times.append(stamp)
            body.append(_message(b"D", struct.pack("<HQ", number, stamp) + row.tobytes()))
    order = np.argsort(times, kind="stable")
    path.write_bytes(data + b"".join(body[k] for k in order))


def write_ardupilot(path: Path, flight: Flight) -> None:
    """A DataFlash log with the messages of ArduPlane: angles in degrees, indicated airspeed, the servo in microseconds."""
    made = topics(flight)
    (t_imu, imu), (t_att, attitude) = made["imu"], made["attitude"]
    (t_air, air), (t_baro, baro), (t_servo, servo) = made["airspeed"], made["baro"], made["servo"]
    none = np.zeros_like
    written = [
        Topic(
            "IMU",
            t_imu,
            {
                "GyrX": none(t_imu),
                "GyrY": imu["q"],
                "GyrZ": none(t_imu),
                "AccX": imu["ax"],
                "AccY": none(t_imu),
                "AccZ": imu["az"],
            },
            dict.fromkeys(("GyrX", "GyrY", "GyrZ"), "rad/s")
            | dict.fromkeys(("AccX", "AccY", "AccZ"), "m/s/s"),
        ),
        Topic(
            "ATT",
            t_att,
            {"Roll": none(t_att), "Pitch": attitude["theta"] / DEG, "Yaw": none(t_att)},
            dict.fromkeys(("Roll", "Pitch", "Yaw"), "deg"),
        ),
        Topic(
            "ARSP",
            t_air,
            {"Airspeed": air["airspeed"] * np.sqrt(DENSITY_KG_M3 / SEA_LEVEL_KG_M3)},
            {"Airspeed": "m/s"},
        ),
        Topic("BARO", t_baro, {"Alt": baro["altitude"]}, {"Alt": "m"}),
        Topic(
            "RCOU",
            t_servo,
            {"C1": 1500.0 + none(t_servo), "C2": 1500.0 + 400.0 * servo["command"] / (FULL_DEG * DEG)},
            {"C1": "PWM", "C2": "PWM"},
            letters="HH",
        ),
    ]
    path.write_bytes(dataflash(written))


def write_csv(path: Path, flight: Flight) -> None:
    """A CSV of a test centre at 50 Hz, its records one below another: foreign names, degrees, knots, feet and g."""
    t = np.arange(0.1, flight.t_s[-1] - 0.1, 0.02)
    series = _recorded(flight, t)
    runs = np.full(t.size, -1)
    for k, (start, end) in enumerate(command_windows()[:RECORDS]):
        runs[(t > start + SETTLED_S) & (t < end - SETTLED_S)] = k + 1
    columns = {
        "Record": runs.astype(np.float64),
        "Time [s]": t,
        "TAS [kt]": series["airspeed"] / (1852.0 / 3600.0),
        "Pitch [deg]": series["theta"] / DEG,
        "Pitch rate [deg/s]": series["q"] / DEG,
        "Nx [g]": series["ax"] / G0,
        "Nz [g]": -series["az"] / G0,
        "Elevator [deg]": series["command"] / DEG,
        "Altitude [ft]": series["altitude"] / 0.3048,
    }
    flown = runs > 0
    rows = np.column_stack([x[flown] for x in columns.values()])
    lines = [",".join(columns), *(",".join(f"{x:.6f}" for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _recorded(flight: Flight, t_s: Array, seed: int = 2) -> dict[str, Array]:
    """Samples of a recorder that takes the upper band out of each signal and its noise, without lag, before it samples."""
    rng = np.random.default_rng(seed)
    made = {}
    for rate_hz, channels in INSTRUMENTS.values():
        for name, (signal, std) in channels.items():
            own = getattr(flight, signal)
            noisy = own + std / np.sqrt(rate_hz * STEP_S) * rng.standard_normal(own.size)
            filtered = np.convolve(np.pad(noisy, LOW_PASS.size // 2, mode="edge"), LOW_PASS, mode="valid")
            made[name] = np.interp(t_s, flight.t_s, filtered)
    return made


def _message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<Hc", len(body), kind) + body


def _inputs(t: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(steps,) 3-2-1-1 and doublets of 2.5 to 4 deg from a second after the start of each record, and the records [rad]."""
    made, free = np.zeros(t.size), np.zeros(t.size, dtype=bool)
    for k, (start, end) in enumerate(command_windows()):
        free[(t >= start) & (t < end)] = True
        steps = ((3, 1), (2, -1), (1, 1), (1, -1)) if k % 3 != 1 else ((1, 1), (1, -1))
        amplitude, unit, at = (2.5 + 0.5 * (k % 4)) * DEG * (-1.0) ** k, 0.2 + 0.02 * (k % 3), start + 1.5
        for count, sign in steps:
            made[(t >= at) & (t < at + count * unit)] = sign * amplitude
            at += count * unit
    return made, free


def _forces(state: Array, elevator: float, thrust: float, gust: float) -> tuple[float, float, float, float]:
    """Specific forces along x and z, q', and airspeed."""
    u, w, q = state[0], state[1] + gust, state[2]
    airspeed, alpha = float(np.hypot(u, w)), float(np.arctan2(w, u))
    rate, d = q * CHORD_M / (2.0 * airspeed), DERIVATIVES
    lift = LIFT_0 + d["CLalpha"] * alpha + d["CLq"] * rate + d["CLde"] * elevator
    moment = MOMENT_0 + d["Cmalpha"] * alpha + d["Cmq"] * rate + d["Cmde"] * elevator
    drag = DRAG[0] + DRAG[1] * lift**2
    pressure = 0.5 * DENSITY_KG_M3 * airspeed**2 * AREA_M2
    x = pressure * (lift * np.sin(alpha) - drag * np.cos(alpha)) + thrust
    z = -pressure * (lift * np.cos(alpha) + drag * np.sin(alpha))
    return x / MASS_KG, z / MASS_KG, pressure * CHORD_M * moment / INERTIA_KG_M2, airspeed


def _rates(state: Array, elevator: float, thrust: float, gust: float) -> Array:
    u, w, q, theta = state[:4]
    ax, az, q_dot, _ = _forces(state, elevator, thrust, gust)
    climb = u * np.sin(theta) - w * np.cos(theta)
    return np.array([ax - G0 * np.sin(theta) - q * w, az + G0 * np.cos(theta) + q * u, q_dot, q, climb])


def _trim() -> tuple[float, float, float]:
    """Angle of attack [rad], elevator [rad] and thrust [N] of level flight, by Newton's method."""
    x = np.array([0.05, 0.0, 3.0])

    def residual(x: Array) -> Array:
        state = np.array([AIRSPEED_M_S * np.cos(x[0]), AIRSPEED_M_S * np.sin(x[0]), 0.0, x[0], 0.0])
        return _rates(state, float(x[1]), float(x[2]), 0.0)[:3]

    for _ in range(20):
        jacobian = np.stack([(residual(x + d) - residual(x - d)) / 2e-6 for d in 1e-6 * np.eye(3)], axis=1)
        x = x - np.linalg.solve(jacobian, residual(x))
    return float(x[0]), float(x[1]), float(x[2])
