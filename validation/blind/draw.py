"""A trial drawn from its number, and flown: logs, and the truth as plain data."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import write_log, write_text
from validation.blind import causes, gusts, sensors, surface
from validation.blind.aircraft_xml import Body
from validation.blind.damper import Damper
from validation.blind.figures import (
    BODY,
    CONDITIONS,
    DEG,
    DERIVATIVES,
    LEAVE_ONE_OUT,
    LENGTH_M,
    LOG_STEP_S,
    SIGMA_M_S,
    SPAN_M,
    STEP_S,
    WITHHELD,
    G,
)
from validation.blind.flight import Truth
from validation.blind.sizes import SIZE16
from validation.blind.surface import Manoeuvre
from validation.blind.truths import EFFECTS, FURTHER, LIBRARY, OFF_LIBRARY, Added, Parts, combined, model

Array = NDArray[np.float64]

MODES: Final = (
    "mixed",
    "null",
    "single",
    "pair",
    "off-library",
    "clutter",
    "curve",
    "unmodelled",
    LEAVE_ONE_OUT,
    *causes.COMPOSITIONS,
    *CONDITIONS,
)
AIRS: Final = tuple(SIGMA_M_S)
_MIXED: Final = {"null": 0.25, "single": 0.45, "pair": 0.12, "off-library": 0.12, "clutter": 0.06}
_SIZES: Final = (0.35, 8.0)  # over size16: noncentrality about 2 to 1000
_CLUTTER: Final = (0.15, 0.5)
_TRIPLE_SIZES: Final = (1.7, 8.0)  # noncentrality about 46 to 1000
_CURVE_SIZES: Final = (0.2, 1.5)  # noncentrality about 0.6 to 36
CURVE: Final = (
    "elevator_delay",
    "elevator_asymmetry",
    "cm_alpha_nonlinear:quadratic",
    "downwash_lag",
    "vane_arm",
    "vane_lag",
    "gyro_lag",
    "accelerometer_arm",
)
"""Whose detection is compared with its bound as a curve over size."""
_CLUTTERS: Final = 4
_WITHOUT: Final = 0.25  # share of trials without any effect in the modes of `CONDITIONS`
_CHANGE: Final = 0.10  # of the airspeed
_DAMPER_S: Final = (0.2, 0.6)
_STEPS_S: Final = (0.040, 0.052, 0.064, 0.080, 0.100)  # 25 to 10 Hz
_LINES: Final = 0.25  # highest line of a multisine over the rate of the log
_LEAD_S: Final = {"calm": 0.2, "light": 2.0, "moderate": 2.0}
_UNLIMITED_HZ: Final = 1e3  # JSON has no infinity
FORBIDDEN: Final = ("airtruth.effects", "airtruth.identification", "airtruth.tracing")


@dataclass(frozen=True)
class Trial:
    """Everything that makes a trial, before it flies.

    Attributes
    ----------
    seed, number : of the trial.
    composition : "null", "single", "pair", "off-library", "clutter", `LEAVE_ONE_OUT`, or one of `causes.COMPOSITIONS` or
        `CONDITIONS`.
    effects : the effects proper; clutter : small ones besides.
    body : drawn derivatives, mass, inertia, CG.
    air : "calm", "light" or "moderate"; spectrum of the gusts; whether they have a rotary part.
    noise : kind of sensor noise.
    duration_s, manoeuvres : records.
    """

    seed: int
    number: int
    composition: str
    effects: tuple[Added, ...]
    clutter: tuple[Added, ...]
    body: Body
    air: str
    spectrum: str
    rotary: bool
    noise: str
    duration_s: float
    manoeuvres: tuple[Manoeuvre, ...]

    @property
    def lead_s(self) -> float:
        """Flight before a record begins."""
        return _LEAD_S[self.air]

    @property
    def log_step_s(self) -> float:
        """Period of the log."""
        return self.manoeuvres[0].log_step_s


def stream(seed: int, number: int, purpose: int) -> np.random.Generator:
    """The random numbers of one purpose in one trial."""
    return np.random.default_rng([seed, number, purpose])


def draw(seed: int, number: int, mode: str = "mixed") -> Trial:
    """The trial of a number."""
    rng = stream(seed, number, 0)
    composition = str(rng.choice(list(_MIXED), p=list(_MIXED.values()))) if mode == "mixed" else mode
    air = str(rng.choice(AIRS))
    if composition in causes.COMPOSITIONS:
        effects, clutter = _set(composition, air, rng), ()
    else:
        effects, clutter = _pooled(composition, air, rng)
    trial = Trial(
        seed=seed,
        number=number,
        composition={"curve": "single", "unmodelled": "off-library"}.get(composition, composition),
        effects=effects,
        clutter=clutter,
        body=_body(rng),
        air=air,
        spectrum=str(rng.choice(gusts.KINDS)),
        rotary=bool(rng.random() < 0.5),
        noise=str(rng.choice(sensors.NOISE_KINDS, p=[0.5, 0.25, 0.25])),
        duration_s=float(rng.choice([5.0, 6.0, 8.0, 10.0])),
        manoeuvres=_manoeuvres(rng)[: int(rng.integers(2, 4)) if composition == "slow" else None],
    )
    return replace(trial, manoeuvres=_conditions(trial, rng)) if composition in CONDITIONS else trial


def _conditions(trial: Trial, rng: np.random.Generator) -> tuple[Manoeuvre, ...]:
    """The manoeuvres of a trial in drifting airspeed, with a damper, or in a coarse log."""
    count = len(trial.manoeuvres)
    if trial.composition == "drift":
        kind = str(rng.choice(["swing", "shear"]))
        signs = rng.choice([-1.0, 1.0], count).tolist()
        changes: list[dict[str, float]] = [{kind: _CHANGE * sign} for sign in signs]
    elif trial.composition == "loop":
        changes = [{"damper_s": float(rng.uniform(*_DAMPER_S))}] * count
    else:
        step = float(rng.choice(_STEPS_S))
        changes = [{"log_step_s": step, "highest_hz": _LINES / step}] * count
    return tuple(replace(m, **change) for m, change in zip(trial.manoeuvres, changes, strict=True))


def _pooled(
    composition: str, air: str, rng: np.random.Generator
) -> tuple[tuple[Added, ...], tuple[Added, ...]]:
    """Effects and clutter of a composition, from their pools."""
    own = composition if composition != "clutter" else ("single" if rng.random() < 0.6 else "null")
    sizes = {"curve": _CURVE_SIZES, "unmodelled": _TRIPLE_SIZES, LEAVE_ONE_OUT: _TRIPLE_SIZES}.get(
        own, _SIZES
    )
    if own in CONDITIONS:
        own, sizes = ("null" if rng.random() < _WITHOUT else "single"), _TRIPLE_SIZES
    pool, count = {
        "null": (LIBRARY, 0),
        "single": (LIBRARY, 1),
        "curve": (CURVE, 1),
        "pair": (LIBRARY, 2),
        "off-library": (OFF_LIBRARY, 1),
        "unmodelled": (OFF_LIBRARY + FURTHER, 1),
        LEAVE_ONE_OUT: (tuple(key for key in LIBRARY if key != "airspeed_scale"), 1),
    }[own]
    keys = [str(key) for key in rng.choice(pool, count, replace=False)]
    clutter_keys: list[str] = []
    if composition == "clutter":
        pool = tuple(key for key in (*LIBRARY, *OFF_LIBRARY) if key not in keys)
        clutter_keys = [str(key) for key in rng.choice(pool, _CLUTTERS, replace=False)]
    return (
        tuple(_added(key, air, sizes, rng) for key in keys),
        tuple(_added(key, air, _CLUTTER, rng) for key in clutter_keys),
    )


def _set(composition: str, air: str, rng: np.random.Generator) -> tuple[Added, ...]:
    """The effects of a trial that is scored by their set."""
    if composition == "derivative":
        return (Added("derivatives", causes.draw_derivatives(rng)),)
    if composition == "triple":
        rows = rng.choice(len(causes.FAMILIES), 3, replace=False).tolist()
        keys = [str(rng.choice(causes.FAMILIES[row])) for row in rows]
        return tuple(_added(key, air, _TRIPLE_SIZES, rng) for key in keys)
    drawn = causes.draw_composite(rng) if composition == "composite" else causes.draw_slow(rng)
    return tuple(Added(key, values) for key, values in drawn)


def _added(key: str, air: str, sizes: tuple[float, float], rng: np.random.Generator) -> Added:
    kind = EFFECTS[key]
    low, high = np.log(sizes)
    size = SIZE16[key][AIRS.index(air)] * float(np.exp(rng.uniform(low, high)))
    size = min(size, kind.largest)
    if kind.signed and rng.random() < 0.5:
        size = -size
    return Added(key, kind.values(size, float(rng.random())))


def _body(rng: np.random.Generator) -> Body:
    derivatives = {name: std * float(rng.standard_normal()) for name, (_, std) in DERIVATIVES.items()}
    mass, inertia, cg = rng.standard_normal(3).tolist()
    return Body(derivatives, 1.0 + BODY["mass"] * mass, 1.0 + BODY["inertia"] * inertia, BODY["cg"] * cg)


def _manoeuvres(rng: np.random.Generator) -> tuple[Manoeuvre, ...]:
    """Six: doublets and 3-2-1-1 in both signs and two amplitudes, a multisine; two kinds are held out."""
    small, large = float(rng.uniform(0.6, 1.0)) * DEG, float(rng.uniform(1.4, 2.2)) * DEG
    plan = [
        ("doublet", large),
        ("3211", -small),
        ("doublet", -large),
        ("3211", 1.2 * small),
        ("multisine", large),
        ("3211", -1.2 * small),
    ]
    result = []
    for kind, amplitude in plan:
        unit = {"doublet": 0.5, "3211": 0.3, "multisine": 1.0}[kind] * float(rng.uniform(0.85, 1.15))
        phases = tuple(rng.uniform(0.0, 2.0 * np.pi, len(surface.MULTISINE_HZ)).tolist())
        start = float(rng.uniform(0.8, 1.2))
        result.append(Manoeuvre(kind, amplitude, start, unit, phases if kind == "multisine" else ()))
    return tuple(result)


def truth_of(trial: Trial, effects: Sequence[Added], step_s: float = STEP_S) -> tuple[Truth, Parts]:
    """The trial's aircraft with these effects, trimmed."""
    parts = combined(effects)
    return Truth(model(trial.body, parts), step_s), parts


def fly_record(
    truth: Truth,
    parts: Parts,
    manoeuvre: Manoeuvre,
    duration_s: float,
    lead_s: float,
    air: Array | None = None,
) -> dict[str, Array]:
    """Noise-free readings of one record at the log's times."""
    command, position, seen = surface.actuate(manoeuvre, duration_s, lead_s, parts.chain)
    every = round(truth.step_s / STEP_S)
    count = len(seen[::every])
    channels = truth.fly(
        seen[::every],
        wind(truth, manoeuvre, duration_s, lead_s, count, air),
        entry=entry(truth.airspeed_m_s, manoeuvre.swing, lead_s),
    )
    return _read(truth, parts, manoeuvre, lead_s, channels, (command, position))


def _read(
    truth: Truth,
    parts: Parts,
    manoeuvre: Manoeuvre,
    lead_s: float,
    channels: dict[str, Array],
    elevator: tuple[Array, Array],
) -> dict[str, Array]:
    """Readings of a flight, its command and measured surface as deviations from trim."""
    command, position = elevator
    clean = sensors.measured(
        channels, parts.faults, truth.model.body.cg, lead_s, truth.step_s, manoeuvre.log_step_s
    )
    clean["elevator_rad"] = truth.elevator_rad + position
    clean["elevator_command_rad"] = truth.elevator_rad + command
    clean["throttle"] = np.full(len(position), truth.throttle)
    return clean


def entry(airspeed_m_s: float, swing: float, lead_s: float) -> tuple[float, float]:
    """Airspeed over that of the trim and angle of climb [rad] a lead before a phugoid passes the trim's airspeed.

    Lanchester's phugoid: V'/V = swing omega cos(omega t), omega = sqrt(2) g/V, and V' = -g climb.
    """
    if swing == 0.0:
        return 1.0, 0.0
    turned = 2.0**0.5 * G / airspeed_m_s * lead_s
    return 1.0 - swing * float(np.sin(turned)), -(2.0**0.5) * swing * float(np.cos(turned))


def wind(
    truth: Truth, manoeuvre: Manoeuvre, duration_s: float, lead_s: float, count: int, air: Array | None
) -> Array | None:
    """The air of a record with its wind along the path, None where it is at rest; (3, count)."""
    if manoeuvre.shear == 0.0:
        return air
    time = np.arange(count) * truth.step_s - lead_s
    total = np.zeros((3, count)) if air is None else air.copy()
    total[0] -= manoeuvre.shear * truth.airspeed_m_s * np.maximum(time, 0.0) / duration_s
    return total


def fly_damped(
    trial: Trial, truth: Truth, parts: Parts, record: int, air: Array | None = None, noisy: bool = True
) -> tuple[dict[str, Array], Damper]:
    """One record with a pitch damper: noise-free readings, and the damper with the readings that it saw.

    Parameters
    ----------
    noisy : whether the damper's gyro has noise and steps; without, the flight has the lead of calm air.
    """
    manoeuvre = trial.manoeuvres[record]
    lead_s = trial.lead_s if noisy else _LEAD_S["calm"]
    steps = round((lead_s + trial.duration_s) / STEP_S)
    errors, quantum = np.zeros(steps // round(LOG_STEP_S / STEP_S) + 1), 0.0
    if noisy:
        rng = stream(trial.seed, trial.number, 400 + record)
        errors = sensors.noise("q_rad_s", trial.noise, len(errors), rng)
        quantum = sensors.quantum("q_rad_s", trial.noise)
    damper = Damper(manoeuvre, parts.chain, parts.faults, lead_s, errors, quantum)
    channels = truth.fly(np.zeros(steps + 1), air, feedback=damper)
    damper(float(channels["q_rad_s"][-1]))
    every, first = round(LOG_STEP_S / surface.FINE_S), round(lead_s / surface.FINE_S)
    position = np.array(damper.measured[: steps * surface.FINE + 1])
    time = np.arange(len(position)) * surface.FINE_S - lead_s
    command = surface.command(manoeuvre, time)
    elevator = command[first::every], position[first::every]
    return _read(truth, parts, manoeuvre, lead_s, channels, elevator), damper


def open_loop(trial: Trial, noisy: bool) -> Trial:
    """A trial with a damper as one without, its surfaces those that the damper makes of it.

    Given the surface that is measured, the records tell of an effect what they tell in open loop: what the damper adds
    depends on earlier readings alone (L. Ljung, System Identification, 2nd ed., 1999, section 13.4).

    Parameters
    ----------
    noisy : the surfaces of the flight, with its gusts and its noise; otherwise those of calm air and a gyro without noise.
    """
    if trial.composition != "loop":
        return trial
    truth, parts = truth_of(trial, (*trial.effects, *trial.clutter))
    lead_s = trial.lead_s if noisy else _LEAD_S["calm"]
    steps = round((lead_s + trial.duration_s) / STEP_S)
    manoeuvres = []
    for index, manoeuvre in enumerate(trial.manoeuvres):
        air = gusts_of(trial, truth.airspeed_m_s, index, steps + 1) if noisy else None
        _, damper = fly_damped(trial, truth, parts, index, air, noisy)
        measured = np.array(damper.measured[: steps * surface.FINE + 1])
        manoeuvres.append(replace(manoeuvre, damper_s=0.0, measured=measured))
    return replace(trial, manoeuvres=tuple(manoeuvres))


def gusts_of(trial: Trial, v_m_s: float, record: int, count: int) -> Array | None:
    """The air of one record (3, count), None if it is calm."""
    if trial.air == "calm":
        return None
    rng = stream(trial.seed, trial.number, 100 + record)
    air = gusts.synthesise(trial.spectrum, SIGMA_M_S[trial.air], LENGTH_M, v_m_s, SPAN_M, STEP_S, count, rng)
    if not trial.rotary:
        air[2] = 0.0
    return air


def fly(trial: Trial) -> FlightLog:
    """Fly a trial; what a tracer is handed.

    Raises
    ------
    RuntimeError
        If this process knows the tracer's side.
    """
    known = [name for name in sys.modules if name.startswith(FORBIDDEN)]
    if known:
        raise RuntimeError(f"the truth must be flown by a process without {known[0]}")
    truth, parts = truth_of(trial, (*trial.effects, *trial.clutter))
    count = round((trial.lead_s + trial.duration_s) / STEP_S) + 1
    records = []
    for index, manoeuvre in enumerate(trial.manoeuvres):
        air = gusts_of(trial, truth.airspeed_m_s, index, count)
        rng = stream(trial.seed, trial.number, 200 + index)
        if trial.composition == "loop":
            clean, damper = fly_damped(trial, truth, parts, index, air)
            noisy = sensors.logged(clean, trial.noise, rng)
            noisy["q_rad_s"] = np.array(damper.readings[-len(clean["q_rad_s"]) :])
        else:
            clean = fly_record(truth, parts, manoeuvre, trial.duration_s, trial.lead_s, air)
            noisy = sensors.logged(clean, trial.noise, rng, trial.log_step_s)
        records.append({**clean, **noisy})
    return as_log(records, trial.log_step_s)


def as_log(records: Sequence[dict[str, Array]], log_step_s: float = LOG_STEP_S) -> FlightLog:
    """Records, one length, as a flight log; runs r1, r2, ..."""
    names = [name for name in records[0] if name != "q_dot_rad_s2"]
    n = len(records[0]["q_rad_s"])
    return FlightLog(
        metadata={"aircraft": "gtm", "sample_rate_hz": _rate(log_step_s)},
        run_ids=tuple(f"r{k + 1}" for k in range(len(records))),
        offsets=np.arange(len(records) + 1, dtype=np.int64) * n,
        t_s=np.tile(np.arange(n) * log_step_s, len(records)),
        channels={name: np.concatenate([r[name] for r in records]) for name in names},
    )


def _rate(log_step_s: float) -> float:
    rate = round(1.0 / log_step_s, 6)
    return int(rate) if rate == int(rate) else rate


def write(trial: Trial, folder: Path) -> Path:
    """Fly a trial and write its log, float32, and the names that a tracer has to do without; the log's path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "log.parquet"
    write_log(path, fly(trial))
    if trial.composition == LEAVE_ONE_OUT:
        write_text(folder / WITHHELD, json.dumps([effect.name for effect in trial.effects]))
    return path


def derivative_increments(trial: Trial) -> dict[str, float]:
    """What the draw and the causes add to the six derivatives, about the declared CG and trim."""
    total = {name: trial.body.derivatives.get(name, 0.0) * value for name, value in causes.DECLARED.items()}
    for effect in trial.effects:
        for name, value in causes.increments(effect.key, effect.values).items():
            total[name] += value
    return total


def plain(trial: Trial) -> dict[str, Any]:
    """A trial as JSON data."""
    data = asdict(trial)
    for manoeuvre in data["manoeuvres"]:
        del manoeuvre["measured"], manoeuvre["samples_rad"]
        manoeuvre["highest_hz"] = min(manoeuvre["highest_hz"], _UNLIMITED_HZ)
    return data
