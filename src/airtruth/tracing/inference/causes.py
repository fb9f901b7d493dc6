"""Physical causes of changed derivatives, and what explains a contradiction of the declared ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect, Prior
from airtruth.effects.registry import EFFECTS

Array = NDArray[np.float64]

DERIVATIVES: Final = "derivatives"
"""Key of the effect that states wrong declarations of derivatives."""


@dataclass(frozen=True)
class Cause:
    """A physical cause that moves several derivatives together.

    Attributes
    ----------
    key : of the effect; direction : (derivatives,) change of the derivatives per unit of size.
    prior, event : as of `airtruth.effects.effect.Effect`.
    """

    key: str
    direction: Array
    prior: Prior
    event: str = ""


def causes_of(directions: Mapping[str, Array]) -> tuple[Cause, ...]:
    """Every effect with a prior as a cause of the derivatives of a motion, those of one event first.

    Parameters
    ----------
    directions : of the motion, see `airtruth.physics.composition.directions`.
    """
    effects = sorted(EFFECTS.values(), key=lambda e: not e.event)
    return tuple(
        Cause(e.key, directions[e.quantity], e.prior, e.event)
        for e in effects
        if e.prior is not None and e.quantity in directions
    )


@dataclass(frozen=True)
class DeclaredCauses:
    """Candidates that explain a contradiction of the declared derivatives.

    Attributes
    ----------
    causes : physical causes; wrong_allowed : whether declarations themselves may be wrong.
    """

    causes: tuple[Cause, ...] = ()
    wrong_allowed: bool = True

    @property
    def keys(self) -> Collection[str]:
        """Keys of the physical causes."""
        return {c.key for c in self.causes}


def size_in_filter(effect: Effect, size: float) -> float:
    """Size of a cause's effect in the filter: a mass or inertia divides the coefficients."""
    return size / (1.0 - size) if effect.divides else size


def size_in_derivatives(effect: Effect, size: float) -> float:
    """Inverse of `size_in_filter`."""
    return size / (1.0 + size) if effect.divides else size


__all__ = [
    "DERIVATIVES",
    "Cause",
    "DeclaredCauses",
    "causes_of",
    "size_in_derivatives",
    "size_in_filter",
]
