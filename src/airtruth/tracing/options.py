"""Choices of a trace."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from airtruth.arguments import names, require_whole
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError, choices
from airtruth.physics.motion import MOTIONS

MODELS: Final = ("aircraft", "linear")
"""Models of the declared aircraft: forces probed in JSBSim, or the linear short-period model."""


@dataclass(frozen=True)
class TraceOptions:
    """Choices of a trace.

    Attributes
    ----------
    model : "aircraft" probes the forces of the declared JSBSim aircraft; "linear" uses the linear short-period
        model of its derivatives. An aircraft without a JSBSim model is always linear.
    hold_out : runs that are not fitted and serve only the report, a string is one of them; None holds out every third, never
        the only one.
    threads : number of records processed at a time; the answer does not depend on it.
    seed : seed of the random draws behind p-values, 0 or more.
    effects : candidates, one or a sequence; None for the library. A key of the library, a name without a variant for all of
        its variants, or an `Effect`, which need not be in the library.
    time_budget_s : time after which the search starts no new step [s]; None for no limit. The answer then depends on the
        machine, is provisional, and lists the omitted steps.
    increments : whether increments are learned from the residual of the named effects; None where the whole library is
        searched.
    motion : "longitudinal" or "lateral"; None for each that the records excite and have the channels for.
    """

    model: str = "aircraft"
    hold_out: tuple[str, ...] | None = None
    threads: int = 1
    seed: int = 0
    effects: tuple[str | Effect, ...] | None = None
    time_budget_s: float | None = None
    increments: bool | None = None
    motion: str | None = None

    @property
    def keys(self) -> tuple[str, ...] | None:
        """Keys and names of the candidates; None for the library."""
        if self.effects is None:
            return None
        return tuple(one.key if isinstance(one, Effect) else one for one in self.effects)

    @property
    def learns(self) -> bool:
        """Whether increments are learned."""
        return self.effects is None if self.increments is None else self.increments

    def __post_init__(self) -> None:
        """Refuse values outside their range.

        Raises
        ------
        ConfigurationError
            Naming the option, its value and what is allowed.
        """
        if self.model not in MODELS:
            raise ConfigurationError(f"--model {self.model!r}: {choices(self.model, MODELS)}")
        if self.motion is not None and self.motion not in MOTIONS:
            raise ConfigurationError(f"--motion {self.motion!r}: {choices(str(self.motion), MOTIONS)}")
        if self.threads < 1:
            raise ConfigurationError(f"--jobs {self.threads}: must be at least 1")
        require_whole("seed", self.seed, 0)
        if self.hold_out is not None:
            object.__setattr__(self, "hold_out", names("hold_out", self.hold_out, "light-00001"))
        if self.effects is not None:
            object.__setattr__(self, "effects", _candidates(self.effects))
        if self.time_budget_s is not None and not 0.0 <= self.time_budget_s < math.inf:
            raise ConfigurationError(
                f"--time-budget {self.time_budget_s}: must be a number of seconds, 0 or more"
            )


def _candidates(given: Any) -> tuple[str | Effect, ...]:
    """Keys of the library, and effects that are not in it."""
    if isinstance(given, Effect):
        return (_candidate(given),)
    several = () if isinstance(given, str) or not isinstance(given, Iterable) else tuple(given)
    if not any(isinstance(one, Effect) for one in several):
        return names("effects", given, "elevator_delay")
    keys = iter(names("effects", [one for one in several if not isinstance(one, Effect)], "elevator_delay"))
    return tuple(_candidate(one) if isinstance(one, Effect) else next(keys) for one in several)


def _candidate(effect: Effect) -> str | Effect:
    """The key of an effect of the library, or the effect itself."""
    known = EFFECTS.get(effect.key)
    if known == effect:
        return effect.key
    if known is not None:
        raise ConfigurationError(
            f"effects: the library has another effect with the key {effect.key}; give yours another name or variant"
        )
    if effect.in_derivatives:
        raise ConfigurationError(
            f"effects: {effect.key} changes the derivatives by a cause, which only the library can; state its aero terms"
        )
    return effect


__all__ = ["MODELS", "TraceOptions"]
