"""Common parts of the tables of a campaign file: quantities with their unit in the key, and distributions of draws."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from airtruth import quantity as qt
from airtruth.errors import choices
from airtruth.quantity import Strict

Array = NDArray[np.float64]


class Constant(Strict):
    """One value for every run."""

    value: float

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        return np.full(runs, self.value)


class Normal(Strict):
    """Normal distribution."""

    mean: float
    std: float = Field(ge=0.0)

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        return self.mean + self.std * rng.standard_normal(runs)


class Uniform(Strict):
    """Uniform distribution."""

    low: float
    high: float

    @model_validator(mode="after")
    def _ordered(self) -> Uniform:
        if self.low > self.high:
            raise ValueError(f"low = {self.low:g} is above high = {self.high:g}")
        return self

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        return self.low + (self.high - self.low) * rng.random(runs)


class Choice(Strict):
    """One of a list, each equally likely."""

    choose: tuple[float, ...] = Field(min_length=1)

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        picked = np.floor(rng.random(runs) * len(self.choose)).astype(np.int64)
        values: Array = np.array(self.choose, dtype=np.float64).take(picked)
        return values


Distribution = Constant | Normal | Uniform | Choice
"""A distribution from which each run draws a value."""

_DISTRIBUTIONS: Final[tuple[tuple[frozenset[str], type[Distribution]], ...]] = (
    (frozenset({"value"}), Constant),
    (frozenset({"mean", "std"}), Normal),
    (frozenset({"low", "high"}), Uniform),
    (frozenset({"choose"}), Choice),
)
"""Keys that a file states of a distribution, and its model."""


def distribution(raw: Any) -> Any:
    """Read a number or a table as a distribution.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if isinstance(raw, bool):
        raise ValueError("write a number or a distribution, not true or false")
    if isinstance(raw, int | float):
        return Constant(value=raw)
    if isinstance(raw, Mapping):
        for keys, model in _DISTRIBUTIONS:
            if set(raw) == keys:
                return model.model_validate(raw)
    if isinstance(raw, Strict):
        return raw
    raise ValueError("write a number, { mean, std }, { low, high } or { choose = [...] }")


Draw = Annotated[Distribution, BeforeValidator(distribution)]
"""A field that a file states as a number or a distribution."""


def one_of(names: Iterable[str]) -> Callable[[str], str]:
    """Check of a text field against the names that it may have.

    Parameters
    ----------
    names : allowed values.
    """

    def check(value: str) -> str:
        if value not in names:
            raise ValueError(f"{value!r} is not known; {choices(value, names)}")
        return value

    return check


class Table(Strict):
    """A table whose keys may end in a unit of their dimension in ``dimensions``."""

    dimensions: ClassVar[dict[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _to_si(cls, raw: Any) -> Any:
        return qt.keys_to_si(raw, cls.dimensions) if isinstance(raw, Mapping) else raw


__all__ = [
    "Choice",
    "Constant",
    "Distribution",
    "Draw",
    "Normal",
    "Table",
    "Uniform",
    "distribution",
    "one_of",
]
