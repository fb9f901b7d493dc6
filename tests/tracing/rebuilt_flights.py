"""Flights that earlier tracers answered wrongly, rebuilt from their description: damage of the GTM, a slow vane.

The GTM flies in the blind trials' JSBSim with increments stated here; the transport is integrated here.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from airtruth import aircraft
from airtruth.aircraft import toml
from airtruth.aircraft.write import write_aircraft
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import write_log
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change
from airtruth.units import DEG, G0
from validation.blind import draw, trials
from validation.blind.aircraft_xml import Body
from validation.blind.surface import lagged, late
from validation.blind.truths import Added

DAMAGED = {
    # lift and moment of a tail in the wake of the body, elevator halved, pitch damping times 0.42; its mass with it
    "tail": (
        Added(
            "derivatives",
            {"dCLalpha": -0.35, "dCLq": -8.0, "dCLde": -0.24, "dCmalpha": 1.07, "dCmq": 24.0, "dCmde": 0.894},
        ),
        Added("mass_error", {"factor": 0.985}),
        Added("inertia_error", {"factor": 0.94}),
        Added("cg_shift", {"dx_mac": -0.04}),
    ),
    # the outer panel lies behind the CG; lift, damping and mass go with it
    "wing": (
        Added("derivatives", {"dCLalpha": -0.24, "dCLq": -1.5, "dCmalpha": 0.10, "dCmq": 0.6}),
        Added("mass_error", {"factor": 0.975}),
        Added("cg_shift", {"dx_mac": 0.025}),
    ),
    "forward": (
        Added("cg_shift", {"dx_mac": -0.106}),
        Added("inertia_error", {"factor": 0.876}),
        Added("mass_error", {"factor": 0.977}),
    ),
    "elevator": (
        Added("elevator_effectiveness", {"factor": 0.5}),
        Added("mass_error", {"factor": 0.99}),
    ),
    "aft": (Added("cg_shift", {"dx_mac": 0.04}),),
}
"""Row -> what the aircraft has that is not declared."""
AIR = {"aft": "light"}
"""Air of a row that is not flown in calm air."""


def fly_damaged(folder: Path) -> dict[str, Path]:
    """Fly every row of `DAMAGED`, six records of 6 s each, white noise; row -> folder of its log."""
    flights = [
        replace(
            draw.draw(15, number, "null"),
            composition="composite",
            effects=effects,
            body=Body(),
            air=AIR.get(name, "calm"),
            spectrum="dryden",
            noise="white",
            duration_s=6.0,
        )
        for number, (name, effects) in enumerate(DAMAGED.items())
    ]
    folders = [folder / name for name in DAMAGED]
    return dict(zip(DAMAGED, trials.flown_apart(flights, folders), strict=True))


def well_declared(folder: Path) -> Path:
    """The GTM with each derivative declared to 0.5 %; its folder."""
    gtm = aircraft.load("gtm")
    stated = {
        name: entry.model_copy(update={"std": 0.005 * abs(entry.value)})
        for name, entry in gtm.file.derivatives.items()
    }
    write_aircraft(gtm, Change(), folder)
    plane = aircraft.load(folder)
    text = toml.write(plane.file.model_copy(update={"derivatives": stated}), "derivatives to 0.5 %")
    (folder / aircraft.FILE).write_text(text, encoding="utf-8")
    return folder


# -- a large transport at high speed, its vane slow, its surface late

V, DENSITY, ALTITUDE = 230.0, 0.4135, 10_000.0
AREA, CHORD, SPAN, MASS, INERTIA = 360.0, 8.0, 58.0, 150e3, 2.0e7
TRUE = np.array([5.6, 3.0, 0.36, -0.31, -24.0, -1.22])
DECLARED = np.array([5.5, 2.0, 0.35, -0.30, -25.0, -1.20])
RELATIVE_STD = np.array([0.05, 0.5, 0.1, 0.1, 0.15, 0.05])
VANE_LAG_S, SURFACE_DELAY_S = 0.45, 0.09
ALPHA, ELEVATOR = 2.5 * DEG, -1.0 * DEG
STEP_S, LOG_STEP_S, LENGTH_S = 0.005, 0.05, 22.0
NOISE = {"alpha_rad": 0.05 * DEG, "q_rad_s": 0.05 * DEG, "az_m_s2": 0.03, "elevator_rad": 0.01 * DEG}
GUST_M_S, GUST_S = 0.3, 2.3
RECORDS = ((1.5, 2.0), (-1.5, 1.4), (1.2, 2.4))
"""Amplitude [deg] and time unit [s] of each record's 3-2-1-1; the third is held out by default."""


def transport(folder: Path, lag_s: float) -> Path:
    """aircraft.toml of the transport, its vane declared with a lag; the folder."""
    entries = {
        "geometry": {"wing_area": (AREA, "m2"), "chord": (CHORD, "m"), "span": (SPAN, "m")},
        "mass": {"mass": (MASS, "kg", 0.01 * MASS), "inertia_yy": (INERTIA, "kg_m2", 0.05 * INERTIA)},
    }
    lines = ["schema = 1", 'name = "transport"']
    for table, quantities in entries.items():
        lines.append(f"[{table}]")
        for name, (value, unit, *std) in quantities.items():
            more = f", std = {std[0]!r}" if std else ""
            lines.append(f'{name} = {{ value = {value!r}, unit = "{unit}"{more} }}')
    lines.append("[derivatives]")
    for name, value, share in zip(
        LONGITUDINAL.parameters, DECLARED.tolist(), RELATIVE_STD.tolist(), strict=True
    ):
        lines.append(f"{name} = {{ value = {value!r}, std = {abs(share * value)!r} }}")
    for channel, std in NOISE.items():
        unit = {"alpha_rad": "rad", "q_rad_s": "rad_s", "az_m_s2": "m_s2", "elevator_rad": "rad"}[channel]
        lines += [f"[sensors.{channel}]", f'noise_std = {{ value = {std!r}, unit = "{unit}" }}']
        if channel == "alpha_rad" and lag_s:
            lines.append(f'lag = {{ value = {lag_s!r}, unit = "s" }}')
    folder.mkdir(parents=True, exist_ok=True)
    (folder / aircraft.FILE).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def fly_transport(folder: Path) -> Path:
    """Three records of the transport; the folder of their log."""
    rng = np.random.default_rng(3)
    records = [_record(rng, amplitude * DEG, unit) for amplitude, unit in RECORDS]
    n = len(records[0]["q_rad_s"])
    log = FlightLog(
        metadata={"aircraft": "transport", "sample_rate_hz": round(1.0 / LOG_STEP_S)},
        run_ids=tuple(f"r{k + 1}" for k in range(len(records))),
        offsets=np.arange(len(records) + 1, dtype=np.int64) * n,
        t_s=np.tile(np.arange(n) * LOG_STEP_S, len(records)),
        channels={name: np.concatenate([r[name] for r in records]) for name in records[0]},
    )
    folder.mkdir(parents=True, exist_ok=True)
    write_log(folder / "log.parquet", log)
    return folder


def _record(rng: np.random.Generator, amplitude: float, unit: float) -> dict[str, np.ndarray]:
    """The short period by RK4, the air's angle of attack with a first-order gust; sensors at the CG."""
    t = np.arange(round(LENGTH_S / STEP_S) + 1) * STEP_S
    signs = np.array([0, 1, 1, 1, -1, -1, 1, -1, 0])
    slot = np.clip(np.floor((t - 2.0) / unit) + 1, 0, len(signs) - 1).astype(int)
    surface = lagged(amplitude * signs[slot], 0.08, STEP_S)
    felt = late(surface, SURFACE_DELAY_S, STEP_S)
    gust = _gust(rng, len(t)) / V
    pressure = 0.5 * DENSITY * V**2
    lift, moment = pressure * AREA / (MASS * V), pressure * AREA * CHORD / INERTIA
    rate = CHORD / (2.0 * V)

    def coefficients(x: np.ndarray, air: float, de: float) -> tuple[float, float]:
        signal = np.array([x[0] + air, x[1] * rate, de])
        return float(TRUE[:3] @ signal), float(TRUE[3:] @ signal)

    def slopes(x: np.ndarray, air: float, de: float) -> np.ndarray:
        cl, cm = coefficients(x, air, de)
        return np.array([x[1] - lift * cl, moment * cm, x[1]])

    x = np.zeros(3)  # alpha, q, theta
    rows = []
    for k in range(len(t)):
        cl, _ = coefficients(x, gust[k], felt[k])
        rows.append([x[0] + gust[k], x[1], x[2], -G0 - lift * V * cl])
        if k + 1 == len(t):
            break
        air, de = 0.5 * (gust[k] + gust[k + 1]), 0.5 * (felt[k] + felt[k + 1])
        k1 = slopes(x, gust[k], felt[k])
        k2 = slopes(x + 0.5 * STEP_S * k1, air, de)
        k3 = slopes(x + 0.5 * STEP_S * k2, air, de)
        k4 = slopes(x + STEP_S * k3, gust[k + 1], felt[k + 1])
        x = x + STEP_S / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    alpha, q, theta, az = np.array(rows).T
    every = round(LOG_STEP_S / STEP_S)
    channels = {
        "alpha_rad": ALPHA + lagged(alpha, VANE_LAG_S, STEP_S),
        "q_rad_s": q,
        "az_m_s2": az,
        "elevator_rad": ELEVATOR + surface,
    }
    logged = {name: values[::every] for name, values in channels.items()}
    for name, std in NOISE.items():
        logged[name] = logged[name] + std * rng.standard_normal(len(logged[name]))
    count = len(logged["q_rad_s"])
    return logged | {
        "theta_rad": ALPHA + theta[::every] + 0.02 * DEG * rng.standard_normal(count),
        "airspeed_m_s": V + 0.1 * rng.standard_normal(count),
        "altitude_m": ALTITUDE + rng.standard_normal(count),
        "density_kg_m3": np.full(count, DENSITY),
    }


def _gust(rng: np.random.Generator, count: int) -> np.ndarray:
    """A stationary first-order gust [m/s]."""
    pole = np.exp(-STEP_S / GUST_S)
    drive = GUST_M_S * np.sqrt(1.0 - pole**2) * rng.standard_normal(count)
    values = np.empty(count)
    values[0] = GUST_M_S * rng.standard_normal()
    for k in range(1, count):
        values[k] = pole * values[k - 1] + drive[k]
    return values
