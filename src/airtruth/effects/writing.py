"""Write a change into an aircraft: a copy of its folder that flies with the effect."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft, AircraftFile, JsbsimModel
from airtruth.effects import aerodynamics_xml, declared_xml, model_files, surface_xml, toml_text
from airtruth.effects.change import AeroTerm, Change
from airtruth.effects.declared_xml import Masses, total
from airtruth.effects.dynamics import joined
from airtruth.effects.neutral import effective, fitted
from airtruth.errors import AircraftError, ConfigurationError, StoreError, choices
from airtruth.physics.short_period import PARAMETERS

MARK: Final = "changed by airtruth"
"""In the heads of both files of a changed aircraft."""
HIGHEST_HZ: Final = 400.0
"""Simulation rate up to which a written delay holds, unless another is asked for [Hz]."""

_SIGNAL_OF: Final = {"alpha": "alpha", "q": "qhat", "de": "elevator"}


@dataclass(frozen=True)
class Corrections:
    """Increments of the six derivatives, linear about a trim.

    Attributes
    ----------
    increments : name of `airtruth.physics.short_period.PARAMETERS` -> increment [1/rad]; may leave some out.
    alpha_rad, elevator_rad : the trim, where lift and moment stay as they are [rad].
    """

    increments: Mapping[str, float]
    alpha_rad: float
    elevator_rad: float

    def terms(self) -> tuple[AeroTerm, ...]:
        """The increments as terms.

        Raises
        ------
        ConfigurationError
            If a name is not a derivative.
        """
        for name in self.increments:
            if name not in PARAMETERS:
                raise ConfigurationError(f"derivative {name!r}: {choices(name, PARAMETERS)}")
        at = {"alpha": self.alpha_rad, "elevator": self.elevator_rad, "qhat": 0.0}
        found = []
        for name, amount in self.increments.items():
            signal = _SIGNAL_OF[name[2:]]
            found.append(
                AeroTerm("CL" if name.startswith("CL") else "Cm", signal, "linear", amount, at[signal])
            )
        return tuple(found)


def write_aircraft(
    aircraft: Aircraft | Path | str,
    change: Change,
    out_folder: Path,
    note: str = "",
    derivatives: Corrections | None = None,
    highest_hz: float = HIGHEST_HZ,
) -> Path:
    """Copy an aircraft's folder with a change written in, in its JSBSim model and its aircraft.toml.

    The copy stands alone: models that ship with JSBSim are copied out of its package, with their engines and
    systems. Neutral terms write nothing. Terms in the air are not the aircraft's and are left out.

    Parameters
    ----------
    aircraft : an aircraft, or its folder or name.
    change : what changes.
    out_folder : folder to write, new or empty; the JSBSim model takes its name.
    note : said in the heads of both files: what was changed, and why.
    derivatives : increments of the declared derivatives, to be written too.
    highest_hz : simulation rate up to which a delay holds [Hz]; above it a delay is that many steps.

    Returns
    -------
    out_folder

    Raises
    ------
    AircraftError
        If the model cannot take the change, or JSBSim refuses the result.
    ConfigurationError
        If a term or derivative is not known.
    StoreError
        If the folder is not empty or cannot be written.
    """
    return changed(aircraft, change, out_folder, note, derivatives, highest_hz).folder


def changed(
    aircraft: Aircraft | Path | str,
    change: Change,
    out_folder: Path,
    note: str = "",
    derivatives: Corrections | None = None,
    highest_hz: float = HIGHEST_HZ,
) -> Aircraft:
    """As `write_aircraft`; the written aircraft, read back and checked."""
    plane = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    if derivatives is not None:
        change = replace(change, aero=change.aero + derivatives.terms())
    change = effective(change)
    file = plane.file
    if file.jsbsim is None and change.in_aircraft:
        raise AircraftError(
            f"{plane.folder}: aircraft.toml has no [jsbsim] table, so there is no model to write the change into"
        )
    _claim(out_folder)
    said = _heading(plane, change, note)
    try:
        if file.jsbsim is not None:
            _write_model(plane, file.jsbsim, change, out_folder, said, highest_hz)
        text = toml_text.write(_changed_file(plane, change, out_folder.name), said)
        (out_folder / planes.FILE).write_text(text, encoding="utf-8")
    except OSError as error:
        raise StoreError(
            f"{out_folder}: cannot be written ({error.strerror}); choose another folder"
        ) from None
    return planes.load(out_folder)


def _claim(folder: Path) -> None:
    if not re.fullmatch(r"[A-Za-z0-9_.-]+", folder.name):
        raise StoreError(f"{folder}: the folder's name is the model's; use letters, digits, '_', '.' and '-'")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise StoreError(f"{folder}: is not empty; choose a new folder for the changed aircraft")
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None


def _heading(plane: Aircraft, change: Change, note: str) -> str:
    lines = [f"{plane.name}, {MARK}. Every quantity in SI."]
    lines += [note] if note else []
    for field in fields(Change):
        lines += [
            f"{field.name}: {_said(term)}" for term in getattr(change, field.name) if field.name != "air"
        ]
    return "\n".join(lines)


def _said(term: Any) -> str:
    return ", ".join(f"{f.name} = {getattr(term, f.name)}" for f in fields(term))


def _write_model(
    plane: Aircraft, model: JsbsimModel, change: Change, out: Path, said: str, highest_hz: float
) -> None:
    read = model_files.read(plane, model)
    model_files.copy(plane, model, read, out)
    root, where = read.root, f"{plane.name} ({read.source.name})"
    constants = plane.constants
    masses = Masses(
        mass_kg=constants.mass_kg, inertia_kg_m2=constants.inertia_yy_kg_m2, chord_m=constants.chord_m
    )
    declared_xml.write(root, change.declared, masses, where)
    _write_functions(root, model, change, where, highest_hz)
    if change.in_aircraft:
        _document(root, said)
    model_files.write(read, out / f"{out.name}.xml")


def _write_functions(
    root: ET.Element, model: JsbsimModel, change: Change, where: str, highest_hz: float
) -> None:
    factor = total(change.declared, "elevator")
    signals = {t.signal for t in change.aero} | {s.signal for s in change.states}
    surface = bool(change.surface) or factor != 1.0
    if not surface and not change.aero:
        return
    aerodynamics = root.find("aerodynamics")
    if aerodynamics is None:
        raise AircraftError(f"{where}: the model has no <aerodynamics>")
    elevator, control = model.elevator, root.find("flight_control")
    named = surface_xml.names(control, elevator.surface)
    components = surface_xml.Components()
    if surface or "elevator" in signals:
        components += surface_xml.chain(named, elevator.surface_rad, change.surface, factor, highest_hz)
    if surface:
        components += surface_xml.redirect(aerodynamics, named, where)
    if change.aero:
        components += aerodynamics_xml.write(
            aerodynamics, change.aero, change.states, named, elevator.surface_rad, model.rotary_gust, where
        )
    if control is None:
        control = ET.SubElement(root, "flight_control", {"name": "Effects"})
    control.extend(surface_xml.channel(components))


def _document(root: ET.Element, said: str) -> None:
    header = root.find("fileheader")
    if header is None:
        header = ET.Element("fileheader")
        root.insert(0, header)
    for line in said.splitlines():
        ET.SubElement(header, "note").text = line


def _changed_file(plane: Aircraft, change: Change, model_name: str) -> AircraftFile:
    """aircraft.toml of the copy: the model beside it, its mass, inertia and CG, and the sensors."""
    file = plane.file
    updates: dict[str, Any] = {}
    if file.jsbsim is not None:
        updates["jsbsim"] = file.jsbsim.model_copy(update={"model": model_name, "root": "."})
    if file.mass is not None:
        mass, inertia = total(change.declared, "mass"), total(change.declared, "inertia")
        old = file.mass
        updates["mass"] = old.model_copy(
            update={
                "mass": old.mass.model_copy(update={"value": old.mass.value * mass}),
                "inertia_yy": old.inertia_yy.model_copy(update={"value": old.inertia_yy.value * inertia}),
                "cg": old.cg.model_copy(update={"value": old.cg.value + total(change.declared, "cg")}),
            }
        )
    dynamics = joined(file.dynamics, change)
    if dynamics is not None:
        updates["dynamics"] = dynamics
    if change.sensors:
        updates["sensors"] = fitted(file.sensors, change.sensors)
    return file.model_copy(update=updates)
