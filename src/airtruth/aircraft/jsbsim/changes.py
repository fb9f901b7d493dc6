"""The functions of a change in a JSBSim model: surfaces, increments of coefficients, and moments of declared quantities."""

from __future__ import annotations

from typing import Final
from xml.etree.ElementTree import Element, SubElement

from airtruth.aircraft.jsbsim import aerodynamics as aerodynamics_xml
from airtruth.aircraft.jsbsim import surface as surface_xml
from airtruth.aircraft.jsbsim.axes import axis
from airtruth.aircraft.jsbsim.functions import function, op, value
from airtruth.aircraft.model import JsbsimModel, SurfaceProperties
from airtruth.aircraft.origin import Origin
from airtruth.errors import AircraftError
from airtruth.physics.motion import MOTIONS
from airtruth.physics.terms import Change, declared_total
from airtruth.units import FT, LBF

_CONTROLS: Final = tuple(c.name for m in MOTIONS.values() for c in m.controls)
"""Controls of every motion."""
_TURNING: Final = "yaw_moment"
"""Declared quantity of a constant yawing moment [N m]."""
_LOADED: Final = "load_y"
"""Declared quantity of a normal force that acts to the left [m]."""


def write(
    root: Element, model: JsbsimModel, change: Change, where: str, highest_hz: float, origin: Origin
) -> None:
    """Add the functions of a change to a model.

    Parameters
    ----------
    root : <fdm_config>, changed.
    model : its properties.
    change : without readings.
    where : subject of error messages.
    highest_hz : highest simulation rate for which a delay is valid [Hz].
    origin : standard deviations and source, for the descriptions.

    Raises
    ------
    AircraftError
        If the model lacks a control or an axis that the change needs.
    ConfigurationError
        If a term's signal is unknown, or two states have one name.
    """
    factors = {name: declared_total(change.declared, name) for name in _CONTROLS}
    moved = {n for n in _CONTROLS if change.of_surface(n) or factors[n] != 1.0}
    turning, loaded = (declared_total(change.declared, name) for name in (_TURNING, _LOADED))
    if not (moved or change.aero or turning or loaded):
        return
    aerodynamics = root.find("aerodynamics")
    if aerodynamics is None:
        raise AircraftError(f"{where}: the model has no <aerodynamics>")
    properties: dict[str, SurfaceProperties | None] = {name: getattr(model, name) for name in _CONTROLS}
    surfaces = {
        name: surface_xml.Surface(
            surface_xml.names(root, control.surface, name), control.surface_rad, name in moved
        )
        for name, control in properties.items()
        if control is not None
    }
    components = surface_xml.Components()
    for name in (n for n in _CONTROLS if n in moved):
        if name not in surfaces:
            raise AircraftError(
                f"{where}: aircraft.toml states no {name}, which the effect changes; state jsbsim.{name} with its properties"
            )
        terms = change.of_surface(name)
        components += surface_xml.chain(surfaces[name], terms, factors[name], highest_hz, origin)
        components += surface_xml.redirect(aerodynamics, surfaces[name].names, where)
    if change.aero:
        gusts = {"qhat": model.rotary_gust, "phat": model.roll_gust, "rhat": model.yaw_gust}
        components += aerodynamics_xml.write(
            aerodynamics, change.aero, change.states, surfaces, gusts, origin, where
        )
    label = surfaces[_CONTROLS[0]].names.label
    if loaded:
        words = f"Roll by a normal force {loaded!r} m to the left [lbf ft]{origin.of_declared(_LOADED)}"
        formula = op("product", -loaded / FT, "forces/fbz-aero-lbs")
        axis(aerodynamics, "ROLL").append(function(f"aero/{label}/load-roll-lbsft", words, formula))
    if turning:
        words = f"Constant yawing moment, nose right [lbf ft]: {turning!r} N m{origin.of_declared(_TURNING)}"
        added = function(f"aero/{label}/yaw-moment-lbsft", words, value(turning / (LBF * FT)))
        axis(aerodynamics, "YAW").append(added)
    if not components.parts:
        return
    control = root.find("flight_control")
    if control is None:
        control = SubElement(root, "flight_control", {"name": "Effects"})
    control.extend(surface_xml.channel(components))


__all__ = ["write"]
