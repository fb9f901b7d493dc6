"""A trial drawn from its number, and flown: logs, and the truth as plain data."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import write_log
from blind import gusts, sensors, surface
from blind.aircraft_xml import Body
from blind.figures import BODY, DEG, DERIVATIVES, LENGTH_M, LOG_STEP_S, SIGMA_M_S, SPAN_M, STEP_S
from blind.flight import Truth
from blind.sizes import SIZE16
from blind.surface import Manoeuvre
from blind.truths import EFFECTS, LIBRARY, OFF_LIBRARY, Added, Parts, combined, model

Array = NDArray[np.float64]

MODES: Final = ("mixed", "null", "single", "pair", "off-library", "clutter", "curve")
AIRS: Final = tuple(SIGMA_M_S)
_MIXED: Final = {"null": 0.25, "single": 0.45, "pair": 0.12, "off-library": 0.12, "clutter": 0.06}
_SIZES: Final = (0.35, 8.0)  # over size16: noncentrality about 2 to 1000
_CLUTTER: Final = (0.15, 0.5)
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
_LEAD_S: Final = {"calm": 0.2, "light": 2.0, "moderate": 2.0}
FORBIDDEN: Final = ("airtruth.effects", "airtruth.identify", "airtruth.trace")


@dataclass(frozen=True)
class Trial:
    """Everything that makes a trial, before it flies.

    Attributes
    ----------
    seed, number : of the trial.
    composition : "null", "single", "pair", "off-library" or "clutter".
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


def stream(seed: int, number: int, purpose: int) -> np.random.Generator:
    """The random numbers of one purpose in one trial."""
    return np.random.default_rng([seed, number, purpose])


def draw(seed: int, number: int, mode: str = "mixed") -> Trial:
    """The trial of a number."""
    rng = stream(seed, number, 0)
    composition = str(rng.choice(list(_MIXED), p=list(_MIXED.values()))) if mode == "mixed" else mode
    sizes = _SIZES
    air = str(rng.choice(AIRS))
    if mode == "curve":
        composition = "single"
    own = composition if composition != "clutter" else ("single" if rng.random() < 0.6 else "null")
    pool, count = {
        "null": (LIBRARY, 0),
        "single": (LIBRARY, 1),
        "pair": (LIBRARY, 2),
        "off-library": (OFF_LIBRARY, 1),
    }[own]
    if mode == "curve":
        pool, sizes = CURVE, _CURVE_SIZES
    keys = [str(key) for key in rng.choice(pool, count, replace=False)]
    clutter_keys: list[str] = []
    if composition == "clutter":
        pool = tuple(key for key in (*LIBRARY, *OFF_LIBRARY) if key not in keys)
        clutter_keys = [str(key) for key in rng.choice(pool, _CLUTTERS, replace=False)]
    return Trial(
        seed=seed,
        number=number,
        composition=composition,
        effects=tuple(_added(key, air, sizes, rng) for key in keys),
        clutter=tuple(_added(key, air, _CLUTTER, rng) for key in clutter_keys),
        body=_body(rng),
        air=air,
        spectrum=str(rng.choice(gusts.KINDS)),
        rotary=bool(rng.random() < 0.5),
        noise=str(rng.choice(sensors.NOISE_KINDS, p=[0.5, 0.25, 0.25])),
        duration_s=float(rng.choice([5.0, 6.0, 8.0, 10.0])),
        manoeuvres=_manoeuvres(rng),
    )


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
    channels = truth.fly(seen[::every], air)
    cg = truth.model.body.cg
    clean = sensors.measured(channels, parts.faults, cg, lead_s, truth.step_s)
    clean["elevator_rad"] = truth.elevator_rad + position
    clean["elevator_command_rad"] = truth.elevator_rad + command
    clean["throttle"] = np.full(len(position), truth.throttle)
    return clean


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
        clean = fly_record(truth, parts, manoeuvre, trial.duration_s, trial.lead_s, air)
        noisy = sensors.logged(clean, trial.noise, stream(trial.seed, trial.number, 200 + index))
        records.append({**clean, **noisy})
    return as_log(records)


def as_log(records: Sequence[dict[str, Array]]) -> FlightLog:
    """Records, one length, as a flight log; runs r1, r2, ..."""
    names = [name for name in records[0] if name != "q_dot_rad_s2"]
    n = len(records[0]["q_rad_s"])
    return FlightLog(
        metadata={"aircraft": "gtm", "sample_rate_hz": round(1.0 / LOG_STEP_S)},
        run_ids=tuple(f"r{k + 1}" for k in range(len(records))),
        offsets=np.arange(len(records) + 1, dtype=np.int64) * n,
        t_s=np.tile(np.arange(n) * LOG_STEP_S, len(records)),
        channels={name: np.concatenate([r[name] for r in records]) for name in names},
    )


def write(trial: Trial, folder: Path) -> Path:
    """Fly a trial and write its log, float32; its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "log.parquet"
    write_log(path, fly(trial))
    return path


def plain(trial: Trial) -> dict[str, Any]:
    """A trial as JSON data."""
    return asdict(trial)
