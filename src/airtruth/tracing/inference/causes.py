"""Physical causes of changed derivatives, and what explains a contradiction of the declared ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect, Prior
from airtruth.effects.registry import EFFECTS
from airtruth.tracing.inference.hypothesis import Hypothesis

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

    def most_probable(self, size: float, std: float) -> float:
        """Size within its plausible range that is most probable, where records tell ``size`` with an error of ``std`` [-]."""
        prior = self.prior
        told = size * prior.std**2 / (prior.std**2 + std**2)
        return min(max(told, prior.low), prior.high)


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
    effects : effects of those causes that the filter carries, beyond first order.
    corrections : causes of a set -> what its refit in the filter cost beyond first order [-].
    """

    causes: tuple[Cause, ...] = ()
    wrong_allowed: bool = True
    effects: tuple[Effect, ...] = ()
    corrections: Mapping[tuple[str, ...], float] = field(default_factory=dict)

    @property
    def keys(self) -> Collection[str]:
        """Keys of the physical causes."""
        return {c.key for c in self.causes}

    def beside(self, hypothesis: Hypothesis) -> DeclaredCauses:
        """Those that are no effect of a hypothesis, which has them free already."""
        taken = {e.key for e in hypothesis.effects}
        return replace(
            self,
            causes=tuple(c for c in self.causes if c.key not in taken),
            effects=tuple(e for e in self.effects if e.key not in taken),
        )


__all__ = ["DERIVATIVES", "Cause", "DeclaredCauses", "causes_of"]
