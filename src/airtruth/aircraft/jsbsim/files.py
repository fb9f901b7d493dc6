"""A JSBSim model's files: read with comments kept, and copied so that the copy needs nothing else."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from airtruth.aircraft import JsbsimModel
from airtruth.aircraft.jsbsim.confine import controls_simulation, model_files
from airtruth.aircraft.probe import model_file, wheel_root
from airtruth.errors import AircraftError, StoreError

_SECTIONS: Final = ("flight_control", "aerodynamics", "mass_balance", "propulsion", "external_reactions")
"""Sections of a model that may be in a file of their own."""
_KINDS: Final = {"engine": "Engines", "systems": "Systems"}
"""Folder of the JSBSim package -> folder of a model that holds copies from it."""
ET.register_namespace("xsi", "http://www.w3.org/2001/XMLSchema-instance")


@dataclass(frozen=True)
class Model:
    """A model as read.

    Attributes
    ----------
    prolog : text before the root element.
    root : root element, with the sections from files of their own.
    source : file of the root element.
    """

    prolog: str
    root: ET.Element
    source: Path


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
    text = _text(path)
    root = _parse(text, path)
    for section in list(root):
        name = section.get("file") if isinstance(section.tag, str) and section.tag in _SECTIONS else None
        if name:
            file = path.parent / (name if name.endswith(".xml") else f"{name}.xml")
            root[list(root).index(section)] = _parse(_text(file), file)
    for child in [c for c in root if c.tag in ("output", "input")]:
        root.remove(child)  # a copy must not open files or sockets of its own
    _without_control(root)
    start = re.search(r"<fdm_config[\s>]", text)
    return Model(text[: start.start()] if start else "", root, path)


def write(model: Model, path: Path) -> None:
    """Write a model's XML."""
    ET.indent(model.root, "  ")
    path.write_text(model.prolog + ET.tostring(model.root, encoding="unicode") + "\n", encoding="utf-8")


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
            inside = source.is_relative_to(folder)
            target = out / (
                source.relative_to(folder) if inside else f"{_KINDS[source.parent.name]}/{source.name}"
            )
            target.parent.mkdir(parents=True, exist_ok=True)
            _copy_file(source, target)
    except OSError as error:
        raise StoreError(f"{out}: cannot be written ({error}); choose another folder") from None


def _copy_file(source: Path, target: Path) -> None:
    """Copy a file without what a copy may not have: XML entities, which are replaced by their values, and control of JSBSim."""
    text = _text(source)
    root = _parse(text, source)
    if _without_control(root) or "<!DOCTYPE" in text:
        target.write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    else:
        shutil.copyfile(source, target)


def _without_control(root: ET.Element) -> bool:
    """Remove the outputs that stop or re-time the simulation, as those of a crash; whether there were any.

    Models of the JSBSim package may have them, a copy may not.
    """
    found = False
    for parent in root.iter():
        for child in [c for c in parent if c.tag == "output" and controls_simulation(c.text or "")]:
            parent.remove(child)
            found = True
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise AircraftError(f"{path}: cannot be read ({error})") from None


def _parse(text: str, path: Path) -> ET.Element:
    try:
        return ET.fromstring(text, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    except ET.ParseError as error:
        raise AircraftError(f"{path}: not valid XML: {error}") from None
