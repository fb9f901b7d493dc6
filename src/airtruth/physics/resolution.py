"""Causes of a change of the derivatives, as linear terms about a trim.

The increments are first order (`airtruth.physics.composition`): several causes add. Forces and moments stay as they are at
the trim, whose own change by the cause is left out; a lost part of the wing alone states what it changes at rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.composition import CAUSES, PARTS, TailGeometry, cause_motion, directions
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.terms import DECLARED, AeroTerm, Change, DeclaredTerm, DerivativeTerm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearPoint:
    """The linear model of an aircraft at a trim.

    Attributes
    ----------
    derivatives : of the motion, in its order [-].
    trim : signal of the motion, or alpha -> value at the trim [rad]; those left out are zero there.
    geometry : what is declared of wing, tail and fin.
    motion : the motion of the model.
    """

    derivatives: Array
    trim: Mapping[str, float]
    geometry: TailGeometry
    motion: Motion = LONGITUDINAL


def derivative_increments(
    terms: Iterable[DerivativeTerm], derivatives: Array, geometry: TailGeometry, motion: Motion = LONGITUDINAL
) -> Array:
    """Change of the derivatives by some causes.

    Parameters
    ----------
    terms : the causes.
    derivatives : of the declared aircraft, in the order of the motion [-].
    geometry : what is declared of its tail.
    motion : whose derivatives change.

    Returns
    -------
    Sum over the causes of size times direction (`airtruth.physics.composition.directions`); the size is the
    difference from neutral.

    Raises
    ------
    ConfigurationError
        If a cause is none of the motion.
    """
    unit = directions(derivatives, geometry, motion)
    total = np.zeros(len(motion.parameters))
    for term in terms:
        if term.cause not in CAUSES or term.cause not in unit:
            known = [cause for cause in CAUSES if cause in unit]
            raise ConfigurationError(f"cause {term.cause!r}: {choices(term.cause, known)}")
        total += (term.value - CAUSES[term.cause]) * unit[term.cause]
    return total


def resolved(change: Change, *points: LinearPoint) -> Change:
    """Return a change without `DerivativeTerm`s, with the linear terms that they amount to at a trim.

    Parameters
    ----------
    change : the terms of one or several effects.
    points : the declared aircraft at the trim, once for each motion whose derivatives change.

    Raises
    ------
    ConfigurationError
        If a cause is not known, or none of a motion of the points.
    """
    if not change.derivatives:
        return change
    of: dict[str, list[DerivativeTerm]] = {at.motion.name: [] for at in points}
    for term in change.derivatives:
        motion = cause_motion(term.cause).name if term.cause in CAUSES else points[0].motion.name
        of.get(motion, of[points[0].motion.name]).append(term)
    rest = replace(change, derivatives=())
    for at in points:
        rest += _resolved(tuple(of[at.motion.name]), at)
    return rest


def _resolved(causes: tuple[DerivativeTerm, ...], at: LinearPoint) -> Change:
    """The terms that the causes of one motion amount to."""
    if not causes:
        return Change()
    motion = at.motion
    amounts = derivative_increments(causes, at.derivatives, at.geometry, motion)
    # a derivative of lift counts across the flight path, a term of it along -z of the body
    for coefficient in (c.name for c in motion.coefficients if c.sign < 0):
        amounts[motion.row(coefficient)] /= np.cos(at.trim[motion.implicit[1]])
    named = {name: float(x) for name, x in zip(motion.parameters, amounts, strict=True) if x != 0.0}
    return Change(aero=linear_terms(named, at.trim, motion), declared=tuple(_at_rest(causes, at)))


def _at_rest(causes: Iterable[DerivativeTerm], at: LinearPoint) -> Iterator[DeclaredTerm]:
    """Declared quantities that parts change beside the derivatives."""
    for term in causes:
        part = PARTS.get(term.cause)
        if part is not None and part.at_rest is not None:
            for name, amount in part.at_rest(at.geometry).items():
                yield DeclaredTerm(name, DECLARED[name] + (term.value - part.neutral) * amount)


def linear_terms(
    increments: Mapping[str, float], trim: Mapping[str, float], motion: Motion = LONGITUDINAL
) -> tuple[AeroTerm, ...]:
    """Increments of derivatives as terms that vanish at a trim.

    Parameters
    ----------
    increments : derivative of the motion -> increment [1/rad, -]; may leave some out.
    trim : signal -> value at the trim [rad]; those left out are zero there.
    motion : of the derivatives.

    Raises
    ------
    ConfigurationError
        If a name is not a derivative of the motion.
    """
    terms = []
    for name, amount in increments.items():
        if name not in motion.parameters:
            raise ConfigurationError(f"derivative {name!r}: {choices(name, motion.parameters)}")
        derivative = motion.derivatives[motion.index(name)]
        signal = motion.signals[derivative.column].name
        coefficient = motion.coefficients[derivative.row].name
        terms.append(AeroTerm(coefficient, signal, "linear", amount, trim.get(signal, 0.0)))
    return tuple(terms)


__all__ = ["LinearPoint", "derivative_increments", "linear_terms", "resolved"]
