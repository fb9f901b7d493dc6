"""The geometry of wing, tail and fin that an aircraft.toml declares."""

from __future__ import annotations

from dataclasses import replace

from airtruth.aircraft.file import Aircraft
from airtruth.aircraft.parts import Fin, Tail
from airtruth.physics.composition import SideGeometry, TailGeometry


def tail_geometry(aircraft: Aircraft) -> TailGeometry:
    """Return what is declared of wing, tail and fin; None for an entry that has to be inferred.

    Parameters
    ----------
    aircraft : its span and wing area give the aspect ratio, its tables [tail], [fin] and [wing] the rest.
    """
    c, tail = aircraft.constants, aircraft.file.tail
    aspect_ratio = c.span_m**2 / c.wing_area_m2 if c.span_m > 0.0 else None
    side = _side_geometry(aircraft, aspect_ratio)
    if tail is None:
        return TailGeometry(aspect_ratio, side=side)
    arm = None if tail.arm is None else tail.arm.value / c.chord_m
    return TailGeometry(aspect_ratio, arm, _lift(tail, c.wing_area_m2), side)


def _side_geometry(aircraft: Aircraft, aspect_ratio: float | None) -> SideGeometry:
    c, fin, wing = aircraft.constants, aircraft.file.fin, aircraft.file.wing
    result = SideGeometry(span_m=c.span_m, mass_kg=c.mass_kg)
    if aspect_ratio is not None:
        result = replace(result, aspect_ratio=aspect_ratio)
    if c.inertia_xx_kg_m2 > 0.0 and c.inertia_zz_kg_m2 > 0.0:
        inertias = (c.inertia_xx_kg_m2, c.inertia_zz_kg_m2, c.inertia_xz_kg_m2)
        result = replace(result, inertia_kg_m2=inertias)
    if wing is not None:
        result = replace(
            result,
            taper=wing.taper.value,
            aileron=(wing.aileron_inboard.value, wing.aileron_outboard.value),
            flap=(wing.flap_inboard.value, wing.flap_outboard.value),
            flap_depth=wing.flap_depth.value,
            wing_mass=wing.mass_share.value,
        )
    if fin is None:
        return result
    arm, height = (None if x is None else x.value / c.span_m for x in (fin.arm, fin.height))
    return replace(
        result,
        fin_arm=arm,
        fin_height=height,
        fin_lift=_lift(fin, c.wing_area_m2),
        rudder_on_fin=fin.rudder,
    )


def _lift(surface: Tail | Fin, wing_area_m2: float) -> float | None:
    """Lift slope of a tail surface by the wing area and the free dynamic pressure [1/rad]."""
    if surface.area is None or surface.lift_slope is None:
        return None
    return surface.efficiency.value * surface.lift_slope.value * surface.area.value / wing_area_m2


__all__ = ["tail_geometry"]
