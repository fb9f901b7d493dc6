"""A campaign's effects: written into a copy of the aircraft, its sensors and its air before anything flies."""

from __future__ import annotations

import json
import shutil
import tempfile
import weakref
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from airtruth.aircraft import Aircraft
from airtruth.effects.change import Change
from airtruth.effects.neutral import effective
from airtruth.errors import ConfigurationError
from airtruth.fly.campaign_file import NO_GUST, Campaign, EffectTable

EFFECTS: Final = "effects"
"""Column of plan.parquet and truth.parquet that states the effects, as JSON; absent without any."""


def read(campaign: Campaign) -> Change:
    """All effects of a campaign together, without what is neutral.

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
    return change


def aircraft(plane: Aircraft, change: Change, simulation_hz: float) -> Aircraft:
    """The aircraft to fly: itself, or a copy with the change, which lasts as long as the returned object.

    Raises
    ------
    AircraftError
        If the aircraft's model cannot take the change.
    """
    change = replace(change, sensors=(), air=())
    if not change.in_aircraft:
        return plane
    from airtruth.effects.writing import changed

    folder = Path(tempfile.mkdtemp(prefix="airtruth-"))
    try:
        flown = changed(plane, change, folder / plane.name, highest_hz=simulation_hz)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    weakref.finalize(flown, shutil.rmtree, folder, ignore_errors=True)
    return flown


def in_the_air(table: pd.DataFrame, change: Change) -> pd.DataFrame:
    """A run table with the gusts that the change makes of them."""
    declared = {name: table[f"{name}_m_s"].to_numpy() for name in ("sigma_u", "sigma_w")}
    other = {"sigma_u": declared["sigma_w"], "sigma_w": declared["sigma_u"]}
    flown = dict(declared)
    for term in change.air:
        unit = np.where(flown[term.level] > 0.0, flown[term.level], other[term.level])
        flown[term.level] = term.factor * unit
    return table.assign(**{f"{name}_m_s": values for name, values in flown.items()})


def state(table: pd.DataFrame, campaign: Campaign) -> pd.DataFrame:
    """A run table that says which effects are flown."""
    if not campaign.effect:
        return table
    said = [e.model_dump(mode="json") for e in campaign.effect]
    return table.assign(**{EFFECTS: json.dumps(said, sort_keys=True)})


def text(effect: EffectTable) -> str:
    """One effect, for people."""
    name = f"{effect.name}:{effect.variant}" if effect.variant else effect.name
    return name + " " + ", ".join(f"{k} = {v:g}" for k, v in effect.parameters.items())
