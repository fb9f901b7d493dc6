"""An effect: its name, its parameters, and what it changes at given values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from airtruth.effects.change import Change
from airtruth.errors import ConfigurationError, choices
from airtruth.units import UNITS


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Attributes
    ----------
    name, unit, meaning : ``name`` ends in its unit where it has one; a unit is a key of `airtruth.units.UNITS`,
        "-" for none.
    low, high : plausible range [unit].
    material : smallest distance from neutral that matters, in the coordinate `size` [see there].
    neutral : value at which the effect changes nothing; infinite for a reciprocal coordinate. A place
        (where something happens, rather than how much) has none that counts.
    reciprocal : the size is 1/value (a bandwidth, a rate limit) rather than value - neutral.
    time_constant : with ``reciprocal``: the size is 1/(2 pi value), a bandwidth in Hz as a time constant [s].
    place : the parameter is a place: it cannot be seen while the effect's size is zero.
    one_sided : sizes below zero mean nothing.
    prior_std : standard deviation of the size before any data, None for none.
    step : size of a step for differences about neutral; for an effect that begins non-smoothly, a finite one.
    """

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    material: float
    neutral: float = 0.0
    reciprocal: bool = False
    time_constant: bool = False
    place: bool = False
    one_sided: bool = False
    prior_std: float | None = None
    step: float = 1e-4

    @property
    def is_limit(self) -> bool:
        """Whether nothing happens until the value is low enough: the size zero has no slope to begin with."""
        return self.reciprocal and not self.time_constant

    @property
    def ends(self) -> tuple[float, float]:
        """Sizes at the ends of the plausible range, the smaller first."""
        low, high = sorted((self.size(self.low), self.size(self.high)))
        return low, high

    @property
    def reach(self) -> tuple[float, float]:
        """Plausible sizes, and none: a reciprocal may vanish, and one-sided sizes begin at zero."""
        low, high = self.ends
        return (0.0 if self.reciprocal else max(low, 0.0) if self.one_sided else low), high

    def size(self, value: float) -> float:
        """Coordinate that is zero at neutral and in which the effect grows smoothly."""
        if not self.reciprocal:
            return value - (0.0 if self.place else self.neutral)
        return 1.0 / (value * (2.0 * math.pi if self.time_constant else 1.0))

    def spellings(self) -> dict[str, float]:
        """Keys by which a file may state the value, and the factor of each to the parameter's unit."""
        units = next((u for u in UNITS.values() if self.unit in u), {})
        stem = self.name.removesuffix(f"_{self.unit}")
        return {self.name: 1.0} | {f"{stem}_{u}": f / units[self.unit] for u, f in units.items() if u}

    def value(self, size: float) -> float:
        """The inverse of `size`."""
        if not self.reciprocal:
            return size + (0.0 if self.place else self.neutral)
        if size <= 0.0:
            return math.inf
        return 1.0 / (size * (2.0 * math.pi if self.time_constant else 1.0))


@dataclass(frozen=True)
class Effect:
    """A physical effect that a declared model may lack.

    Attributes
    ----------
    name : public name; several variants (a break or a curve, one channel or another) may share it.
    variant : which of them, "" if there is only one.
    where : "surface", "dynamics", "declared", "sensor" or "air".
    parameters : the size comes first; places after it.
    describe : values by name -> what changes.
    channels : columns of the log that it needs beyond those every log has.
    explanation : one or two sentences for `airtruth effects`.
    source : where the equation and the material size come from.
    splits : manoeuvre or sensor that tells it from its look-alikes.
    """

    name: str
    where: Literal["surface", "dynamics", "declared", "sensor", "air"]
    parameters: tuple[Parameter, ...]
    describe: Callable[[Mapping[str, float]], Change]
    explanation: str
    source: str
    variant: str = ""
    channels: tuple[str, ...] = ()
    splits: str = ""

    @property
    def key(self) -> str:
        """Unique name: NAME, or NAME:VARIANT."""
        return f"{self.name}:{self.variant}" if self.variant else self.name

    def change(self, values: Mapping[str, float]) -> Change:
        """What the effect changes at these values.

        Raises
        ------
        ConfigurationError
            If a parameter is missing, unknown or not a number.
        """
        names = [p.name for p in self.parameters]
        for name, value in values.items():
            if name not in names:
                raise ConfigurationError(f"effect {self.key}: parameter {name!r}: {choices(name, names)}")
            if math.isnan(value):
                raise ConfigurationError(f"effect {self.key}: parameter {name!r} is not a number")
        missing = [name for name in names if name not in values]
        if missing:
            raise ConfigurationError(f"effect {self.key}: parameter {missing[0]!r} is missing")
        return self.describe(values)

    def read(self, raw: Mapping[str, Any]) -> dict[str, float]:
        """Values as a file states them, turned into the parameters' own units.

        Parameters
        ----------
        raw : a parameter's name, or the name with another unit at its end (``delay_ms`` for ``delay_s``,
            ``value_deg`` for ``value`` of a bias), to a number.

        Raises
        ------
        ConfigurationError
            If a key is unknown, a parameter is missing or given twice, or a value is not a number or outside
            the parameter's range. The neutral value is always allowed.
        """
        keys = {key: (p.name, factor) for p in self.parameters for key, factor in p.spellings().items()}
        found: dict[str, float] = {}
        for key, value in raw.items():
            if key not in keys:
                raise ConfigurationError(
                    f"effect {self.key}: {key!r} is not a parameter; {choices(key, keys)}"
                )
            name, factor = keys[key]
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ConfigurationError(f"effect {self.key}: {key} has to be a number (found {value!r})")
            if name in found:
                raise ConfigurationError(f"effect {self.key}: {key}: {name} is given twice")
            found[name] = value * factor
        for p in self.parameters:
            if p.name not in found:
                raise ConfigurationError(
                    f"effect {self.key}: {p.name} is missing ({p.meaning}); write one of {', '.join(p.spellings())}"
                )
            value = found[p.name]
            if not (p.low <= value <= p.high or (value == p.neutral and not p.place)):
                raise ConfigurationError(
                    f"effect {self.key}: {p.name} = {value:g} is outside its range of {p.low:g} to {p.high:g} {p.unit}"
                )
        return found
