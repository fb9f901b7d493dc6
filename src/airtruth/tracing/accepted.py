"""An accepted effect as trace.json states it: estimates of its parameters, or the table of a learned increment."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Literal

from airtruth.effects.registry import EFFECTS


@dataclass(frozen=True)
class IncrementTable:
    """A learned increment over its signal; it is constant outside.

    Attributes
    ----------
    at : (points,) of the signal, or of the state that it drives [unit of the signal].
    value, low, high : increment of the coefficient [-], of a derivative [1/rad, -] or of a reading [its unit], and its 95 %
        band.
    samples : number of samples of the fitted records nearest to each point [-].
    trim : where the increment is zero by definition [unit of the signal]; None in an answer of an earlier version.
    """

    at: tuple[float, ...]
    value: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    samples: tuple[int, ...]
    trim: float | None = None

    @property
    def origin(self) -> float:
        """The trim; without one, the middle of the points where the band vanishes [unit of the signal]."""
        if self.trim is not None:
            return self.trim
        zero = [x for x, low, high in zip(self.at, self.low, self.high, strict=True) if low == high]
        return sum(zero) / len(zero) if zero else 0.0

    @property
    def onset(self) -> tuple[float | None, float | None]:
        """Points below and above the trim from which the band excludes zero; None where it contains zero to the end."""
        sure = [x for x, low, high in zip(self.at, self.low, self.high, strict=True) if low * high > 0.0]
        return (
            max((x for x in sure if x < self.origin), default=None),
            min((x for x in sure if x > self.origin), default=None),
        )

    @property
    def steepest(self) -> int:
        """Number of the first point of the steepest cell, which is that of a step."""
        rises = [abs(after - before) for before, after in pairwise(self.value)]
        return rises.index(max(rises))

    def to_dict(self) -> dict[str, list[float] | float | None]:
        """Keys of trace.json."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}


@dataclass(frozen=True)
class IncrementState:
    """A state between a signal and a learned increment, see `airtruth.physics.terms.StateTerm`.

    Attributes
    ----------
    kind : "lag", "mode" or "play"; signal : what drives it.
    time_s : time constant, or 1/wn of a mode [s]; 0 of a play.
    damping : damping ratio of a mode [-].
    half_width : of a play [unit of the signal].
    """

    kind: Literal["lag", "mode", "play"]
    signal: str
    time_s: float
    damping: float = 0.0
    half_width: float = 0.0


@dataclass(frozen=True)
class ParameterEstimate:
    """Estimate of one parameter of an effect, in the parameter's unit.

    Attributes
    ----------
    value, std : estimate and standard deviation.
    ci95 : ends of the 95 % interval; None for an end at infinity.
    """

    value: float
    std: float
    ci95: tuple[float | None, float | None]

    def to_dict(self) -> dict[str, Any]:
        """Value, standard deviation and interval."""
        return {"value": self.value, "std": self.std, "ci95": list(self.ci95)}


@dataclass(frozen=True)
class AcceptedEffect:
    """An effect that the declared aircraft lacks.

    Attributes
    ----------
    name, variant : of the effect; the variant is empty where the effect has only one.
    parameters : name -> estimate.
    p_value : probability of such a gain by chance, corrected for the number of candidates [-].
    separation_sigma : distance to the next effect, the square root of the difference in 2 log L [-].
    indistinguishable_from : names of the effects that explain the records as well.
    gain_2_log_likelihood : gain in 2 log L of the refit [-]; None where an old file does not state it.
    other_variants : variants of the same effect that explain the records as well.
    channel : column of the log that the variant names; None where the variant is no column.
    about_alpha_rad : angle of attack about which a curvature counts [rad]; None for other effects.
    acts_on, over : of a learned increment: coefficient, and the signal on which it depends; None for other effects.
    by, by_at : of a learned increment of a derivative: the signal that multiplies the table, and from where it counts; of
        a lag that changes: the signal that is late.
    relative_size : its swing over that of the declared derivative in the flown range [-]; of a linear one its share.
    table : the increment with its band; None for a linear one, whose share is a parameter.
    states : what lies between signal and increment; empty for a function of the signal itself.
    """

    name: str
    parameters: dict[str, ParameterEstimate]
    p_value: float
    separation_sigma: float
    indistinguishable_from: tuple[str, ...] = ()
    variant: str = ""
    gain_2_log_likelihood: float | None = None
    other_variants: tuple[str, ...] = ()
    channel: str | None = None
    about_alpha_rad: float | None = None
    acts_on: str | None = None
    over: str | None = None
    by: str | None = None
    by_at: float = 0.0
    relative_size: float | None = None
    table: IncrementTable | None = None
    states: tuple[IncrementState, ...] = ()

    @property
    def key(self) -> str:
        """Name with the variant."""
        return effect_key(self.name, self.variant)

    @property
    def label(self) -> str:
        """Name in sets of effects, see `airtruth.effects.effect.Effect.label`."""
        return EFFECTS[self.key].label if self.key in EFFECTS else self.name

    @property
    def subject(self) -> str:
        """Coefficient or reading of a learned increment, or its derivative: `Cm by elevator_rad`; empty for other effects."""
        if self.by:
            return f"{self.acts_on} by {'a lag of ' if self.states else ''}{self.by}"
        return self.acts_on or ""

    def to_dict(self) -> dict[str, Any]:
        """Keys of trace.json; those that do not apply are left out."""
        row: dict[str, Any] = {
            "name": self.name,
            "variant": self.variant,
            "parameters": {name: p.to_dict() for name, p in self.parameters.items()},
            "p_value": self.p_value,
            "separation_sigma": self.separation_sigma,
            "indistinguishable_from": list(self.indistinguishable_from),
        }
        optional = {
            "gain_2_log_likelihood": self.gain_2_log_likelihood,
            "other_variants": list(self.other_variants) or None,
            "channel": self.channel,
            "about_alpha_rad": self.about_alpha_rad,
        }
        found = row | {name: value for name, value in optional.items() if value is not None}
        return found | self._learned() if self.acts_on is not None else found

    def _learned(self) -> dict[str, Any]:
        return {
            "acts_on": self.acts_on,
            "over": self.over,
            **({} if self.by is None else {"by": self.by, "by_at": self.by_at}),
            "relative_size": self.relative_size,
            "table": None if self.table is None else self.table.to_dict(),
            "states": [asdict(state) for state in self.states],
        }


def effect_key(name: str, variant: str) -> str:
    """Name of an effect with its variant, ``name:variant``."""
    return f"{name}:{variant}" if variant else name


__all__ = ["AcceptedEffect", "IncrementState", "IncrementTable", "ParameterEstimate", "effect_key"]
