"""aircraft.toml of an aircraft that is known by its geometry: derivatives by handbook formulas, and their scatter."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final

from airtruth.errors import ConfigurationError
from airtruth.physics.handbook import EQUATIONS, Planform, derivatives, standard_deviations
from airtruth.starting.texts import filled

TAIL_ASPECT_RATIO: Final = 4.5
"""Aspect ratio of a tail without a stated span [-] (judgement: tails of light aircraft and transports have 3.5 to 5.5)."""
_GYRATION: Final = 0.36
"""Radius of gyration in pitch over half the length [-]: 0.34 to 0.38 in D. P. Raymer, Aircraft Design, table 16.1."""
_GYRATION_STD: Final = 0.2
"""Relative standard deviation of an inertia by the length [-] (judgement: twice that of the table's radius, for a payload)."""
_SWUNG_STD: Final = 0.05
"""Relative standard deviation of a stated inertia [-] (judgement: a swing test of a small aircraft)."""
_WEIGHED_STD: Final = 0.01
"""Relative standard deviation of a stated mass [-] (judgement: scales, and a battery or fuel that was changed)."""


@dataclass(frozen=True)
class Measured:
    """Dimensions and mass that a user measures with a tape and scales; None where they are not known.

    Attributes
    ----------
    span_m, wing_area_m2, tail_area_m2, tail_arm_m, mass_kg : see `airtruth.physics.handbook.Planform`; all are needed.
    inertia_kg_m2, length_m : pitch inertia about the CG [kg m2], or length of the fuselage [m], which estimates it.
    chord_m : default wing_area_m2/span_m; tail_span_m : default by `TAIL_ASPECT_RATIO`.
    elevator_share, cg : see `airtruth.physics.handbook.Planform`.
    """

    span_m: float | None = None
    wing_area_m2: float | None = None
    tail_area_m2: float | None = None
    tail_arm_m: float | None = None
    mass_kg: float | None = None
    inertia_kg_m2: float | None = None
    length_m: float | None = None
    chord_m: float | None = None
    tail_span_m: float | None = None
    elevator_share: float | None = None
    cg: float | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing is known."""
        return all(getattr(self, f.name) is None for f in fields(self))


@dataclass(frozen=True)
class ProposedAircraft:
    """A proposed aircraft.toml.

    Attributes
    ----------
    text : the file; summary : the derivatives with their standard deviations.
    """

    text: str
    summary: str


def proposed_aircraft(name: str, known: Measured) -> ProposedAircraft:
    """Propose an aircraft from its geometry.

    Parameters
    ----------
    name : name of the aircraft, as logs state it; known : its measures.

    Raises
    ------
    ConfigurationError
        If a measure is missing or not above 0.
    """
    planform, mass, inertia = _planform(known), known.mass_kg or 0.0, known.inertia_kg_m2
    if inertia is not None:
        inertia_std, inertia_source = _SWUNG_STD * inertia, "stated"
    else:
        inertia = mass * (0.5 * _GYRATION * (known.length_m or 0.0)) ** 2
        inertia_std, inertia_source = (
            _GYRATION_STD * inertia,
            f"radius of gyration {_GYRATION / 2:g} of the length",
        )
    values, stds = derivatives(planform), standard_deviations(planform)
    lines = [
        f'{key} = {{ value = {value:.4g}, std = {stds[key]:.2g}, source = "handbook, {EQUATIONS[key]}" }}'
        for key, value in values.items()
    ]
    numbers = {
        "wing_area": planform.wing_area_m2,
        "chord": planform.chord_m,
        "span": planform.span_m,
        "mass": mass,
        "mass_std": _WEIGHED_STD * mass,
        "inertia": inertia,
        "inertia_std": inertia_std,
        "cg": planform.cg,
        "tail_arm": planform.tail_arm_m,
    }
    text = filled(
        "geometry",
        name=name,
        inertia_source=inertia_source,
        derivatives="\n".join(lines),
        **{key: f"{value:.6g}" for key, value in numbers.items()},
    )
    table = [f"{key:8s} {value:8.3g} +- {stds[key]:.2g} 1/rad" for key, value in values.items()]
    return ProposedAircraft(
        text, "\n".join(["derivatives by handbook formulas, with their scatter:", *table])
    )


def _planform(known: Measured) -> Planform:
    needed = ("span_m", "wing_area_m2", "tail_area_m2", "tail_arm_m", "mass_kg")
    missing = [_option(key) for key in needed if getattr(known, key) is None]
    if known.inertia_kg_m2 is None and known.length_m is None:
        missing.append("--inertia-kg-m2 or --length-m")
    if missing:
        raise ConfigurationError(f"geometry: derivatives need {', '.join(missing)} as well; state them")
    for f in fields(known):
        value = getattr(known, f.name)
        if value is not None and not (math.isfinite(value) and (value > 0.0 or f.name == "cg")):
            raise ConfigurationError(f"{_option(f.name)} {value:g}: has to be a number above 0")
    span, area, tail = known.span_m or 0.0, known.wing_area_m2 or 0.0, known.tail_area_m2 or 0.0
    usual = {"chord_m": area / span, "tail_span_m": math.sqrt(TAIL_ASPECT_RATIO * tail)}
    stated = {f.name: getattr(known, f.name, None) for f in fields(Planform)}
    return Planform(**usual | {name: value for name, value in stated.items() if value is not None})


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


__all__ = ["TAIL_ASPECT_RATIO", "Measured", "ProposedAircraft", "proposed_aircraft"]
