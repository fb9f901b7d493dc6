"""Effects in the aerodynamics: nonlinear and unsteady lift and pitching moment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from airtruth.effects.change import AeroTerm, Change, StateTerm
from airtruth.effects.effect import Effect, Parameter

Values = Mapping[str, float]

_UNSTEADY: Final = "Etkin and Reid, Dynamics of Flight, 3rd ed., 1996, ch. 5"


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
    place=True,
    step=5e-3,
)


def _slope(name: str, meaning: str, reach: float, material: float, step: float) -> Parameter:
    return Parameter(
        name,
        "-",
        meaning,
        low=-reach,
        high=reach,
        material=material,
        prior_std=reach / 2.0,
        step=step,
    )


EFFECTS: Final = (
    Effect(
        name="elevator_asymmetry",
        where="dynamics",
        parameters=(_slope("dCmde", "change of Cmde below zero deflection [1/rad]", 1.5, 0.05, 0.05),),
        describe=_asymmetry,
        explanation="The elevator is more or less effective trailing edge up than down.",
        source="Cm += dCmde min(0, elevator). Material: 3 % of the GTM's Cmde of -1.8.",
        splits="Manoeuvres in both signs.",
    ),
    Effect(
        name="cm_alpha_nonlinear",
        variant="break",
        where="dynamics",
        parameters=(
            _slope("dCmalpha", "change of Cmalpha above the break [1/rad]", 4.0, 0.1, 0.1),
            _AT_ALPHA,
        ),
        describe=_cm_break,
        explanation="Pitch stiffness changes at an angle of attack: separation, or a tail that leaves the wake.",
        source="Cm += dCmalpha max(0, alpha - at). Material: 6 % of the GTM's Cmalpha of -1.8.",
        splits="Larger amplitudes tell a break from a curve; records on both sides of the break place it.",
    ),
    Effect(
        name="cm_alpha_nonlinear",
        variant="quadratic",
        where="dynamics",
        parameters=(_slope("Cmalpha2", "curvature of Cm in alpha [1/rad2]", 20.0, 0.5, 0.5),),
        describe=_cm_quadratic,
        explanation="Pitch stiffness changes gradually with angle of attack.",
        source="Cm += Cmalpha2 alpha^2; about the trim its linear part is one of Cmalpha. Material: Cmalpha changes by "
        "0.1 over 0.1 rad.",
        splits="Two amplitudes, or two trims.",
    ),
    Effect(
        name="cl_alpha_nonlinear",
        variant="break",
        where="dynamics",
        parameters=(
            _slope("dCLalpha", "change of CLalpha above the break [1/rad]", 5.0, 0.25, 0.25),
            _AT_ALPHA,
        ),
        describe=_cl_break,
        explanation="The lift slope changes at an angle of attack: separation.",
        source="CL += dCLalpha max(0, alpha - at), force along -z of the body through the CG. Material: 5 % of a "
        "lift slope of 5.",
        splits="A normal accelerometer, and records on both sides of the break.",
    ),
    Effect(
        name="cl_alpha_nonlinear",
        variant="quadratic",
        where="dynamics",
        parameters=(_slope("CLalpha2", "curvature of CL in alpha [1/rad2]", 40.0, 1.25, 1.0),),
        describe=_cl_quadratic,
        explanation="The lift slope changes gradually with angle of attack.",
        source="CL += CLalpha2 alpha^2, force along -z of the body through the CG. Material: CLalpha changes by 0.25 "
        "over 0.1 rad.",
        splits="A normal accelerometer, two amplitudes or two trims.",
    ),
    Effect(
        name="downwash_lag",
        where="dynamics",
        parameters=(
            _slope("Cmalphadot", "moment per alpha_dot c/(2V), inertial alpha_dot [-]", 40.0, 2.5, 1.0),
        ),
        describe=_downwash,
        explanation="The tail meets the downwash that left the wing l/V earlier, so Cm has a term in alpha_dot.",
        source=f"Cm += Cmalphadot alpha_dot c/(2V); {_UNSTEADY} (Cm alpha_dot by downwash lag). Material: 6 % of the "
        "GTM's Cmq of -41.",
        splits="Nearly one with Cmq in a single manoeuvre; motions in which alpha_dot and q differ (pull-up, roller "
        "coaster, gusts, slow climb and push) tell them apart.",
    ),
    Effect(
        name="lift_alpha_dot",
        where="dynamics",
        parameters=(
            _slope("CLalphadot", "lift per alpha_dot c/(2V), inertial alpha_dot [-]", 20.0, 2.0, 0.5),
        ),
        describe=_plunge_lift,
        explanation="Lift has a term in alpha_dot: the tail's late downwash, and the air that the wing must accelerate.",
        source=f"CL += CLalphadot alpha_dot c/(2V), force along -z of the body through the CG; {_UNSTEADY}.",
        splits="A normal accelerometer at a known place, high frequencies.",
    ),
    Effect(
        name="lift_lag",
        where="dynamics",
        parameters=(
            _slope("dCLalpha", "share of the lift slope that comes late [1/rad]", 3.0, 0.25, 0.1),
            Parameter("tau_s", "s", "time constant", low=0.02, high=1.0, material=0.0, place=True, step=0.01),
        ),
        describe=_lift_lag,
        explanation="A share of the lift follows the angle of attack with a first-order lag (separation, wake).",
        source="CL += dCLalpha (x - alpha), tau x' = alpha - x: the one-term indicial response; Klein and Morelli, "
        "Aircraft System Identification, 2006, ch. 4 (unsteady aerodynamics).",
        splits="A normal accelerometer and a wide band of frequencies.",
    ),
    Effect(
        name="elastic_mode",
        where="dynamics",
        parameters=(
            _slope("dCmalpha", "share of Cmalpha that passes through the mode [1/rad]", 2.0, 0.1, 0.05),
            Parameter(
                "frequency_hz",
                "hz",
                "natural frequency",
                low=0.5,
                high=15.0,
                material=0.0,
                place=True,
                step=0.05,
            ),
            Parameter(
                "damping", "-", "damping ratio", low=0.01, high=0.5, material=0.0, place=True, step=0.01
            ),
        ),
        describe=_elastic_mode,
        explanation="A share of the pitching moment passes through a lightly damped mode: bending of the fuselage, or "
        "a liquid that sloshes.",
        source="Cm += dCmalpha (x - alpha), x'' + 2 zeta wn x' + wn^2 x = wn^2 alpha: a mode driven by the load, "
        "quasi-steady part in Cmalpha.",
        splits="A sweep or multisine through its frequency.",
    ),
)
"""Effects of this family."""
