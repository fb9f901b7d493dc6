"""A campaign's effects: added to a copy of the aircraft, to its sensors and to its air before the first flight."""

from __future__ import annotations

import json
import math
import tempfile
import weakref
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from airtruth.aircraft import Aircraft
from airtruth.aircraft.neutral import effective
from airtruth.errors import ConfigurationError
from airtruth.logs.atomic import write_error
from airtruth.logs.temporary import private_folder, remove
from airtruth.physics.terms import Change
from airtruth.simulation.campaign.effect_table import EffectTable
from airtruth.simulation.campaign.file import NO_GUST, Campaign
from airtruth.simulation.resolution import at_condition
from airtruth.simulation.simulator import Condition

LEVELS: Final = ("sigma_u", "sigma_v", "sigma_w")
"""Standard deviations of the gust components, columns of a run table with their unit."""
EFFECTS: Final = "effects"
"""Column of plan.parquet and truth.parquet with the effects as JSON; absent without effects."""


def read(campaign: Campaign) -> Change:
    """Return all effects of a campaign together, without neutral terms.

    Raises
    ------
    ConfigurationError
        If an effect is one of the gusts and there are none.
    """
    change = Change()
    for effect in campaign.effect:
        change += effect.change()
    change = effective(change)
    if change.air and campaign.gust.level == NO_GUST:
        raise ConfigurationError(
            "effect: a factor on the gusts needs gusts; set gust.level to light, moderate or severe, or leave the effect out"
        )
    if any(term.level == "sigma_v" for term in change.air) and not campaign.side_gusts:
        raise ConfigurationError(
            "effect: a factor on the side gusts needs them; leave gust.lateral out or set it to true, or leave the effect out"
        )
    return change


def aircraft(plane: Aircraft, change: Change, simulation_hz: float, nominal: Condition) -> Aircraft:
    """Return the aircraft to fly: itself, or a copy with the change that exists as long as the returned object.

    Parameters
    ----------
    plane : declared aircraft.
    change : what all effects change.
    simulation_hz : rate of the simulation [Hz].
    nominal : flight condition at which effects on the derivatives are counted.

    Raises
    ------
    AircraftError
        If the aircraft's model cannot take the change.
    TrimError
        If an effect acts on the derivatives and the aircraft cannot be trimmed.
    """
    change = replace(change, sensors=(), air=())
    if not (change.in_aircraft or change.readings):
        return plane
    from airtruth.aircraft.write import changed

    change = at_condition(change, plane, nominal, 1.0 / simulation_hz)

    try:
        folder = private_folder()
    except OSError as error:
        raise write_error(Path(tempfile.gettempdir()), error) from None
    try:
        flown = changed(plane, change, folder / plane.name, highest_hz=simulation_hz)
    except BaseException:
        remove(folder)
        raise
    weakref.finalize(flown, remove, folder)
    return flown


def in_the_air(table: pd.DataFrame, change: Change) -> pd.DataFrame:
    """Return a run table with the gust levels of the change; the side gust follows the vertical one."""
    levels = [name for name in LEVELS if f"{name}_m_s" in table]
    declared = {name: table[f"{name}_m_s"].to_numpy() for name in levels}
    other = {"sigma_u": declared["sigma_w"], "sigma_w": declared["sigma_u"]}
    flown = dict(declared)
    for level in {term.level for term in change.air}:
        factor = math.prod(term.factor for term in change.air if term.level == level)
        if level in other:
            flown[level] = factor * np.where(declared[level] > 0.0, declared[level], other[level])
        if level in ("sigma_v", "sigma_w") and "sigma_v" in flown:
            flown["sigma_v"] = factor * flown["sigma_v"]
    return table.assign(**{f"{name}_m_s": values for name, values in flown.items()})


def state(table: pd.DataFrame, campaign: Campaign) -> pd.DataFrame:
    """Return a run table with the flown effects in a column."""
    if not campaign.effect:
        return table
    effects = [e.model_dump(mode="json") for e in campaign.effect]
    return table.assign(**{EFFECTS: json.dumps(effects, sort_keys=True)})


def text(effect: EffectTable) -> str:
    """One effect as text."""
    name = f"{effect.name}:{effect.variant}" if effect.variant else effect.name
    return name + " " + ", ".join(f"{k} = {v:g}" for k, v in effect.parameters.items())
