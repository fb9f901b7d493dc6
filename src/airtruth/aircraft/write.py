"""Write a change into an aircraft: a copy of its folder that flies with the effect."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element, SubElement

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft, AircraftFile, JsbsimModel
from airtruth.aircraft import toml as toml_text
from airtruth.aircraft.dynamics import with_change
from airtruth.aircraft.jsbsim import changes as changes_xml
from airtruth.aircraft.jsbsim import files as model_files
from airtruth.aircraft.jsbsim import mass_balance as declared_xml
from airtruth.aircraft.neutral import effective, fitted
from airtruth.aircraft.origin import MARK, UNKNOWN, Origin, Term, number_of
from airtruth.aircraft.toml_patch import patched
from airtruth.errors import AircraftError, ConfigurationError, StoreError
from airtruth.logs import ledger
from airtruth.logs.atomic import new_folder
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.resolution import linear_terms
from airtruth.physics.terms import DECLARED, AeroTerm, Change, declared_total

_QUANTITIES: Final = {
    "mass": "mass",
    "inertia_yy": "inertia",
    "inertia_xx": "inertia_xx",
    "inertia_zz": "inertia_zz",
    "inertia_xz": "inertia_xz",
    "cg": "cg",
}
"""Entry of [mass] -> quantity of a `DeclaredTerm`."""
HIGHEST_HZ: Final = 400.0
"""Simulation rate up to which a written delay holds, unless another is asked for [Hz]."""


@dataclass(frozen=True)
class Corrections:
    """Increments of the derivatives of a motion, linear about a trim.

    Attributes
    ----------
    increments : derivative -> increment [1/rad, -]; may leave some out.
    trim : signal -> value where the coefficients stay as they are [rad]; those left out are zero there.
    std : standard deviations of the increments, of those that have one [1/rad, -].
    motion : of the derivatives.
    """

    increments: Mapping[str, float]
    trim: Mapping[str, float]
    std: Mapping[str, float] = field(default_factory=dict)
    motion: Motion = LONGITUDINAL

    def terms(self) -> dict[str, AeroTerm]:
        """The increments as terms, by the names of the derivatives.

        Raises
        ------
        ConfigurationError
            If a name is not a derivative.
        """
        terms = linear_terms(self.increments, self.trim, self.motion)
        return dict(zip(self.increments, terms, strict=True))


def write_aircraft(
    aircraft: Aircraft | Path | str,
    change: Change,
    out_folder: Path,
    note: str = "",
    derivatives: Corrections | None = None,
    highest_hz: float = HIGHEST_HZ,
    origin: Origin = UNKNOWN,
) -> Path:
    """Copy an aircraft's folder with a change written in, in its JSBSim model and its aircraft.toml.

    Both files keep every line, comment and unit that the change does not concern.

    The copy is complete: models that ship with JSBSim are copied out of its package, with their engines and systems.
    Neutral terms write nothing. Terms in the air do not belong to an aircraft and are left out.

    Parameters
    ----------
    aircraft : an aircraft, or its folder or name.
    change : terms to add.
    out_folder : folder to write, new or empty; the JSBSim model takes its name.
    note : added to the heads of both files: the reason of the change.
    derivatives : increments of the declared derivatives, to be added as well.
    highest_hz : simulation rate up to which a delay is valid [Hz]; above it the delay is shorter.
    origin : standard deviations and source of the numbers; both files state them beside each.

    Returns
    -------
    out_folder

    Raises
    ------
    AircraftError
        If the model cannot take the change, or JSBSim refuses the result.
    ConfigurationError
        If a term or derivative is not known, or a `DerivativeTerm` is not resolved.
    StoreError
        If the folder is not empty or cannot be written.
    """
    return changed(aircraft, change, out_folder, note, derivatives, highest_hz, origin).folder


def changed(
    aircraft: Aircraft | Path | str,
    change: Change,
    out_folder: Path,
    note: str = "",
    derivatives: Corrections | None = None,
    highest_hz: float = HIGHEST_HZ,
    origin: Origin = UNKNOWN,
    declared: str | None = None,
) -> Aircraft:
    """Write as `write_aircraft`, and return the aircraft, read back and checked.

    Parameters
    ----------
    declared : text of the aircraft.toml to change; None for that in the aircraft's folder.
    """
    plane = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    if derivatives is not None:
        terms = derivatives.terms()
        change = replace(change, aero=change.aero + tuple(terms.values()))
        stated: dict[Term, float] = {terms[name]: std for name, std in derivatives.std.items()}
        origin = replace(origin, std={**origin.std, **stated})
    change = effective(change)
    if change.derivatives:
        raise ConfigurationError(
            f"{plane.folder}: {change.derivatives[0].cause} changes the derivatives by an amount that depends on the trim; "
            "resolve the change at a trim first (airtruth.simulation.resolution.at_condition)"
        )
    file = plane.file
    if file.jsbsim is None and change.in_aircraft:
        raise AircraftError(
            f"{plane.folder}: has no JSBSim model to write the change into, or no [jsbsim] table in aircraft.toml; "
            "`airtruth aircraft new` writes one"
        )
    require_new(out_folder)
    heading = f"{plane.name}, {MARK}. {note}".rstrip()
    with new_folder(out_folder) as folder:
        if file.jsbsim is not None:
            _write_model(plane, file.jsbsim, change, folder, heading, highest_hz, origin)
        text = _aircraft_text(plane, _changed_file(plane, change, folder.name, origin), heading, declared)
        (folder / planes.FILE).write_bytes(text.encode())
        ledger.add_folder(folder, "aircraft")
    return planes.load(out_folder)


def require_new(folder: Path, *, force: bool = False) -> None:
    """Refuse a folder for an aircraft that is not new or empty; with ``force`` it may be that of an aircraft.

    Raises
    ------
    StoreError
        If its name cannot be that of a JSBSim model, or the folder is not empty or cannot be read.
    """
    if not re.fullmatch(r"[A-Za-z0-9_.-]+", folder.name):
        raise StoreError(f"{folder}: the folder's name is the model's; use letters, digits, '_', '.' and '-'")
    try:
        if not folder.exists() or not any(folder.iterdir()):
            return
        if not force:
            raise StoreError(f"{folder}: is not empty; choose a new folder for the aircraft")
        if not (folder / planes.FILE).is_file():
            raise StoreError(
                f"{folder}: is not empty and holds no {planes.FILE}, so --force does not replace it; choose a new folder"
            )
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None


def _aircraft_text(plane: Aircraft, file: AircraftFile, heading: str, declared: str | None) -> str:
    """aircraft.toml with the changed content; an aircraft in memory, of no folder, is written whole."""
    path = plane.folder / planes.FILE
    head = heading.partition("\n")[0]
    if declared is None and not path.is_file():
        return toml_text.write(file, head)
    return patched(path.read_bytes().decode() if declared is None else declared, file, head)


def _write_model(
    plane: Aircraft,
    model: JsbsimModel,
    change: Change,
    out: Path,
    heading: str,
    highest_hz: float,
    origin: Origin,
) -> None:
    read = model_files.read(plane.folder, model)
    model_files.copy(read, out)
    root, where = read.root, f"{plane.name} ({read.source.name})"
    declared_xml.write(root, change.declared, plane.constants, where)
    changes_xml.write(root, model, change.in_motion, where, highest_hz, origin)
    if change.in_aircraft or change.readings:
        declared = [f"{t.quantity}: {number_of(t)!r}{origin.words(t)}" for t in change.declared]
        _document(root, [*heading.splitlines(), *declared])
    model_files.write(read, out / f"{out.name}.xml")


def _document(root: Element, lines: Sequence[str]) -> None:
    header = root.find("fileheader")
    if header is None:
        header = Element("fileheader")
        root.insert(0, header)
    for line in lines:
        SubElement(header, "note").text = line


def _changed_file(plane: Aircraft, change: Change, model_name: str, origin: Origin) -> AircraftFile:
    """aircraft.toml of the copy: the model beside it, its mass, inertia and CG, and the sensors."""
    file = plane.file
    updates: dict[str, Any] = {}
    shift = declared_total(change.declared, "cg")
    if file.jsbsim is not None:
        updates["jsbsim"] = file.jsbsim.model_copy(update={"model": model_name, "root": "."})
    if file.mass is not None:
        old = file.mass
        product = math.sqrt(plane.constants.inertia_xx_kg_m2 * plane.constants.inertia_zz_kg_m2)
        moved = {}
        for key, quantity in _QUANTITIES.items():
            stated = getattr(old, key)
            if stated is None:
                continue
            total, unit = declared_total(change.declared, quantity), product if key == "inertia_xz" else 1.0
            is_factor = DECLARED[quantity] == 1.0
            value = stated.value * total if is_factor else stated.value + unit * total
            if value != stated.value:
                std = origin.std_of(quantity, stated.value if is_factor else unit)
                moved[key] = origin.stated(stated, value, std)
        if moved:
            updates["mass"] = old.model_copy(update=moved)
    for name, part in (("tail", file.tail), ("fin", file.fin)):
        if not shift or part is None or part.arm is None:
            continue
        std = origin.std_of("cg", plane.chord_m)
        both = None if std is None else math.hypot(part.arm.std, std)
        shorter = origin.stated(part.arm, part.arm.value - shift * plane.chord_m, both)
        updates[name] = part.model_copy(update={"arm": shorter})
    dynamics = with_change(file.dynamics, change)
    if dynamics is not None:
        updates["dynamics"] = dynamics
    if change.sensors:
        updates["sensors"] = fitted(file.sensors, change.sensors, origin)
    return file.model_copy(update=updates)
