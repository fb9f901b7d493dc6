"""An aircraft from any JSBSim model: surveyed in a disposable process, written as a folder that works at once."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory
from typing import Any, Final, Literal

from airtruth.aircraft import Aircraft, AircraftFile, JsbsimModel, Sensor, load, toml
from airtruth.aircraft.file import FILE
from airtruth.aircraft.jsbsim import files
from airtruth.aircraft.jsbsim.bypass import bypass
from airtruth.aircraft.jsbsim.confine import model_files
from airtruth.aircraft.model import (
    ElevatorProperties,
    LateralProperties,
    SurfaceProperties,
    ThrottleProperties,
)
from airtruth.aircraft.probe import Constants, wheel_root
from airtruth.aircraft.write import require_new
from airtruth.channels import LATERAL, SIGNALS
from airtruth.errors import AircraftError, StoreError, choices
from airtruth.isolation.client import call
from airtruth.isolation.limits import ProcessLimits
from airtruth.isolation.protocol import IsolatedError, Task
from airtruth.logs import ledger
from airtruth.logs.atomic import new_folder
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL
from airtruth.quantity import Quantity
from airtruth.simulation.survey import words
from airtruth.simulation.survey.words import REPORT
from airtruth.units import DEG, G0

CAMPAIGN: Final = "first.toml"
"""Name of the campaign that is written beside aircraft.toml."""
LATERAL_CAMPAIGN: Final = "lateral.toml"
"""Name of the campaign in six axes, where aileron and rudder are found and a record with them keeps to its range."""
_LIMITS: Final = ProcessLimits(seconds=900.0, memory_bytes=4_000_000_000)
"""Limits of a survey (judgement: four engines and a slow machine need two minutes)."""
_STICK_RAD: Final = 25.0 * DEG
"""Travel of the surface per unit of the stick where a fly-by-wire is bypassed [rad] (judgement: that of a fighter)."""
_NOISE: Final = {"angle": 0.05 * DEG, "angular_rate": 0.05 * DEG, "acceleration": 0.005 * G0}
"""Dimension -> noise of the sensors of a new aircraft [SI] (judgement: good flight-test instruments)."""
_SURFACE_NOISE_RAD: Final = 0.02 * DEG
"""The same of a control surface [rad]."""


@dataclass(frozen=True)
class ForeignAircraft:
    """An aircraft that was written for a JSBSim model, and what the survey of the model found.

    Attributes
    ----------
    aircraft : as written and read back.
    notes : what was found.
    decisions : what the user has to decide.
    rows : of the envelope, one line per altitude.
    flight : the first condition, derivatives and test flight there; empty where it cannot fly.
    cause : why it cannot fly; "" where it can.
    has_campaign : whether a record was identified in which it keeps to its range, for `CAMPAIGN`.
    has_lateral_campaign : the same in six axes, for `LATERAL_CAMPAIGN`.
    """

    aircraft: Aircraft
    notes: tuple[str, ...]
    decisions: tuple[str, ...]
    rows: tuple[str, ...]
    flight: tuple[str, ...]
    cause: str
    has_campaign: bool
    has_lateral_campaign: bool = False

    @property
    def flies(self) -> bool:
        """Whether a trim was found."""
        return not self.cause

    def summary(self) -> str:
        """The report."""
        folder = self.aircraft.folder
        lines = [f"{folder}: {self.aircraft.name}"]
        sections = (
            ("found", self.notes),
            (
                "flies" if self.flies else "does not fly",
                self.rows if self.flies else (self.cause, *self.rows),
            ),
            ("first condition", self.flight),
            ("to decide", self.decisions),
        )
        for title, entries in sections:
            if entries:
                lines += ["", f"{title}:", *(f"  {entry}" for entry in entries)]
        name = self.aircraft.name
        if self.has_campaign or self.has_lateral_campaign:
            lines += ["", "next:"]
        if self.has_campaign:
            lines += [
                f"  airtruth fly {quote(str(folder / CAMPAIGN))} --out out/{name}",
                f"  airtruth identify out/{name} --aircraft {quote(str(folder))}",
                f"  airtruth trace out/{name} --aircraft {quote(str(folder))} --out out/{name}-trace",
            ]
        if self.has_lateral_campaign:
            lines.append(f"  airtruth fly {quote(str(folder / LATERAL_CAMPAIGN))} --out out/{name}-lateral")
        return "\n".join(lines)


def new_from_jsbsim(source: str | Path, out: Path, *, force: bool = False) -> ForeignAircraft:
    """Survey a JSBSim model and write an aircraft for it.

    Parameters
    ----------
    source : name of a model that the JSBSim package ships; a model's XML file; or a folder that holds one.
    out : folder to write, new or empty.
    force : replace the aircraft that the folder holds, with all of its files.

    Raises
    ------
    AircraftError
        If the model does not exist, may not be loaded (`airtruth.aircraft.jsbsim.confine`), JSBSim refuses it or dies
        on it, or no elevator is found.
    StoreError
        If the folder is not empty, holds the model or cannot be written.
    """
    require_new(out, force=force)
    folder, model, root = _located(source)
    if out.resolve() == folder or out.resolve() in folder.parents:
        raise StoreError(f"{out}: holds the model that is read; choose another --out")
    model_files(folder / f"{model}.xml", wheel_root())
    facts = _survey(folder, model, root)
    if "integrating" not in facts:
        return _written(out, folder, model, root, facts)
    with TemporaryDirectory() as scratch:
        beside = Path(scratch) / out.name
        note = _bypassed(beside, folder, model, root, facts)
        again = _survey(beside, model, ".")
        if "integrating" in again:
            raise AircraftError(
                f"{model}: a fly-by-wire integrates {', '.join(again['integrating'])} and is not bypassed"
            )
        return _written(out, beside, model, ".", {**again, "notes": [note, *again["notes"]]})


def _bypassed(
    beside: Path, folder: Path, model: str, root: Literal[".", "wheel"], facts: Mapping[str, Any]
) -> str:
    """Copy a model with its fly-by-wire bypassed; return a note."""
    found = JsbsimModel.model_validate({**facts["jsbsim"], "root": root})
    read = files.read(folder, found)
    (surface,) = found.surfaces(LONGITUDINAL).values()
    held = [name for name in facts["integrating"] if name != surface.surface]
    bypass(read.root, surface.command, surface.surface, _STICK_RAD / surface.surface_rad, held)
    files.copy(read, beside)
    files.write(read, beside / f"{model}.xml")
    also = f"; {', '.join(held)} held at 0" if held else ""
    return (
        f"augmentation: the fly-by-wire integrates and no property switches it off; {surface.command} drives "
        f"{surface.surface} in a copy of the model{also}"
    )


def _written(
    out: Path, folder: Path, model: str, root: Literal[".", "wheel"], facts: Mapping[str, Any]
) -> ForeignAircraft:
    """Write the folder of a surveyed model."""
    sections = ("notes", "decisions")
    notes, decisions = (tuple(str(x) for x in facts[key]) for key in sections)
    decisions += ("sensors: the noise of every channel in aircraft.toml is an assumption; state your own",)
    table = _table(facts["jsbsim"], out.name, model, root)
    flight = words.flight(facts) + tuple(f"six axes: {line}" for line in words.lateral(facts))
    lateral = words.lateral_campaign(out.name, facts) if facts["condition"] else ""
    file = AircraftFile.model_construct(
        name=out.name,
        description=f"{model} of JSBSim",
        jsbsim=table,
        sensors=_sensors(bool(table.surfaces(MOTION))),
    )
    heading = f"{model} of JSBSim, surveyed by airtruth; {REPORT} has the report. Author and licence: the JSBSim file."
    with new_folder(out) as made:
        if root == ".":
            read = files.read(folder, table.model_copy(update={"model": model}))
            files.copy(read, made)
            files.write(read, made / f"{out.name}.xml")
        (made / FILE).write_text(toml.write(file, heading), encoding="utf-8")
        unread = Aircraft(folder=out, file=file, constants=Constants.model_validate(facts["constants"]))
        records = facts["flight"] is not None and facts["flight"]["duration_s"] > 0.0
        written = ForeignAircraft(
            unread, notes, decisions, words.rows(facts), flight, str(facts["cause"]), records, bool(lateral)
        )
        if records:
            (made / CAMPAIGN).write_text(words.campaign(out.name, facts), encoding="utf-8")
        if lateral:
            (made / LATERAL_CAMPAIGN).write_text(lateral, encoding="utf-8")
        (made / REPORT).write_text(written.summary() + "\n", encoding="utf-8")
        ledger.add_folder(made, "aircraft")
    return replace(written, aircraft=load(out))


def _located(source: str | Path) -> tuple[Path, str, Literal[".", "wheel"]]:
    """Folder of a model, its name, and where it lies."""
    path = Path(source)
    if path.is_file():
        return path.resolve().parent, path.stem, "."
    if path.is_dir():
        own = path / f"{path.resolve().name}.xml"
        found = [own] if own.is_file() else [p for p in sorted(path.glob("*.xml")) if _is_model(p)]
        if len(found) != 1:
            names = ", ".join(p.name for p in found) or "none"
            raise AircraftError(
                f"{path}: has to hold one JSBSim model (found: {names}); give the XML file itself"
            )
        return path.resolve(), found[0].stem, "."
    wheel = wheel_root() / "aircraft"
    name = str(source)
    known = sorted(p.name for p in wheel.iterdir() if (p / f"{p.name}.xml").is_file())
    if name not in known:
        raise AircraftError(
            f"--jsbsim {name!r}: no such file, folder or model of JSBSim; {choices(name, known)}"
        )
    return wheel / name, name, "wheel"


def _is_model(path: Path) -> bool:
    try:
        return ET.parse(path).getroot().tag == "fdm_config"
    except (ET.ParseError, OSError):
        return False


def _survey(folder: Path, model: str, root: str) -> Mapping[str, Any]:
    task = Task(
        "airtruth.simulation.survey.task:survey",
        {"folder": str(folder), "model": model, "root": root},
        _LIMITS,
        ("airtruth.simulation.survey.task",),
    )
    try:
        return call(task).facts
    except IsolatedError as error:
        reason = {
            "time": f"did not finish within {_LIMITS.seconds:.0f} s",
            "memory": "needs more memory than a model may",
        }.get(error.kind, f"ended the process of JSBSim ({error.detail})")
        raise AircraftError(f"{model}: the survey of this model {reason}; JSBSim cannot fly it") from None


def _table(found: Mapping[str, Any], name: str, model: str, root: Literal[".", "wheel"]) -> JsbsimModel:
    """The [jsbsim] table with the entries that differ from their defaults."""
    entries: dict[str, Any] = {
        "model": name if root == "." else model,
        "root": root,
        "throttle": ThrottleProperties(command=tuple(found["throttle"]["command"])),
    }
    entries |= {key: found[key] for key in ("set", "declare", "engine_start_s") if found[key]}
    for control in (*LONGITUDINAL.controls, *MOTION.controls):
        own = found[control.name]
        if own is not None:
            kind = ElevatorProperties if control in LONGITUDINAL.controls else SurfaceProperties
            entries[control.name] = kind(**{"surface": own["surface"], **_stated(kind, own)})
    if found["lateral"] is not None:
        entries["lateral"] = LateralProperties(**found["lateral"])
    return JsbsimModel(**entries)


def _stated(kind: type[SurfaceProperties], found: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of a control's table that differ from their defaults."""
    return {k: v for k, v in found.items() if v != kind.model_fields[k].default}


def _sensors(lateral: bool) -> dict[str, Sensor]:
    aside = (name for name in LATERAL if name not in MOTION.commands)
    noise = {
        name: _SURFACE_NOISE_RAD
        if name in (*LONGITUDINAL.surfaces, *MOTION.surfaces)
        else _NOISE[SIGNALS[name].dimension]
        for name in (*LONGITUDINAL.channels, *(aside if lateral else ()))
    }
    source = "assumed by airtruth"
    return {name: Sensor(noise_std=Quantity(value=std, source=source)) for name, std in noise.items()}


__all__ = ["CAMPAIGN", "LATERAL_CAMPAIGN", "REPORT", "ForeignAircraft", "new_from_jsbsim"]
