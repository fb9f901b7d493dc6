"""Names of properties in the XML of a model: what its aerodynamics read, and what may switch a feedback off."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

_AUGMENTATION: Final = re.compile(
    r"fbw|sas|cas|damper|augment|stabil|autopilot|^ap/|hold|gain|override|engage|enable|active", re.IGNORECASE
)
"""Names of properties that may switch feedback on or off (judgement: words of the models in the JSBSim package)."""
_READING: Final = ("property", "independentVar", "input", "test", "clipto", "p", "v")
"""Elements whose text is the name of a property."""
_NAME: Final = re.compile(r"-?/?[A-Za-z_][\w./-]*(?:\[\d+\][\w./-]*)*")
"""Form of a property's name; a sign in front negates it."""


@dataclass(frozen=True)
class ModelNames:
    """Properties in the files of a model, each once, in the order of the files.

    Attributes
    ----------
    aerodynamic : read by the aerodynamic functions.
    read, written : read anywhere; outputs and names of components.
    engines : tags of the root elements of the engines' files, for example "piston_engine".
    has_propeller : whether a thruster is a propeller.
    sensors : names of the `<sensor>`, `<accelerometer>`, `<gyro>` and `<magnetometer>` components.
    by_axis : axis of the aerodynamics -> properties that its functions read.
    """

    aerodynamic: tuple[str, ...]
    read: tuple[str, ...]
    written: tuple[str, ...]
    engines: tuple[str, ...]
    sensors: tuple[str, ...]
    has_propeller: bool = False
    by_axis: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def switches(self) -> list[str]:
        """Properties that may switch feedback on or off: read, never written."""
        outputs = set(self.written)
        return [n for n in self.read if _AUGMENTATION.search(n) and n not in outputs]


def names_of(files: Sequence[Path]) -> ModelNames:
    """Collect the names in the files of a model, which `airtruth.aircraft.jsbsim.confine` has checked."""
    aerodynamic: dict[str, None] = {}
    read: dict[str, None] = {}
    written: dict[str, None] = {}
    engines: list[str] = []
    sensors: dict[str, None] = {}
    propeller = False
    by_axis: dict[str, dict[str, None]] = {}
    for path in files:
        root = ET.fromstring(path.read_bytes())
        propeller = propeller or root.tag == "propeller"
        if str(root.tag).endswith("_engine"):
            engines.append(str(root.tag))
            continue
        for section in root.iter("aerodynamics"):
            aerodynamic.update(dict.fromkeys(_properties(section)))
            for axis in section.iter("axis"):
                by_axis.setdefault(str(axis.get("name")), {}).update(dict.fromkeys(_properties(axis)))
        read.update(dict.fromkeys(_properties(root)))
        for element in root.iter():
            if element.tag == "output":
                written.update(dict.fromkeys(_NAME.findall(element.text or "")))
            elif element.get("name") and element.tag not in ("property", "function", "fdm_config"):
                written[_component(str(element.get("name")))] = None
            if element.tag in ("sensor", "accelerometer", "gyro", "magnetometer") and element.get("name"):
                sensors[str(element.get("name"))] = None
    return ModelNames(
        tuple(aerodynamic),
        tuple(read),
        tuple(written),
        tuple(engines),
        tuple(sensors),
        propeller,
        {axis: tuple(found) for axis, found in by_axis.items()},
    )


def _properties(root: ET.Element) -> Iterator[str]:
    for element in root.iter():
        if element.tag in _READING:
            for name in _NAME.findall(element.text or ""):
                if "/" in name:
                    yield name.removeprefix("-")


def _component(name: str) -> str:
    """Property that holds the output of a component."""
    return name if "/" in name else "fcs/" + name.strip().lower().replace(" ", "-")


__all__ = ["ModelNames", "names_of"]
