"""Records of a business jet at 10 Hz: a pilot's smooth inputs, and instruments without a declaration.

    python -m validation.jet_records --seed 1 --trials 4 [--gust 1.0] [--dive 10] [--late]

The truth is that of `validation.pitch_truth`: 5,200 kg at 100 m/s and 3,090 m. The tracer gets an aircraft.toml without a JSBSim
model. Its values differ from the truth by up to a standard deviation, and it declares no sensor and no servo. Nothing is missing,
or with ``--late`` the channels have the lags of an air data computer and of an attitude reference, more than the library can tell
apart. With ``--dive 10`` the records begin in dives and climbs, so that the airspeed varies by 11 to 19 %. A trial depends on its
seed and the options alone.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from airtruth import aircraft
from airtruth.aircraft import Aircraft
from airtruth.logs.flight_log import FlightLog
from airtruth.tracing import TraceOptions, trace
from airtruth.units import DEG, G0
from validation.pitch_truth import STEP_S, Body, flown, gusts, trimmed

Array = NDArray[np.float64]

JET: Final = Body(
    mass_kg=5200.0,
    inertia_kg_m2=27000.0,
    area_m2=30.0,
    chord_m=2.06,
    density_kg_m3=0.9,
    airspeed_m_s=100.0,
    lift=(0.2, 5.6, 8.0, 0.45),
    moment=(0.03, -0.75, -14.0, -1.25),
    drag=(0.025, 0.045),
)
ALTITUDE_M: Final = 3090.0
"""Of the standard atmosphere with the density of the jet [m]."""
RECORDS, DURATION_S, EVERY = 6, 24.0, 40
GUST_LENGTH_M: Final = 533.0
"""Scale of turbulence above 2,000 ft (MIL-F-8785C, 3.7.2.1) [m]."""
NOISE: Final = {
    "airspeed_m_s": 0.3,
    "alpha_rad": 0.05 * DEG,
    "q_rad_s": 0.05 * DEG,
    "theta_rad": 0.05 * DEG,
    "ax_m_s2": 0.005 * G0,
    "az_m_s2": 0.01 * G0,
    "elevator_rad": 0.02 * DEG,
    "altitude_m": 0.3,
}
LATE: Final[dict[str, tuple[tuple[float, ...], float]]] = {
    "alpha_rad": ((0.06, 0.06), 0.05),
    "q_rad_s": ((0.03,), 0.0),
    "theta_rad": ((), 0.1),
    "az_m_s2": ((0.05, 0.05), 0.0),
    "airspeed_m_s": ((0.3,), 0.0),
}
"""Channel -> time constants of its lags, and its delay [s]."""
PROMPT: Final[tuple[tuple[float, ...], float]] = ((), 0.0)
"""Lags and delay of the other channels."""
DECLARED: Final = f"""
schema = 1
name = "jet"
[geometry]
wing_area = {{ value = {JET.area_m2}, unit = "m2" }}
chord = {{ value = {JET.chord_m}, unit = "m" }}
span = {{ value = 15.9, unit = "m" }}
[mass]
mass = {{ value = {JET.mass_kg}, unit = "kg", std = 60.0 }}
inertia_yy = {{ value = {JET.inertia_kg_m2}, unit = "kg_m2", std = 1500.0 }}
cg = {{ value = 0.25, std = 0.01 }}
[derivatives]
CLalpha = {{ value = 5.2, std = 0.5 }}
CLq = {{ value = 6.0, std = 4.0 }}
CLde = {{ value = 0.4, std = 0.15 }}
Cmalpha = {{ value = -0.65, std = 0.15 }}
Cmq = {{ value = -12.0, std = 4.0 }}
Cmde = {{ value = -1.1, std = 0.3 }}
"""


def declared(folder: Path) -> Aircraft:
    """The declared aircraft, whose file is written into a folder."""
    (folder / aircraft.FILE).write_text(DECLARED, encoding="utf-8")
    return aircraft.load(folder)


def flight_log(seed: int, gust_m_s: float = 1.0, dive_rad: float = 0.0, late: bool = False) -> FlightLog:
    """Six records of a trial.

    Parameters
    ----------
    gust_m_s : standard deviation of the vertical gust [m/s].
    dive_rad : angle of the flight path below the horizon at the start, in every other record above it [rad].
    late : whether the channels have the lags and delays of `LATE`.
    """
    rng = np.random.default_rng(seed)
    steps = round(DURATION_S / STEP_S) + 1
    t = STEP_S * np.arange(steps)
    alpha, elevator, thrust = trimmed(JET)
    surface = elevator + _inputs(rng, t)
    air = gusts(rng, (steps, RECORDS), gust_m_s, (GUST_LENGTH_M, GUST_LENGTH_M), JET.airspeed_m_s)
    start = np.zeros((5, RECORDS))
    start[0], start[1] = JET.airspeed_m_s * np.cos(alpha), JET.airspeed_m_s * np.sin(alpha)
    start[3] = alpha - dive_rad * (-1.0) ** np.arange(RECORDS)
    states, forces = flown(JET, start, surface, thrust, air)
    q, theta, height = np.moveaxis(states, 1, 0)[2:]
    ax, az, _, airspeed, angle = np.moveaxis(forces, 1, 0)
    exact = {
        "airspeed_m_s": airspeed,
        "alpha_rad": angle,
        "q_rad_s": q,
        "theta_rad": theta,
        "ax_m_s2": ax,
        "az_m_s2": az,
        "elevator_rad": surface.T,
        "altitude_m": ALTITUDE_M + height,
    }
    channels = {}
    for name, x in exact.items():
        lags, delay_s = LATE.get(name, PROMPT) if late else PROMPT
        read = _read(x, lags, delay_s)[::EVERY].T.ravel()
        channels[name] = np.asarray(read + NOISE[name] * rng.standard_normal(read.size))
    samples = (steps - 1) // EVERY + 1
    names = tuple(f"r{i + 1}" for i in range(RECORDS))
    times = np.tile(t[::EVERY], RECORDS)
    return FlightLog({"aircraft": "jet"}, names, samples * np.arange(RECORDS + 1), times, channels)


def _read(x: Array, lags_s: Sequence[float], delay_s: float) -> Array:
    """(steps, records) behind first-order lags and a delay; before the start it has its first value."""
    late = round(delay_s / STEP_S)
    made = np.concatenate([np.repeat(x[:1], late, axis=0), x[: len(x) - late]])
    for time_s in lags_s:
        kept = np.exp(-STEP_S / time_s)
        made = lfilter([1.0 - kept], [1.0, -kept], made - made[0], axis=0) + made[0]
    return np.asarray(made)


def _inputs(rng: np.random.Generator, t: Array) -> Array:
    """(records, steps) four pulls and pushes of 0.5 to 2 deg whose edges take half a second [rad]."""
    kernel = np.convolve(np.ones(100), np.ones(100)) / 1e4
    found = np.zeros((RECORDS, t.size))
    for i in range(RECORDS):
        start = 2.0
        for k in range(4):
            end = start + rng.uniform(0.5, 1.2)
            found[i, (t >= start) & (t < end)] = rng.uniform(0.5, 2.0) * DEG * (-1.0) ** (k + i)
            start = end + rng.choice([0.0, 0.0, 2.0])
        found[i] = np.convolve(found[i], kernel, mode="same")
    return found


def main(argv: Sequence[str] | None = None) -> None:
    """Fly and trace the trials, and print one line for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--trials", type=int, default=4)
    parser.add_argument("--gust", type=float, default=1.0, help="vertical gust, standard deviation [m/s]")
    parser.add_argument("--dive", type=float, default=0.0, help="angle of the path at the start [deg]")
    parser.add_argument("--late", action="store_true", help="lags and delays of every channel")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        plane = declared(Path(folder))
        for seed in range(options.seed, options.seed + options.trials):
            log = flight_log(seed, options.gust, options.dive * DEG, options.late)
            answer = trace([log], plane, TraceOptions()).to_dict()
            named = ", ".join(effect["name"] for effect in answer["effects"]) or "-"
            provisional = ", provisional" if answer["provisional"] else ""
            after = " ".join(f"{name} {value:.3g}" for name, value in answer["derivatives"]["after"].items())
            p_value = answer["anomaly"]["p_value"]
            sys.stdout.write(
                f"{seed}: {answer['verdict']}{provisional}, p = {p_value:.2g}: {named}; {after}\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
