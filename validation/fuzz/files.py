"""Damaged TOML files: campaigns, mappings and aircraft."""

from __future__ import annotations

import shutil
import tomllib
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from airtruth.aircraft import load
from airtruth.importers import import_log, read_mapping
from airtruth.isolation import client
from airtruth.simulation.campaign import plan as planning
from validation.fuzz import foreign, logs
from validation.fuzz.mutate import altered, odd_text, toml

ROOT = Path(__file__).resolve().parents[2]
"""The checkout."""


@cache
def campaigns() -> tuple[dict[str, Any], ...]:
    """Campaigns that use every table of the format."""
    small = tomllib.loads(logs.CAMPAIGN)
    rich = small | {
        "runs": 4,
        "simulation_hz": 200.0,
        "log_hz": 50.0,
        "condition": {"eas_kt": {"choose": [75.0, 76.0]}, "altitude_m": {"low": 2000.0, "high": 2100.0}, "flight_path_deg": 0.5},
        "manoeuvre": [
            {"kind": "multisine", "amplitude_deg": 0.5, "start_s": 0.5, "length_s": 3.0, "lowest_hz": 0.4, "highest_hz": 2.0,
             "part": 1, "parts": 2},
            {"kind": "sweep", "amplitude_deg": 0.5, "start_s": 0.5, "length_s": 3.0, "lowest_hz": 0.4, "highest_hz": 2.0},
            {"kind": "3211", "amplitude_deg": {"mean": 0.8, "std": 0.01}, "start_s": 0.5, "step_s": 0.2, "saturate": True},
        ],
        "wind": {"along_track_m_s": {"mean": 0.0, "std": 1.0}, "keeps": "true_airspeed"},
        "sensors": {
            "channel": {
                "alpha_rad": {"noise_std": {"value": 0.1, "unit": "deg"}, "delay": {"value": 20.0, "unit": "ms"}}
            }
        },
        "augmentation": {"damper_gain_s": 0.05, "attitude_gain": 0.1},
        "effect": [{"name": "elevator_delay", "delay_ms": 30.0}, {"name": "vane_scale", "factor": 1.1}],
    }  # fmt: skip
    return small, rich, tomllib.loads((ROOT / "data/campaigns/moderate-fit.toml").read_text(encoding="utf-8"))


@cache
def mappings() -> tuple[dict[str, Any], ...]:
    """Mappings that use every table of the format."""
    rich = foreign.mapping() | {
        "aircraft": "gtm",
        "source": {"format": "csv", "delimiter": ",", "decimal": ".", "skip_rows": 0, "header": True},
        "resample": {"rate_hz": 25.0, "method": "cubic"},
        "manoeuvre": [
            {"run_id": "a", "start_s": 0.2, "end_s": 2.0},
            {"run_id": "b", "start_s": 2.0, "end_s": 3.8},
        ],
        "constants": {"mass_kg": {"value": 26.2, "unit": "kg"}, "chord_m": {"column": "rho", "unit": "ft"}},
    }
    channels = dict(rich["channels"])
    channels["elevator_rad"] = {
        "columns": ["Elev", "Elev"],
        "unit": "deg",
        "sign": 1,
        "scale": 1.0,
        "offset": 0.0,
    }
    channels["theta_rad"] = {"column": "Pitch", "unit": "deg", "clock": {"column": "time", "unit": "s"}}
    return foreign.mapping(), rich | {"channels": channels}


@cache
def aircraft() -> tuple[dict[str, Any], ...]:
    """aircraft.toml of the GTM, of an updated one, and of one without a JSBSim model."""
    gtm = tomllib.loads((ROOT / "aircraft/gtm/aircraft.toml").read_text(encoding="utf-8"))
    plain = {key: entry for key, entry in gtm.items() if key != "jsbsim"}
    dynamics = {
        "surface": [{"kind": "delay", "value": 0.02}],
        "states": [{"kind": "lag", "name": "wake", "signal": "alpha", "time_s": 0.1}],
        "aero": [{"coefficient": "Cm", "shape": "linear", "amplitude": -3.0, "signal": "alpha_dot_hat"}],
    }
    return gtm, plain, plain | {"dynamics": dynamics}


def damaged_toml(rng: Random, documents: tuple[dict[str, Any], ...]) -> bytes:
    """One of some documents with other entries, or its text with other bytes."""
    document = rng.choice(documents)
    if rng.random() < 0.25:
        return odd_text(rng, toml(document))
    changed = altered(rng, document)
    return toml(changed if isinstance(changed, dict) else {"x": changed}).encode("utf-8", "surrogatepass")


def plan_campaign(path: Path) -> str:
    """Plan a campaign as `airtruth fly --dry-run` does."""
    return planning.describe(planning.make(path))


def import_through(path: Path) -> None:
    """Import a sound file through a mapping."""
    mapping = read_mapping(path)
    data = path.with_name("f.csv")
    data.write_bytes(foreign.csv()[0][0])
    import_log(data, mapping, force=True)


def load_aircraft(content: bytes, folder: Path) -> None:
    """Load the GTM with another aircraft.toml."""
    home = folder / "gtm"
    shutil.copytree(ROOT / "aircraft" / "gtm", home, dirs_exist_ok=True)
    (home / "aircraft.toml").write_bytes(content)
    load(home)


def campaign_case(rng: Random, folder: Path) -> None:
    """Damage a campaign file and plan it."""
    (folder / "c.toml").write_bytes(damaged_toml(rng, campaigns()))
    plan_campaign(folder / "c.toml")


def mapping_case(rng: Random, folder: Path) -> None:
    """Damage a mapping and import a sound file through it."""
    (folder / "m.toml").write_bytes(damaged_toml(rng, mappings()))
    import_through(folder / "m.toml")


def aircraft_case(rng: Random, folder: Path) -> None:
    """Damage an aircraft.toml and load it."""
    load_aircraft(damaged_toml(rng, aircraft()), folder)


def warm(folder: Path) -> None:
    """Every document is accepted as it is."""
    for number, document in enumerate(campaigns()):
        path = folder / f"{number}.toml"
        path.write_text(toml(document), encoding="utf-8")
        planning.make(path)
    for document in mappings():
        (folder / "m.toml").write_text(toml(document), encoding="utf-8")
        import_through(folder / "m.toml")
    client.close()
    for document in aircraft():
        load_aircraft(toml(document).encode(), folder)


__all__ = [
    "aircraft",
    "aircraft_case",
    "campaign_case",
    "campaigns",
    "damaged_toml",
    "import_through",
    "load_aircraft",
    "mapping_case",
    "mappings",
    "plan_campaign",
    "warm",
]
