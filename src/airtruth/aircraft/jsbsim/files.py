"""A JSBSim model's files: read with their places, changed without a byte more than the change, and copied whole."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element
from xml.parsers.expat import ExpatError

from airtruth.aircraft import JsbsimModel
from airtruth.aircraft.jsbsim.confine import controls_simulation, model_files
from airtruth.aircraft.jsbsim.document import Document, parse
from airtruth.aircraft.probe import model_file, wheel_root
from airtruth.errors import AircraftError, StoreError

_SECTIONS: Final = ("flight_control", "aerodynamics", "mass_balance", "propulsion", "external_reactions")
"""Sections of a model that may be in a file of their own."""
_KINDS: Final = {"engine": "Engines", "systems": "Systems"}
"""Folder of the JSBSim package -> folder of a model that holds copies from it."""


@dataclass(frozen=True)
class Model:
    """A model as read.

    Attributes
    ----------
    root : root element, with the sections from files of their own.
    source : file of the root element.
    document : that file.
    sections : file of each section of its own, and its content.
    """

    root: Element
    source: Path
    document: Document
    sections: tuple[tuple[Path, Document], ...] = ()


def read(folder: Path, model: JsbsimModel) -> Model:
    """Read the model's XML.

    Parameters
    ----------
    folder : folder of aircraft.toml; model : its [jsbsim] table.

    Raises
    ------
    AircraftError
        If a file cannot be read or is not XML.
    """
    path = model_file(folder, model.root, model.model)
    document = _parsed(path)
    root = document.root
    sections = []
    for section in list(root):
        name = section.get("file") if isinstance(section.tag, str) and section.tag in _SECTIONS else None
        if name:
            file = path.parent / (name if name.endswith(".xml") else f"{name}.xml")
            own = _parsed(file)
            document.stand_in(section, own.root)
            sections.append((file, own))
    for child in [c for c in root if c.tag in ("output", "input")]:
        root.remove(child)  # a copy must not open files or sockets of its own
    _without_control(root)
    return Model(root, path, document, tuple(sections))


def write(model: Model, path: Path) -> None:
    """Write a model's XML with the changes of its tree; its sections in files of their own go beside it."""
    path.write_bytes(model.document.patched())
    for file, section in model.sections:
        target = path.parent / _copied_to(model.source.parent.resolve(), file.resolve())
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(section.patched())


def copy(read_model: Model, out: Path) -> None:
    """Copy the files that a model refers to, without its own XML: engines, systems, sections.

    Nothing else of its folder is copied, and no link is followed out of it.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    """
    folder = read_model.source.parent.resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
        for source in model_files(read_model.source, wheel_root()):
            if source.resolve() == read_model.source.resolve():
                continue
            target = out / _copied_to(folder, source)
            target.parent.mkdir(parents=True, exist_ok=True)
            _copy_file(source, target)
    except OSError as error:
        raise StoreError(f"{out}: cannot be written ({error}); choose another folder") from None


def _copied_to(folder: Path, source: Path) -> Path:
    """Path of a copy relative to that of the model."""
    if source.is_relative_to(folder):
        return source.relative_to(folder)
    return Path(_KINDS[source.parent.name]) / source.name


def _copy_file(source: Path, target: Path) -> None:
    """Copy a file without what a copy may not have: XML entities, which are replaced by their values, and control of JSBSim."""
    document = _parsed(source)
    if _without_control(document.root) or document.content != source.read_bytes():
        target.write_bytes(document.patched())
    else:
        shutil.copyfile(source, target)


def _without_control(root: Element) -> bool:
    """Remove the outputs that stop or re-time the simulation, as those of a crash; whether there were any.

    Models of the JSBSim package may have them, a copy may not.
    """
    found = False
    for parent in root.iter():
        for child in [c for c in parent if c.tag == "output" and controls_simulation(c.text or "")]:
            parent.remove(child)
            found = True
    return found


def _parsed(path: Path) -> Document:
    try:
        content = path.read_bytes()
        content.decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise AircraftError(f"{path}: cannot be read ({error})") from None
    try:
        return parse(content)
    except ExpatError as error:
        raise AircraftError(f"{path}: not valid XML: {error}") from None
