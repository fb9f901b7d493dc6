"""Choices of a trace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from airtruth.errors import ConfigurationError, choices

MODELS: Final = ("aircraft", "linear")


@dataclass(frozen=True)
class TraceOptions:
    """Choices of a trace.

    Attributes
    ----------
    model : "aircraft" probes the declared JSBSim aircraft; "linear" takes the linear short-period model of
        its derivatives. An aircraft without a JSBSim model is linear in any case.
    hold_out : runs kept for the report; None holds out every third, never the only one.
    threads : records worked on at a time; the answer does not depend on it.
    seed : of the draws behind p-values.
    effects : keys of the candidates, a name alone for all of its variants; None for the whole library.
    refitted : write the refitted derivatives into the updated aircraft too; those that a curvature sets free are
        written in any case.
    """

    model: str = "aircraft"
    hold_out: tuple[str, ...] | None = None
    threads: int = 1
    seed: int = 0
    effects: tuple[str, ...] | None = None
    refitted: bool = True

    def __post_init__(self) -> None:
        """Refuse values that mean nothing.

        Raises
        ------
        ConfigurationError
            Naming the option, its value and what is allowed.
        """
        if self.model not in MODELS:
            raise ConfigurationError(f"--model {self.model!r}: {choices(self.model, MODELS)}")
        if self.threads < 1:
            raise ConfigurationError(f"--jobs {self.threads}: must be at least 1")
