"""Effects as columns of a quadratic: names, prior odds, and prior of each size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect, Prior
from airtruth.tracing.inference.causes import Cause

Array = NDArray[np.float64]

_LEAST_SHAPE: Final = 0.1
"""Uncertainty of the shape of a cause from which it widens the derivatives [-] (judgement: less is second order)."""


@dataclass(frozen=True)
class EffectColumn:
    """An effect of the filter, or a cause that changes the derivatives alone.

    Attributes
    ----------
    effect, cause : one of them.
    locations : parameters of the effect after its size; tried : number of locations that were compared.
    freed : derivatives that the effect leaves without a declaration (`hypothesis.unconstrained_by`).
    """

    effect: Effect | None = None
    cause: Cause | None = None
    locations: tuple[float, ...] = ()
    tried: int = 1
    freed: tuple[int, ...] = ()

    @cached_property
    def key(self) -> str:
        """Key of the effect."""
        return self.effect.key if self.effect is not None else self.of_cause.key

    @cached_property
    def label(self) -> str:
        """Name of the effect in sets."""
        return self.effect.label if self.effect is not None else self.of_cause.key

    @property
    def of_cause(self) -> Cause:
        """The cause.

        Raises
        ------
        ValueError
            If there is none.
        """
        if self.cause is None:
            raise ValueError("the column is an effect of the filter")
        return self.cause

    @property
    def prior(self) -> Prior | None:
        """Normal prior of the size; None for one that is log-uniform."""
        return self.effect.prior if self.effect is not None else self.of_cause.prior

    @property
    def log_odds(self) -> float:
        """Logarithm of the prior odds, shared among the locations that were compared."""
        prior = self.prior
        return (Prior.log_odds if prior is None else prior.log_odds) - float(np.log(self.tried))

    @property
    def event(self) -> str:
        """Event that moves it together with other effects; empty for an effect of its own."""
        return self.effect.event if self.effect is not None else self.of_cause.event

    @property
    def widens(self) -> bool:
        """Whether it widens the prior of the derivatives."""
        return bool(self.freed) or (self.cause is not None and self.cause.prior.shape > _LEAST_SHAPE)

    @property
    def told(self) -> tuple[float, float]:
        """Precision s^-2 of what other records tell of the size, and the precision times their mean b; zero for nothing."""
        if self.effect is None:
            return 0.0, 0.0
        first = self.effect.parameters[0]
        return first.prior_std**-2.0, first.prior_mean * first.prior_std**-2.0

    @cached_property
    def _late_signal(self) -> str:
        return "" if self.effect is None else self.effect.late_signal

    def may_join(self, other: EffectColumn) -> bool:
        """Whether both may be in one set: not two variants of one effect, but delays of two channels."""
        if self.label != other.label:
            return True
        late = self._late_signal, other._late_signal
        return self.key != other.key and late[0] != late[1] and "" not in late


class SizePriors(NamedTuple):
    """(columns,) constant of the log-density, 1 if it falls with the logarithm of the size, range, least size, and sign."""

    constant: Array
    falls: Array
    low: Array
    high: Array
    least: Array
    sign: Array


def size_priors(columns: Sequence[EffectColumn]) -> SizePriors:
    """Priors of the sizes of some columns."""
    return SizePriors(*np.array([_size_prior(c) for c in columns]).reshape(-1, 6).T)


def _size_prior(c: EffectColumn) -> tuple[float, float, float, float, float, float]:
    """Prior of the size of a column; see `SizePriors`. What is one-sided has no lower end but the least size."""
    prior = c.prior
    if c.effect is None or prior is not None:
        given = c.of_cause.prior if prior is None else prior
        return (-0.5 * float(np.log(2.0 * np.pi * given.std**2)), 0.0, given.low, given.high, 0.0, 0.0)
    first = c.effect.parameters[0]
    low, high = first.reach
    sign = 1.0 if low >= 0.0 else float(first.sign)
    end = max(abs(low), abs(high))
    least = min(first.material, 0.5 * end)
    sides = 1.0 if sign else 2.0
    return (-float(np.log(sides * np.log(end / least))), 1.0, -end if low >= 0.0 else low, high, least, sign)


__all__ = ["EffectColumn", "SizePriors", "size_priors"]
