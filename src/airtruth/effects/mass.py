"""Errors in declared mass properties, elevator effectiveness and thrust line.

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


EFFECTS: Final = (
    Effect(
        name="elevator_effectiveness",
        where="declared",
        parameters=(factor("on the forces and moments of the elevator", 0.3, 2.0, 0.05),),
        describe=_change("elevator", "factor"),
        explanation="The elevator is more or less effective than declared: damage, a gap, an error of gearing.",
        source="Forces and moments of the elevator times factor; written as deflection times factor, exact where they "
        "are linear in it. Material: 5 %, the usual uncertainty of a wind-tunnel Cmde.",
        distinguished_by="It is known only as accurately as Cmde and CLde are declared.",
        prior=Prior(0.3, -0.7, 1.0),
    ),
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
        prior=Prior(0.05, -0.15, 0.15, log_odds=-2.0),
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
)
"""Effects of this module."""
