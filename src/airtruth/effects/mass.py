"""Errors in declared mass properties, effectiveness of controls and thrust.

The priors are judgement: usual errors of declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from airtruth.effects.effect import Effect, Parameter, Prior, factor
from airtruth.physics.terms import Change, DeclaredTerm

Values = Mapping[str, float]

LOADING: Final = "loading"
"""Event that moves mass, inertia and CG together: an undeclared load, or a lost part."""


def _change(quantity: str, parameter: str) -> Callable[[Values], Change]:
    def describe(values: Values) -> Change:
        return Change(declared=(DeclaredTerm(quantity, values[parameter]),))

    return describe


_KNOWN_BY: Final = {
    "elevator": ("Cmde", "CLde"),
    "aileron": ("Clda", "Cnda"),
    "rudder": ("Cndr", "CYdr"),
}
"""Control -> derivatives whose declared accuracy limits what is known of its effectiveness."""


def _effectiveness(control: str) -> Effect:
    first, second = _KNOWN_BY[control]
    return Effect(
        name=f"{control}_effectiveness",
        where="declared",
        parameters=(factor(f"on the forces and moments of the {control}", -0.2, 2.0, 0.05),),
        describe=_change(control, "factor"),
        explanation=f"The {control} is more or less effective than declared: a part or all of it is lost, a gap, "
        "an error of gearing.",
        source=f"Forces and moments of the {control} times factor; written as deflection times factor, exact where they "
        f"are linear in it. The range has room for the estimate of a lost surface on both sides of zero. Material: 5 %, the "
        f"usual uncertainty of a wind-tunnel {first}.",
        distinguished_by=f"It is known only as accurately as {first} and {second} are declared.",
        prior=Prior(0.3, -1.2, 1.0),
    )


def _inertia(axis: str, motion: str, moment: str) -> Effect:
    return Effect(
        name="inertia_error",
        variant=f"i{axis}",
        where="declared",
        parameters=(factor(f"on the {motion} inertia", 0.6, 1.6, 0.05),),
        describe=_change(f"inertia_{axis}", "factor"),
        explanation=f"The {motion} inertia differs from the declared one.",
        source="Euler's equations. Material: 5 %, the accuracy of a swing test.",
        distinguished_by=f"It scales the derivatives of {moment} together, and is known only as accurately as they are "
        "declared.",
        prior=Prior(0.15, -0.4, 0.6),
        event=LOADING,
    )


EFFECTS: Final = (
    *(_effectiveness(control) for control in _KNOWN_BY),
    Effect(
        name="mass_error",
        where="declared",
        parameters=(factor("on the mass", 0.7, 1.4, 0.02),),
        describe=_change("mass", "factor"),
        explanation="The aircraft is heavier or lighter than declared, with the declared CG and pitch inertia.",
        source="Newton's second law. Material: 2 %, the accuracy of a weighing with the fuel estimated.",
        distinguished_by="Weigh the aircraft. A scale error of the airspeed has a similar effect on az.",
        prior=Prior(0.1, -0.3, 0.4),
        event=LOADING,
    ),
    Effect(
        name="inertia_error",
        where="declared",
        parameters=(factor("on the pitch inertia", 0.6, 1.6, 0.05),),
        describe=_change("inertia", "factor"),
        explanation="The pitch inertia differs from the declared one.",
        source="Euler's equation. Material: 5 %, the accuracy of a swing test.",
        distinguished_by="It scales Cmalpha, Cmq and Cmde together, and is known only as accurately as they are declared.",
        prior=Prior(0.15, -0.4, 0.6),
        event=LOADING,
    ),
    Effect(
        name="cg_shift",
        where="declared",
        parameters=(
            Parameter(
                "dx_mac",
                "-",
                "CG behind its declared position, in chords",
                low=-0.15,
                high=0.15,
                material=0.01,
                step=1e-3,
            ),
        ),
        describe=_change("cg", "dx_mac"),
        explanation="The centre of gravity is behind or ahead of its declared position. The records determine how far "
        "it has moved relative to the sensors.",
        source="Moment transfer: dCm = CL dx + ...; Etkin and Reid, Dynamics of Flight, 3rd ed., 1996, ch. 2. "
        "Material: 1 % of the chord.",
        distinguished_by="Two loadings; with one, Cmalpha and Cmq absorb it.",
        prior=Prior(0.05, -0.15, 0.15, log_odds=-4.0),
        event=LOADING,
    ),
    Effect(
        name="thrust_moment",
        where="declared",
        parameters=(
            Parameter(
                "arm_m",
                "m",
                "distance by which the thrust line is lower than declared; nose-up positive",
                low=-1.0,
                high=1.0,
                material=0.02,
                step=5e-3,
                spans=0.5,
            ),
        ),
        describe=_change("thrust_arm", "arm_m"),
        explanation="The thrust line is lower (nose-up) or higher than declared.",
        source="M += arm T. Material: 2 cm on a model of the GTM's size.",
        distinguished_by="Change the thrust during the record: the trim absorbs the moment of a constant thrust.",
    ),
    _inertia("xx", "roll", "Cl"),
    _inertia("zz", "yaw", "Cn"),
    Effect(
        name="inertia_error",
        variant="ixz",
        where="declared",
        parameters=(
            Parameter(
                "shift",
                "-",
                "increment of the product of inertia Ixz over the square root of Ixx Izz",
                low=-0.3,
                high=0.3,
                material=0.02,
                step=1e-3,
            ),
        ),
        describe=_change("inertia_xz", "shift"),
        explanation="The product of inertia differs from the declared one: the principal axes are inclined to the body axes "
        "by another angle.",
        source="Euler's equations; Ixz is the integral of x z dm. Material: 0.02, one degree of inclination of the GTM's "
        "axes.",
        distinguished_by="It couples roll and yaw both ways; adverse yaw and Clr couple one way.",
        prior=Prior(0.05, -0.3, 0.3, log_odds=-6.0),
        event=LOADING,
    ),
    Effect(
        name="cg_shift_y",
        where="declared",
        parameters=(
            Parameter(
                "dy_m",
                "m",
                "CG to the right of its declared position",
                low=-1.0,
                high=1.0,
                material=0.01,
                step=1e-3,
                spans=0.1,
            ),
        ),
        describe=_change("cg_y", "dy_m"),
        explanation="The centre of gravity is beside the plane of symmetry: a lost part, or fuel on one side.",
        source="Moment transfer: L += dy q_bar S CL, N grows with the axial force; Etkin and Reid, Dynamics of Flight, 3rd "
        "ed., 1996, ch. 2. Material: 1 cm, half a percent of the GTM's span.",
        distinguished_by="The rolling moment at rest grows with the load factor; that of a rigging error does not.",
        event=LOADING,
    ),
    Effect(
        name="thrust_asymmetry",
        where="declared",
        parameters=(
            Parameter(
                "moment_n_m",
                "n_m",
                "constant yawing moment, nose right",
                low=-5e4,
                high=5e4,
                material=0.5,
                step=0.05,
            ),
        ),
        describe=_change("yaw_moment", "moment_n_m"),
        explanation="The thrust of one side differs from that of the other.",
        source="N += moment. Material: 0.5 N m, which the rudder of the GTM holds with 0.2 deg.",
        distinguished_by="Change the thrust or the airspeed during the record: a rudder out of rig grows with the dynamic "
        "pressure.",
    ),
)
"""Effects of this module."""
