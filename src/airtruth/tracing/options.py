"""Choices of a trace."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from airtruth.arguments import names, require_whole
from airtruth.errors import ConfigurationError, choices

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
    effects : keys of the candidates, a string is one of them; a name without a variant selects all of its variants; None
        for the library.
    time_budget_s : time after which the search starts no new step [s]; None for no limit. The answer then depends on the
        machine, is provisional, and lists the omitted steps.
    increments : whether increments are learned from the residual of the named effects; None where the whole library is
        searched.
    """

    model: str = "aircraft"
    hold_out: tuple[str, ...] | None = None
    threads: int = 1
    seed: int = 0
    effects: tuple[str, ...] | None = None
    time_budget_s: float | None = None
    increments: bool | None = None

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
        if self.threads < 1:
            raise ConfigurationError(f"--jobs {self.threads}: must be at least 1")
        require_whole("seed", self.seed, 0)
        for name, example in (("hold_out", "light-00001"), ("effects", "elevator_delay")):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, names(name, value, example))
        if self.time_budget_s is not None and not 0.0 <= self.time_budget_s < math.inf:
            raise ConfigurationError(
                f"--time-budget {self.time_budget_s}: must be a number of seconds, 0 or more"
            )
