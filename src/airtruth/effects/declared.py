"""Effects that are another value of something declared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from airtruth.effects.change import Change, DeclaredTerm
from airtruth.effects.effect import Effect, Parameter

Values = Mapping[str, float]


def _elevator(values: Values) -> Change:
    return Change(declared=(DeclaredTerm("elevator", values["factor"]),))


def _mass(values: Values) -> Change:
    return Change(declared=(DeclaredTerm("mass", values["factor"]),))


def _inertia(values: Values) -> Change:
    return Change(declared=(DeclaredTerm("inertia", values["factor"]),))


def _cg(values: Values) -> Change:
    return Change(declared=(DeclaredTerm("cg", values["dx_mac"]),))


def _thrust(values: Values) -> Change:
    return Change(declared=(DeclaredTerm("thrust_arm", values["arm_m"]),))


def _factor(meaning: str, low: float, high: float, material: float, prior_std: float) -> Parameter:
    return Parameter(
        "factor",
        "-",
        meaning,
        low=low,
        high=high,
        material=material,
        neutral=1.0,
        prior_std=prior_std,
        step=1e-3,
    )


EFFECTS: Final = (
    Effect(
        name="elevator_effectiveness",
        where="declared",
        parameters=(_factor("on the forces and moments of the surface", 0.3, 2.0, 0.05, 0.2),),
        describe=_elevator,
        explanation="The elevator gives more or less than declared: damage, a gap, a gearing error.",
        source="Forces and moments of the elevator times factor; written as deflection times factor, exact where they "
        "are linear in it. Material: 5 %, the usual uncertainty of a wind-tunnel Cmde.",
        splits="Only as well as the declared Cmde and CLde are known.",
    ),
    Effect(
        name="mass_error",
        where="declared",
        parameters=(_factor("on the mass", 0.7, 1.4, 0.02, 0.05),),
        describe=_mass,
        explanation="The aircraft is heavier or lighter than declared, CG and pitch inertia as declared.",
        source="Newton's second law. Material: 2 %, what weighing gives with the fuel estimated.",
        splits="Weighing; an airspeed scale looks alike in az.",
    ),
    Effect(
        name="inertia_error",
        where="declared",
        parameters=(_factor("on the pitch inertia", 0.6, 1.6, 0.05, 0.1),),
        describe=_inertia,
        explanation="The pitch inertia is not the declared one.",
        source="Euler's equation. Material: 5 %, what a swing test gives.",
        splits="Scales Cmalpha, Cmq and Cmde together; only as well as these are known.",
    ),
    Effect(
        name="cg_shift",
        where="declared",
        parameters=(
            Parameter(
                "dx_mac",
                "-",
                "CG behind its declared place, in chords",
                low=-0.15,
                high=0.15,
                material=0.01,
                prior_std=0.03,
                step=1e-3,
            ),
        ),
        describe=_cg,
        explanation="The centre of gravity lies behind or ahead of where it is declared. The sensors keep their "
        "declared distance from it.",
        source="Moment transfer: dCm = CL dx + ...; Etkin and Reid, Dynamics of Flight, 3rd ed., 1996, ch. 2. "
        "Material: 1 % of the chord.",
        splits="Two loadings; else absorbed by Cmalpha and Cmq.",
    ),
    Effect(
        name="thrust_moment",
        where="declared",
        parameters=(
            Parameter(
                "arm_m",
                "m",
                "thrust passes so much lower below the CG than declared; nose-up positive",
                low=-1.0,
                high=1.0,
                material=0.02,
                prior_std=0.2,
                step=5e-3,
            ),
        ),
        describe=_thrust,
        explanation="The thrust line lies lower (nose-up) or higher than declared.",
        source="M += arm T. Material: 2 cm on a model of the GTM's size.",
        splits="Changes of thrust during the record; at constant thrust it is trimmed out.",
    ),
)
"""Effects of this family."""
