"""From a campaign file to a run table: every random draw of every run, before the first flight."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airtruth import __version__
from airtruth.aircraft import Aircraft, Sensor, load
from airtruth.aircraft.neutral import fitted
from airtruth.errors import AirtruthError, ConfigurationError, TrimError
from airtruth.logs.names import ordered_number
from airtruth.physics import atmosphere
from airtruth.physics.gust_figures import gust_scales, side_gust
from airtruth.simulation.campaign import effects as with_effects
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign import streams, tables
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.inputs import (
    beyond_limits,
    extreme_amplitudes,
    in_words,
    lacking,
    read_input,
)
from airtruth.simulation.campaign.numbering import chunk_numbers, chunk_offsets
from airtruth.simulation.disposable import isolated
from airtruth.simulation.manoeuvres import Manoeuvre, end_s, sample
from airtruth.simulation.simulator import Condition, Straight, jsbsim_model
from airtruth.simulation.trim import Trim, trim
from airtruth.units import KT

Array = NDArray[np.float64]

_FURTHER: Final = re.compile(r"amplitude_\d+_rad")
"""Columns of a run table with the amplitudes of the second input and those that follow."""


@dataclass(frozen=True)
class PlannedRun:
    """One row of a run table.

    Attributes
    ----------
    run, run_id, chunk : number and name of the run, and number of its chunk.
    eas_m_s, altitude_m, gamma_rad : flight condition, see `airtruth.simulation.simulator.Condition`.
    wind_m_s : constant wind along the track [m/s].
    manoeuvre : index in `Plan.manoeuvres`.
    amplitude_rad : factor on the first input, of unit amplitude [rad].
    sigma_u_m_s, sigma_w_m_s, length_u_m, length_w_m : gusts [m/s], [m].
    effects : the flown effects as JSON; None without effects.
    sigma_v_m_s, length_v_m : side gusts [m/s], [m].
    straight : how the trim holds the aircraft straight, see `airtruth.simulation.simulator.Condition`.
    further_amplitudes_rad : factors on the other inputs of the manoeuvre [rad]; entries beyond them are not numbers.
    """

    run: int
    run_id: str
    chunk: int
    eas_m_s: float
    altitude_m: float
    gamma_rad: float
    wind_m_s: float
    manoeuvre: int
    amplitude_rad: float
    sigma_u_m_s: float
    sigma_w_m_s: float
    length_u_m: float
    length_w_m: float
    effects: str | None = None
    sigma_v_m_s: float = 0.0
    length_v_m: float = 1.0
    straight: Straight = "pitch-plane"
    further_amplitudes_rad: tuple[float, ...] = ()

    def amplitude_of(self, number: int) -> float:
        """Factor on an input of the manoeuvre, counted from 0 [rad]."""
        return self.amplitude_rad if number == 0 else self.further_amplitudes_rad[number - 1]

    @property
    def condition(self) -> Condition:
        """Its flight condition."""
        return Condition(self.eas_m_s, self.altitude_m, self.gamma_rad, self.straight)


@dataclass(frozen=True)
class Plan:
    """A campaign with every random draw: all that a worker needs to fly any run.

    Attributes
    ----------
    campaign : the campaign file.
    aircraft : aircraft to fly, the campaign's effects added.
    seed : seed of every draw.
    sensors : channel -> sensor, the campaign's entries applied.
    inputs : alternatives, each with one or more inputs; run k flies number ``table.manoeuvre[k]``, scaled to its amplitudes.
    table : one row per run: run, run_id, chunk, eas_m_s, altitude_m, gamma_rad, wind_m_s, manoeuvre,
        amplitude_rad, sigma_u_m_s, sigma_w_m_s, length_u_m, length_w_m; where there are any amplitude_2_rad and so on
        (further inputs), sigma_v_m_s and length_v_m (side gusts), straight (lateral campaigns) and effects.
    digest : fingerprint of all this except the number of runs, by which a folder recognises its campaign.
    nominal : condition of the run of median airspeed and its trim, which no worker computes again.
    """

    campaign: Campaign
    aircraft: Aircraft
    seed: int
    sensors: dict[str, Sensor]
    inputs: tuple[tuple[Manoeuvre, ...], ...]
    table: pd.DataFrame
    digest: str
    nominal: tuple[Condition, Trim] | None = None

    @property
    def dt_s(self) -> float:
        """Simulation step [s]."""
        return 1.0 / self.campaign.simulation_hz

    @property
    def log_every(self) -> int:
        """Simulation steps per log sample."""
        return round(self.campaign.simulation_hz / self.campaign.log_hz)

    @property
    def t_s(self) -> Array:
        """(samples,) times of the simulation [s]."""
        return np.arange(self.samples, dtype=np.float64) * self.dt_s

    @property
    def samples(self) -> int:
        """Simulation samples per run, both ends counted."""
        return round(self.campaign.duration * self.campaign.simulation_hz) + 1


def make(campaign: Path | str | Campaign, seed: int | None = None, runs: int | None = None) -> Plan:
    """Read a campaign and draw its run table.

    Parameters
    ----------
    campaign : campaign file, or a campaign that was read; the paths in it are relative to the file's folder, or to the
        working folder.
    seed, runs : instead of the campaign's own.

    Raises
    ------
    ConfigurationError
        If the campaign cannot be flown as written, every problem in the message; the nominal condition is trimmed
        here.
    AircraftError
        If the aircraft does not exist or cannot be loaded.
    StoreError
        If a file cannot be read.
    """
    changes = {k: v for k, v in (("seed", seed), ("runs", runs)) if v is not None}
    if isinstance(campaign, Campaign):
        path = Path(f"campaign {campaign.name}")
        campaign = campaign.changed(changes)
    else:
        path = Path(campaign)
        campaign = campaign_file.read(path, changes)
    aircraft = load(campaign.aircraft, near=path.parent)
    lacks = lacking(campaign, jsbsim_model(aircraft))
    if lacks:
        raise ConfigurationError(
            f"{path}: "
            + "; ".join(f"{key}: {aircraft.name} has no {what} in its aircraft.toml" for key, what in lacks)
        )
    try:
        effects = with_effects.read(campaign)
        table = _run_table(campaign, campaign.seed)
        table = with_effects.state(with_effects.in_the_air(table, effects), campaign)
        flown = with_effects.aircraft(aircraft, effects, campaign.simulation_hz, _nominal(table))
        sensors = fitted(campaign.sensors.apply(aircraft.file.sensors), effects.sensors)
        inputs = tuple(tuple(read_input(i, path.parent) for i in row.inputs) for row in campaign.manoeuvre)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None
    plan = Plan(
        campaign=campaign,
        aircraft=flown,
        seed=campaign.seed,
        sensors=sensors,
        inputs=inputs,
        table=table,
        digest=_digest(campaign, flown, inputs),
    )
    return _checked(plan, path)


def planned_runs(table: pd.DataFrame) -> list[PlannedRun]:
    """Return the rows of a run table."""
    further = [name for name in table.columns if _FURTHER.fullmatch(name)]
    columns = {str(name): table[name].tolist() for name in table.columns if name not in further}
    if further:
        columns["further_amplitudes_rad"] = list(map(tuple, table[further].to_numpy().tolist()))
    return [PlannedRun(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]


def chunk_runs(plan: Plan, chunk: int) -> list[PlannedRun]:
    """Return the runs of one chunk."""
    rows = chunk_offsets(plan.table, np.array([chunk, chunk + 1]))
    return planned_runs(plan.table.iloc[rows[0] : rows[1]])


def _run_table(campaign: Campaign, seed: int) -> pd.DataFrame:
    runs = campaign.runs

    def draw(name: str, distribution: tables.Distribution) -> Array:
        return distribution.draw(streams.plan_stream(seed, name), runs)

    number = np.arange(runs)
    wind = draw("wind", campaign.wind.along_track)
    altitude = draw("altitude", campaign.condition.altitude)
    eas = draw("eas", campaign.condition.eas)
    factor = draw("gust factor", campaign.gust.factor)
    if eas.min() <= 0.0:
        raise ConfigurationError(
            f"condition.eas: {eas.min() / KT:g} kt is drawn; an airspeed must be positive"
        )
    if factor.min() < 0.0:
        raise ConfigurationError(f"gust.factor: {factor.min():g} is drawn; a factor must not be negative")
    if campaign.wind.keeps == "ground_speed":
        density = atmosphere.density_kg_m3(atmosphere.geopotential_m(altitude))
        eas = eas - wind * np.sqrt(density / atmosphere.RHO0_KG_M3)
        if eas.min() <= 0.0:
            raise ConfigurationError(
                f"wind.along_track: a tailwind of {wind.max():g} m/s at a kept ground speed leaves an airspeed of "
                f"{eas.min() / KT:.3g} kt; lower the wind, or set keeps = 'true_airspeed'"
            )
    kind = number % len(campaign.manoeuvre)
    amplitudes = np.stack([draw(f"amplitude {k}", m.amplitude) for k, m in enumerate(campaign.manoeuvre)])
    further = {}
    for j in range(1, max(len(m.inputs) for m in campaign.manoeuvre)):
        drawn = [
            draw(f"amplitude {k} {j}", m.inputs[j].amplitude) if j < len(m.inputs) else np.full(runs, np.nan)
            for k, m in enumerate(campaign.manoeuvre)
        ]
        further[f"amplitude_{j + 1}_rad"] = np.stack(drawn)[kind, number]
    gusts = _gust_columns(campaign, altitude, factor)
    trimmed = {"straight": campaign.condition.straight} if campaign.lateral else {}
    return pd.DataFrame(
        {
            "run": number,
            "run_id": [f"{campaign.name}-{ordered_number(k, 6)}" for k in number.tolist()],
            "chunk": chunk_numbers(runs),
            "eas_m_s": eas,
            "altitude_m": altitude,
            "gamma_rad": draw("flight path", campaign.condition.flight_path),
            "wind_m_s": wind,
            "manoeuvre": kind,
            "amplitude_rad": amplitudes[kind, number],
            **further,
            **gusts,
            **trimmed,
        }
    )


def _gust_columns(campaign: Campaign, altitude: Array, factor: Array) -> dict[str, Array]:
    figures, level = campaign.gust.figures, campaign.gust.level
    names = ["sigma_u_m_s", "sigma_w_m_s", "length_u_m", "length_w_m"]
    if not campaign.in_gusts:
        return {name: np.full(len(altitude), 0.0 if name.startswith("sigma") else 1.0) for name in names}
    unique, inverse = np.unique(altitude, return_inverse=True)
    scales = [gust_scales(figures, level, float(h)) for h in unique]
    rows = [tuple(s) for s in scales]
    if campaign.side_gusts:
        names += ["sigma_v_m_s", "length_v_m"]
        rows = [(*s, *side_gust(figures, s)) for s in scales]
    columns = {
        name: np.array(values)[inverse] for name, values in zip(names, zip(*rows, strict=True), strict=True)
    }
    return {name: values * factor if name.startswith("sigma") else values for name, values in columns.items()}


def _digest(campaign: Campaign, aircraft: Aircraft, inputs: tuple[tuple[Manoeuvre, ...], ...]) -> str:
    content = hashlib.sha256(campaign.model_dump_json(by_alias=True, exclude={"runs"}).encode())
    content.update(f"{__version__} {version('jsbsim')} {version('numpy')}".encode())
    for file in sorted(
        p for p in aircraft.folder.rglob("*") if p.is_file() and p.suffix in (".xml", ".toml")
    ):
        content.update(file.relative_to(aircraft.folder).as_posix().encode() + b"\0" + file.read_bytes())
    for m in itertools.chain(*inputs):
        content.update(
            np.ascontiguousarray(m.times_s).tobytes() + np.ascontiguousarray(m.values_rad).tobytes()
        )
    return content.hexdigest()


def _checked(plan: Plan, path: Path) -> Plan:
    """The plan with its nominal trim, or every problem of the campaign that can be known before the flight."""
    problems: list[str] = []
    nominal = _nominal_trims(plan, problems)
    for number, (inputs, row) in enumerate(zip(plan.inputs, plan.campaign.manoeuvre, strict=True)):
        shapes = []
        for place, manoeuvre in enumerate(inputs):
            where = f"manoeuvre.{number}" + (f".also.{place - 1}" if place else "")
            try:
                shapes.append(sample(manoeuvre, plan.t_s))
            except AirtruthError as error:
                problems.append(f"{where}: {error}")
                continue
            if end_s(manoeuvre) > plan.campaign.duration + 1e-9:
                problems.append(
                    f"{where}: it ends at {end_s(manoeuvre):g} s, after the run of {plan.campaign.duration:g} s; "
                    "lengthen duration_s or shorten the manoeuvre"
                )
        rows = plan.table[plan.table["manoeuvre"] == number]
        saturates = any(table.saturate for table in row.inputs)
        if nominal and len(rows) and len(shapes) == len(inputs) and not saturates:
            amplitudes = extreme_amplitudes(rows, inputs)
            found = beyond_limits(plan.aircraft, nominal[0], inputs, shapes, amplitudes, plan.dt_s)
            problems += [f"manoeuvre.{number}: {p}" for p in found]
    if problems:
        raise ConfigurationError(f"{path}: {len(problems)} problem(s)\n  " + "\n  ".join(problems))
    return replace(plan, nominal=(_nominal(plan.table), nominal[0]))


def _nominal_trims(plan: Plan, problems: list[str]) -> list[Trim]:
    """Trim the run of median airspeed; a run in a tail of a distribution may still fail in flight."""
    plane, at = plan.aircraft, _nominal(plan.table)
    try:
        return [isolated(f"the trim of {plane.name}", trim, plane, at, plan.dt_s)]
    except TrimError as error:
        problems.append(f"condition: {error}")
        return []


def _nominal(table: pd.DataFrame) -> Condition:
    """Flight condition of the run of median airspeed."""
    constant = all(table[name].nunique() == 1 for name in ("eas_m_s", "altitude_m", "gamma_rad"))
    median = int(np.argmin(np.abs(table["eas_m_s"].to_numpy() - table["eas_m_s"].median())))
    (nominal,) = planned_runs(table.iloc[[0 if constant else median]])
    return nominal.condition


def describe(plan: Plan) -> str:
    """Describe the campaign as text."""
    c, t = plan.campaign, plan.table
    lines = [
        f"campaign   {c.name}{': ' + c.title if c.title else ''}",
        f"aircraft   {plan.aircraft.name} ({'with effects' if c.effect else plan.aircraft.folder})",
        f"runs       {c.runs} of {c.duration:g} s, simulated at {c.simulation_hz:g} Hz, logged at {c.log_hz:g} Hz",
        f"files      {t['chunk'].nunique()} of up to {int(t['chunk'].value_counts().max())} runs",
        f"seed       {plan.seed}",
    ]
    shown = {
        "eas_m_s": "EAS [m/s]",
        "altitude_m": "altitude [m]",
        "wind_m_s": "wind [m/s]",
        "sigma_u_m_s": "sigma_u [m/s]",
        "sigma_w_m_s": "sigma_w [m/s]",
        "sigma_v_m_s": "sigma_v [m/s]",
    }
    for name, label in shown.items():
        if name not in t:
            continue
        low, high = t[name].min(), t[name].max()
        lines.append(f"{label:<14} {low:.4g}" + (f" to {high:.4g}" if high > low else ""))
    lines.append("manoeuvres " + ", ".join(in_words(inputs) for inputs in plan.inputs))
    lines += [f"effect     {with_effects.text(effect)}" for effect in c.effect]
    return "\n".join(lines)


def settings_json(plan: Plan) -> str:
    """Return campaign.json: the campaign as read, and the fingerprint by which a resumed call recognises it."""
    facts = {
        "name": plan.campaign.name,
        "title": plan.campaign.title,
        "runs": plan.campaign.runs,
        "seed": plan.seed,
        "aircraft": plan.aircraft.name,
        "gust": plan.campaign.gust.model_dump(mode="json"),
        "digest": plan.digest,
        "campaign": plan.campaign.model_dump(mode="json", by_alias=True),
    }
    return json.dumps(facts, indent=1, sort_keys=True) + "\n"
