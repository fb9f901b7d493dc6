"""Causes of a change of the derivatives, as linear terms about a trim.

The increments are first order (`airtruth.physics.composition`): several causes add. Forces and moments stay as they are at
the trim, whose own change by the cause is left out; a lost wing tip alone states what it adds at rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.composition import CAUSES, PARTS, SideGeometry, TailGeometry, cause_motion, directions
from airtruth.physics.composition_lateral import lift_slope
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion
from airtruth.physics.terms import DECLARED, AeroTerm, Change, DeclaredTerm, DerivativeTerm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearPoint:
    """The linear model of an aircraft at a trim.

    Attributes
    ----------
    derivatives : (6,) in the order of `airtruth.physics.motion.LONGITUDINAL` [-].
    alpha_rad, elevator_rad : the trim [rad].
    geometry : what is declared of the tail.
    """

    derivatives: Array
    alpha_rad: float
    elevator_rad: float
    geometry: TailGeometry

    motion = LONGITUDINAL

    @property
    def at(self) -> Mapping[str, float]:
        """Signal -> value at the trim [rad]."""
        return {"alpha": self.alpha_rad, "elevator": self.elevator_rad}

    def along_body(self, increments: Array) -> Array:
        """Increments of derivatives as those of terms: lift counts across the flight path, a term of CL along -z of the body."""
        turned = increments.copy()
        turned[LONGITUDINAL.row("CL")] /= np.cos(self.alpha_rad)
        return turned


@dataclass(frozen=True)
class SidePoint:
    """The linear model of the lateral motion of an aircraft at a trim in six axes.

    Attributes
    ----------
    derivatives : (15,) in the order of `airtruth.physics.motion.LATERAL` [-].
    alpha_rad, beta_rad, aileron_rad, rudder_rad : the trim [rad].
    lift : lift coefficient of the trim [-].
    geometry : what is declared of fin and wing.
    """

    derivatives: Array
    alpha_rad: float
    beta_rad: float
    aileron_rad: float
    rudder_rad: float
    lift: float
    geometry: SideGeometry

    motion = LATERAL

    @property
    def at(self) -> Mapping[str, float]:
        """Signal -> value at the trim [rad]."""
        return {"beta": self.beta_rad, "aileron": self.aileron_rad, "rudder": self.rudder_rad}

    def along_body(self, increments: Array) -> Array:
        """Increments of derivatives as those of terms: both count in body axes."""
        return increments

    def at_rest(self, coefficient: str, amount: float) -> AeroTerm:
        """A moment that grows with the lift: ``amount`` per lift coefficient, linear in the angle of attack."""
        slope = lift_slope(self.geometry)
        return AeroTerm(coefficient, "alpha", "linear", amount * slope, self.alpha_rad - self.lift / slope)


def derivative_increments(
    terms: Iterable[DerivativeTerm], derivatives: Array, geometry: Any, motion: Motion = LONGITUDINAL
) -> Array:
    """Change of the derivatives of a motion by some causes.

    Parameters
    ----------
    terms : the causes; those of another motion do not count.
    derivatives, geometry, motion : as in `airtruth.physics.composition.directions`.

    Returns
    -------
    Sum over the causes of size times direction (`airtruth.physics.composition.directions`); the size is the
    difference from neutral.

    Raises
    ------
    ConfigurationError
        If a cause is not known.
    """
    unit = directions(derivatives, geometry, motion)
    total = np.zeros(len(motion.parameters))
    for term in terms:
        if term.cause not in CAUSES:
            raise ConfigurationError(f"cause {term.cause!r}: {choices(term.cause, CAUSES)}")
        if cause_motion(term.cause) is motion:
            total += (term.value - CAUSES[term.cause]) * unit[term.cause]
    return total


def resolved(change: Change, *points: LinearPoint | SidePoint) -> Change:
    """Return a change without `DerivativeTerm`s, with the linear terms that they amount to at a trim.

    Parameters
    ----------
    change : the terms of one or several effects.
    points : the declared aircraft at the trim, one for each motion that the causes concern.

    Raises
    ------
    ConfigurationError
        If a cause is not known, or concerns a motion without a point.
    """
    if not change.derivatives:
        return change
    for term in change.derivatives:
        if term.cause in CAUSES and cause_motion(term.cause) not in [p.motion for p in points]:
            raise ConfigurationError(
                f"cause {term.cause!r} changes derivatives of the {cause_motion(term.cause).name} motion; resolve it at a "
                "trim of that motion"
            )
    for at in points:
        causes = change.derivatives
        amounts = at.along_body(derivative_increments(causes, at.derivatives, at.geometry, at.motion))
        parameters = zip(at.motion.parameters, amounts, strict=True)
        terms = linear_terms({name: float(x) for name, x in parameters if x != 0.0}, at.at)
        rest = tuple(_at_rest(causes, at)) if isinstance(at, SidePoint) else ()
        change = replace(
            change,
            aero=change.aero + terms + tuple(t for t in rest if isinstance(t, AeroTerm)),
            declared=change.declared + tuple(t for t in rest if isinstance(t, DeclaredTerm)),
        )
    return replace(change, derivatives=())


def _at_rest(causes: Iterable[DerivativeTerm], at: SidePoint) -> Iterator[AeroTerm | DeclaredTerm]:
    """What parts add beside the derivatives."""
    for term in causes:
        part = PARTS.get(term.cause)
        if part is not None and part.at_rest is not None:
            for name, amount in part.at_rest(at.geometry).items():
                added = (term.value - part.neutral) * amount
                yield DeclaredTerm(name, added) if name in DECLARED else at.at_rest(name, added)


def linear_terms(increments: Mapping[str, float], at: Mapping[str, float]) -> tuple[AeroTerm, ...]:
    """Increments of derivatives as terms that vanish at a trim.

    Parameters
    ----------
    increments : derivative of any motion -> increment [1/rad]; may leave some out.
    at : signal -> value at the trim [rad]; those of the rates are zero.

    Raises
    ------
    ConfigurationError
        If a name is not a derivative.
    """
    terms = []
    for name, amount in increments.items():
        motion = next((m for m in MOTIONS.values() if name in m.parameters), None)
        if motion is None:
            known = [each for m in MOTIONS.values() for each in m.parameters]
            raise ConfigurationError(f"derivative {name!r}: {choices(name, known)}")
        derivative = motion.derivatives[motion.index(name)]
        signal = motion.signals[derivative.column].name
        coefficient = motion.coefficients[derivative.row].name
        terms.append(AeroTerm(coefficient, signal, "linear", amount, at.get(signal, 0.0)))
    return tuple(terms)


__all__ = ["LinearPoint", "SidePoint", "derivative_increments", "linear_terms", "resolved"]
