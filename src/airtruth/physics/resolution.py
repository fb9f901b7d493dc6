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
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import AeroTerm, Change, DerivativeTerm

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


def derivative_increments(
    terms: Iterable[DerivativeTerm], derivatives: Array, geometry: TailGeometry
) -> Array:
    """Change of the six derivatives by some causes.

    Parameters
    ----------
    terms : the causes.
    derivatives : (6,) of the declared aircraft [-].
    geometry : what is declared of its tail.

    Returns
    -------
    (6,) sum over the causes of size times direction (`airtruth.physics.composition.directions`); the size is the
    difference from neutral.

    Raises
    ------
    ConfigurationError
        If a cause is not known.
    """
    names = LONGITUDINAL.parameters
    unit = dict(directions(derivatives, geometry)) | dict(zip(names, np.eye(len(names)), strict=True))
    total = np.zeros(len(names))
    for term in terms:
        if term.cause not in CAUSES:
            raise ConfigurationError(f"cause {term.cause!r}: {choices(term.cause, CAUSES)}")
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
    amounts = derivative_increments(change.derivatives, at.derivatives, at.geometry)
    # a derivative of lift counts across the flight path, a term of CL along -z of the body
    amounts[LONGITUDINAL.row("CL")] /= np.cos(at.alpha_rad)
    named = {name: float(x) for name, x in zip(LONGITUDINAL.parameters, amounts, strict=True) if x != 0.0}
    terms = linear_terms(named, at.alpha_rad, at.elevator_rad)
    return replace(change, aero=change.aero + terms, derivatives=())


def linear_terms(
    increments: Mapping[str, float], alpha_rad: float, elevator_rad: float
) -> tuple[AeroTerm, ...]:
    """Increments of derivatives as terms that vanish at a trim.

    Parameters
    ----------
    increments : derivative of `airtruth.physics.motion.LONGITUDINAL` -> increment [1/rad]; may leave some out.
    alpha_rad, elevator_rad : the trim [rad].

    Raises
    ------
    ConfigurationError
        If a name is not a derivative.
    """
    at = {"alpha": alpha_rad, "elevator": elevator_rad, "qhat": 0.0}
    terms = []
    for name, amount in increments.items():
        if name not in LONGITUDINAL.parameters:
            raise ConfigurationError(f"derivative {name!r}: {choices(name, LONGITUDINAL.parameters)}")
        derivative = LONGITUDINAL.derivatives[LONGITUDINAL.index(name)]
        signal = LONGITUDINAL.signals[derivative.column].name
        coefficient = LONGITUDINAL.coefficients[derivative.row].name
        terms.append(AeroTerm(coefficient, signal, "linear", amount, at[signal]))
    return tuple(terms)


__all__ = ["LinearPoint", "derivative_increments", "linear_terms", "resolved"]
