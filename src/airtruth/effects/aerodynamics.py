"""Effects in the aerodynamics: nonlinear and unsteady lift and moments."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final, Literal

from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.terms import AeroTerm, Change, StateTerm

Values = Mapping[str, float]

_UNSTEADY: Final = "Etkin and Reid, Dynamics of Flight, 3rd ed., 1996, ch. 5"
"""Source of the terms in alpha_dot."""


def _asymmetry(values: Values) -> Change:
    return Change(aero=(AeroTerm("Cm", "elevator", "below", values["dCmde"]),))


def _cm_break(values: Values) -> Change:
    return Change(aero=(AeroTerm("Cm", "alpha", "above", values["dCmalpha"], values["at_alpha_rad"]),))


def _cm_quadratic(values: Values) -> Change:
    return Change(aero=(AeroTerm("Cm", "alpha", "quadratic", values["Cmalpha2"]),))


def _cl_break(values: Values) -> Change:
    return Change(aero=(AeroTerm("CL", "alpha", "above", values["dCLalpha"], values["at_alpha_rad"]),))


def _cl_quadratic(values: Values) -> Change:
    return Change(aero=(AeroTerm("CL", "alpha", "quadratic", values["CLalpha2"]),))


def _beta_break(coefficient: str, slope: str) -> Callable[[Values], Change]:
    """A change of slope beyond an angle of sideslip to either side."""

    def describe(values: Values) -> Change:
        amount, at = values[slope], values["at_beta_rad"]
        sides: tuple[tuple[Literal["above", "below"], float], ...] = (("above", at), ("below", -at))
        return Change(aero=tuple(AeroTerm(coefficient, "beta", shape, amount, x) for shape, x in sides))

    return describe


def _downwash(values: Values) -> Change:
    return Change(aero=(AeroTerm("Cm", "alpha_dot_hat", "linear", values["Cmalphadot"]),))


def _plunge_lift(values: Values) -> Change:
    return Change(aero=(AeroTerm("CL", "alpha_dot_hat", "linear", values["CLalphadot"]),))


def _lift_lag(values: Values) -> Change:
    state = StateTerm("lift-lag", "lag", "alpha", values["tau_s"])
    late = values["dCLalpha"]
    return Change(
        states=(state,),
        aero=(AeroTerm("CL", state.name, "linear", late), AeroTerm("CL", "alpha", "linear", -late)),
    )


def _elastic_mode(values: Values) -> Change:
    time_s = 1.0 / (2.0 * math.pi * values["frequency_hz"])
    state = StateTerm("elastic-mode", "mode", "alpha", time_s, values["damping"])
    share = values["dCmalpha"]
    return Change(
        states=(state,),
        aero=(AeroTerm("Cm", state.name, "linear", share), AeroTerm("Cm", "alpha", "linear", -share)),
    )


_AT_ALPHA: Final = Parameter(
    "at_alpha_rad",
    "rad",
    "angle of attack of the break",
    low=-0.1,
    high=0.3,
    material=0.0,
    is_location=True,
    step=5e-3,
)
"""Break of a slope: from below zero lift to the stall of a wing of moderate aspect ratio (judgement)."""


_AT_BETA: Final = Parameter(
    "at_beta_rad",
    "rad",
    "magnitude of the sideslip from which the slope changes",
    low=0.01,
    high=0.3,
    material=0.0,
    is_location=True,
    step=5e-3,
)
"""Break of a slope over the sideslip, the same to both sides (judgement: from what noise leaves to a stalled fin)."""


def _slope(
    name: str,
    meaning: str,
    reach: float,
    material: float,
    step: float,
    of: str,
    sign: Literal[-1, 0, 1] = 0,
) -> Parameter:
    """A change of a derivative; ``of`` is the declared one with which its material size scales."""
    return Parameter(
        name,
        "-",
        meaning,
        low=-reach,
        high=reach,
        material=material,
        step=step,
        sign=sign,
        scales_with=of,
    )


EFFECTS: Final = (
    Effect(
        name="elevator_asymmetry",
        where="dynamics",
        parameters=(
            _slope("dCmde", "change of Cmde at deflections below zero [1/rad]", 1.5, 0.05, 0.05, "Cmde"),
        ),
        describe=_asymmetry,
        explanation="The effectiveness of the elevator differs between trailing edge up and trailing edge down.",
        source="Cm += dCmde min(0, elevator). Material: 3 % of the GTM's Cmde of -1.8.",
        distinguished_by="Manoeuvres in both signs.",
    ),
    Effect(
        name="cm_alpha_nonlinear",
        variant="break",
        where="dynamics",
        parameters=(
            _slope("dCmalpha", "change of Cmalpha above the break [1/rad]", 4.0, 0.1, 0.1, "Cmalpha"),
            _AT_ALPHA,
        ),
        describe=_cm_break,
        explanation="Pitch stiffness changes at an angle of attack: the flow separates, or the tail leaves the wake of "
        "the wing.",
        source="Cm += dCmalpha max(0, alpha - at). Material: 6 % of the GTM's Cmalpha of -1.8.",
        distinguished_by="Larger amplitudes distinguish a break from a curve; records on both sides locate the break.",
    ),
    Effect(
        name="cm_alpha_nonlinear",
        variant="quadratic",
        where="dynamics",
        parameters=(_slope("Cmalpha2", "curvature of Cm over alpha [1/rad2]", 20.0, 0.5, 0.5, "Cmalpha"),),
        describe=_cm_quadratic,
        explanation="Pitch stiffness changes gradually with the angle of attack.",
        source="Cm += Cmalpha2 alpha^2; near a trim its linear part adds to Cmalpha. Material: Cmalpha changes by 0.1 "
        "over 0.1 rad.",
        distinguished_by="Two amplitudes, or two trims.",
    ),
    Effect(
        name="cl_alpha_nonlinear",
        variant="break",
        where="dynamics",
        parameters=(
            _slope("dCLalpha", "change of CLalpha above the break [1/rad]", 5.0, 0.25, 0.25, "CLalpha"),
            _AT_ALPHA,
        ),
        describe=_cl_break,
        explanation="The lift slope changes at an angle of attack: the flow separates.",
        source="CL += dCLalpha max(0, alpha - at), a force along -z of the body through the CG. Material: 5 % of a lift "
        "slope of 5.",
        distinguished_by="A normal accelerometer, and records on both sides of the break.",
    ),
    Effect(
        name="cl_alpha_nonlinear",
        variant="quadratic",
        where="dynamics",
        parameters=(_slope("CLalpha2", "curvature of CL over alpha [1/rad2]", 40.0, 1.25, 1.0, "CLalpha"),),
        describe=_cl_quadratic,
        explanation="The lift slope changes gradually with the angle of attack.",
        source="CL += CLalpha2 alpha^2, a force along -z of the body through the CG. Material: CLalpha changes by 0.25 "
        "over 0.1 rad.",
        distinguished_by="A normal accelerometer, and two amplitudes or two trims.",
    ),
    Effect(
        name="downwash_lag",
        where="dynamics",
        parameters=(
            _slope(
                "Cmalphadot",
                "moment per alpha_dot c/(2V), alpha_dot over ground [-]",
                40.0,
                2.5,
                1.0,
                "Cmq",
                -1,
            ),
        ),
        describe=_downwash,
        explanation="The downwash at the tail left the wing a time l/V earlier, so that Cm depends on alpha_dot.",
        source=f"Cm += Cmalphadot alpha_dot c/(2V); {_UNSTEADY} (Cm alpha_dot by downwash lag). Material: 6 % of the "
        "GTM's Cmq of -41.",
        distinguished_by="In a single manoeuvre it is nearly collinear with Cmq. Motions in which alpha_dot and q differ "
        "(pull-up, roller coaster, gusts, slow climb and push) separate the two.",
    ),
    Effect(
        name="lift_alpha_dot",
        where="dynamics",
        parameters=(
            _slope(
                "CLalphadot", "lift per alpha_dot c/(2V), alpha_dot over ground [-]", 20.0, 2.0, 0.5, "CLq", 1
            ),
        ),
        describe=_plunge_lift,
        explanation="Lift depends on alpha_dot: the downwash reaches the tail late, and the wing accelerates air.",
        source=f"CL += CLalphadot alpha_dot c/(2V), a force along -z of the body through the CG; {_UNSTEADY}.",
        distinguished_by="A normal accelerometer at a surveyed position, and high frequencies.",
    ),
    Effect(
        name="lift_lag",
        where="dynamics",
        parameters=(
            _slope("dCLalpha", "lagging part of the lift slope [1/rad]", 3.0, 0.25, 0.1, "CLalpha", 1),
            Parameter(
                "tau_s",
                "s",
                "time constant",
                low=0.02,
                high=1.0,
                material=0.0,
                is_location=True,
                step=0.01,
            ),
        ),
        describe=_lift_lag,
        explanation="Part of the lift follows the angle of attack with a first-order lag (wake, separation).",
        source="CL += dCLalpha (x - alpha), tau x' = alpha - x: the one-term indicial response; Klein and Morelli, "
        "Aircraft System Identification, 2006, ch. 4 (unsteady aerodynamics).",
        distinguished_by="A normal accelerometer, and a wide band of frequencies.",
    ),
    Effect(
        name="elastic_mode",
        where="dynamics",
        parameters=(
            _slope(
                "dCmalpha", "part of Cmalpha that acts through the mode [1/rad]", 2.0, 0.1, 0.05, "Cmalpha"
            ),
            Parameter(
                "frequency_hz",
                "hz",
                "natural frequency",
                low=0.5,
                high=15.0,
                material=0.0,
                is_location=True,
                step=0.05,
            ),
            Parameter(
                "damping",
                "-",
                "damping ratio",
                low=0.01,
                high=0.2,
                material=0.0,
                is_location=True,
                step=0.01,
            ),
        ),
        describe=_elastic_mode,
        explanation="Part of the pitching moment acts through a lightly damped mode: bending of the fuselage, or a "
        "liquid that sloshes.",
        source="Cm += dCmalpha (x - alpha), x'' + 2 zeta wn x' + wn^2 x = wn^2 alpha: a mode driven by the load, its "
        "quasi-steady part in Cmalpha. A damping ratio of at most 0.2 (judgement): a mode with more is a lag, which is not "
        "a structure or a liquid.",
        distinguished_by="A sweep or multisine through its frequency.",
    ),
    Effect(
        name="cn_beta_nonlinear",
        variant="break",
        where="dynamics",
        parameters=(
            _slope(
                "dCnbeta",
                "change of Cnbeta beyond the break, to both sides [1/rad]",
                1.0,
                0.01,
                0.01,
                "Cnbeta",
            ),
            _AT_BETA,
        ),
        describe=_beta_break("Cn", "dCnbeta"),
        explanation="Weathercock stability changes at a sideslip: the fin stalls, or leaves the wake of the fuselage.",
        source="Cn += dCnbeta (max(0, beta - at) + min(0, beta + at)). Material: 5 % of the GTM's Cnbeta of 0.22.",
        distinguished_by="Two amplitudes; records beyond the break locate it.",
    ),
    Effect(
        name="cl_beta_nonlinear",
        variant="break",
        where="dynamics",
        parameters=(
            _slope(
                "dClbeta",
                "change of Clbeta beyond the break, to both sides [1/rad]",
                1.0,
                0.01,
                0.01,
                "Clbeta",
            ),
            _AT_BETA,
        ),
        describe=_beta_break("Cl", "dClbeta"),
        explanation="The rolling moment due to sideslip changes its slope: the flow over the windward wing separates.",
        source="Cl += dClbeta (max(0, beta - at) + min(0, beta + at)). Material: 7 % of the GTM's Clbeta of -0.14.",
        distinguished_by="Two amplitudes; records beyond the break locate it.",
    ),
)
"""Effects of this module."""
