"""From a campaign file to a run table: every random draw of every run, before the first flight."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airtruth import __version__
from airtruth.aircraft import Aircraft, Sensor, load
from airtruth.aircraft.neutral import fitted
from airtruth.errors import AirtruthError, ConfigurationError, TrimError
from airtruth.logs.names import ordered_number
from airtruth.logs.store import read_log
from airtruth.physics import actuators, atmosphere
from airtruth.physics.gust_figures import gust_scales
from airtruth.simulation.campaign import effects as with_effects
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.campaign import streams
from airtruth.simulation.campaign.file import NO_GUST, Campaign, ManoeuvreTable
from airtruth.simulation.campaign.numbering import chunk_numbers, chunk_offsets
from airtruth.simulation.disposable import isolated
from airtruth.simulation.manoeuvres import Manoeuvre, end_s, sample
from airtruth.simulation.simulator import Condition, jsbsim_model
from airtruth.simulation.trim import Trim, trim
from airtruth.units import DEG, KT

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlannedRun:
    """One row of a run table.

    Attributes
    ----------
    run, run_id, chunk : number and name of the run, and number of its chunk.
    eas_m_s, altitude_m, gamma_rad : flight condition, see `airtruth.simulation.simulator.Condition`.
    wind_m_s : constant wind along the track [m/s].
    manoeuvre : index in `Plan.manoeuvres`.
    amplitude_rad : factor on a manoeuvre of unit amplitude [rad].
    sigma_u_m_s, sigma_w_m_s, length_u_m, length_w_m : gusts [m/s], [m].
    effects : the flown effects as JSON; None without effects.
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

    @property
    def condition(self) -> Condition:
        """Its flight condition."""
        return Condition(self.eas_m_s, self.altitude_m, self.gamma_rad)


@dataclass(frozen=True)
class Plan:
    """A campaign with every random draw: all that a worker needs to fly any run.

    Attributes
    ----------
    campaign : the campaign file.
    aircraft : aircraft to fly, the campaign's effects added.
    seed : seed of every draw.
    sensors : channel -> sensor, the campaign's entries applied.
    manoeuvres : alternatives; run k flies number ``table.manoeuvre[k]``, scaled to its amplitude.
    table : one row per run: run, run_id, chunk, eas_m_s, altitude_m, gamma_rad, wind_m_s, manoeuvre,
        amplitude_rad, sigma_u_m_s, sigma_w_m_s, length_u_m, length_w_m, and effects where there are any.
    digest : fingerprint of all this except the number of runs, by which a folder recognises its campaign.
    nominal : condition of the run of median airspeed and its trim, which no worker computes again.
    """

    campaign: Campaign
    aircraft: Aircraft
    seed: int
    sensors: dict[str, Sensor]
    manoeuvres: tuple[Manoeuvre, ...]
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
    model = jsbsim_model(aircraft)
    if campaign.gust.rotary and model.rotary_gust is None:
        raise ConfigurationError(
            f"{path}: gust.rotary: {aircraft.name} has no rotary_gust property in its aircraft.toml"
        )
    gains = campaign.augmentation
    if (gains.damper_gain_s or gains.attitude_gain) and model.augmentation is None:
        raise ConfigurationError(
            f"{path}: augmentation: {aircraft.name} has no [jsbsim.augmentation] in its aircraft.toml"
        )
    try:
        effects = with_effects.read(campaign)
        table = _run_table(campaign, campaign.seed)
        table = with_effects.state(with_effects.in_the_air(table, effects), campaign)
        flown = with_effects.aircraft(aircraft, effects, campaign.simulation_hz, _nominal(table))
        sensors = fitted(campaign.sensors.apply(aircraft.file.sensors), effects.sensors)
        manoeuvres = tuple(_manoeuvre(m, path.parent) for m in campaign.manoeuvre)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None
    plan = Plan(
        campaign=campaign,
        aircraft=flown,
        seed=campaign.seed,
        sensors=sensors,
        manoeuvres=manoeuvres,
        table=table,
        digest=_digest(campaign, flown, manoeuvres),
    )
    return _checked(plan, path)


def planned_runs(table: pd.DataFrame) -> list[PlannedRun]:
    """Return the rows of a run table."""
    columns = {str(name): table[name].tolist() for name in table.columns}
    return [PlannedRun(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]


def chunk_runs(plan: Plan, chunk: int) -> list[PlannedRun]:
    """Return the runs of one chunk."""
    rows = chunk_offsets(plan.table, np.array([chunk, chunk + 1]))
    return planned_runs(plan.table.iloc[rows[0] : rows[1]])


def _run_table(campaign: Campaign, seed: int) -> pd.DataFrame:
    runs = campaign.runs

    def draw(name: str, distribution: campaign_file.Distribution) -> Array:
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
    gusts = _gust_columns(campaign, altitude, factor)
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
            **gusts,
        }
    )


def _gust_columns(campaign: Campaign, altitude: Array, factor: Array) -> dict[str, Array]:
    names = ("sigma_u_m_s", "sigma_w_m_s", "length_u_m", "length_w_m")
    if campaign.gust.level == NO_GUST:
        return {name: np.full(len(altitude), 0.0 if name.startswith("sigma") else 1.0) for name in names}
    unique, inverse = np.unique(altitude, return_inverse=True)
    scales = [gust_scales(campaign.gust.figures, campaign.gust.level, float(h)) for h in unique]
    columns = {name: np.array([getattr(s, name) for s in scales])[inverse] for name in names}
    return {name: values * factor if name.startswith("sigma") else values for name, values in columns.items()}


def _manoeuvre(table: ManoeuvreTable, folder: Path) -> Manoeuvre:
    """The manoeuvre at unit amplitude; a replay at its own."""
    timed = ("start_s", "step_s", "length_s", "segments_s", "rise_s")
    shaped = ("lowest_hz", "highest_hz", "part", "parts", "levels", "harmonics", "weights", "phases_rad")
    common = {name: getattr(table, re.sub("_(s|hz|rad)$", "", name)) for name in (*timed, *shaped)}
    if table.kind != "replay":
        return Manoeuvre(table.kind, amplitude_rad=1.0, **common)
    log = read_log(folder / table.file, columns=[table.channel])
    if table.run_id and table.run_id not in log.run_ids:
        raise ConfigurationError(
            f"{folder / table.file}: no run {table.run_id!r}; it holds {', '.join(log.run_ids[:10])}"
        )
    rows = log.rows(log.run_ids.index(table.run_id) if table.run_id else 0)
    values = log.channels[table.channel][rows]
    return Manoeuvre(
        "replay",
        start_s=table.start,
        times_s=log.t_s[rows],
        values_rad=values - values[0],
        surface=table.channel == "elevator_rad",
    )


def _digest(campaign: Campaign, aircraft: Aircraft, manoeuvres: tuple[Manoeuvre, ...]) -> str:
    content = hashlib.sha256(campaign.model_dump_json(by_alias=True, exclude={"runs"}).encode())
    content.update(f"{__version__} {version('jsbsim')} {version('numpy')}".encode())
    for file in sorted(
        p for p in aircraft.folder.rglob("*") if p.is_file() and p.suffix in (".xml", ".toml")
    ):
        content.update(file.relative_to(aircraft.folder).as_posix().encode() + b"\0" + file.read_bytes())
    for m in manoeuvres:
        content.update(
            np.ascontiguousarray(m.times_s).tobytes() + np.ascontiguousarray(m.values_rad).tobytes()
        )
    return content.hexdigest()


def _checked(plan: Plan, path: Path) -> Plan:
    """The plan with its nominal trim, or every problem of the campaign that can be known before the flight."""
    problems: list[str] = []
    t = np.arange(plan.samples, dtype=np.float64) * plan.dt_s
    nominal = _nominal_trims(plan, problems)
    for number, (manoeuvre, table) in enumerate(zip(plan.manoeuvres, plan.campaign.manoeuvre, strict=True)):
        where = f"manoeuvre.{number}"
        try:
            shape = sample(manoeuvre, t)
        except AirtruthError as error:
            problems.append(f"{where}: {error}")
            continue
        if end_s(manoeuvre) > plan.campaign.duration + 1e-9:
            problems.append(
                f"{where}: it ends at {end_s(manoeuvre):g} s, after the run of {plan.campaign.duration:g} s; "
                "lengthen duration_s or shorten the manoeuvre"
            )
        rows = plan.table[plan.table["manoeuvre"] == number]
        if nominal and len(rows) and not table.saturate:
            problems += [f"{where}: {p}" for p in _saturation(plan, manoeuvre, shape, rows, nominal)]
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


def _saturation(
    plan: Plan, manoeuvre: Manoeuvre, shape: Array, rows: pd.DataFrame, trims: list[Trim]
) -> list[str]:
    servo = plan.aircraft.file.elevator_actuator
    if servo is None or manoeuvre.surface:
        return []
    amplitudes = (
        np.array([1.0])
        if manoeuvre.kind == "replay"
        else rows["amplitude_rad"].agg(["min", "max"]).to_numpy()
    )
    command = trims[0].elevator_rad + amplitudes[:, None] * shape
    low, high = servo.minimum.value, servo.maximum.value
    allowed = f"allowed {low / DEG:g} to {high / DEG:g} deg"
    if command.min() < low or command.max() > high:
        return [
            f"the command reaches {command.min() / DEG:.1f} to {command.max() / DEG:.1f} deg with the trim's "
            f"{trims[0].elevator_rad / DEG:.1f} deg; {allowed}. Lower amplitude_deg, or state saturate = true"
        ]
    common = (plan.dt_s, servo.bandwidth.value)
    free = actuators.respond(command, *common, np.inf, low, high, 0.0)
    limited = actuators.respond(command, *common, servo.rate_limit.value, low, high, 0.0)
    if np.abs(free - limited).max() > 1e-6:
        return [
            f"the surface would have to move faster than the servo's {servo.rate_limit.value / DEG:g} deg/s; "
            "lower amplitude_deg, or state saturate = true"
        ]
    return []


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
    }
    for name, label in shown.items():
        low, high = t[name].min(), t[name].max()
        lines.append(f"{label:<14} {low:.4g}" + (f" to {high:.4g}" if high > low else ""))
    lines.append("manoeuvres " + ", ".join(m.kind for m in plan.manoeuvres))
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
