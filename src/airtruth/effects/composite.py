"""Effects that move several derivatives together: tail, wing, flow, ice, and the derivatives themselves.

Each is a `DerivativeTerm`; `airtruth.physics.composition` gives the direction of the six derivatives per unit of it. The
priors are judgement: tail and wing that lose lift rather than gain it, and the accuracy of first-order contributions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from airtruth.effects.effect import Effect, Parameter, Prior, factor
from airtruth.physics.terms import Change, DerivativeTerm

Values = Mapping[str, float]

_TAIL: Final = "Etkin and Reid, Dynamics of Flight, 3rd ed., 1996, ch. 2 and 5"
"""Source of the contributions of wing and tail."""
_ICE: Final = "M. B. Bragg et al., Effect of Ice Accretion on Aircraft Flight Dynamics, AIAA 2000-0360"
"""Source of the icing model."""


def _caused(cause: str, parameter: str) -> Callable[[Values], Change]:
    def describe(values: Values) -> Change:
        return Change(derivatives=(DerivativeTerm(cause, values[parameter]),))

    return describe


def _shifted(values: Values) -> Change:
    terms = (DerivativeTerm(name.removeprefix("d"), x) for name, x in values.items() if x != 0.0)
    return Change(derivatives=tuple(terms))


def _shift(name: str, reach: float, material: float) -> Parameter:
    return Parameter(
        f"d{name}",
        "-",
        f"change of {name} [1/rad]",
        low=-reach,
        high=reach,
        material=material,
        step=material,
        default=0.0,
    )


EFFECTS: Final = (
    Effect(
        name="tail_effectiveness",
        where="declared",
        parameters=(factor("on the lift of the horizontal tail and its elevator", 0.0, 1.6, 0.05),),
        describe=_caused("tail", "factor"),
        explanation="The horizontal tail has more or less lift than declared: part of it is lost, iced, or in the wake "
        "of the wing.",
        source=f"Contribution of the tail to the six derivatives times factor; {_TAIL}. Arm and lift slope of the tail "
        "are those of [tail] in aircraft.toml, or inferred from Cmde/CLde and Cmq. Material: 5 %, a third of the usual "
        "uncertainty of Cmq.",
        distinguished_by="Elevator and pitch damping change by the same share; elevator_effectiveness leaves Cmq and "
        "Cmalpha as they are.",
        in_derivatives=True,
        prior=Prior(0.3, -1.0, 0.05, shape=0.25),
    ),
    Effect(
        name="wing_effectiveness",
        where="declared",
        parameters=(factor("on the lift of the wing and its downwash at the tail", 0.5, 1.3, 0.03),),
        describe=_caused("wing", "factor"),
        explanation="The wing has more or less lift than declared: a part of it is lost, iced, or contaminated.",
        source="Contribution of wing and body to the derivatives of alpha and q times factor, with the downwash that "
        f"follows it; {_TAIL}. Material: 3 %, below the usual uncertainty of CLalpha.",
        distinguished_by="The elevator keeps its effectiveness. A normal accelerometer separates it from cg_shift.",
        in_derivatives=True,
        prior=Prior(0.15, -0.6, 0.05, shape=0.3),
    ),
    Effect(
        name="dynamic_pressure",
        where="declared",
        parameters=(factor("on the dynamic pressure", 0.6, 1.6, 0.02),),
        describe=_caused("dynamic_pressure", "factor"),
        explanation="The dynamic pressure differs from the one computed with airspeed and density: a position error of the "
        "static pressure, or an error of the density.",
        source="All six derivatives times factor, q_bar = 1/2 density V^2. Material: 2 %, an airspeed error of 1 %.",
        distinguished_by="All six derivatives change by the same share; airspeed_scale also changes the rate of "
        "rotation of the flight path.",
        in_derivatives=True,
        prior=Prior(0.05, -0.35, 0.5),
    ),
    Effect(
        name="aerodynamic_center",
        where="declared",
        parameters=(
            Parameter(
                "dx_mac",
                "-",
                "aerodynamic centre behind its declared position, in chords",
                low=-0.2,
                high=0.2,
                material=0.01,
                step=1e-3,
            ),
        ),
        describe=_caused("aerodynamic_center", "dx_mac"),
        explanation="The lift due to alpha acts behind or ahead of its declared position: another Mach number, a store, "
        "an elastic wing.",
        source=f"dCmalpha = -CLalpha dx; {_TAIL}. Material: 1 % of the chord.",
        distinguished_by="A shift of the CG also changes Cmq and Cmde, by little.",
        in_derivatives=True,
        prior=Prior(0.05, -0.15, 0.15, log_odds=-4.0),
    ),
    Effect(
        name="icing",
        where="declared",
        parameters=(
            Parameter(
                "severity",
                "-",
                "share of the reference ice of a light transport",
                low=0.0,
                high=4.0,
                material=0.2,
                one_sided=True,
                step=0.01,
            ),
        ),
        describe=_caused("icing", "severity"),
        explanation="Ice on wing and tail lowers all six derivatives by shares that icing flights have measured.",
        source="Derivative times (1 + severity k), k of the Twin Otter with the reference ice: -0.100 CLalpha, -0.0135 "
        f"CLq, -0.095 CLde, -0.099 Cmalpha, -0.035 Cmq, -0.100 Cmde; {_ICE}, table 1. Material: CLalpha changes by 2 %.",
        distinguished_by="Pitch damping changes by a third of the share of the others; with tail_effectiveness by an "
        "equal share.",
        in_derivatives=True,
        prior=Prior(1.0, 0.0, 4.0, shape=0.4, log_odds=-5.0),
    ),
    Effect(
        name="derivatives",
        where="declared",
        parameters=(
            _shift("CLalpha", 5.0, 0.15),
            _shift("CLq", 100.0, 5.0),
            _shift("CLde", 2.0, 0.03),
            _shift("Cmalpha", 5.0, 0.05),
            _shift("Cmq", 100.0, 2.0),
            _shift("Cmde", 5.0, 0.05),
        ),
        describe=_shifted,
        explanation="Derivatives differ from the declared ones, for a cause that the library does not contain.",
        source="Increments of the derivatives about the trim. Material: 3 to 6 % of the GTM's derivatives, 15 % of its "
        "CLq.",
        distinguished_by="A cause with fewer parameters explains the same shifts if there is one: mass, CG, tail, wing.",
        in_derivatives=True,
    ),
)
"""Effects of this module."""
