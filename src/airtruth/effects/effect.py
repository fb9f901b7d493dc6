"""An effect: its name, its parameters, and the terms that it changes at given values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from airtruth.channels import SIGNALS
from airtruth.errors import ConfigurationError, choices
from airtruth.physics.composition import PARTS
from airtruth.physics.motion import LONGITUDINAL, MOTIONS, Motion
from airtruth.physics.resolution import LinearPoint, resolved
from airtruth.physics.terms import LATE, Change, coefficients_of
from airtruth.quantity import LARGEST
from airtruth.units import UNITS, printed

GTM: Final[Mapping[str, float]] = {
    "CLalpha": 4.787,
    "CLq": 31.7,
    "Cmalpha": 1.785,
    "Cmq": 41.2,
    "Cmde": 1.787,
    "Clbeta": 0.140,
    "Clda": 0.0718,
    "Cnbeta": 0.219,
}
"""Magnitudes of the derivatives for which material sizes are stated (aircraft/gtm/aircraft.toml; lateral ones of the JSBSim
model) [-]."""
_LEAST_RATIO: Final = 0.1
"""Least ratio of a derivative to that of the GTM by which a material size scales [-] (judgement: a derivative near zero is no
measure of what matters)."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: its size, or a location at which it acts.

    Attributes
    ----------
    name, unit, meaning : ``name`` ends in its unit if it has one; a unit is a key of `airtruth.units.UNITS`,
        "-" for none.
    low, high : plausible range [unit].
    material : smallest `size` that matters to a user; see the effect's source for the reason.
    neutral : value at which the effect changes nothing; infinite for a reciprocal parameter. A location has none.
    reciprocal : whether the size is 1/value (a bandwidth, a rate limit) instead of value - neutral.
    time_constant : with ``reciprocal``: the size is 1/(2 pi value), the time constant [s] of a bandwidth in Hz.
    is_location : whether it is a location (an angle of attack, a frequency): it has no influence while the size of the
        effect is zero.
    one_sided : whether sizes below zero have no meaning.
    step : size of a step for differences about neutral; a finite one where the effect sets in abruptly.
    default : value where a file or a caller states none; None where it has to be stated.
    sign : sign of the size of every real aircraft, 0 where both occur. A campaign may fly the other; a trace does not
        accept it.
    spans : largest size in wing spans of a real aircraft; a trace accepts no larger one.
    prior_std, prior_mean : of a normal prior of the size; an infinite standard deviation for none.
    scales_with : derivative with which ``material`` scales, which is that of the GTM; empty for none.
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
    is_location: bool = False
    one_sided: bool = False
    step: float = 1e-4
    default: float | None = None
    sign: Literal[-1, 0, 1] = 0
    spans: float = math.inf
    prior_std: float = math.inf
    prior_mean: float = 0.0
    scales_with: str = ""

    def for_aircraft(self, derivatives: Mapping[str, float]) -> Parameter:
        """The parameter with the material size of an aircraft, by its derivatives; at most that of the GTM.

        Examples
        --------
        >>> change = Parameter("dCmalpha", "-", "change of Cmalpha", -4.0, 4.0, 0.1, scales_with="Cmalpha")
        >>> change.for_aircraft({"Cmalpha": -0.8925}).material
        0.05
        """
        if not self.scales_with:
            return self
        ratio = abs(derivatives[self.scales_with]) / GTM[self.scales_with]
        return replace(self, material=self.material * min(1.0, max(ratio, _LEAST_RATIO)))

    @property
    def is_limit(self) -> bool:
        """Whether nothing happens until the value is low enough, so that the slope at size zero vanishes."""
        return self.reciprocal and not self.time_constant

    @property
    def ends(self) -> tuple[float, float]:
        """Sizes at the ends of the plausible range, the smaller first."""
        low, high = sorted((self.size(self.low), self.size(self.high)))
        return low, high

    @property
    def reach(self) -> tuple[float, float]:
        """Range of plausible sizes; that of a reciprocal or one-sided parameter begins at zero."""
        low, high = self.ends
        return (0.0 if self.reciprocal else max(low, 0.0) if self.one_sided else low), high

    def size(self, value: float) -> float:
        """Coordinate that is zero at neutral and in which the effect grows smoothly.

        Examples
        --------
        >>> Parameter("factor", "-", "on the mass", 0.7, 1.4, 0.02, neutral=1.0).size(1.25)
        0.25
        """
        if not self.reciprocal:
            return value - (0.0 if self.is_location else self.neutral)
        return 1.0 / (value * (2.0 * math.pi if self.time_constant else 1.0))

    def value(self, size: float) -> float:
        """Inverse of `size`.

        Examples
        --------
        >>> Parameter("rate_rad_s", "rad_s", "limit", 0.1, 20.0, 0.5, math.inf, reciprocal=True).value(0.5)
        2.0
        """
        if not self.reciprocal:
            return size + (0.0 if self.is_location else self.neutral)
        if size <= 0.0:
            return math.inf
        return 1.0 / (size * (2.0 * math.pi if self.time_constant else 1.0))

    def spellings(self) -> dict[str, float]:
        """Keys by which a file may state the value, with the factor of each to the parameter's unit."""
        units = next((u for u in UNITS.values() if self.unit in u), {})
        stem = self.name.removesuffix(f"_{self.unit}")
        return {self.name: 1.0} | {f"{stem}_{u}": f / units[self.unit] for u, f in units.items() if u}


def factor(meaning: str, low: float, high: float, material: float) -> Parameter:
    """A parameter named ``factor`` that multiplies a declared quantity; one is neutral.

    Parameters
    ----------
    meaning, low, high, material : as of `Parameter` [-].
    """
    return Parameter("factor", "-", meaning, low=low, high=high, material=material, neutral=1.0, step=1e-3)


@dataclass(frozen=True)
class Prior:
    """Prior knowledge of an effect that explains changed derivatives, in the units of its size.

    Attributes
    ----------
    std : standard deviation of the size [-]; low, high : its plausible range.
    shape : relative uncertainty of each element of its direction [-]; the default is of one that follows from definitions,
        second order in the size (judgement).
    log_odds : logarithm of its prior odds [-]; the default is of a usual cause, one in 150 (judgement: nothing missing then has a
        prior probability of two in three; one in 55 made the weights of right sets in blind trials too low by 0.16).
    """

    std: float
    low: float
    high: float
    shape: float = 0.02
    log_odds: float = -5.0


@dataclass(frozen=True)
class Effect:
    """A physical effect that a declared model may lack.

    Attributes
    ----------
    name : public name; several variants (a break or a curve, one channel or another) may share it.
    where : "surface", "dynamics", "declared", "sensor" or "air".
    parameters : the size first, then locations; the sizes alone where there are several (`in_derivatives`).
    describe : values by name -> the terms that the effect changes.
    explanation : one or two sentences for `airtruth effects`.
    source : equation with its source, and the reason of the material size.
    variant : name of the variant, "" if there is only one.
    distinguished_by : manoeuvre or sensor that separates it from effects with a similar response, as a sentence.
    in_derivatives : whether it changes the derivatives of a motion, by an amount that depends on the aircraft at its trim
        (`airtruth.physics.terms.DerivativeTerm`).
    prior : of an effect that explains changed derivatives; None of any other.
    event : what moves it together with other effects of the same event; empty for an effect of its own.
    """

    name: str
    where: Literal["surface", "dynamics", "declared", "sensor", "air"]
    parameters: tuple[Parameter, ...]
    describe: Callable[[Mapping[str, float]], Change]
    explanation: str
    source: str
    variant: str = ""
    distinguished_by: str = ""
    in_derivatives: bool = False
    prior: Prior | None = None
    event: str = ""

    def for_aircraft(self, derivatives: Mapping[str, float]) -> Effect:
        """The effect with the material sizes of an aircraft, see `Parameter.for_aircraft`."""
        return replace(self, parameters=tuple(p.for_aircraft(derivatives) for p in self.parameters))

    @property
    def key(self) -> str:
        """Unique name: NAME, or NAME:VARIANT."""
        return f"{self.name}:{self.variant}" if self.variant else self.name

    @property
    def label(self) -> str:
        """Name in sets of effects: that of all its variants in the pitch plane, and the key elsewhere."""
        return self.name if not self.variant or self.applies_to(LONGITUDINAL) else self.key

    @property
    def channels(self) -> tuple[str, ...]:
        """Columns of a log on which it acts as an error of a sensor, sorted."""
        change = self._example
        return tuple(sorted({t.channel for t in change.sensors} | {t.channel for t in change.readings}))

    @property
    def _example(self) -> Change:
        """The terms that it changes, at one step from neutral."""
        return self.describe({p.name: p.value(p.step) for p in self.parameters})

    @property
    def quantity(self) -> str:
        """Declared quantity, or cause of changed derivatives, whose error it is; empty for any other effect."""
        change = self._example
        names = (*(t.quantity for t in change.declared), *(t.cause for t in change.derivatives))
        return names[0] if len(names) == 1 else ""

    @property
    def divides(self) -> bool:
        """Whether its factor divides coefficients, as that of a mass or an inertia does."""
        return any(d.divides for m in MOTIONS.values() for d in m.declared if d.name == self.quantity)

    @property
    def late_signal(self) -> str:
        """Channel whose reading it delays, or "surface" of its control; empty for any other effect. Its size is a time [s]."""
        change = self._example
        if any(term.kind in LATE for term in change.surface):
            return "surface"
        return next((term.channel for term in change.sensors if term.kind in LATE), "")

    @property
    def variant_channel(self) -> str | None:
        """The variant where it is a column of a log."""
        return self.variant if self.variant in SIGNALS else None

    def applies_to(self, motion: Motion) -> bool:
        """Whether every name in its terms is one of a motion, and every error of a sensor one that the motion shows.

        Of a known input, that is an error of what every motion knows, or one that an output of the motion brings about.
        """
        example = self._example
        names = example.names()
        seen = {*motion.channels, *set.intersection(*(set(m.known) for m in MOTIONS.values()))}
        shown = all(t.channel in seen or t.rate in motion.output_channels for t in example.sensors)
        parts = names & PARTS.keys()
        known = motion.names | set(coefficients_of(motion))
        of_motion = all(PARTS[name].motion == motion.name for name in parts)
        return shown and names - parts <= known and of_motion

    @property
    def acts_at_rest(self) -> bool:
        """Whether a part that it changes adds forces beside the derivatives, which the filter has to carry."""
        return any(t.cause in PARTS and PARTS[t.cause].at_rest is not None for t in self._example.derivatives)

    def at_point(self, point: LinearPoint) -> Effect:
        """The effect with its causes of changed derivatives as terms about a trim; the same one where it has none."""
        if not self.in_derivatives:
            return self
        describe = self.describe
        return replace(self, describe=lambda values: resolved(describe(values), point), in_derivatives=False)

    @property
    def motions(self) -> tuple[str, ...]:
        """Names of the motions to which it applies."""
        return tuple(name for name, motion in MOTIONS.items() if self.applies_to(motion))

    def change(self, values: Mapping[str, float]) -> Change:
        """Return the terms that the effect changes at these values.

        Parameters
        ----------
        values : parameter -> value [its unit].

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
        filled = self._defaults() | dict(values)
        missing = [name for name in names if name not in filled]
        if missing:
            raise ConfigurationError(f"effect {self.key}: parameter {missing[0]!r} is missing")
        return self.describe(filled)

    def _defaults(self) -> dict[str, float]:
        return {p.name: p.default for p in self.parameters if p.default is not None}

    def read(self, raw: Mapping[str, Any]) -> dict[str, float]:
        """Read values from a table of a file, in the parameters' own units.

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
        values: dict[str, float] = {}
        for key, value in raw.items():
            if key not in keys:
                raise ConfigurationError(
                    f"effect {self.key}: {key!r} is not a parameter; {choices(key, keys)}"
                )
            name, factor = keys[key]
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ConfigurationError(f"effect {self.key}: {key} has to be a number (is {value!r})")
            if isinstance(value, int) and abs(value) > LARGEST:
                raise ConfigurationError(
                    f"effect {self.key}: {key} has to be between -{LARGEST:g} and {LARGEST:g}"
                )
            if name in values:
                raise ConfigurationError(f"effect {self.key}: {key}: {name} is given twice")
            values[name] = value * factor
        if not values and self._defaults():
            raise ConfigurationError(
                f"effect {self.key}: every parameter is missing (each may be left out, all of them may not); write one "
                f"of {', '.join(keys)}"
            )
        values = self._defaults() | values
        for p in self.parameters:
            if p.name not in values:
                raise ConfigurationError(
                    f"effect {self.key}: {p.name} is missing ({p.meaning}); write one of {', '.join(p.spellings())}"
                )
            value = values[p.name]
            if not (p.low <= value <= p.high or (value == p.neutral and not p.is_location)):
                bounds = f"{p.low:g} to {p.high:g} {printed(p.unit)}".rstrip()
                raise ConfigurationError(
                    f"effect {self.key}: {p.name} = {value:g} is outside its range of {bounds}"
                )
        return values
