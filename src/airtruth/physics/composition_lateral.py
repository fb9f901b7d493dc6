"""Contributions of the fin and of parts of the wing to the lateral derivatives, from the declared derivatives and the geometry.

The directions are first order, as those of `airtruth.physics.composition`. Body axes, about the CG, rates over p b/(2V) and
r b/(2V).

Sources: B. Etkin and L. D. Reid, Dynamics of Flight, 3rd ed., 1996, sections 5.5 to 5.8 (fin); strip theory, the same,
section 5.7 (wing).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]

_FIN_SHARE: Final = 0.9
"""Share of the fin in Cnr [-]: without it a tenth of the GTM's yaw damping is left (NASA GTM_DesignSim, loss of the fin)."""
_SMALLEST: Final = 1e-6
"""Least CYdr that gives the arm of the fin [-] (judgement: below rounding of any declared value)."""
_REFERENCE_LOSS: Final = 0.2
"""Loss at which the changes of a lost tip are exact, in semispans [-] (judgement: losses of 10 to 25 % are survived)."""


@dataclass(frozen=True)
class Strips:
    """A part of one half of the wing that may be lost.

    Attributes
    ----------
    first, last : inboard and outboard end in semispans [-].
    chord : its share of the local chord, from the trailing edge [-].
    size : size of the cause that loses all of it [-]; other sizes are in proportion.
    """

    first: float
    last: float
    chord: float = 1.0
    size: float = 1.0


@dataclass(frozen=True)
class SideGeometry:
    """Declared fin and wing; None where a value has to be inferred. The other defaults are judgement.

    Attributes
    ----------
    span_m : of the wing [m]; 0 where it is not declared.
    aspect_ratio : of the wing [-]: transports and light aircraft have 7 to 10.
    taper : chord at the tip over that at the root [-].
    aileron : inboard and outboard end of the ailerons in semispans [-].
    flap : the same of the trailing-edge flaps: from the body of a transport to its ailerons.
    flap_depth : chord of the flaps over that of the wing [-]: transports have 0.2 to 0.3.
    wing_mass : mass of the wing over that of the aircraft [-]: transports have 0.10 to 0.13.
    fin_arm, fin_height : distance of the fin's aerodynamic centre behind and above the CG over the span [-].
    fin_lift : lift slope of the fin by the wing area and the free dynamic pressure [1/rad].
    rudder_on_fin : whether the rudder is a part of the fin.
    inertia_kg_m2 : Ixx, Izz, Ixz [kg m2]; mass_kg : mass of the aircraft [kg], 0 where it is not declared.
    """

    span_m: float = 0.0
    aspect_ratio: float = 8.0
    taper: float = 0.4
    aileron: tuple[float, float] = (0.6, 0.95)
    flap: tuple[float, float] = (0.1, 0.6)
    flap_depth: float = 0.25
    wing_mass: float = 0.12
    fin_arm: float | None = None
    fin_height: float | None = None
    fin_lift: float | None = None
    rudder_on_fin: bool = True
    inertia_kg_m2: tuple[float, float, float] | None = None
    mass_kg: float = 0.0

    @property
    def tip(self) -> Strips:
        """A wing tip, by the part of its semispan that is lost."""
        return Strips(1.0 - _REFERENCE_LOSS, 1.0, size=_REFERENCE_LOSS)

    @property
    def own_flap(self) -> Strips:
        """The flap of one side, by the part of it that is lost."""
        return Strips(*self.flap, chord=self.flap_depth)


def fin_part(derivatives: Array, geometry: SideGeometry) -> Array:
    """Contribution of the fin, and of a rudder on it, to the lateral derivatives.

    The fin meets the flow at beta - 2 l rhat + 2 h phat, and carries CY = -a times that angle at l behind and h above the CG.

    Parameters
    ----------
    derivatives : (15,) of the aircraft, in the order of `airtruth.physics.motion.LATERAL` [-].
    geometry : what is declared. An undeclared arm is -Cndr/CYdr, an undeclared height Cldr/CYdr, and an undeclared lift slope
        follows from Cnr: that of the fin is -2 a l^2.

    Returns
    -------
    (15,) CYbeta = -a, CYp = -2 a h, CYr = 2 a l; Cl = h CY and Cn = -l CY of each; l and h over the span.
    """
    by = _named(derivatives)
    force = np.copysign(max(abs(by["CYdr"]), _SMALLEST), by["CYdr"])
    arm = -by["Cndr"] / force if geometry.fin_arm is None else geometry.fin_arm
    height = by["Cldr"] / force if geometry.fin_height is None else geometry.fin_height
    lift = geometry.fin_lift
    if lift is None:
        lift = -_FIN_SHARE * by["Cnr"] / (2.0 * arm**2) if arm else 0.0
    angles = {"beta": 1.0, "phat": 2.0 * height, "rhat": -2.0 * arm}
    levers = {"CY": 1.0, "Cl": height, "Cn": -arm}
    part = np.zeros_like(derivatives)
    for signal, angle in angles.items():
        for coefficient, lever in levers.items():
            part[LATERAL.at(coefficient, signal)] = -lift * angle * lever
    if geometry.rudder_on_fin:
        column = LATERAL.column("rudder")
        part[column] = derivatives[column]
    return part


def lost_part(derivatives: Array, geometry: SideGeometry, lost: Strips) -> Array:
    """Change of the lateral derivatives per unit of a cause that loses strips of one half of the wing.

    Strip theory with a lift slope that is constant along the span: the strips have the share of their chord times y in the
    dihedral effect and of their chord times y^2 in the roll damping. The part of an aileron behind them is lost with them, by its
    share of chord times y.

    Parameters
    ----------
    derivatives, geometry : as in `fin_part`.
    """
    of_wing = derivatives - fin_part(derivatives, geometry)
    part = np.zeros_like(derivatives)
    for signal, power in (("beta", 1), ("phat", 2)):
        at = LATERAL.at("Cl", signal)
        share = _strips(geometry, lost.first, lost.last, power) / _strips(geometry, 0.0, 1.0, power)
        part[at] = -0.5 * lost.chord * share * of_wing[at]
    first, last = geometry.aileron
    inboard, outboard = (min(max(y, first), last) for y in (lost.first, lost.last))
    column = LATERAL.column("aileron")
    of_aileron = _strips(geometry, inboard, outboard, 1) / _strips(geometry, first, last, 1)
    part[column] = -0.5 * of_aileron * derivatives[column]
    return np.asarray(part / lost.size)


def lost_at_rest(geometry: SideGeometry, lost: Strips, side: float = 1.0) -> Mapping[str, float]:
    """Declared quantities that lost strips of a wing change beside the derivatives, per unit of their cause.

    Parameters
    ----------
    side : 1 for the right half of the wing, -1 for the left one.

    Returns
    -------
    "cg_y" : CG to the right [m]; "load_y" : centre of the lift to the left [m]; "inertia_xx", "inertia_zz" : relative changes,
    where mass and inertias are declared [-]. Lift and mass of a strip are in proportion to its chord.
    """
    arm, square = (
        0.5 * lost.chord * _strips(geometry, lost.first, lost.last, power) / _strips(geometry, 0.0, 1.0, 0)
        for power in (1, 2)
    )
    half = 0.5 * geometry.span_m
    turned = geometry.wing_mass * geometry.mass_kg * half**2 * square
    xx, zz, _ = geometry.inertia_kg_m2 or (np.inf, np.inf, 0.0)
    found = {
        "cg_y": -side * half * arm * geometry.wing_mass,
        "load_y": side * half * arm,
        "inertia_xx": -turned / xx,
        "inertia_zz": -turned / zz,
    }
    return {name: amount / lost.size for name, amount in found.items()}


def inertia_parts(derivatives: Array, geometry: SideGeometry) -> dict[str, Array]:
    """Change of the apparent derivatives per unit of each inertia's error: -dJ J^-1 times the moments.

    Parameters
    ----------
    derivatives, geometry : as in `fin_part`; without inertias Ixz counts as zero.

    Returns
    -------
    Declared quantity -> (15,). A factor on Ixx or Izz; Ixz in units of the square root of Ixx Izz.
    """
    xx, zz, xz = geometry.inertia_kg_m2 or (1.0, 1.0, 0.0)
    inverse = np.linalg.inv(np.array([[xx, -xz], [-xz, zz]]))
    rows = LATERAL.row("Cl"), LATERAL.row("Cn")
    moments = np.array([derivatives[row] for row in rows])
    cross = -float(np.sqrt(xx * zz))
    errors = {
        "inertia_xx": np.array([[xx, 0.0], [0.0, 0.0]]),
        "inertia_zz": np.array([[0.0, 0.0], [0.0, zz]]),
        "inertia_xz": np.array([[0.0, cross], [cross, 0.0]]),
    }
    found = {}
    for name, error in errors.items():
        found[name] = np.zeros_like(derivatives)
        for row, change in zip(rows, -error @ inverse @ moments, strict=True):
            found[name][row] = change
    return found


def cg_part(derivatives: Array, geometry: SideGeometry) -> Array:
    """Change of the lateral derivatives per chord that the CG is farther aft, to first order, in the same motion.

    The side force acts ahead of the new CG: dCn = d CY, and there beta is higher by 2 d rhat; d over the span.

    Parameters
    ----------
    derivatives, geometry : as in `fin_part`.
    """
    part = np.zeros_like(derivatives)
    beta, rate = LATERAL.column("beta"), LATERAL.column("rhat")
    part[rate] = 2.0 * derivatives[beta]
    part[LATERAL.row("Cn")] += derivatives[LATERAL.row("CY")]
    return np.asarray(part / geometry.aspect_ratio)


def _named(derivatives: Array) -> dict[str, float]:
    return dict(zip(LATERAL.parameters, derivatives.tolist(), strict=True))


def _strips(geometry: SideGeometry, first: float, last: float, power: int) -> float:
    """Integral of the chord over that at the root times y^power between two places of a wing, y in semispans."""
    slope = geometry.taper - 1.0
    ends = [y ** (power + 1) / (power + 1) + slope * y ** (power + 2) / (power + 2) for y in (first, last)]
    return ends[1] - ends[0]


__all__ = ["SideGeometry", "Strips", "cg_part", "fin_part", "inertia_parts", "lost_at_rest", "lost_part"]
