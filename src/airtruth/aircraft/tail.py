"""The geometry of the horizontal tail that an aircraft.toml declares."""

from __future__ import annotations

from airtruth.aircraft.file import Aircraft
from airtruth.physics.composition import TailGeometry


def tail_geometry(aircraft: Aircraft) -> TailGeometry:
    """Return what is declared of the wing and the tail; None for an entry that has to be inferred.

    Parameters
    ----------
    aircraft : its span and wing area give the aspect ratio, its table [tail] the rest.
    """
    c, tail = aircraft.constants, aircraft.file.tail
    aspect_ratio = c.span_m**2 / c.wing_area_m2 if c.span_m > 0.0 else None
    if tail is None:
        return TailGeometry(aspect_ratio)
    lift = None
    if tail.area is not None and tail.lift_slope is not None:
        lift = tail.efficiency.value * tail.lift_slope.value * tail.area.value / c.wing_area_m2
    return TailGeometry(aspect_ratio, None if tail.arm is None else tail.arm.value / c.chord_m, lift)


__all__ = ["tail_geometry"]
