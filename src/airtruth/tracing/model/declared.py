"""Derivatives of a motion that aircraft.toml declares, and their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from math import hypot, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.tail import tail_geometry
from airtruth.errors import AircraftError
from airtruth.physics.composition import directions
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.motion_parts import Declared
from airtruth.quantity import Quantity

Array = NDArray[np.float64]


class Uncertainty(NamedTuple):
    """Uncertainty of derivatives for which aircraft.toml states none, in the order of the motion.

    relative : standard deviation over the value [-]; least : least standard deviation [-], which keeps the prior regular where a
    derivative is near zero.
    """

    relative: tuple[float, ...]
    least: tuple[float, ...]


UNCERTAINTY: Final[Mapping[str, Uncertainty]] = {
    LONGITUDINAL.name: Uncertainty(
        relative=(0.05, 0.30, 0.10, 0.05, 0.15, 0.05),
        least=(0.005, 0.1, 0.002, 0.001, 0.05, 0.001),
    ),
    LATERAL.name: Uncertainty(
        relative=(0.10, 0.50, 0.30, 0.50, 0.15, 0.10, 0.10, 0.20, 0.10, 0.20, 0.10, 0.30, 0.15, 0.30, 0.08),
        least=(0.01, 0.05, 0.05, 0.005, 0.005, *2 * (0.002, 0.005, 0.005, 0.001, 0.001)),
    ),
}
"""Motion -> uncertainty (judgement): smaller ones let a declared error pass for an effect, larger ones let the derivatives absorb
an effect. Derivatives of the angle of flow and of the main control are known best, those of the side force and of rates least."""
_CERTAIN: Final = 1e-6
"""Relative standard deviation of an inertia that is declared without one [-]: none, but the prior stays regular."""


def stated_derivatives(aircraft: Aircraft, motion: Motion) -> Array:
    """(derivatives,) as aircraft.toml states them [-].

    Raises
    ------
    AircraftError
        If one is missing.
    """
    stated = aircraft.file.derivatives
    missing = [name for name in motion.parameters if name not in stated]
    if missing:
        raise AircraftError(
            f"{aircraft.folder}: without a JSBSim model aircraft.toml needs [derivatives] with {', '.join(missing)}; "
            "write what `airtruth identify` estimates there, each as { value = ..., std = ... }"
        )
    return np.array([stated[name].value for name in motion.parameters])


def declared_covariance(aircraft: Aircraft, derivatives: Array, motion: Motion = LONGITUDINAL) -> Array:
    """(derivatives, derivatives) covariance as aircraft.toml declares it, with what mass, inertias and CG add [-].

    A coefficient that acts on another mass or inertia looks like another coefficient: each declared quantity adds its variance
    along its direction (`airtruth.physics.composition.directions`).
    """
    stated = aircraft.file.derivatives
    relative, least = UNCERTAINTY[motion.name]
    std = np.empty(len(motion.parameters))
    for i, name in enumerate(motion.parameters):
        quantity = stated.get(name)
        own = relative[i] * abs(derivatives[i])
        if quantity and quantity.std > 0.0:
            own = quantity.std * (abs(derivatives[i] / quantity.value) if quantity.value else 1.0)
        std[i] = max(own, least[i])
    covariance = np.diag(std**2)
    along = directions(derivatives, tail_geometry(aircraft), motion)
    for declared in motion.declared:
        if declared.name in along:
            direction = along[declared.name]
            covariance += _std(aircraft, declared) ** 2 * np.outer(direction, direction)
    return covariance


def _std(aircraft: Aircraft, declared: Declared) -> float:
    """Standard deviation of a declared quantity [-]; 0 where none is stated.

    That of a factor is over its value, and that of a product of inertia over sqrt(Ixx Izz), as effects count them.
    """
    mass = aircraft.file.mass
    quantity: Quantity | None = getattr(mass, declared.entry, None)
    if mass is None or quantity is None:
        return 0.0
    if declared.divides:
        return float(quantity.std / quantity.value)
    xx, zz = mass.inertia_xx, mass.inertia_zz
    if quantity is mass.inertia_xz and xx is not None and zz is not None:
        return float(quantity.std / sqrt(xx.value * zz.value))
    return float(quantity.std)


def inertia_std(aircraft: Aircraft, motion: Motion = LONGITUDINAL) -> float:
    """Relative standard deviation of the declared inertias of a motion together [-]; next to none where none is stated.

    Two independent inertias of relative variances a and b share a common factor of the variance 1/(1/a + 1/b) at most.
    """
    moments = {c.name for c in motion.coefficients if c.length is not None}
    own = [max(_std(aircraft, d), _CERTAIN) for d in motion.declared if moments & {*d.divides}]
    return reduce(lambda a, b: a * b / hypot(a, b), own)


__all__ = ["UNCERTAINTY", "Uncertainty", "declared_covariance", "inertia_std", "stated_derivatives"]
