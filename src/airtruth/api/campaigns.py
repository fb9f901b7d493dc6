"""Public functions of simulated flights: load an aircraft, fly a campaign, verify it, list the effects."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from airtruth.aircraft import Aircraft
    from airtruth.api.arguments import AircraftSource, FilePath
    from airtruth.effects.effect import Effect
    from airtruth.logs.verify import Verification
    from airtruth.simulation.campaign.file import Campaign
    from airtruth.simulation.campaign.result import CampaignResult


def load_aircraft(aircraft: AircraftSource) -> Aircraft:
    """Load an aircraft; its JSBSim model, if it has one, is checked in a child process.

    Parameters
    ----------
    aircraft : folder with aircraft.toml, that file, or the name of a shipped aircraft; a loaded aircraft is
        returned as it is.

    Raises
    ------
    AircraftError
        If it does not exist, a file is malformed, or JSBSim refuses the model.

    Examples
    --------
    >>> gtm = at.load_aircraft("gtm")
    >>> round(gtm.mass_kg, 2), round(gtm.chord_m, 3)
    (26.19, 0.279)
    """
    from airtruth.aircraft import Aircraft, load
    from airtruth.errors import AircraftError

    if isinstance(aircraft, Aircraft):
        return aircraft
    if not isinstance(aircraft, str | os.PathLike):
        raise AircraftError(
            f"{type(aircraft).__name__} is not an aircraft; give a folder, a shipped name, or an Aircraft"
        )
    return load(Path(aircraft))


def fly(
    campaign: FilePath | Campaign,
    out: FilePath,
    *,
    runs: int | None = None,
    seed: int | None = None,
    jobs: int = 1,
) -> CampaignResult:
    """Fly a campaign in JSBSim and write its flight logs; the same call resumes an interrupted campaign.

    A call with more runs continues a smaller campaign, and damaged or missing files are written again.

    Parameters
    ----------
    campaign : campaign file, see docs/campaigns.md, or a `Campaign`.
    out : folder of the campaign: logs/, plan.parquet, truth.parquet, manifest.jsonl, campaign.json.
    runs, seed : number of runs and seed, instead of the file's.
    jobs : number of child processes that fly; the logs do not depend on it.

    Raises
    ------
    ConfigurationError
        If the campaign cannot be flown as written, or the folder holds another one or more runs.
    AircraftError, TrimError
        If the aircraft cannot be loaded or trimmed.
    StoreError
        If a file cannot be read or written.

    Examples
    --------
    >>> flown = at.fly("light.toml", "out/light", runs=6)
    >>> flown.runs, len(flown.failures)
    (6, 0)
    """
    from airtruth.arguments import as_path
    from airtruth.simulation.campaign.run import fly

    return fly(campaign_of(campaign), as_path("out", out), jobs, seed, runs)


def verify(folder: FilePath) -> Verification:
    """Compare every file of a folder with the digest that was recorded when it was written.

    Parameters
    ----------
    folder : folder of a campaign, or another folder into which a command wrote.

    Returns
    -------
    Verification
        Its ``findings`` name each damaged, missing and extra file; ``intact`` is true if there is none.

    Raises
    ------
    StoreError
        If it is no folder, no digest is recorded in it, or a file cannot be read.

    Examples
    --------
    >>> flown = at.fly("light.toml", "out/verified", runs=2)
    >>> at.verify("out/verified").intact
    True
    """
    from airtruth.arguments import as_path
    from airtruth.logs.verify import verify

    return verify(as_path("folder", folder))


def list_effects(*names: str) -> tuple[Effect, ...]:
    """List the effects that can be flown and traced.

    Parameters
    ----------
    names : effects to list, by name or key; none for the whole library.

    Raises
    ------
    ConfigurationError
        If a name does not exist.

    Examples
    --------
    >>> (delay,) = at.list_effects("elevator_delay")
    >>> [(p.name, p.unit) for p in delay.parameters]
    [('delay_s', 's')]
    """
    from airtruth.effects.registry import EFFECTS, listed

    return tuple(effect for name in names for effect in listed(name)) or tuple(EFFECTS.values())


def campaign_of(campaign: FilePath | Campaign) -> Path | Campaign:
    """A path as a `Path`, a campaign as it is.

    Raises
    ------
    ConfigurationError
        If it is neither.
    """
    from airtruth.errors import ConfigurationError
    from airtruth.simulation.campaign.file import Campaign

    if isinstance(campaign, Campaign):
        return campaign
    if not isinstance(campaign, str | os.PathLike):
        raise ConfigurationError(
            f"{type(campaign).__name__} is not a campaign; give a campaign file, or a Campaign"
        )
    return Path(campaign)
