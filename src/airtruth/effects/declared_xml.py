"""Other values of what a JSBSim model declares: mass, pitch inertia, CG, thrust line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from airtruth.effects.change import DeclaredTerm
from airtruth.errors import AircraftError
from airtruth.quantity import Strict
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
_DEFAULTS: Final = {"length": "IN", "mass": "LBS", "inertia": "SLUG*FT2"}


class Masses(Strict):
    """Mass [kg], pitch inertia [kg m2] and chord [m] of the aircraft as loaded."""

    mass_kg: float
    inertia_kg_m2: float
    chord_m: float


@dataclass(frozen=True)
class _Item:
    """A mass [kg] at a place, x aft and z up [m]."""

    mass_kg: float
    x_m: float
    z_m: float


def total(terms: Sequence[DeclaredTerm], quantity: str) -> float:
    """All terms of a quantity together: the product of factors, or the sum of shifts."""
    values = [t.value for t in terms if t.quantity == quantity]
    if quantity in ("cg", "thrust_arm"):
        return sum(values)
    product = 1.0
    for v in values:
        product *= v
    return product


def write(root: Element, terms: Sequence[DeclaredTerm], loaded: Masses, where: str) -> None:
    """Write mass, inertia, CG and thrust line into a model; the elevator's factor is the surface's.

    Parameters
    ----------
    root : <fdm_config>, changed.
    terms : see `airtruth.effects.change`.
    loaded : what the model has as it is.
    where : named in errors.

    Raises
    ------
    AircraftError
        If the model lacks the element that has to change.
    """
    balance = root.find("mass_balance")
    shift, mass = total(terms, "cg"), total(terms, "mass")
    inertia, arm = total(terms, "inertia"), total(terms, "thrust_arm")
    if balance is None:
        if shift or mass != 1.0 or inertia != 1.0:
            raise AircraftError(
                f"{where}: the model has no <mass_balance>, so mass, inertia and CG cannot be changed"
            )
    else:
        about = 0.0
        if shift:
            about = _move(root, balance, shift * loaded.chord_m, loaded.mass_kg, where)
        if inertia != 1.0 or about:
            _add(balance, "iyy", (inertia - 1.0) * loaded.inertia_kg_m2 - about, "inertia", where)
        if mass != 1.0:
            _add_mass(root, balance, (mass - 1.0) * loaded.mass_kg, where)
    if arm:
        for place in _thrust_places(root, where):
            _add(place, "z", -arm, "length", where, place.get("unit"))


def _number(element: Element | None, kind: str, unit: str | None = None) -> float:
    if element is None or element.text is None:
        return 0.0
    return float(element.text) * _TO_SI[(unit or element.get("unit") or _DEFAULTS[kind]).upper()]


def _add(parent: Element, tag: str, more: float, kind: str, where: str, unit: str | None = None) -> None:
    """Add to a number, ``more`` in SI, in the element's own unit."""
    element = parent.find(tag)
    if element is None:
        raise AircraftError(f"{where}: <{parent.tag}> has no <{tag}>, which the effect has to change")
    factor = _TO_SI[(unit or element.get("unit") or _DEFAULTS[kind]).upper()]
    element.text = f" {float(element.text or 0.0) + more / factor!r} "


def _place(parent: Element) -> Element:
    found = parent.find("location")
    return Element("location") if found is None else found


def _item(mass_kg: float, place: Element) -> _Item:
    unit = place.get("unit")
    return _Item(mass_kg, *(_number(place.find(axis), "length", unit) for axis in ("x", "z")))


def _items(root: Element, balance: Element) -> list[_Item]:
    """The empty aircraft first, then point masses and tanks."""
    found = [_item(_number(balance.find("emptywt"), "mass"), _place(balance))]
    found += [_item(_number(p.find("weight"), "mass"), _place(p)) for p in balance.findall("pointmass")]
    return found + [
        _item(_number(t.find("contents"), "mass"), _place(t)) for t in root.findall("propulsion/tank")
    ]


def _centre(items: Sequence[_Item]) -> tuple[float, float]:
    mass = sum(i.mass_kg for i in items)
    return sum(i.mass_kg * i.x_m for i in items) / mass, sum(i.mass_kg * i.z_m for i in items) / mass


def _about_centre(items: Sequence[_Item]) -> float:
    """Pitch inertia of the items as points about their centre [kg m2]."""
    x, z = _centre(items)
    return sum(i.mass_kg * ((i.x_m - x) ** 2 + (i.z_m - z) ** 2) for i in items)


def _move(root: Element, balance: Element, aft_m: float, mass_kg: float, where: str) -> float:
    """Move the CG of all by moving that of the empty aircraft; what its place adds to the inertia [kg m2]."""
    before = _items(root, balance)
    place = _place(balance)
    _add(place, "x", aft_m * mass_kg / before[0].mass_kg, "length", where, place.get("unit"))
    return _about_centre(_items(root, balance)) - _about_centre(before)


def _add_mass(root: Element, balance: Element, more_kg: float, where: str) -> None:
    """A point mass at the CG, which moves neither the CG nor the inertia."""
    x, z = _centre(_items(root, balance))
    point = SubElement(balance, "pointmass", {"name": "undeclared mass"})
    SubElement(point, "weight", {"unit": "LBS"}).text = repr(more_kg / LB)  # JSBSim's kg is short of digits
    place = SubElement(point, "location", {"unit": "M"})
    for axis, value in (("x", x), ("y", 0.0), ("z", z)):
        SubElement(place, axis).text = repr(value)


def _thrust_places(root: Element, where: str) -> list[Element]:
    """Where thrust acts: thrusters, or else external forces that are named thrust."""
    places = root.findall("propulsion/engine/thruster/location")
    if not places:
        forces = root.findall("external_reactions/force")
        places = [p for f in forces if f.get("name", "").startswith("thrust") for p in f.findall("location")]
    if not places:
        raise AircraftError(
            f"{where}: the model has no engine with a <thruster> and <location>, and no external force whose name starts "
            "with 'thrust'; thrust_moment has nothing to move"
        )
    return places
