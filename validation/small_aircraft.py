"""Flights of a small aircraft, traced as its user would: 12 kg, 22 m/s, a noisy airspeed and a servo with a rate limit.

    python -m validation.small_aircraft --seed 1 --trials 10 [--gust 0.35] [--effect elevator_delay] [--drawn]

The truth is that of `validation.pitch_truth` with constant thrust in vertical and horizontal gusts. The tracer gets logs at
50 Hz, or another rate, and an aircraft.toml without a JSBSim model. Nothing is missing, or the stated effect.
The values of the file are those of the truth, or with ``--drawn`` the truth has derivatives, mass and inertia from their declared
uncertainty. A trial depends on its seed and the options alone.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from validation import pitch_truth
from validation.pitch_truth import STEP_S, Body

Array = NDArray[np.float64]

MASS_KG, INERTIA_KG_M2, AREA_M2, CHORD_M = 12.0, 1.10, 0.96, 0.30
LIFT: Final = (0.24, 5.2, 7.5, 0.36)
"""CL at zero, and over alpha, q c/(2 V) and elevator."""
MOMENT: Final = (0.035, -0.90, -14.0, -1.10)
DRAG: Final = (0.028, 0.042)
"""CD at zero lift, and over CL squared."""
DENSITY_KG_M3, AIRSPEED_M_S = 1.2075, 22.0
SERVO_S, RATE_RAD_S = 1.0 / (2.0 * np.pi * 7.0), 250.0 * DEG
ACCELEROMETER_M = 0.05
RECORDS, DURATION_S, EVERY = 6, 9.0, 8
GUST_LENGTHS_M: Final = (80.0, 40.0)
NOISE: Final = {
    "airspeed_m_s": 0.25,
    "alpha_rad": 0.15 * DEG,
    "q_rad_s": 0.2 * DEG,
    "theta_rad": 0.15 * DEG,
    "ax_m_s2": 0.015 * G0,
    "az_m_s2": 0.02 * G0,
    "elevator_rad": 0.04 * DEG,
    "altitude_m": 0.3,
}
EFFECTS: Final = {
    "elevator_delay": 0.04,
    "vane_arm": 0.35,
    "gyro_scale": 0.9,
    "vane_lag": 0.06,
    "elevator_effectiveness": 0.75,
    "cm_alpha_nonlinear": 0.5,
    "elevator_fade": 3.0,
}
"""Effects that may be flown, and the value of each [SI]. The slope of the moment changes above `BREAK_RAD`. The elevator's effect
fades by this share of its deflection [1/rad], which the library lacks."""
BREAK_RAD: Final = 0.06
STD: Final = ((0.0, 0.26, 1.5, 0.036), (0.0, 0.05, 1.4, 0.055))
"""Declared uncertainty of `LIFT` and `MOMENT`, as in `DECLARED`."""
MASS_STD_KG, INERTIA_STD_KG_M2 = 0.1, 0.033
DECLARED: Final = f"""
schema = 1
name = "small"
[geometry]
wing_area = {{ value = {AREA_M2}, unit = "m2" }}
chord = {{ value = {CHORD_M}, unit = "m" }}
span = {{ value = 3.2, unit = "m" }}
[mass]
mass = {{ value = {MASS_KG}, unit = "kg", std = 0.1 }}
inertia_yy = {{ value = {INERTIA_KG_M2}, unit = "kg_m2", std = 0.033 }}
cg = {{ value = 0.25, std = 0.005 }}
[derivatives]
CLalpha = {{ value = {LIFT[1]}, std = 0.26 }}
CLq = {{ value = {LIFT[2]}, std = 1.5 }}
CLde = {{ value = {LIFT[3]}, std = 0.036 }}
Cmalpha = {{ value = {MOMENT[1]}, std = 0.05 }}
Cmq = {{ value = {MOMENT[2]}, std = 1.4 }}
Cmde = {{ value = {MOMENT[3]}, std = 0.055 }}
[elevator_actuator]
bandwidth = {{ value = 7.0, unit = "hz" }}
rate_limit = {{ value = 250.0, unit = "deg_s" }}
minimum = {{ value = -20.0, unit = "deg" }}
maximum = {{ value = 20.0, unit = "deg" }}
[sensors.airspeed_m_s]
noise_std = {{ value = 0.25, unit = "m_s" }}
[sensors.alpha_rad]
noise_std = {{ value = 0.15, unit = "deg" }}
[sensors.q_rad_s]
noise_std = {{ value = 0.2, unit = "deg_s" }}
[sensors.theta_rad]
noise_std = {{ value = 0.15, unit = "deg" }}
[sensors.ax_m_s2]
noise_std = {{ value = 0.015, unit = "g" }}
x = {{ value = {ACCELEROMETER_M}, unit = "m" }}
[sensors.az_m_s2]
noise_std = {{ value = 0.02, unit = "g" }}
x = {{ value = {ACCELEROMETER_M}, unit = "m" }}
[sensors.elevator_rad]
noise_std = {{ value = 0.04, unit = "deg" }}
"""


@dataclass(frozen=True)
class Truth:
    """The aircraft that flies: coefficients as `LIFT` and `MOMENT`, mass [kg] and inertia [kg m2], and the effect it has."""

    lift: tuple[float, ...] = LIFT
    moment: tuple[float, ...] = MOMENT
    mass_kg: float = MASS_KG
    inertia_kg_m2: float = INERTIA_KG_M2
    effect: str | None = None

    @property
    def body(self) -> Body:
        """The aircraft with its effect."""
        amounts = {self.effect: EFFECTS[self.effect]} if self.effect else {}
        return Body(
            mass_kg=self.mass_kg,
            inertia_kg_m2=self.inertia_kg_m2,
            area_m2=AREA_M2,
            chord_m=CHORD_M,
            density_kg_m3=DENSITY_KG_M3,
            airspeed_m_s=AIRSPEED_M_S,
            lift=self.lift,
            moment=self.moment,
            drag=DRAG,
            effectiveness=amounts.get("elevator_effectiveness", 1.0),
            fade=amounts.get("elevator_fade", 0.0),
            moment_break=(amounts.get("cm_alpha_nonlinear", 0.0), BREAK_RAD),
        )


def drawn(seed: int, effect: str | None = None) -> Truth:
    """An aircraft whose derivatives, mass and inertia are drawn from their declared uncertainty."""
    rng = np.random.default_rng([seed, 1])
    lift, moment = (
        tuple((np.array(mean) + np.array(std) * rng.standard_normal(4)).tolist())
        for mean, std in zip((LIFT, MOMENT), STD, strict=True)
    )
    mass = MASS_KG + MASS_STD_KG * rng.standard_normal()
    return Truth(lift, moment, mass, INERTIA_KG_M2 + INERTIA_STD_KG_M2 * rng.standard_normal(), effect)


def declared(folder: Path) -> Aircraft:
    """The declared aircraft, whose file is written into a folder."""
    (folder / aircraft.FILE).write_text(DECLARED, encoding="utf-8")
    return aircraft.load(folder)


def flight_log(
    seed: int,
    gust_m_s: float = 0.0,
    truth: Truth = Truth(),
    noise: float = 1.0,
    every: int = EVERY,
    stds: Mapping[str, float] | None = None,
) -> FlightLog:
    """Six records of a trial.

    Parameters
    ----------
    gust_m_s : standard deviation of the vertical gust [m/s]; that of the horizontal one is 1.2 times as large.
    truth : the aircraft that flies.
    noise : multiple of the noise of the sensors [-].
    every : steps to a sample of the log [-].
    stds : noise of each channel; None for `NOISE`.
    """
    rng = np.random.default_rng(seed)
    steps = round(DURATION_S / STEP_S)
    t = STEP_S * np.arange(steps + 1)
    alpha, elevator, thrust = trimmed(truth)
    surface = _servo(elevator + _commands(rng, t), elevator)
    late_s = EFFECTS["elevator_delay"] if truth.effect == "elevator_delay" else 0.0
    gusts = pitch_truth.gusts(rng, (steps + 1, RECORDS), gust_m_s, GUST_LENGTHS_M, AIRSPEED_M_S)
    state = np.zeros((5, RECORDS))
    state[0], state[1], state[3] = AIRSPEED_M_S * np.cos(alpha), AIRSPEED_M_S * np.sin(alpha), alpha
    acting = np.stack([np.interp(t - late_s, t, one) for one in surface])
    states, forces = pitch_truth.flown(truth.body, state, acting, thrust, gusts)
    u, w, q, theta, altitude = np.moveaxis(states, 1, 0)
    ax, az, q_dot, airspeed, angle = np.moveaxis(forces, 1, 0)
    if truth.effect == "vane_lag":
        angle = lfilter(*_lag(EFFECTS["vane_lag"]), angle - alpha, axis=0) + alpha
    if truth.effect == "vane_arm":
        angle = np.arctan2(w + gusts[:, 1] - q * EFFECTS["vane_arm"], u + gusts[:, 0])
    exact = {
        "airspeed_m_s": airspeed,
        "alpha_rad": angle,
        "q_rad_s": q * (EFFECTS["gyro_scale"] if truth.effect == "gyro_scale" else 1.0),
        "theta_rad": theta,
        "ax_m_s2": ax - q**2 * ACCELEROMETER_M,
        "az_m_s2": az - q_dot * ACCELEROMETER_M,
        "elevator_rad": surface.T,
        "altitude_m": 150.0 + altitude,
    }
    channels = {name: _measured(rng, x[::every], noise * (stds or NOISE)[name]) for name, x in exact.items()}
    samples = steps // every + 1
    names = tuple(f"r{i + 1}" for i in range(RECORDS))
    times = np.tile(t[::every], RECORDS)
    return FlightLog({"aircraft": "small"}, names, samples * np.arange(RECORDS + 1), times, channels)


def _lag(time_s: float) -> tuple[list[float], list[float]]:
    """Numerator and denominator of a first-order lag by the bilinear transform."""
    ratio = 2.0 * time_s / STEP_S
    return [1.0 / (1.0 + ratio)] * 2, [1.0, (1.0 - ratio) / (1.0 + ratio)]


def _measured(rng: np.random.Generator, exact: Array, std: float) -> Array:
    """Samples of all records, one after another, with noise."""
    picked = exact.T.ravel()
    return np.asarray(picked + std * rng.standard_normal(picked.size))


def trimmed(truth: Truth = Truth()) -> tuple[float, float, float]:
    """Angle of attack [rad], elevator [rad] and thrust [N] of level flight."""
    return pitch_truth.trimmed(truth.body)


def _commands(rng: np.random.Generator, t: Array) -> Array:
    """(records, steps) 3-2-1-1 and doublets of 3 to 5 deg in both signs, from 1 s on [rad]."""
    found = np.zeros((RECORDS, t.size))
    for i in range(RECORDS):
        steps = (
            ((3, 1), (2, -1), (1, 1), (1, -1)) if i % 3 != 1 else ((1, 1), (1, -1), (3, 0), (1, -1), (1, 1))
        )
        amplitude = rng.uniform(3.0, 5.0) * DEG * (-1.0) ** i
        unit, start = rng.uniform(0.25, 0.35), rng.uniform(1.0, 1.2)
        for count, sign in steps:
            found[i, (t >= start) & (t < start + count * unit)] = sign * amplitude
            start += count * unit
    return found


def _servo(command: Array, start: float) -> Array:
    """(records, steps) first order with a rate limit, in ten substeps."""
    made, x = np.empty_like(command), np.full(len(command), start)
    for k in range(command.shape[1]):
        made[:, k] = x
        for _ in range(10):
            x = x + 0.1 * STEP_S * np.clip((command[:, k] - x) / SERVO_S, -RATE_RAD_S, RATE_RAD_S)
    return made


def main(argv: Sequence[str] | None = None) -> None:
    """Fly and trace the trials, and print one line for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument(
        "--gust", type=float, default=0.0, help="standard deviation of the vertical gust [m/s]"
    )
    parser.add_argument("--effect", choices=sorted(EFFECTS))
    parser.add_argument(
        "--drawn",
        action="store_true",
        help="draw derivatives, mass and inertia from their declared uncertainty",
    )
    parser.add_argument("--every", type=int, default=EVERY, help="steps of 2.5 ms to a sample of the log")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        plane = declared(Path(folder))
        for seed in range(options.seed, options.seed + options.trials):
            truth = drawn(seed, options.effect) if options.drawn else Truth(effect=options.effect)
            log = flight_log(seed, options.gust, truth, every=options.every)
            answer = trace([log], plane, TraceOptions()).to_dict()
            named = "; ".join(_shown(effect) for effect in answer["effects"]) or "-"
            provisional = ", provisional" if answer["provisional"] else ""
            p_value = answer["anomaly"]["p_value"]
            sys.stdout.write(f"{seed}: {answer['verdict']}{provisional}, p = {p_value:.2g}: {named}\n")
            sys.stdout.flush()


def _shown(effect: dict[str, object]) -> str:
    return f"{effect['name']} {effect['parameters']} or {effect['indistinguishable_from']}"


if __name__ == "__main__":
    main()
