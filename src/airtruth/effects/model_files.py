"""A JSBSim model's files: read with comments kept, and copied so that the copy needs nothing else."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from airtruth.aircraft import Aircraft, JsbsimModel
from airtruth.aircraft_probe import model_file, model_root
from airtruth.errors import AircraftError, StoreError

_SECTIONS: Final = ("flight_control", "aerodynamics", "mass_balance", "propulsion", "external_reactions")
ET.register_namespace("xsi", "http://www.w3.org/2001/XMLSchema-instance")


@dataclass(frozen=True)
class Model:
    """A model as read: what stands before its root element, and the root, sections in files of their own read in."""

    prolog: str
    root: ET.Element
    source: Path


def read(aircraft: Aircraft, model: JsbsimModel) -> Model:
    """Read the model's XML.

    Raises
    ------
    AircraftError
        If a file cannot be read or is not XML.
    """
    path = model_file(aircraft.folder, model.root, model.model)
    text = _text(path)
    root = _parse(text, path)
    for section in list(root):
        name = section.get("file") if isinstance(section.tag, str) and section.tag in _SECTIONS else None
        if name:
            file = path.parent / (name if name.endswith(".xml") else f"{name}.xml")
            root[list(root).index(section)] = _parse(_text(file), file)
    start = re.search(r"<fdm_config[\s>]", text)
    return Model(text[: start.start()] if start else "", root, path)


def write(model: Model, path: Path) -> None:
    """Write a model's XML."""
    ET.indent(model.root, "  ")
    path.write_text(model.prolog + ET.tostring(model.root, encoding="unicode") + "\n", encoding="utf-8")


def copy(aircraft: Aircraft, model: JsbsimModel, read_model: Model, out: Path) -> None:
    """Copy a model's folder, without its own XML and aircraft.toml, and the engines and systems that it names.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    """
    _, _, engines, systems = model_root(aircraft.folder, model.root)
    try:
        shutil.copytree(
            read_model.source.parent,
            out,
            dirs_exist_ok=True,
            ignore=shutil.ignore_patterns(read_model.source.name, "aircraft.toml"),
        )
        root = read_model.root
        _named(
            root.findall("propulsion/engine") + root.findall("propulsion/engine/thruster"),
            engines,
            out,
            "Engines",
        )
        _named(root.findall("system") + root.findall("autopilot"), systems, out, "Systems")
    except OSError as error:
        raise StoreError(f"{out}: cannot be written ({error}); choose another folder") from None


def _named(elements: list[ET.Element], folder: Path, out: Path, kind: str) -> None:
    for name in {e.get("file", "") for e in elements} - {""}:
        file = f"{name.removesuffix('.xml')}.xml"
        if not (out / file).exists() and not (out / kind / file).exists() and (folder / file).is_file():
            (out / kind).mkdir(exist_ok=True)
            shutil.copyfile(folder / file, out / kind / file)


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
