"""Effects that move several derivatives together: tail, wing, fin, flow, ice, and the derivatives themselves.

Each is a `DerivativeTerm`; `airtruth.physics.composition` gives the direction of the derivatives per unit of it. The
priors are judgement: parts that lose lift rather than gain it, and the accuracy of first-order contributions.
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
    terms = (DerivativeTerm(name[1:], x) for name, x in values.items() if x != 0.0)
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


def _tip(side: str, variant: str) -> Effect:
    return _lost(
        "wing_tip",
        side,
        variant,
        ("semispan", 0.5, 0.02),
        (
            f"The {side} wing tip is lost: roll damping and dihedral effect fall, the {side} aileron with them, the "
            "aircraft rolls to that side at rest, and the CG moves away from it.",
            f"Strip theory; {_LATERAL}, section 5.7. Taper, ailerons and mass of the wing are those of [wing] in "
            "aircraft.toml. Exact for a fifth of the semispan, linear in the loss. Material: 2 % of the semispan, a change of "
            "Clp by 3 %.",
            "Roll damping falls with the aileron; aileron_effectiveness leaves Clp as it is. The rolling moment "
            "at rest grows with the lift.",
        ),
        0.15,
    )


def _flap(side: str, variant: str) -> Effect:
    return _lost(
        "flap",
        side,
        variant,
        ("trailing-edge flap", 1.0, 0.1),
        (
            f"The {side} trailing-edge flap is lost: the aircraft rolls to that side with its lift, and roll damping and "
            "dihedral effect fall a little.",
            f"Strip theory with the chord that is lost; {_LATERAL}, section 5.7. Ends and chord of the flaps, taper and mass "
            "of the wing are those of [wing] in aircraft.toml. Material: a tenth of a flap, a rolling moment that half a degree "
            "of the GTM's aileron balances.",
            "The aileron keeps its effectiveness, and roll damping loses two fifths of what it loses with a wing "
            "tip of the same rolling moment. cg_shift_y yaws the aircraft too.",
        ),
        0.5,
    )


def _lost(
    part: str,
    side: str,
    variant: str,
    lost: tuple[str, float, float],
    words: tuple[str, str, str],
    std: float,
) -> Effect:
    """The loss of a part of one half of the wing: of what a fraction is lost, the most, and the material one."""
    whole, most, material = lost
    explanation, source, distinguished_by = words
    meaning = f"part of the {side} {whole} that is lost"
    fraction = Parameter(
        "fraction", "-", meaning, low=0.0, high=most, material=material, one_sided=True, step=1e-3
    )
    return Effect(
        name=f"{part}_loss",
        variant=variant,
        where="declared",
        parameters=(fraction,),
        describe=_caused(f"{side}_{part}", fraction.name),
        explanation=explanation,
        source=source,
        distinguished_by=distinguished_by,
        in_derivatives=True,
        prior=Prior(std, 0.0, most, shape=0.3, log_odds=-6.0),
    )


def _of_one(name: str, derivative: str, reach: float, material: float, words: tuple[str, str, str]) -> Effect:
    """A change of one derivative with a name of its own; its parameter is d and the derivative."""
    explanation, source, distinguished_by = words
    parameter = Parameter(
        f"d{derivative}",
        "-",
        f"change of {derivative} [1/rad]",
        low=-reach,
        high=reach,
        material=material,
        step=material,
    )
    return Effect(
        name=name,
        where="declared",
        parameters=(parameter,),
        describe=_caused(derivative, parameter.name),
        explanation=explanation,
        source=source,
        distinguished_by=distinguished_by,
        in_derivatives=True,
        prior=Prior(10.0 * material, -reach, reach, log_odds=-6.0),
    )


_LATERAL: Final = "Etkin and Reid, Dynamics of Flight, 3rd ed., 1996"
"""Source of the contributions of fin and wing to the lateral derivatives."""
_REACHES: Final = {
    "CYbeta": (3.0, 0.05),
    "CYp": (1.0, 0.05),
    "CYr": (3.0, 0.09),
    "CYda": (0.5, 0.005),
    "CYdr": (1.0, 0.02),
    "Clbeta": (0.5, 0.01),
    "Clp": (1.0, 0.02),
    "Clr": (0.5, 0.015),
    "Clda": (0.5, 0.004),
    "Cldr": (0.2, 0.003),
    "Cnbeta": (0.5, 0.01),
    "Cnp": (0.5, 0.01),
    "Cnr": (1.0, 0.03),
    "Cnda": (0.2, 0.002),
    "Cndr": (0.5, 0.01),
}
"""Lateral derivative -> largest and material change [1/rad] (judgement: 5 to 10 % of the GTM's, or of the largest of its
coefficient)."""

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
        prior=Prior(0.05, -0.15, 0.15, log_odds=-6.0),
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
        prior=Prior(1.0, 0.0, 4.0, shape=0.4, log_odds=-7.0),
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
    Effect(
        name="fin_effectiveness",
        where="declared",
        parameters=(factor("on the side force of the fin and its rudder", 0.0, 1.6, 0.03),),
        describe=_caused("fin", "factor"),
        explanation="The fin has more or less side force than declared: part of it is lost, iced, or in the wake of the "
        "fuselage.",
        source=f"Contribution of the fin to CY, Cl and Cn of beta, p and r, and of a rudder on it, times factor; {_LATERAL}, "
        "sections 5.5 to 5.8. Arm, height and lift slope are those of [fin] in aircraft.toml, or inferred from Cndr/CYdr, "
        "Cldr/CYdr and Cnr. Material: 3 %, a change of Cnbeta by 5 %.",
        distinguished_by="Cnbeta and Cnr change together; an error of the yaw inertia scales Cndr by the same share.",
        in_derivatives=True,
        prior=Prior(0.3, -1.0, 0.05, shape=0.25),
    ),
    _tip("left", ""),
    _tip("right", "right"),
    _flap("left", ""),
    _flap("right", "right"),
    _of_one(
        "adverse_yaw",
        "Cnda",
        0.2,
        0.002,
        (
            "The ailerons yaw the aircraft more or less than declared: another differential, or spoilers.",
            "Cn += dCnda aileron. Material: 3 % of the GTM's Clda of -0.07.",
            "A rudder that is held still, and both senses of the aileron.",
        ),
    ),
    _of_one(
        "dihedral",
        "Clbeta",
        0.5,
        0.01,
        (
            "The rolling moment due to sideslip differs from the declared one: elastic wings, fuel, another sweep.",
            "Cl += dClbeta beta. Material: 7 % of the GTM's Clbeta of -0.14.",
            "Steady sideslips, and rudder inputs at a constant aileron.",
        ),
    ),
    Effect(
        name="derivatives",
        variant="lateral",
        where="declared",
        parameters=tuple(_shift(name, *reach) for name, reach in _REACHES.items()),
        describe=_shifted,
        explanation="Lateral derivatives differ from the declared ones, for a cause that the library does not contain.",
        source="Increments of the derivatives about the trim. Material: 5 to 10 % of the GTM's derivatives, or of the largest "
        "of the same coefficient.",
        distinguished_by="A cause with fewer parameters explains the same shifts if there is one: fin, wing tip, inertia, CG.",
        in_derivatives=True,
    ),
)
"""Effects of this module."""
