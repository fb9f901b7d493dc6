"""From a campaign file to a run table: every random draw of every run, made before the first flight."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airtruth import __version__
from airtruth.aircraft import Aircraft, Sensor, load
from airtruth.effects.neutral import fitted
from airtruth.errors import AirtruthError, ConfigurationError
from airtruth.fly import campaign_file, streams, with_effects
from airtruth.fly.campaign_file import NO_GUST, Campaign, ManoeuvreTable
from airtruth.fly.engine import Condition, jsbsim_model
from airtruth.fly.manoeuvres import Manoeuvre, end_s, sample
from airtruth.fly.trim import Trim, trim
from airtruth.logs.store import read_log
from airtruth.physics import actuators, atmosphere
from airtruth.physics.gust_figures import gust_scales
from airtruth.units import DEG, KT

Array = NDArray[np.float64]
Row = dict[str, Any]
"""One row of a run table: column -> value."""

_LARGEST_CHUNK: Final = 100
_CHUNKS: Final = 32  # a small campaign is cut into about this many, so that both cores stay busy


@dataclass(frozen=True)
class Plan:
    """All that a worker needs to fly any run of a campaign.

    Attributes
    ----------
    campaign, aircraft : what to fly; the aircraft has the campaign's effects written in.
    seed : of every draw.
    sensors : channel -> sensor, the campaign's entries applied.
    manoeuvres : alternatives; run k flies number ``table.manoeuvre[k]``, scaled to its amplitude.
    table : one row per run: run, run_id, chunk, eas_m_s, altitude_m, gamma_rad, wind_m_s, manoeuvre,
        amplitude_rad, sigma_u_m_s, sigma_w_m_s, length_u_m, length_w_m, and effects where there are any.
    digest : fingerprint of all of this; tells two campaigns apart.
    """

    campaign: Campaign
    aircraft: Aircraft
    seed: int
    sensors: dict[str, Sensor]
    manoeuvres: tuple[Manoeuvre, ...]
    table: pd.DataFrame
    digest: str

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


def make(path: Path, seed: int | None = None, runs: int | None = None) -> Plan:
    """Read a campaign file and draw its run table.

    Parameters
    ----------
    path : campaign file.
    seed, runs : in place of the file's own.

    Raises
    ------
    ConfigurationError, StoreError, AircraftError, TrimError
        If the campaign cannot be flown as written; nominal conditions are trimmed here.
    """
    changes = {k: v for k, v in (("seed", seed), ("runs", runs)) if v is not None}
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
        flown = with_effects.aircraft(aircraft, effects, campaign.simulation_hz)
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
    _check(plan, path)
    return plan


def rows(plan: Plan, chunk: int) -> list[Row]:
    """Rows of one chunk of the run table."""
    chosen = plan.table[plan.table["chunk"] == chunk]
    return [{str(key): value for key, value in row.items()} for row in chosen.to_dict("records")]


def condition(row: Row) -> Condition:
    """Flight condition of one run of the table."""
    return Condition(float(row["eas_m_s"]), float(row["altitude_m"]), float(row["gamma_rad"]))


def _run_table(campaign: Campaign, seed: int) -> pd.DataFrame:
    runs = campaign.runs

    def draw(name: str, distribution: campaign_file.Distribution) -> Array:
        return distribution.draw(streams.plan_stream(seed, name), runs)

    number = np.arange(runs)
    chunk = max(1, min(_LARGEST_CHUNK, -(-runs // _CHUNKS)))
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
    kind = number % len(campaign.manoeuvre)
    amplitudes = np.stack([draw(f"amplitude {k}", m.amplitude) for k, m in enumerate(campaign.manoeuvre)])
    gusts = _gust_columns(campaign, altitude, factor)
    return pd.DataFrame(
        {
            "run": number,
            "run_id": [f"{campaign.name}-{k:06d}" for k in number],
            "chunk": number // chunk,
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
    common = {
        "start_s": table.start,
        "step_s": table.step,
        "length_s": table.length,
        "lowest_hz": table.lowest,
        "highest_hz": table.highest,
        "part": table.part,
        "parts": table.parts,
    }
    if table.kind != "replay":
        return Manoeuvre(table.kind, amplitude_rad=1.0, **common)  # type: ignore[arg-type]
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
    content = hashlib.sha256(campaign.model_dump_json(by_alias=True).encode())
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


def _check(plan: Plan, path: Path) -> None:
    """Everything that can be known to fail before flying; all problems at once."""
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


def _nominal_trims(plan: Plan, problems: list[str]) -> list[Trim]:
    """The trim of the run of median airspeed; a draw in a tail may still fail in flight."""
    table = plan.table
    constant = all(table[name].nunique() == 1 for name in ("eas_m_s", "altitude_m", "gamma_rad"))
    median = int(np.argmin(np.abs(table["eas_m_s"].to_numpy() - table["eas_m_s"].median())))
    row = {str(key): value for key, value in table.iloc[0 if constant else median].items()}
    try:
        return [trim(plan.aircraft, condition(row), plan.dt_s)]
    except AirtruthError as error:
        problems.append(f"condition: {error}")
        return []


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
            f"{trims[0].elevator_rad / DEG:.1f} deg; {allowed}. Lower amplitude_deg, or say saturate = true"
        ]
    common = (plan.dt_s, servo.bandwidth.value)
    free = actuators.respond(command, *common, np.inf, low, high, 0.0)
    limited = actuators.respond(command, *common, servo.rate_limit.value, low, high, 0.0)
    if np.abs(free - limited).max() > 1e-6:
        return [
            f"the surface would have to move faster than the servo's {servo.rate_limit.value / DEG:g} deg/s; "
            "lower amplitude_deg, or say saturate = true"
        ]
    return []


def describe(plan: Plan) -> str:
    """What would be flown, for people."""
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
    """campaign.json: the campaign as read, and the fingerprint by which a resumed run knows it."""
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
