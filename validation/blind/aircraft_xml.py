"""The truth's JSBSim model: hand edits of the declared aircraft's XML."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from validation.blind.figures import (
    ALPHA_TRIM_RAD,
    BODY,
    CG_IN,
    CHORD_M,
    DECLARED,
    DERIVATIVES,
    INCH,
    REFERENCE_IN,
)

NAME: Final = "gtm"
ELEVATOR: Final = "truth/elevator-rad"
LIFT: Final = "truth/lift-increment"
MOMENT: Final = "truth/moment-increment"
ALIVE: Final = "truth/alive"
_ALPHA: Final = "aero/alpha-rad"
_PLANET: Final = """<?xml version="1.0"?>
<planet name="Flat and still">
  <semimajor_axis unit="M"> 6.378137e9 </semimajor_axis>
  <semiminor_axis unit="M"> 6.378137e9 </semiminor_axis>
  <rotation_rate> 0.0 </rotation_rate>
  <GM unit="M3/SEC2"> 3.989407157896148e20 </GM>
  <J2> 0.0 </J2>
</planet>
"""


@dataclass(frozen=True)
class Body:
    """Relative errors of the derivatives and of the body; what a truth draws.

    Attributes
    ----------
    derivatives : relative error of each of `DERIVATIVES`, about the declared CG.
    mass, inertia : factors [-].
    cg : true CG aft of the declared one [chords].
    """

    derivatives: Mapping[str, float] = field(default_factory=dict)
    mass: float = 1.0
    inertia: float = 1.0
    cg: float = 0.0


@dataclass(frozen=True)
class Shape:
    """coefficient += value f(signal), static; ``shape`` is one of `SHAPES`, signals in rad."""

    coefficient: str
    shape: str
    value: float
    at: float = 0.0


SHAPES: Final = (
    "alpha-above",
    "alpha-square",
    "alpha-elevator",
    "alphadot",
    "elevator-below",
    "elevator-odd-square",
    "alpha-linear",
    "rate-linear",
    "elevator-linear",
    "one",
)


def _product(*parts: str) -> str:
    return f"<product>{''.join(parts)}</product>"


def _value(x: float) -> str:
    return f"<value>{x!r}</value>"


def _property(name: str) -> str:
    return f"<property>{name}</property>"


def _difference(a: str, b: str) -> str:
    return f"<difference>{a}{b}</difference>"


def _function(shape: str, at: float) -> str:
    """The XML of f, without its amplitude."""
    alpha, elevator = _property(_ALPHA), _property(ELEVATOR)
    from_at = _difference(alpha, _value(at))
    if shape == "alpha-above":
        return f"<max>{_value(0.0)}{from_at}</max>"
    if shape == "alpha-square":
        return _product(from_at, from_at)
    if shape == "alpha-elevator":
        return _product(from_at, elevator)
    if shape == "alphadot":
        return _product(_property(ALIVE), _property("aero/alphadot-rad_sec"), _property("aero/ci2vel"))
    if shape == "elevator-below":
        return f"<min>{_value(0.0)}{elevator}</min>"
    if shape == "elevator-odd-square":
        return _product(elevator, f"<abs>{elevator}</abs>")
    if shape == "alpha-linear":
        return from_at
    if shape == "one":
        return _value(1.0)
    if shape == "rate-linear":
        return _property("aero/function/qhat")
    return elevator


def linear(increments: Mapping[str, float]) -> tuple[Shape, ...]:
    """Increments of derivatives, about the declared trim."""
    shapes = []
    for name, value in increments.items():
        signal = {"alpha": "alpha-linear", "q": "rate-linear", "de": "elevator-linear"}[name[2:]]
        at = ALPHA_TRIM_RAD if signal == "alpha-linear" else 0.0
        shapes.append(Shape(name[:2], signal, value, at))
    return tuple(shapes)


def _own(body: Body) -> tuple[Shape, ...]:
    """The drawn derivatives as increments."""
    return linear({name: error * DERIVATIVES[name][0] for name, error in body.derivatives.items()})


def _transfer() -> float:
    """Moment about the aerodynamic reference, over q_bar S c, of a unit of lift that acts at the declared CG."""
    return (REFERENCE_IN[0] - CG_IN[0]) * INCH / CHORD_M


def write(
    folder: Path,
    body: Body,
    shapes: Iterable[Shape] = (),
    elevator_factor: float = 1.0,
    thrust_arm_m: float = 0.0,
) -> None:
    """Write the truth's model folder: ``folder``/gtm/gtm.xml and the planet.

    Increments of CL act along -z of the body at the declared CG, those of Cm about it.
    """
    tree = ET.parse(DECLARED / f"{NAME}.xml")
    root = tree.getroot()
    for system in root.findall("system"):
        root.remove(system)
    control = root.find("flight_control")
    aero = root.find("aerodynamics")
    assert control is not None
    assert aero is not None
    channel = control.find("channel[@name='Elevator']")
    assert channel is not None
    control.remove(channel)
    for name in (ELEVATOR, LIFT, MOMENT, ALIVE):
        element = ET.Element("property", {"value": "0"})
        element.text = name
        aero.insert(0, element)
    for element in aero.iter("property"):
        if element.text == "fcs/elevator-pos-rad":
            element.text = ELEVATOR
    _masses(root, body)
    for location in root.findall("external_reactions/force/location/z"):
        location.text = repr(float(location.text or "") - thrust_arm_m / INCH)
    if elevator_factor != 1.0:
        for product in aero.findall("axis/function/product"):
            if product.find("table/independentVar[@lookup='column']") is not None and any(
                (v.text or "").strip() == "aero/function/elevator-deg" for v in product.iter("independentVar")
            ):
                product.append(ET.fromstring(_value(elevator_factor)))
    _increments(aero, [*_own(body), *shapes], _transfer())
    (folder / NAME).mkdir(parents=True)
    tree.write(folder / NAME / f"{NAME}.xml")
    (folder / "planet.xml").write_text(_PLANET)


def _masses(root: ET.Element, body: Body) -> None:
    for path, factor in (("emptywt", body.mass), ("iyy", body.inertia)):
        element = root.find(f"mass_balance/{path}")
        assert element is not None
        element.text = repr(float(element.text or "") * factor)
    x = root.find("mass_balance/location/x")
    assert x is not None
    x.text = repr(float(x.text or "") + body.cg * CHORD_M / INCH)


def _increments(aero: ET.Element, shapes: Iterable[Shape], transfer: float) -> None:
    terms: dict[str, list[str]] = {"CL": [_property(LIFT)], "Cm": [_property(MOMENT)]}
    for s in shapes:
        terms[s.coefficient].append(_product(_value(s.value), _function(s.shape, s.at)))
    lift, moment = ("<sum>" + "".join(terms[name]) + "<value>0.0</value></sum>" for name in ("CL", "Cm"))
    scale = _property("aero/qbar-psf") + _property("metrics/Sw-sqft")
    force = _product(scale, _value(-1.0), lift)
    moment = f"<sum>{moment}{_product(_value(transfer), lift)}</sum>"
    turning = _product(scale, _property("metrics/cbarw-ft"), moment)
    for axis, text in (("Z", force), ("PITCH", turning)):
        element = aero.find(f"axis[@name='{axis}']")
        assert element is not None
        name = f"truth/increment-{axis.lower()}"
        element.append(ET.fromstring(f'<function name="{name}">{text}</function>'))


def nuisances(body: Body) -> dict[str, tuple[Body, float]]:
    """One step from a body in each uncertain quantity: name -> (body, step over its standard deviation)."""
    part = 0.5
    result = {}
    for name, (_, std) in DERIVATIVES.items():
        moved = {**body.derivatives, name: body.derivatives.get(name, 0.0) + part * std}
        result[name] = (replace(body, derivatives=moved), part)
    result["mass"] = (replace(body, mass=body.mass + part * BODY["mass"]), part)
    result["inertia"] = (replace(body, inertia=body.inertia + part * BODY["inertia"]), part)
    result["cg"] = (replace(body, cg=body.cg + part * BODY["cg"]), part)
    return result
