"""Consistency of the estimators when a pitch damper feeds noise and gusts back to the elevator, and the effect of a
nonlinear auxiliary model. Prints the tables of docs/closed_loop.md.

    python -m studies.closed_loop_study [calm] [loop] [growth] [tables] [auxiliary] [methods] [--runs N]
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from airtruth import aircraft as registry
from airtruth.aircraft import Aircraft
from airtruth.identification import Estimates, Options, identify_batch, identify_joint
from airtruth.logs import store
from airtruth.logs.flight_log import Batch, batches
from airtruth.physics.longitudinal import auxiliary, simulate
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import Scale, system
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.simulation.linearise import linearise
from airtruth.simulation.probe import probe
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import Trim, trim
from airtruth.units import DEG, FT, KT
from studies.affine_aircraft import affine_copy

Array = NDArray[np.float64]
Auxiliary = Callable[[Array, Array, float, Scale], tuple[Array, ...]]

GTM: Final = Path(__file__).resolve().parents[1] / "aircraft" / "gtm"
"""Declared aircraft."""

CONDITION: Final = Condition(75.0 * KT, 7000.0 * FT)
"""Flight condition of the paper: equivalent airspeed [m/s] and altitude [m]."""

LOOP_STEP_S: Final = 0.005
"""Step of the auxiliary model of the loop [s], that of the simulation."""

DAMPER_DELAY_S: Final = 0.010
"""Delay of the damper in JSBSim [s]: its path does not have the frame by which a command is late."""

NOISE: Final = {"alpha_rad": (0.031, "deg"), "q_rad_s": (0.3857, "deg_s"), "elevator_rad": (0.01, "deg")}
"""Channel -> standard deviation of the sensor noise, and its unit (aircraft/gtm/aircraft.toml)."""

NOISE_AZ_G: Final = 0.0082
"""Standard deviation of the accelerometer noise [g] (aircraft/gtm/aircraft.toml)."""

TOLERANCE: Final = 1e-4
"""Tolerance of the iteration [-]; judgement: well below the differences between the estimators."""

SHOWN: Final = ("CLalpha", "Cmalpha", "Cmq", "Cmde")
"""Derivatives in the tables."""


@dataclass(frozen=True)
class Level:
    """Damper gain [s], and factors of the light gusts and of the sensor noise [-], of one campaign."""

    damper_gain_s: float
    gust: float
    noise: float

    def __str__(self) -> str:
        return f"K {self.damper_gain_s:.1f} s, gust {self.gust:g}, noise {self.noise:g}"


def fly(folder: Path, level: Level, runs: int, seed: int, log_hz: int = 50) -> Batch:
    """Fly a campaign of 5 s with a doublet of 2 deg; return its records."""
    noise = "".join(
        f'[sensors.channel.{name}]\nnoise_std = {{ value = {value * level.noise}, unit = "{unit}" }}\n'
        for name, (value, unit) in (*NOISE.items(), ("az_m_s2", (NOISE_AZ_G, "g")))
    )
    gust = f'level = "light"\nfactor = {level.gust}' if level.gust else 'level = "none"'
    text = f"""
schema = 1
name = "loop"
aircraft = "{folder}"
runs = {runs}
seed = {seed}
duration_s = 5.0
log_hz = {log_hz}
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "doublet"
amplitude_deg = 2.0
[gust]
figures = "gtm"
{gust}
[augmentation]
damper_gain_s = {level.damper_gain_s}
{noise}"""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "loop.toml"
        path.write_text(text)
        out = Path(scratch) / "out"
        failures = campaign.fly(plan.make(path), out).failures
        if failures:
            raise RuntimeError(f"{level}: {failures[0].reason}")
        parts = [b for log in sorted((out / "logs").glob("*.parquet")) for b in batches(store.read_log(log))]
    return Batch(
        run_ids=tuple(name for b in parts for name in b.run_ids),
        dt_s=parts[0].dt_s,
        t_s=np.concatenate([b.t_s for b in parts]),
        channels={name: np.concatenate([b.channels[name] for b in parts]) for name in parts[0].channels},
    )


def loop_auxiliary(
    damper_gain_s: float, bandwidth_rad_s: float, delay_s: float, damper_delay_s: float
) -> Auxiliary:
    """Return the auxiliary model of the whole loop: eq. (2) of the paper behind servo, delays and damper.

    Its input is the reference (runs, samples) [rad]. The servo is e' = w (c - e) with c(t) = reference(t - delay) +
    gain q(t - damper delay) in steps of `LOOP_STEP_S`; c is linear over a step, and a delay is at least one step.
    It returns alpha, q and elevator.
    """
    late, damper_late = (max(1, round(d / LOOP_STEP_S)) for d in (delay_s, damper_delay_s))

    def respond(theta: Array, u: Array, dt_s: float, scale: Scale) -> tuple[Array, ...]:
        a, b = system(theta, scale)
        runs, samples = u.shape
        every = round(dt_s / LOOP_STEP_S)
        big = np.zeros((runs, 5, 5))  # alpha, q, elevator, c, slope of c
        big[:, :2, :2], big[:, :2, 2] = a, b
        big[:, 2, 2], big[:, 2, 3], big[:, 3, 4] = -bandwidth_rad_s, bandwidth_rad_s, 1.0
        step = expm(big * LOOP_STEP_S)[:, :3]
        fine = np.arange((samples - 1) * every + 1)
        reference = np.stack([np.interp(fine / every, np.arange(samples), row) for row in u], axis=1)
        state, command = np.zeros((fine.size, runs, 5)), np.zeros((fine.size + damper_late, runs))
        command[late : fine.size] = reference[: fine.size - late]
        for k in range(fine.size - 1):
            command[k + damper_late] += damper_gain_s * state[k, :, 1]
            state[k, :, 3] = command[k]
            state[k, :, 4] = (command[k + 1] - command[k]) / LOOP_STEP_S
            state[k + 1, :, :3] = np.einsum("rij,rj->ri", step, state[k])
        return tuple(np.ascontiguousarray(state[::every, :, i].T) for i in range(3))

    return respond


def of_reference(loop: Auxiliary, reference: Array) -> Auxiliary:
    """Return the loop driven by one reference (samples,) in place of the input that the method passes, for iv-f1."""

    def respond(theta: Array, u: Array, dt_s: float, scale: Scale) -> tuple[Array, ...]:
        return loop(theta, np.broadcast_to(reference, u.shape), dt_s, scale)

    return respond


def estimators(batch: Batch, level: Level, gtm: Aircraft) -> dict[str, tuple[str, Options]]:
    """Return label -> method and options; all runs of a batch have the same reference."""
    servo = gtm.file.elevator_actuator
    assert servo is not None
    bandwidth = 2.0 * np.pi * servo.bandwidth.value
    loop = loop_auxiliary(level.damper_gain_s, bandwidth, servo.delay.value, DAMPER_DELAY_S)
    reference = batch.channels["elevator_command_rad"][0]
    fixed = of_reference(loop, reference - reference[0])
    plain = Options(covariance="none", tolerance=TOLERANCE)
    return {
        "ls": ("ls", plain),
        "iv-lowpass": ("iv-lowpass", plain),
        "iv-f1": ("iv-f1", plain),
        "iv-reference": ("iv-reference", plain),
        "iv-reference, loop": ("iv-reference", replace(plain, auxiliary=loop)),
        "iv-f1, loop": ("iv-f1", replace(plain, auxiliary=fixed)),
    }


def part_of(batch: Batch, rows: slice) -> Batch:
    """Return some of the runs."""
    channels = {name: values[rows] for name, values in batch.channels.items()}
    return replace(batch, run_ids=batch.run_ids[rows], t_s=batch.t_s[rows], channels=channels)


def groups(batch: Batch, size: int) -> Iterator[Batch]:
    """Yield groups of ``size`` runs without the remainder."""
    for first in range(0, len(batch.run_ids) - size + 1, size):
        yield part_of(batch, slice(first, first + size))


def joint(batch: Batch, size: int, gtm: Aircraft, method: str, options: Options) -> Array:
    """Return joint estimates of groups of runs, (groups, 6), without those that did not converge."""
    if size == 1:
        estimates: list[Estimates] = [identify_batch(batch, gtm, method, options)]
    else:
        estimates = [identify_joint([g], gtm, method, options) for g in groups(batch, size)]
    return np.concatenate([e.theta[e.converged] for e in estimates])


def errors(theta: Array, truth: Array) -> str:
    """Return the bias [% of the truth] ± its Monte Carlo standard error of the derivatives in `SHOWN`."""
    if not len(theta):
        return " | ".join([f"{'none':>15}"] * len(SHOWN))
    cells = []
    for name in SHOWN:
        i = LONGITUDINAL.parameters.index(name)
        error = 100.0 * (theta[:, i] / truth[i] - 1.0)
        spread = error.std(ddof=1) / np.sqrt(len(error)) if len(error) > 1 else np.nan
        cells.append(f"{error.mean():+8.2f} ± {spread:4.2f}" if len(error) > 1 else f"{error.mean():+8.2f}")
    return " | ".join(cells)


HEADER: Final = " | ".join(f"{name:>15}" for name in SHOWN)
"""Headings of the derivatives."""


def loop_table(folder: Path, truth: Array, gtm: Aircraft, runs: int, levels: Sequence[Level]) -> None:
    """Print the error of each estimator in calm air, then the increment by gusts and noise: joint estimates of ten runs."""
    print(f"| level | estimator | {HEADER} | estimates |\n|---|---|" + "---|" * (len(SHOWN) + 1))
    calm: dict[tuple[float, str], Array] = {}
    for number, level in enumerate(levels):
        still = level.gust == 0.0 and level.noise == 0.0
        batch = fly(folder, level, 1 if still else runs, 100 + number)
        for label, (method, options) in estimators(batch, level, gtm).items():
            key = (level.damper_gain_s, label)
            if still:
                theta = joint(batch, 1, gtm, method, options)
                calm[key] = theta[0]
                print(f"| {level} | {label:18} | {errors(theta, truth)} | |", flush=True)
                continue
            theta = joint(batch, 10, gtm, method, options)
            added = errors(theta - calm[key] + truth, truth)
            print(f"| {level} | {label:18} | {added} | {len(theta)} of {runs // 10} |", flush=True)


def methods_table(folder: Path, truth: Array, gtm: Aircraft, runs: int, levels: Sequence[Level]) -> None:
    """Print the error of the methods that `estimators` lacks, and of two that it has: joint estimates of ten runs."""
    print(f"| level | estimator | {HEADER} | estimates |\n|---|---|" + "---|" * (len(SHOWN) + 1))
    options = Options(covariance="none")
    for number, level in enumerate(levels):
        batch = fly(folder, level, runs, 300 + number)
        for method in METHODS:
            theta = joint(batch, 10, gtm, method, options)
            print(
                f"| {level} | {method:12} | {errors(theta, truth)} | {len(theta)} of {runs // 10} |",
                flush=True,
            )


def calm_table(folder: Path, truth: Array, gtm: Aircraft, at: Trim, level: Level) -> None:
    """Print the errors in calm air without noise, by sample rate and with constant airspeed."""
    print(f"{level}\n| record | estimator | {HEADER} |\n|---|---|" + "---|" * len(SHOWN))
    for log_hz in (50, 100, 200):
        batch = fly(folder, level, 1, 1, log_hz)
        for label, (method, options) in estimators(batch, level, gtm).items():
            theta = joint(batch, 1, gtm, method, options)
            print(f"| {log_hz} Hz | {label:18} | {errors(theta, truth)} |", flush=True)
    model = probe(gtm, at)
    for drift, word in ((1.0, "free"), (0.0, "held")):
        motion = simulate(replace(model, drift=drift), batch.channels["elevator_rad"], batch.dt_s)
        made = {
            "airspeed_m_s": motion.airspeed_m_s,
            "alpha_rad": motion.alpha_rad,
            "q_rad_s": motion.q_rad_s,
            "az_m_s2": motion.az_m_s2,
        }
        simulated = replace(batch, channels={**batch.channels, **made})
        for label, (method, options) in estimators(batch, level, gtm).items():
            theta = joint(simulated, 1, gtm, method, options)
            print(f"| 200 Hz, tables, airspeed {word} | {label:18} | {errors(theta, truth)} |", flush=True)


def growth_table(folder: Path, truth: Array, gtm: Aircraft, runs: int, level: Level) -> None:
    """Print the bias of joint estimates by the number of runs in an estimate."""
    print(f"{level}\n| estimator | runs per estimate | {HEADER} |\n|---|---|" + "---|" * len(SHOWN))
    batch = fly(folder, level, runs, 7)
    for label, (method, options) in estimators(batch, level, gtm).items():
        for size in (1, 10, 100):
            theta = joint(batch, size, gtm, method, options)
            print(f"| {label:18} | {size:3} | {errors(theta, truth)} |", flush=True)


def auxiliary_table(gtm: Aircraft, at: Trim, truth: Array, runs: int, gust: float) -> None:
    """Linear against nonlinear auxiliary model."""
    model = probe(gtm, at)
    calm = fly(gtm.folder, Level(0.0, 0.0, 0.0), 1, 1)
    batch = fly(gtm.folder, Level(0.0, gust, 1.0), runs, 11)
    surface = calm.channels["elevator_rad"]
    error = simulate(model, surface, calm.dt_s).alpha_rad - calm.channels["alpha_rad"]
    print(
        f"light gusts x {gust:g}; nonlinear model against JSBSim in calm air: alpha within {np.abs(error).max() / DEG:.4f} deg"
    )
    print(
        f"| method | auxiliary | {HEADER} | std Cmalpha % | std Cmq % | std Cmde % | iterations | converged |"
    )
    print("|---|---|" + "---|" * (len(SHOWN) + 5))
    squares = identify_batch(calm, gtm, "ls", Options(covariance="none")).theta
    print(f"| ls | none, calm air | {errors(squares, truth)} | | | | | |")
    for method in ("iv-lowpass", "iv-f1"):
        plain = Options(covariance="none")
        secant = identify_batch(calm, gtm, method, plain).theta[0]
        print(f"| {method} | linear, calm air | {errors(secant[None], truth)} | | | | | |")
        for label, chosen in (
            ("linear", None),
            ("tables, slopes   ", auxiliary(model, truth)),
            ("tables, calm fit ", auxiliary(model, secant)),
        ):
            e = identify_batch(batch, gtm, method, replace(plain, auxiliary=chosen))
            theta = e.theta[e.converged]
            spread = 100.0 * theta.std(axis=0, ddof=1) / np.abs(truth)
            precision = 1.0 / np.sqrt(2.0 * len(theta))
            figures = " | ".join(f"{s:.2f} ± {s * precision:.2f}" for s in spread[3:])
            print(
                f"| {method} | {label} | {errors(theta, truth)} | {figures} | {e.iterations.mean():.2f} | "
                f"{e.converged.sum()} of {runs} |",
                flush=True,
            )


LEVELS: Final = [
    Level(gain, gust, noise)
    for gain in (0.0, 0.3, 0.6)
    for gust, noise in ((0.0, 0.0), (0.0, 1.0), (0.0, 4.0), (1.0, 1.0), (2.0, 1.0), (4.0, 1.0))
]
"""Levels of damper gain, gusts and noise, those without disturbances first for each gain."""

METHODS: Final = (
    "ls",
    "iv-reference",
    "iv-actuator",
    "iv-kalman",
    "iv-refined",
    "frequency",
    "iv-frequency",
    "filter-error",
    "output-error",
)
"""Methods of `methods_table`."""

METHOD_LEVELS: Final = [
    Level(0.0, 1.0, 1.0),
    Level(0.6, 0.0, 1.0),
    Level(0.6, 1.0, 1.0),
    Level(0.6, 2.0, 1.0),
]
"""Levels of `methods_table`: noise as declared, because the likelihood takes its prior from the declaration."""

PARTS: Final = ("calm", "loop", "growth", "tables", "auxiliary", "methods")
"""Tables that the command prints."""


def main() -> None:
    """Print the tables asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("part", nargs="*", help=f"of {', '.join(PARTS)}; all if none")
    parser.add_argument("--runs", type=int, default=400)
    chosen = parser.parse_args()
    parts, runs = chosen.part or PARTS, chosen.runs
    if set(parts) - set(PARTS):
        parser.error(f"parts are {', '.join(PARTS)}")
    gtm = registry.load(GTM)
    at = trim(gtm, CONDITION)
    own = linearise(gtm, at).plus
    with tempfile.TemporaryDirectory() as scratch:
        flat = affine_copy(GTM, Path(scratch) / "gtm", at.alpha_rad, at.elevator_rad)
        affine = registry.load(flat)
        level = trim(affine, CONDITION)
        truth = linearise(affine, level).plus
        if "calm" in parts:
            for gain in (0.0, 0.6):
                print("\n## Affine aerodynamics in calm air: error in per cent\n")
                calm_table(flat, truth, affine, level, Level(gain, 0.0, 0.0))
        if "loop" in parts:
            print("\n## Affine aerodynamics: error in calm air, then what gusts and noise add [%]\n")
            loop_table(flat, truth, affine, runs, LEVELS)
        if "growth" in parts:
            print("\n## Affine aerodynamics: error [%] by the number of runs that share an estimate\n")
            growth_table(flat, truth, affine, runs, Level(0.6, 2.0, 1.0))
        if "methods" in parts:
            print("\n## Affine aerodynamics, further methods: error [%]\n")
            methods_table(flat, truth, affine, runs, METHOD_LEVELS)
        if "tables" in parts:
            print("\n## The GTM's own tables: error in calm air, then what gusts and noise add [%]\n")
            loop_table(GTM, own, gtm, runs, [x for x in LEVELS if x.gust + x.noise in (0.0, 3.0)])
        if "auxiliary" in parts:
            for title, plane, where, right in (
                ("the GTM's own tables", gtm, at, own),
                ("affine aerodynamics", affine, level, truth),
            ):
                for gust in (1.0, 2.0):
                    print(f"\n## Auxiliary model, {title}\n")
                    auxiliary_table(plane, where, right, runs, gust)


if __name__ == "__main__":
    main()
