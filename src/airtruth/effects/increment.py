"""Learned increments as effects; their shapes are those of `airtruth.effects.increment_shape`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from airtruth.effects.effect import Effect, Parameter
from airtruth.effects.increment_shape import (
    AXIAL,
    NAME,
    SIGNAL_NAMES,
    SIGNALS,
    SLOPE,
    STEP,
    STEPS,
    Memory,
    Shape,
)
from airtruth.physics.motion import MOTIONS

_COEFFICIENTS: Final = {c.name: c for m in MOTIONS.values() for c in m.coefficients}
"""Name -> coefficient of a motion."""
_DIFFERENCE: Final[Mapping[str, float]] = {
    "force": 1e-3,
    "moment": 1e-4,
    "axial": 1e-4,
    "rad": 1e-4,
    "rad_s": 1e-3,
    "m_s2": 1e-2,
}
"""Step of the differences in a bend [-, unit of the channel] (judgement: small against noise, large against rounding)."""
_REACH: Final[Mapping[str, float]] = {
    "force": 1.0,
    "moment": 0.3,
    "axial": 0.1,
    "rad": 0.1,
    "rad_s": 1.0,
    "m_s2": 30.0,
}
"""Largest bend over one cell [-, unit of the channel] (judgement: the lift and the moment of a stall; 6 deg of a vane)."""
_RATE: Final = 30.0
"""Rate over its nondimensional value by which the share of a reading over it exceeds one over an angle [-] (judgement)."""
_DERIVATIVE: Final[Mapping[str | None, float]] = {None: 7.0, "chord": 200.0, "span": 20.0}
"""Increment of a derivative over one of a coefficient [1/rad, -], by the reference length of the factor (judgement: Cm of 0.3
over a Cmde of 2 and a Cmq of 60; rates over the span are smaller by its ratio to the chord)."""
_HELD: Final = 1e-6
"""Standard deviation over its largest value of a slope that is held [-]: none but for rounding."""
_REACH_OF_MEMORY: Final = 3.0
"""Largest ratio by which a refit may change a time constant or a half width [-] (judgement: the grid's steps are smaller)."""


@dataclass(frozen=True)
class Increment(Effect):
    """A learned increment as an effect; its parameters are those of its function, or the share of a linear one, and its times.

    Attributes
    ----------
    shape : where it acts, and by which functions.
    """

    shape: Shape = field(kw_only=True)

    @property
    def label(self) -> str:
        """Name of all learned increments."""
        return self.name

    @property
    def bends(self) -> int:
        """Number of bends, the slope among them; 1 for a linear increment."""
        return max(len(self.shape.coefficients), 1)

    def with_prior(self, std: float) -> Increment:
        """The effect with another standard deviation of the prior of its bends and slope [-]."""
        first = tuple(replace(p, prior_std=std) for p in self.parameters[: self.bends])
        return replace(self, parameters=first + self.parameters[self.bends :])

    def with_slope_held(self) -> Increment:
        """The effect with a slope that the records do not change."""
        held = (replace(p, prior_std=_HELD * p.high) if p.name == SLOPE else p for p in self.parameters)
        return replace(self, parameters=tuple(held))


def increment(shape: Shape, prior_std: float = math.inf) -> Increment:
    """The effect of a shape.

    Parameters
    ----------
    shape : where it acts, and by which functions.
    prior_std : standard deviation of the prior of its bends and slope [-].
    """
    size = "share" if not shape.cells else ""
    names = [size] if size else list(shape.coefficients)
    kind, scale = _kind(shape.acts_on), _scale(shape)
    reach, step = scale * _REACH[kind], scale * _DIFFERENCE[kind]
    if size:
        rate = _RATE if shape.of_reading and SIGNALS[shape.signal].length is not None else 1.0
        reach, step = 20.0 * rate * reach, 100.0 * rate * step
    meanings = {
        "share": "part that acts through the state [1/unit of the signal]",
        SLOPE: "rise over the cell of the trim",
        STEP: "rise over the cell of the step",
    }
    parameters = [
        Parameter(
            name,
            "-",
            meanings.get(name, "bend over one cell"),
            -reach,
            reach,
            0.0,
            step=step,
            prior_std=prior_std,
        )
        for name in names
    ]
    if shape.memory is not None:
        parameters += [
            _of_memory(name, value, shape.memory) for name, value in shape.estimated_memory.items()
        ]
    acts = _words(shape.acts_on)
    return Increment(
        name=NAME,
        variant=shape.variant,
        where="sensor" if shape.of_reading else "dynamics",
        parameters=tuple(parameters),
        describe=shape.terms,
        explanation=f"An increment of the {acts} that no effect of the library describes, learned from the records.",
        source="Penalised linear spline (S. N. Wood, Generalized Additive Models, 2nd ed., 2017, section 5.3).",
        distinguished_by="Records that cover its range slowly and fast separate a function from memory.",
        shape=shape,
    )


def _kind(acts_on: str) -> str:
    """Key of `_REACH` and `_DIFFERENCE`: kind of a coefficient, or unit of a channel."""
    if acts_on in _COEFFICIENTS:
        return "force" if _COEFFICIENTS[acts_on].length is None else "moment"
    units = (unit for unit in sorted(_REACH, key=len, reverse=True) if acts_on.endswith(f"_{unit}"))
    return next(units, "axial")


def _scale(shape: Shape) -> float:
    """Increment of what a shape acts on over one of a coefficient: larger for a derivative."""
    return _DERIVATIVE[SIGNALS[shape.factor].length] if shape.factor else 1.0


def _words(acts_on: str) -> str:
    """The coefficient on which an increment acts, in words."""
    if acts_on in _COEFFICIENTS:
        return _COEFFICIENTS[acts_on].description.partition(",")[0]
    return "axial force" if acts_on == AXIAL else f"reading of {acts_on}"


def _of_memory(name: str, value: float, memory: Memory) -> Parameter:
    """Parameter of a memory that a refit estimates: a time constant, a damping ratio or a half width."""
    if name == "damping":
        return Parameter(name, "-", "damping ratio", 0.01, 0.7, 0.0, is_location=True, step=0.5)
    low, high = value / _REACH_OF_MEMORY, value * _REACH_OF_MEMORY
    if name == "half_width":
        return Parameter(name, "-", "half width of the play", low, high, 0.0, is_location=True, step=value)
    meaning = "time constant" if memory.kind == "lag" else "inverse of the natural frequency in rad/s"
    return Parameter(name, "s", meaning, low, high, 0.0, is_location=True, step=value)


__all__ = ["NAME", "SIGNAL_NAMES", "STEP", "STEPS", "Increment", "Memory", "Shape", "increment"]
