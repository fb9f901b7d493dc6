"""Tables of aircraft.toml for the parts of an aircraft: tail, fin and wing."""

from __future__ import annotations

from pydantic import model_validator

from airtruth import quantity as qt
from airtruth.physics.composition_lateral import SideGeometry
from airtruth.quantity import Quantity, Strict


class Tail(Strict):
    """Horizontal tail; an entry that is not stated is inferred from the derivatives.

    arm: distance from the CG aft to the tail's aerodynamic centre; area: exposed to the stream; lift_slope: of the
    isolated tail per its area [1/rad]; efficiency: dynamic pressure at the tail over that of the free stream.
    """

    arm: qt.Length | None = None
    area: qt.Area | None = None
    lift_slope: qt.Ratio | None = None
    efficiency: qt.Ratio = Quantity(value=1.0)

    @model_validator(mode="after")
    def _complete(self) -> Tail:
        qt.require_positive(self, type(self).model_fields)
        if (self.area is None) != (self.lift_slope is None):
            raise ValueError("area and lift_slope give the lift of the tail together; state both or neither")
        return self


class Fin(Strict):
    """Vertical fin; an entry that is not stated is inferred from the lateral derivatives.

    arm, height: distance of the fin's aerodynamic centre behind and above the CG; area, lift_slope, efficiency: as of the
    tail; rudder: whether the rudder is a part of it.
    """

    arm: qt.Length | None = None
    height: qt.Length | None = None
    area: qt.Area | None = None
    lift_slope: qt.Ratio | None = None
    efficiency: qt.Ratio = Quantity(value=1.0)
    rudder: bool = True

    @model_validator(mode="after")
    def _complete(self) -> Fin:
        qt.require_positive(self, ("arm", "area", "lift_slope", "efficiency"))
        if (self.area is None) != (self.lift_slope is None):
            raise ValueError(
                "area and lift_slope give the side force of the fin together; state both or neither"
            )
        return self


class Wing(Strict):
    """Plan form of the wing, for the loss of a wing tip or of a flap.

    taper: chord at the tip over that at the root; aileron_inboard, aileron_outboard, flap_inboard, flap_outboard: ends of the
    ailerons and of the flaps in semispans; flap_depth: chord of the flaps over that of the wing; mass_share: mass of the wing
    over that of the aircraft.
    """

    taper: qt.Ratio = Quantity(value=SideGeometry.taper)
    aileron_inboard: qt.Ratio = Quantity(value=SideGeometry.aileron[0])
    aileron_outboard: qt.Ratio = Quantity(value=SideGeometry.aileron[1])
    flap_inboard: qt.Ratio = Quantity(value=SideGeometry.flap[0])
    flap_outboard: qt.Ratio = Quantity(value=SideGeometry.flap[1])
    flap_depth: qt.Ratio = Quantity(value=SideGeometry.flap_depth)
    mass_share: qt.Ratio = Quantity(value=SideGeometry.wing_mass)

    @model_validator(mode="after")
    def _possible(self) -> Wing:
        names = [name for name in type(self).model_fields if not name.endswith("_inboard")]
        qt.require_positive(self, names)
        for end in (name for name in names if name.endswith("_outboard")):
            start = end.replace("_outboard", "_inboard")
            first, last = getattr(self, start).value, getattr(self, end).value
            if not 0.0 <= first < last <= 1.0:
                raise ValueError(
                    f"{start} = {first:g} and {end} = {last:g}: ends in semispans, from 0 at the root to 1 at the tip, the "
                    "inboard one first"
                )
        return self


__all__ = ["Fin", "Tail", "Wing"]
