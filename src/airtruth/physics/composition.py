"""Contributions of parts and flow to the derivatives, from the declared derivatives and the geometry.

A cause that acts on a whole part of the aircraft moves several derivatives in one direction. The directions are first
order: a fraction s of the cause adds s times its direction to the derivatives.

Sources: B. Etkin and L. D. Reid, Dynamics of Flight, 3rd ed., 1996, ch. 2 and 5 (tail, downwash, transfer of moments);
M. B. Bragg et al., Effect of Ice Accretion on Aircraft Flight Dynamics, AIAA 2000-0360, table 1 (icing).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.composition_lateral import (
    SideGeometry,
    Strips,
    cg_part,
    fin_part,
    inertia_parts,
    lost_at_rest,
    lost_part,
)
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion
from airtruth.physics.short_period import CL_ALPHA, CL_DE, CL_Q, CM_ALPHA, CM_DE, CM_Q

Array = NDArray[np.float64]

_TAIL_SHARE: Final = 1.0 / 1.1
"""Share of the tail in Cmq [-]: the wing adds 10 % (Etkin and Reid, section 5.4)."""
_ASPECT_RATIO: Final = 8.0
"""Aspect ratio where no span is declared [-] (judgement: transports and light aircraft have 7 to 10)."""
_SMALLEST: Final = 1e-6
"""Least CLde that gives a tail arm [-] (judgement: below rounding of any declared value)."""
ICED: Final = (-0.100, -0.0135, -0.095, -0.099, -0.035, -0.100)
"""Relative change of the six derivatives by the reference ice of a Twin Otter [-] (Bragg et al., table 1)."""


@dataclass(frozen=True)
class TailGeometry:
    """Declared wing, tail and fin; None where a value has to be inferred.

    Attributes
    ----------
    aspect_ratio : of the wing [-].
    arm : distance from the CG to the tail's aerodynamic centre over the chord [-].
    lift : lift slope of the tail by the wing area and the free dynamic pressure, a_t S_t/S efficiency [1/rad].
    side : what the lateral motion needs.
    """

    aspect_ratio: float | None = None
    arm: float | None = None
    lift: float | None = None
    side: SideGeometry = field(default_factory=SideGeometry)


def tail_part(derivatives: Array, geometry: TailGeometry) -> Array:
    """Contribution of the horizontal tail to the six derivatives.

    Parameters
    ----------
    derivatives : (6,) of the aircraft [-].
    geometry : what is declared of the tail. An undeclared arm is -Cmde/CLde, an undeclared lift slope follows from Cmq.

    Returns
    -------
    (6,) CLalpha = a (1 - e), CLq = 2 a l, CLde, and the moments -l CL of each; a the lift slope, l the arm, and
    e = 2 CLalpha_w/(pi A) the slope of the downwash.
    """
    a, arm, downwash = _tail(derivatives, geometry)
    part = np.zeros(6)
    part[[CL_ALPHA, CL_Q, CL_DE]] = a * (1.0 - downwash), 2.0 * a * arm, derivatives[CL_DE]
    part[[CM_ALPHA, CM_Q, CM_DE]] = -arm * part[CL_ALPHA], -arm * part[CL_Q], derivatives[CM_DE]
    return part


def wing_part(derivatives: Array, geometry: TailGeometry) -> Array:
    """Change of the six derivatives per relative change of the wing's lift, the downwash at the tail included.

    Parameters
    ----------
    derivatives, geometry : as in `tail_part`.
    """
    a, arm, downwash = _tail(derivatives, geometry)
    tail = tail_part(derivatives, geometry)
    part = derivatives - tail
    part[[CL_DE, CM_DE]] = 0.0
    part[CL_ALPHA] -= a * downwash
    part[CM_ALPHA] += arm * a * downwash
    return part


def _tail(derivatives: Array, geometry: TailGeometry) -> tuple[float, float, float]:
    """Lift slope and arm of the tail, and slope of the downwash."""
    arm = geometry.arm
    if arm is None:
        arm = float(-derivatives[CM_DE] / max(abs(derivatives[CL_DE]), _SMALLEST))
    a = geometry.lift
    if a is None:
        a = float(-_TAIL_SHARE * derivatives[CM_Q] / (2.0 * arm**2)) if arm else 0.0
    slope = 2.0 / (np.pi * (geometry.aspect_ratio or _ASPECT_RATIO))
    # CLalpha_w = CLalpha - a (1 - e) with e = slope CLalpha_w
    wing = (derivatives[CL_ALPHA] - a) / (1.0 - a * slope)
    return a, arm, float(slope * wing)


def _centre(derivatives: Array, _geometry: TailGeometry) -> Array:
    part = np.zeros_like(derivatives)
    part[CM_ALPHA] = -derivatives[CL_ALPHA]
    return part


@dataclass(frozen=True)
class Part:
    """A part of the aircraft, or a property of the flow, that moves several derivatives.

    Attributes
    ----------
    neutral : value that changes nothing: 1 of a factor, 0 of a shift or of a severity.
    direction : derivatives of the motion and geometry -> change of the derivatives per unit, at the neutral value.
    motion : name of the motion whose derivatives they are.
    at_rest : geometry -> declared quantities that it changes per unit beside the derivatives [their units; relative changes of
        factors]; None for nothing.
    """

    neutral: float
    direction: Callable[[Array, TailGeometry], Array]
    motion: str = LONGITUDINAL.name
    at_rest: Callable[[TailGeometry], Mapping[str, float]] | None = None


def _fin(derivatives: Array, geometry: TailGeometry) -> Array:
    return fin_part(derivatives, geometry.side)


def _of_wing(strips: Callable[[SideGeometry], Strips], side: float) -> Part:
    """Lost strips of the right (1) or the left (-1) half of the wing."""
    return Part(
        0.0,
        lambda derivatives, geometry: lost_part(derivatives, geometry.side, strips(geometry.side)),
        LATERAL.name,
        lambda geometry: lost_at_rest(geometry.side, strips(geometry.side), side),
    )


PARTS: Final[Mapping[str, Part]] = MappingProxyType(
    {
        "tail": Part(1.0, tail_part),
        "wing": Part(1.0, wing_part),
        "dynamic_pressure": Part(1.0, lambda derivatives, _: derivatives.copy()),
        "aerodynamic_center": Part(0.0, _centre),
        "icing": Part(0.0, lambda derivatives, _: np.array(ICED) * derivatives),
        "fin": Part(1.0, _fin, LATERAL.name),
        "left_wing_tip": _of_wing(lambda side: side.tip, -1.0),
        "right_wing_tip": _of_wing(lambda side: side.tip, 1.0),
        "left_flap": _of_wing(lambda side: side.own_flap, -1.0),
        "right_flap": _of_wing(lambda side: side.own_flap, 1.0),
    }
)
"""Causes by name: tail, wing, dynamic pressure and fin are factors, the aerodynamic centre counts aft in chords, icing is a
severity, 1 for the reference ice, a wing tip is the part of its semispan that is lost, and a flap the part of it that is lost."""
CAUSES: Final[Mapping[str, float]] = MappingProxyType(
    {name: part.neutral for name, part in PARTS.items()}
    | dict.fromkeys((name for m in MOTIONS.values() for name in m.parameters), 0.0)
)
"""Causes of a change of the derivatives (`airtruth.physics.terms.DerivativeTerm`) -> neutral value; a derivative is its own
cause."""


def cause_motion(cause: str) -> Motion:
    """The motion whose derivatives a cause changes.

    Parameters
    ----------
    cause : one of `CAUSES`.
    """
    if cause in PARTS:
        return MOTIONS[PARTS[cause].motion]
    return next(motion for motion in MOTIONS.values() if cause in motion.parameters)


def directions(
    derivatives: Array, geometry: TailGeometry, motion: Motion = LONGITUDINAL
) -> Mapping[str, Array]:
    """Change of the apparent derivatives per unit of each declared quantity and each part, at its neutral value.

    Parameters
    ----------
    derivatives : of the motion, in its order [-]; geometry : as in `tail_part`.
    motion : whose derivatives, quantities, controls and parts count.

    Returns
    -------
    quantity, part or derivative -> change of the derivatives. A factor on the mass or an inertia divides its coefficients, the
    effectiveness of a control multiplies its derivatives, and "cg" counts aft in chords: lift pitches the nose up about a
    centre of gravity that lies farther aft, and a side force yaws it to the right.
    """
    found = {}
    for quantity in motion.declared:
        if quantity.divides:
            divided = np.zeros_like(derivatives)
            for row in map(motion.row, quantity.divides):
                divided[row] = derivatives[row]
            found[quantity.name] = -divided
    for control in motion.controls:
        found[control.name] = np.zeros_like(derivatives)
        column = motion.column(control.name)
        found[control.name][column] = derivatives[column]
    found |= _LOADING[motion.name](derivatives, geometry)
    parts = {name: part for name, part in PARTS.items() if part.motion == motion.name}
    found |= {name: part.direction(derivatives, geometry) for name, part in parts.items()}
    return MappingProxyType(found | dict(zip(motion.parameters, np.eye(len(derivatives)), strict=True)))


def _pitch_loading(derivatives: Array, _geometry: TailGeometry) -> dict[str, Array]:
    """A CG farther aft."""
    aft = np.zeros_like(derivatives)
    aft[LONGITUDINAL.row("Cm")] = derivatives[LONGITUDINAL.row("CL")]
    return {"cg": aft}


def _side_loading(derivatives: Array, geometry: TailGeometry) -> dict[str, Array]:
    """Inertias, which a product of inertia couples, and a CG farther aft."""
    side = geometry.side
    return {**inertia_parts(derivatives, side), "cg": cg_part(derivatives, side)}


_LOADING: Final[Mapping[str, Callable[[Array, TailGeometry], dict[str, Array]]]] = MappingProxyType(
    {LONGITUDINAL.name: _pitch_loading, LATERAL.name: _side_loading}
)
"""Motion -> directions of the loading that do not divide a coefficient alone."""


def cg_transfer(shift: float) -> Array:
    """Matrix (6, 6) that turns derivatives about one centre of gravity into those about another, in the same motion.

    The lift acts at the old centre of gravity, which is ahead of the new one by ``shift``: dCm = shift CL, and there
    alpha is lower by 2 shift q c/(2V) (Etkin and Reid, ch. 2 and 5). Exact for linear CL and Cm; T(a) T(b) = T(a + b).

    Parameters
    ----------
    shift : new centre of gravity behind the old one [chords].
    """
    matrix = np.eye(6)
    matrix[CL_Q, CL_ALPHA] = -2.0 * shift
    matrix[CM_ALPHA, CL_ALPHA] = shift
    matrix[CM_Q, CL_ALPHA] = -2.0 * shift**2
    matrix[CM_Q, CL_Q] = shift
    matrix[CM_Q, CM_ALPHA] = -2.0 * shift
    matrix[CM_DE, CL_DE] = shift
    return matrix


__all__ = [
    "CAUSES",
    "ICED",
    "PARTS",
    "Part",
    "SideGeometry",
    "TailGeometry",
    "cause_motion",
    "cg_transfer",
    "directions",
    "tail_part",
    "wing_part",
]
