"""Bypass of a fly-by-wire that no property switches off: the stick drives the surface, other moving surfaces are held."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Final

CHANNEL: Final = "Bypass by airtruth"
"""Name of the channel that is added behind the flight controls."""


def bypass(
    root: ET.Element, command: str, surface: str, units_per_command: float, held: Sequence[str]
) -> None:
    """Add a channel behind all others that writes the surface from the command, and zero into other surfaces.

    Parameters
    ----------
    root : root element of a model; it has a `<flight_control>`.
    command, surface : properties of the stick and of the elevator.
    units_per_command : surface per unit of the command [its unit].
    held : properties of further surfaces that the fly-by-wire moves.
    """
    control = root.find("flight_control")
    if control is None:
        control = ET.SubElement(root, "flight_control", {"name": "Bypass"})
    channel = ET.SubElement(control, "channel", {"name": CHANNEL})
    for number, (output, gain) in enumerate([(surface, units_per_command), *((name, 0.0) for name in held)]):
        component = ET.SubElement(channel, "pure_gain", {"name": f"airtruth/bypass-{number}"})
        ET.SubElement(component, "input").text = command
        ET.SubElement(component, "gain").text = repr(gain)
        ET.SubElement(component, "output").text = output


__all__ = ["CHANNEL", "bypass"]
