"""Changes of mass, inertias, CG and thrust line of a JSBSim model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from airtruth.aircraft.probe import Constants
from airtruth.errors import AircraftError
from airtruth.physics.terms import DeclaredTerm, declared_total
from airtruth.units import FT, INCH, LB, SLUG

_TO_SI: Final = {
    "LBS": LB,
    "KG": 1.0,
    "SLUG": SLUG,
    "IN": INCH,
    "FT": FT,
    "M": 1.0,
    "SLUG*FT2": SLUG * FT**2,
    "KG*M2": 1.0,
}
"""SI value of JSBSim's units."""
_DEFAULTS: Final = {"length": "IN", "mass": "LBS", "inertia": "SLUG*FT2"}
"""JSBSim's unit of an element without one."""


@dataclass(frozen=True)
class _Item:
    """A mass [kg] at a location, x aft, y right and z up [m]."""

    mass_kg: float
    x_m: float
    y_m: float
    z_m: float


def write(root: Element, terms: Sequence[DeclaredTerm], loaded: Constants, where: str) -> None:
    """Write mass, inertias, CG and thrust line into a model; the factors of controls are those of their surfaces.

    Parameters
    ----------
    root : <fdm_config>, changed.
    terms : see `airtruth.physics.terms`.
    loaded : constants of the model before the change.
    where : subject of error messages.

    Raises
    ------
    AircraftError
        If the model lacks the element that has to change.
    """
    balance = root.find("mass_balance")
    shift, mass = declared_total(terms, "cg"), declared_total(terms, "mass")
    inertia, arm = declared_total(terms, "inertia"), declared_total(terms, "thrust_arm")
    aside, cross = declared_total(terms, "cg_y"), declared_total(terms, "inertia_xz")
    roll, yaw = declared_total(terms, "inertia_xx"), declared_total(terms, "inertia_zz")
    if balance is None:
        if shift or aside or cross or {mass, inertia, roll, yaw} != {1.0}:
            raise AircraftError(
                f"{where}: the model has no <mass_balance>, so mass, inertia and CG cannot be changed; "
                "add one, or choose another effect"
            )
    else:
        about = 0.0
        if shift:
            before = _items(root, balance)
            _move(balance, "x", shift * loaded.chord_m * loaded.mass_kg / before[0].mass_kg, where)
            about = _about_centre(_items(root, balance)) - _about_centre(before)
        if inertia != 1.0 or about:
            _add(balance, "iyy", (inertia - 1.0) * loaded.inertia_yy_kg_m2 - about, "inertia", where)
        sideways = 0.0
        if aside:
            before = _items(root, balance)
            _move(balance, "y", aside * loaded.mass_kg / before[0].mass_kg, where)
            sideways = _beside_centre(_items(root, balance)) - _beside_centre(before)
        for tag, factor, declared in (
            ("ixx", roll, loaded.inertia_xx_kg_m2),
            ("izz", yaw, loaded.inertia_zz_kg_m2),
        ):
            if factor != 1.0 or sideways:
                _add(balance, tag, (factor - 1.0) * declared - sideways, "inertia", where)
        if cross:
            unit = math.sqrt(loaded.inertia_xx_kg_m2 * loaded.inertia_zz_kg_m2)
            _add(balance, "ixz", _product_sign(balance) * cross * unit, "inertia", where)
        if mass != 1.0:
            _add_mass(root, balance, (mass - 1.0) * loaded.mass_kg, where)
    if arm:
        for location in _thrust_locations(root, where):
            _add(location, "z", -arm, "length", where, location.get("unit"))


def _number(element: Element | None, kind: str, unit: str | None = None) -> float:
    if element is None or element.text is None:
        return 0.0
    return float(element.text) * _TO_SI[(unit or element.get("unit") or _DEFAULTS[kind]).upper()]


def _add(parent: Element, tag: str, more: float, kind: str, where: str, unit: str | None = None) -> None:
    """Add to a number, ``more`` in SI, in the element's own unit."""
    element = parent.find(tag)
    if element is None:
        raise AircraftError(
            f"{where}: <{parent.tag}> has no <{tag}>, which the effect has to change; add it to the model"
        )
    factor = _TO_SI[(unit or element.get("unit") or _DEFAULTS[kind]).upper()]
    text = element.text or ""
    number = float(text or 0.0) + more / factor
    element.text = text.replace(text.strip(), repr(number)) if text.strip() else repr(number)


def _location(parent: Element) -> Element:
    location = parent.find("location")
    return Element("location") if location is None else location


def _item(mass_kg: float, location: Element) -> _Item:
    unit = location.get("unit")
    return _Item(mass_kg, *(_number(location.find(axis), "length", unit) for axis in ("x", "y", "z")))


def _items(root: Element, balance: Element) -> list[_Item]:
    """The empty aircraft first, then point masses and tanks."""
    items = [_item(_number(balance.find("emptywt"), "mass"), _location(balance))]
    items += [_item(_number(p.find("weight"), "mass"), _location(p)) for p in balance.findall("pointmass")]
    return items + [
        _item(_number(t.find("contents"), "mass"), _location(t)) for t in root.findall("propulsion/tank")
    ]


def _centre(items: Sequence[_Item]) -> tuple[float, float]:
    mass = sum(i.mass_kg for i in items)
    return sum(i.mass_kg * i.x_m for i in items) / mass, sum(i.mass_kg * i.z_m for i in items) / mass


def _about_centre(items: Sequence[_Item]) -> float:
    """Pitch inertia of the items as points about their centre [kg m2]."""
    x, z = _centre(items)
    return sum(i.mass_kg * ((i.x_m - x) ** 2 + (i.z_m - z) ** 2) for i in items)


def _beside_centre(items: Sequence[_Item]) -> float:
    """Roll or yaw inertia of the items as points, as far as it follows from their distances to the side [kg m2]."""
    mass = sum(i.mass_kg for i in items)
    y = sum(i.mass_kg * i.y_m for i in items) / mass
    return sum(i.mass_kg * (i.y_m - y) ** 2 for i in items)


def _product_sign(balance: Element) -> float:
    """Sign of JSBSim's <ixz> against the integral of x z dm, x forward and z down."""
    return -1.0 if balance.get("negated_crossproduct_inertia", "true") == "true" else 1.0


def _move(balance: Element, along: str, by_m: float, where: str) -> None:
    """Move the empty aircraft along a structural axis, and with it the CG."""
    location = _location(balance)
    _add(location, along, by_m, "length", where, location.get("unit"))


def _add_mass(root: Element, balance: Element, more_kg: float, where: str) -> None:
    """A point mass at the CG, which moves neither the CG nor the inertia."""
    x, z = _centre(_items(root, balance))
    point = SubElement(balance, "pointmass", {"name": "undeclared mass"})
    SubElement(point, "weight", {"unit": "LBS"}).text = repr(more_kg / LB)  # JSBSim's kg is short of digits
    location = SubElement(point, "location", {"unit": "M"})
    for axis, value in (("x", x), ("y", 0.0), ("z", z)):
        SubElement(location, axis).text = repr(value)


def _thrust_locations(root: Element, where: str) -> list[Element]:
    """Locations of the thrusters, or else of the external forces named thrust."""
    locations = root.findall("propulsion/engine/thruster/location")
    if not locations:
        forces = root.findall("external_reactions/force")
        locations = [
            p for f in forces if f.get("name", "").startswith("thrust") for p in f.findall("location")
        ]
    if not locations:
        raise AircraftError(
            f"{where}: the model has no engine with a <thruster> and <location>, and no external force whose name starts "
            "with 'thrust'; thrust_moment has nothing to move"
        )
    return locations
