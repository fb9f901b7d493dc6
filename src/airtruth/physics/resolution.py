"""Causes of a change of the derivatives, as linear terms about a trim.

The increments are first order (`airtruth.physics.composition`): several causes add. Lift and moment stay as they are at
the trim, whose own change by the cause is left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.composition import CAUSES, TailGeometry, directions
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.terms import AeroTerm, Change, DerivativeTerm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearPoint:
    """The linear model of an aircraft at a trim.

    Attributes
    ----------
    derivatives : of the motion, in its order [-].
    trim : signal of the motion -> value at the trim [rad]; those left out are zero there.
    geometry : what is declared of the tail.
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
    names = motion.parameters
    unit = dict(directions(derivatives, geometry, motion)) | dict(zip(names, np.eye(len(names)), strict=True))
    total = np.zeros(len(names))
    for term in terms:
        if term.cause not in CAUSES or term.cause not in unit:
            known = [cause for cause in CAUSES if cause in unit]
            raise ConfigurationError(f"cause {term.cause!r}: {choices(term.cause, known)}")
        total += (term.value - CAUSES[term.cause]) * unit[term.cause]
    return total


def resolved(change: Change, at: LinearPoint) -> Change:
    """Return a change without `DerivativeTerm`s, with the linear terms that they amount to at a trim.

    Parameters
    ----------
    change : the terms of one or several effects.
    at : the declared aircraft at the trim.

    Raises
    ------
    ConfigurationError
        If a cause is not known.
    """
    if not change.derivatives:
        return change
    motion = at.motion
    amounts = derivative_increments(change.derivatives, at.derivatives, at.geometry, motion)
    # a derivative of lift counts across the flight path, a term of it along -z of the body
    for coefficient in (c.name for c in motion.coefficients if c.sign < 0):
        amounts[motion.row(coefficient)] /= np.cos(at.trim[motion.implicit[1]])
    named = {name: float(x) for name, x in zip(motion.parameters, amounts, strict=True) if x != 0.0}
    terms = linear_terms(named, at.trim, motion)
    return replace(change, aero=change.aero + terms, derivatives=())


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
