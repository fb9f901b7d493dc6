"""The six short-period derivatives of a conventional aircraft from its geometry, by handbook formulas.

With A = b^2/S, tail volume V = S_t l_t/(S c), and the dynamic pressure at the tail over that of the free stream eta:

    a = 2 pi A/(2 + sqrt(4 + A^2))                                      (1) Helmbold's equation at low speed
    d eps/d alpha = 2 a_w/(pi A)                                        (2) downwash far behind the wing
    CLalpha = a_w + a_t eta S_t/S (1 - d eps/d alpha)                   (3)
    Cmalpha = a_w (h - 1/4) - a_t eta V (1 - d eps/d alpha)             (4)
    CLq = 2 a_t eta V (1 + d eps/d alpha)                               (5)
    Cmq = -2 a_t eta V l_t/c (1.1 + d eps/d alpha)                      (6)
    CLde = a_t tau eta S_t/S,  Cmde = -a_t tau eta V                    (7)
    tau = 1 - (theta - sin theta)/pi,  cos theta = 2 c_e/c_t - 1        (8) thin aerofoil with a flap

The terms in d eps/d alpha of (5) and (6) are those of alpha_dot (the lag of the downwash), which a short period does not
separate from q; the wing adds a tenth to the damping of the tail.

Sources: H. B. Helmbold, Jahrbuch 1942 der deutschen Luftfahrtforschung, p. I 111 (1); R. C. Nelson, Flight Stability and
Automatic Control, 2nd ed., 1998, chapters 2 and 3 (2 to 7); H. Glauert, ARC R&M 1095, 1927 (8).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Final

from airtruth.errors import ConfigurationError
from airtruth.physics.expected import EXPECTED
from airtruth.physics.motion import LONGITUDINAL

EQUATIONS: Final[Mapping[str, str]] = {
    name: f"eq. ({number})" for name, number in zip(LONGITUDINAL.parameters, (3, 5, 7, 4, 6, 7), strict=True)
}
"""Derivative -> its equation in `airtruth.physics.handbook`."""
RELATIVE_SCATTER: Final[Mapping[str, float]] = {
    name: scatter
    for name, scatter in zip(LONGITUDINAL.parameters, (0.13, 1.1, 0.34, None, 0.8, 0.44), strict=True)
    if scatter is not None
}
"""Standard deviation of a proposed derivative over its value [-]: the relative error that 68 % of eight JSBSim models do not
exceed (measured, `python -m studies.geometry_scatter`)."""
MARGIN_SCATTER: Final = 0.05
"""Standard deviation of a proposed static margin -Cmalpha/CLalpha [chords] (measured, as `RELATIVE_SCATTER`): the bodies
that the formulas leave out move the neutral point, whatever the margin."""


@dataclass(frozen=True)
class Planform:
    """Wing and horizontal tail of a conventional aircraft.

    Attributes
    ----------
    span_m, wing_area_m2, chord_m : of the wing [m, m2, m].
    tail_span_m, tail_area_m2 : of the horizontal tail, elevator included [m, m2].
    tail_arm_m : distance from the CG to the quarter chord of the tail [m].
    elevator_share : chord of the elevator behind its hinge over that of the tail [-]; 1 for an all-moving tail.
    cg : CG behind the leading edge of the mean aerodynamic chord [chords].
    efficiency : dynamic pressure at the tail over that of the free stream [-].
    """

    span_m: float
    wing_area_m2: float
    chord_m: float
    tail_span_m: float
    tail_area_m2: float
    tail_arm_m: float
    elevator_share: float = 0.35
    cg: float = 0.25
    efficiency: float = 0.9

    def __post_init__(self) -> None:
        """Refuse values without meaning.

        Raises
        ------
        ConfigurationError
            If a length or area is not above 0, or the elevator is larger than its tail.
        """
        for name in (f.name for f in fields(self) if f.default is MISSING):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ConfigurationError(f"geometry: {name} has to be above 0 (is {value:g})")
        if not 0.0 < self.elevator_share <= 1.0:
            raise ConfigurationError(
                f"geometry: elevator_share has to be above 0 and at most 1 (is {self.elevator_share:g}): chord of the elevator "
                "over that of the tail, 1 for an all-moving tail"
            )
        if not (math.isfinite(self.cg) and math.isfinite(self.efficiency)):
            raise ConfigurationError("geometry: cg and efficiency have to be finite numbers")


def lift_slope(aspect_ratio: float) -> float:
    """Slope of the lift of an unswept wing [1/rad], eq. (1).

    Examples
    --------
    >>> round(lift_slope(6.0), 3)
    4.529
    """
    return 2.0 * math.pi * aspect_ratio / (2.0 + math.sqrt(4.0 + aspect_ratio**2))


def flap_effectiveness(share: float) -> float:
    """Change of the angle of attack without lift per angle of a flap [-], eq. (8).

    Parameters
    ----------
    share : chord of the flap over that of the aerofoil [-].

    Examples
    --------
    >>> [round(flap_effectiveness(share), 4) for share in (0.25, 0.5, 1.0)]
    [0.609, 0.8183, 1.0]
    """
    theta = math.acos(2.0 * share - 1.0)
    return 1.0 - (theta - math.sin(theta)) / math.pi


def derivatives(planform: Planform) -> dict[str, float]:
    """The six derivatives by eqs. (1) to (8), by the names of ``LONGITUDINAL.parameters`` [1/rad].

    Examples
    --------
    >>> light = Planform(10.9, 16.2, 1.49, 3.4, 2.0, 4.6, 0.4)
    >>> {name: round(value, 2) for name, value in derivatives(light).items()}
    {'CLalpha': 5.09, 'CLq': 4.35, 'CLde': 0.37, 'Cmalpha': -0.9, 'Cmq': -14.37, 'Cmde': -1.15}
    """
    p = planform
    aspect = p.span_m**2 / p.wing_area_m2
    wing, tail = lift_slope(aspect), lift_slope(p.tail_span_m**2 / p.tail_area_m2)
    downwash = 2.0 * wing / (math.pi * aspect)
    arm = p.tail_arm_m / p.chord_m
    area = p.efficiency * tail * p.tail_area_m2 / p.wing_area_m2  # a_t eta S_t/S
    tau = flap_effectiveness(p.elevator_share)
    lift = (wing + area * (1.0 - downwash), 2.0 * area * arm * (1.0 + downwash), area * tau)
    stiffness = wing * (p.cg - 0.25) - area * arm * (1.0 - downwash)
    moment = (stiffness, -2.0 * area * arm**2 * (1.1 + downwash), -area * arm * tau)
    return dict(zip(LONGITUDINAL.parameters, (*lift, *moment), strict=True))


def standard_deviations(planform: Planform) -> dict[str, float]:
    """Standard deviation of each of `derivatives` [1/rad].

    Examples
    --------
    >>> light = Planform(10.9, 16.2, 1.49, 3.4, 2.0, 4.6, 0.4)
    >>> std = standard_deviations(light)
    >>> round(std["Cmalpha"] / derivatives(light)["CLalpha"], 3) == MARGIN_SCATTER
    True
    """
    values = derivatives(planform)
    stds = {name: RELATIVE_SCATTER.get(name, 0.0) * abs(value) for name, value in values.items()}
    return stds | {EXPECTED[LONGITUDINAL.name].stiffness: MARGIN_SCATTER * values[LONGITUDINAL.parameters[0]]}


__all__ = [
    "EQUATIONS",
    "MARGIN_SCATTER",
    "RELATIVE_SCATTER",
    "Planform",
    "derivatives",
    "flap_effectiveness",
    "lift_slope",
    "standard_deviations",
]
