"""How increments of coefficients reach the axes of a JSBSim model's <aerodynamics>."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from airtruth.aircraft.jsbsim.functions import function, op, prop
from airtruth.errors import AircraftError

_ALPHA: Final = "aero/alpha-rad"
"""Property of the angle of attack [rad]."""
_BETA: Final = "aero/beta-rad"
"""Property of the sideslip [rad]."""
_PARTNERS: Final[Mapping[str, frozenset[str]]] = {
    "Z": frozenset("X"),
    "X": frozenset("Z"),
    "NORMAL": frozenset({"AXIAL"}),
    "AXIAL": frozenset({"NORMAL"}),
    "Y": frozenset("XZ"),
    "SIDE": frozenset({"AXIAL", "NORMAL"}),
}
"""Axis -> those beside which JSBSim accepts it."""
_TURNING: Final = {
    "Cm": ("PITCH", "metrics/cbarw-ft", "moment"),
    "Cl": ("ROLL", "metrics/bw-ft", "roll"),
    "Cn": ("YAW", "metrics/bw-ft", "yaw"),
}
"""Coefficient of a moment -> axis, reference length [ft], and part of the name of its function."""


@dataclass(frozen=True)
class _Force:
    """How a force that a coefficient states reaches the axes of a model.

    Attributes
    ----------
    total : last part of the name of its sum.
    direction : along which axis of the body.
    body : body axis that carries it -> its sign; JSBSim counts AXIAL aft.
    wind : axis of lift, drag and side force -> sign, and function of the angle.
    angle : property of the angle between body and wind [rad].
    turns : axis of a moment, coordinate whose distance from the CG causes it, sign, and part of the name of its function.
    missing : what the model lacks where neither carries it.
    """

    total: str
    direction: str
    body: Mapping[str, float]
    wind: Mapping[str, tuple[float, str]]
    angle: str
    turns: tuple[tuple[str, str, float, str], ...]
    missing: str


_FORCES: Final[Mapping[str, _Force]] = {
    "CL": _Force(
        "force",
        "-z",
        {"Z": -1.0, "NORMAL": 1.0},
        {"LIFT": (1.0, "cos"), "DRAG": (1.0, "sin")},
        _ALPHA,
        (("PITCH", "x", -1.0, "moment"),),
        "LIFT, Z or NORMAL that could carry lift",
    ),
    "CX": _Force(
        "axial",
        "x",
        {"X": 1.0, "AXIAL": -1.0},
        {"LIFT": (1.0, "sin"), "DRAG": (-1.0, "cos")},
        _ALPHA,
        (("PITCH", "z", -1.0, "moment"),),
        "DRAG, X or AXIAL that could carry an axial force",
    ),
    "CY": _Force(
        "side",
        "y",
        {"Y": 1.0, "SIDE": 1.0},
        {"SIDE": (1.0, "cos"), "DRAG": (-1.0, "sin")},
        _BETA,
        (("YAW", "x", -1.0, "yaw"), ("ROLL", "z", 1.0, "roll")),
        "SIDE or Y that could carry a side force",
    ),
}
"""Coefficient of a force -> how it reaches the axes."""
CARRIED: Final = (*_TURNING, *_FORCES)
"""Coefficients that reach an axis."""


def to_axes(aerodynamics: Element, by_coefficient: Mapping[str, list[str]], root: str, where: str) -> None:
    """Add the increments of coefficients to the axes.

    Parameters
    ----------
    aerodynamics : the model's element, changed.
    by_coefficient : coefficient of `CARRIED` -> properties of its increments.
    root : part of the names of properties.
    where : subject of error messages.

    Raises
    ------
    AircraftError
        If no axis of the model can carry a force.
    """
    pressure = "aero/qbar-psf", "metrics/Sw-sqft"
    for coefficient, (to, length, name) in _TURNING.items():
        if by_coefficient[coefficient]:
            formula = op("product", *pressure, length, _sum(by_coefficient[coefficient]))
            words = f"Increments of {coefficient} about the CG [lbf ft]"
            axis(aerodynamics, to).append(function(f"{root}{name}-lbsft", words, formula))
    for coefficient, force in _FORCES.items():
        if not by_coefficient[coefficient]:
            continue
        total = f"{root}{force.total}-lbs"
        words = f"Sum of the increments of {coefficient}: force along {force.direction} of the body [lbf]"
        formula = op("product", *pressure, _sum(by_coefficient[coefficient]))
        first = next((i for i, e in enumerate(aerodynamics) if e.tag == "axis"), len(aerodynamics))
        aerodynamics.insert(first, function(total, words, formula))
        for name, share in _shares(aerodynamics, force, total, where).items():
            words = f"Increments of {coefficient} [lbf]"
            axis(aerodynamics, name).append(function(f"{root}{force.total}-{name}-lbs", words, share))
        # JSBSim applies forces at its reference point; this takes them back to the CG
        for to, across, sign, name in force.turns:
            shift = op("product", sign, _arm(aerodynamics, across), total)
            words = f"Increments of {coefficient} taken to the CG [lbf ft]"
            axis(aerodynamics, to).append(function(f"{root}{force.total}-{name}-lbsft", words, shift))


def _sum(properties: Sequence[str]) -> Element:
    return op("sum", *properties) if len(properties) > 1 else prop(properties[0])


def _arm(aerodynamics: Element, across: str) -> Element:
    """Distance along a structural axis from JSBSim's reference point of the forces to the CG [ft]."""
    ends = f"inertia/cg-{across}-in", f"metrics/aero-rp-{across}-in"
    arm = op("quotient", op("difference", *ends), 12.0)
    shift = aerodynamics.find("aero_ref_pt_shift_x/function")
    if across != "x" or shift is None:
        return arm
    chords = deepcopy(next(e for e in shift if e.tag not in ("description", "documentation")))
    for element in chords.iter():
        element.attrib.pop("name", None)  # a property is bound once
    return op("difference", arm, op("product", chords, "metrics/cbarw-ft"))


def axis(aerodynamics: Element, name: str) -> Element:
    """The axis of a name, made where the model has none."""
    found = next((a for a in aerodynamics.findall("axis") if a.get("name", "").upper() == name), None)
    return SubElement(aerodynamics, "axis", {"name": name}) if found is None else found


def _shares(aerodynamics: Element, force: _Force, total: str, where: str) -> dict[str, Element]:
    """Axis of the model -> what it carries of a force whose property is ``total``."""
    names = {a.get("name", "").upper() for a in aerodynamics.findall("axis")}
    for name, sign in force.body.items():
        if _PARTNERS[name] & names or (name in names and name not in force.wind):
            return {name: op("product", sign, total)}
    if not names & set(force.wind):
        raise AircraftError(
            f"{where}: its <aerodynamics> have no axis {force.missing}, to which the effect adds; add the axis to the model"
        )
    found = {}
    for name, (sign, component_of) in force.wind.items():
        share = op(component_of, force.angle)
        found[name] = op("product", total, share if sign > 0.0 else op("product", sign, share))
    return found


__all__ = ["CARRIED", "axis", "to_axes"]
