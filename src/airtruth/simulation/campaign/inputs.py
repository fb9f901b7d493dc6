"""The control inputs of a run: read from their tables, and compared with the limits of the actuators."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft, JsbsimModel
from airtruth.errors import ConfigurationError
from airtruth.logs.store import read_log
from airtruth.physics import actuators
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.manoeuvre_table import InputTable
from airtruth.simulation.manoeuvres import CONTROLS, LATERAL_CONTROLS, Manoeuvre
from airtruth.simulation.trim import Trim
from airtruth.units import DEG

Array = NDArray[np.float64]


def lacking(campaign: Campaign, model: JsbsimModel) -> list[tuple[str, str]]:
    """Keys of a campaign that need a property which the aircraft's [jsbsim] table does not name, and this property.

    Parameters
    ----------
    campaign, model : the campaign and the table.
    """
    gains = campaign.augmentation
    found = []
    if campaign.gust.rotary and model.rotary_gust is None:
        found.append(("gust.rotary", "rotary_gust property"))
    if campaign.gust.rotary and campaign.side_gusts and (model.roll_gust is None or model.yaw_gust is None):
        found.append(("gust.rotary", "roll_gust and yaw_gust properties, which side gusts need"))
    if (gains.damper_gain_s or gains.attitude_gain) and model.augmentation is None:
        found.append(("augmentation", "[jsbsim.augmentation]"))
    if campaign.lateral:
        key = "augmentation" if gains.lateral else "manoeuvre.control" if campaign.moved else "gust.lateral"
        found += [
            (key, f"[jsbsim.{control}]") for control in LATERAL_CONTROLS if getattr(model, control) is None
        ]
    return found


def read_input(table: InputTable, folder: Path) -> Manoeuvre:
    """The input at unit amplitude; a replay at its own.

    Parameters
    ----------
    table : its table.
    folder : folder to which the file of a replay is relative.

    Raises
    ------
    StoreError
        If the log of a replay cannot be read.
    ConfigurationError
        If the log lacks the run.
    """
    timed = ("start_s", "step_s", "length_s", "segments_s", "rise_s")
    shaped = ("lowest_hz", "highest_hz", "part", "parts", "levels", "harmonics", "weights", "phases_rad")
    common = {name: getattr(table, re.sub("_(s|hz|rad)$", "", name)) for name in (*timed, *shaped)}
    if table.kind != "replay":
        return Manoeuvre(table.kind, amplitude_rad=1.0, control=table.control, **common)
    log = read_log(folder / table.file, columns=[table.channel])
    if table.run_id and table.run_id not in log.run_ids:
        raise ConfigurationError(
            f"{folder / table.file}: no run {table.run_id!r}; it holds {', '.join(log.run_ids[:10])}"
        )
    if table.channel not in log.channels:
        raise ConfigurationError(
            f"{folder / table.file}: no channel {table.channel} to replay; choose a log that has it"
        )
    rows = log.rows(log.run_ids.index(table.run_id) if table.run_id else 0)
    values = log.channels[table.channel][rows]
    return Manoeuvre(
        "replay",
        start_s=table.start,
        times_s=log.t_s[rows],
        values_rad=values - values[0],
        surface=table.on_surface,
        control=table.control,
    )


def commands(
    inputs: Sequence[Manoeuvre], shapes: Sequence[Array], amplitudes_rad: Sequence[float]
) -> dict[str, Array]:
    """Command of each control that the inputs move, deviation from trim [rad]; inputs of one control add.

    Parameters
    ----------
    inputs : the inputs of a run.
    shapes : (samples,) of each, at unit amplitude; of a replay at its own.
    amplitudes_rad : factor on each [rad]; a replay has none.
    """
    result: dict[str, Array] = {}
    for manoeuvre, shape, amplitude in zip(inputs, shapes, amplitudes_rad, strict=True):
        own = shape if manoeuvre.kind == "replay" else amplitude * shape
        moved = result.get(manoeuvre.control)
        result[manoeuvre.control] = own if moved is None else moved + own
    return result


def extreme_amplitudes(rows: pd.DataFrame, inputs: Sequence[Manoeuvre]) -> list[tuple[float, ...]]:
    """Every combination of the lowest and the highest amplitude of each input [rad].

    Parameters
    ----------
    rows : run table of the runs that fly the inputs.
    inputs : the inputs.
    """
    names = ["amplitude_rad", *(f"amplitude_{k}_rad" for k in range(2, len(inputs) + 1))]
    ends = [sorted({float(rows[name].min()), float(rows[name].max())}) for name in names]
    return list(product(*ends))


def beyond_limits(
    aircraft: Aircraft,
    at: Trim,
    inputs: Sequence[Manoeuvre],
    shapes: Sequence[Array],
    amplitudes_rad: Sequence[tuple[float, ...]],
    dt_s: float,
) -> list[str]:
    """Problems of the inputs with the limits that the aircraft declares of its actuators, one of each control.

    Parameters
    ----------
    aircraft, at : the aircraft and its trim.
    inputs, shapes : the inputs, and (samples,) of each.
    amplitudes_rad : combinations of amplitudes to test [rad].
    dt_s : simulation step [s].
    """
    if any(m.surface for m in inputs):
        return []
    moved = [commands(inputs, shapes, chosen) for chosen in amplitudes_rad]
    found = []
    for control in (c for c in CONTROLS if c in moved[0]):
        found += list(_of_actuator(aircraft, control, at, np.stack([m[control] for m in moved]), dt_s))[:1]
    return found


def _of_actuator(aircraft: Aircraft, control: str, at: Trim, deviation: Array, dt_s: float) -> Iterator[str]:
    """Problems of the command of one control, (cases, samples) [rad]."""
    servo = getattr(aircraft.file, f"{control}_actuator", None)
    if servo is None:
        return
    trim_rad = at.surfaces_rad[control]
    command = trim_rad + deviation
    which = "" if control == ELEVATOR else f"{control} "
    low, high = servo.minimum.value, servo.maximum.value
    if command.min() < low or command.max() > high:
        yield (
            f"the {which}command reaches {command.min() / DEG:.1f} to {command.max() / DEG:.1f} deg with the trim's "
            f"{trim_rad / DEG:.1f} deg; allowed {low / DEG:g} to {high / DEG:g} deg. Lower amplitude_deg, or state "
            "saturate = true"
        )
    common = (dt_s, servo.bandwidth.value)
    free = actuators.respond(command, *common, np.inf, low, high, 0.0)
    limited = actuators.respond(command, *common, servo.rate_limit.value, low, high, 0.0)
    if np.abs(free - limited).max() > 1e-6:
        surface = "surface" if control == ELEVATOR else control
        yield (
            f"the {surface} would have to move faster than the servo's {servo.rate_limit.value / DEG:g} deg/s; "
            "lower amplitude_deg, or state saturate = true"
        )


def in_words(inputs: Sequence[Manoeuvre]) -> str:
    """Kinds of the inputs; the control is named where it is not the elevator alone."""
    if all(m.control == ELEVATOR for m in inputs):
        return " and ".join(m.kind for m in inputs)
    return " and ".join(f"{m.control} {m.kind}" for m in inputs)


__all__ = ["beyond_limits", "commands", "extreme_amplitudes", "in_words", "lacking", "read_input"]
