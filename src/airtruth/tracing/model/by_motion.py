"""Equations of a motion, chosen by the type of its aircraft.

A kernel calls `rates`, `outputs`, `air_at` and `move_plays`; numba compiles into it those of the motion whose tuples it is
given, so that one source serves every motion and no branch is left in the loop. A motion registers its equations
(`register`) with the types of its aircraft and of its inputs along a record.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import by_types
from airtruth.tracing.model.kernel_input import AnyGrid, AnyPoint, FilterModel

Array = NDArray[np.float64]


class MotionEquations(NamedTuple):
    """Equations of one motion; functions but ``settle`` are `airtruth.numerics.compiled.inner`.

    Attributes
    ----------
    states, early : numbers of its states and of its early outputs; one more output is late.
    rates, outputs, air_at, move_plays : as the functions of this module.
    settle : (state, inputs, model) -> None: the effects' states into equilibrium with the states of the motion.
    shifted : (inputs at one time, number of a field, amount) -> the inputs with the amount added to the field.
    signals_at : (state, inputs, rate of the first state, model, out) -> None: the signals of
        `airtruth.tracing.model.tangent.flown_of` into ``out``.
    point : type of its inputs at one time, with the fields of those along a record: controls first, coefficients last.
    coefficients : number of its coefficients.
    has_roll_gust : whether a state of a roll gust, of unit variance, follows the other states of the gusts.
    """

    states: int
    early: int
    rates: Callable[..., float]
    outputs: Callable[..., None]
    air_at: Callable[..., AnyPoint]
    move_plays: Callable[..., None]
    settle: Callable[[Array, AnyPoint, FilterModel], None]
    shifted: Callable[..., AnyPoint]
    signals_at: Callable[..., None]
    point: Any
    coefficients: int
    has_roll_gust: bool = False


_OF: Final[dict[type, MotionEquations]] = {}
"""Type of an aircraft, and type of its inputs along a record -> equations."""


def register(aircraft: type, grid: type, equations: MotionEquations) -> None:
    """State the equations of a motion.

    Parameters
    ----------
    aircraft : type of `FilterModel.aircraft`; grid : type of `KernelInput.grid`.
    """
    _OF[aircraft] = _OF[grid] = _OF[equations.point] = equations


def equations_of(model: FilterModel) -> MotionEquations:
    """Equations of a model."""
    return _OF[type(model.aircraft)]


def equations_of_grid(grid: tuple[Array, ...]) -> MotionEquations:
    """Equations of inputs along a record."""
    return _OF[type(grid)]


def coefficients_of(grid: tuple[Array, ...]) -> tuple[str, ...]:
    """Names of the increments of coefficients among inputs along a record."""
    own = _OF[type(grid)]
    return tuple(own.point._fields[-own.coefficients :])


def _typed(model: Any) -> MotionEquations:
    """Equations by numba's type of a model."""
    return _OF[model.types[model.fields.index("aircraft")].instance_class]


def _states(model: Any) -> Callable[..., int]:
    number = _typed(model).states
    return lambda model: number


def _early(model: Any) -> Callable[..., int]:
    number = _typed(model).early
    return lambda model: number


def _all_outputs(model: Any) -> Callable[..., int]:
    number = _typed(model).early + 1
    return lambda model: number


def _rates(x: Any, at: Any, model: Any, out: Any) -> Callable[..., float]:
    own = _typed(model).rates
    return lambda x, at, model, out: own(x, at, model, out)


def _outputs(x: Any, rate: Any, force: Any, at: Any, model: Any, y: Any) -> Callable[..., None]:
    own = _typed(model).outputs
    return lambda x, rate, force, at, model, y: own(x, rate, force, at, model, y)


def _air_at(grid: Any, point: Any) -> Callable[..., AnyPoint]:
    own = _OF[grid.instance_class].air_at
    return lambda grid, point: own(grid, point)


def _signals_at(x: Any, at: Any, rate: Any, model: Any, out: Any) -> Callable[..., None]:
    own = _typed(model).signals_at
    return lambda x, at, rate, model, out: own(x, at, rate, model, out)


def _shifted(at: Any, field: Any, by: Any) -> Callable[..., AnyPoint]:
    own = _OF[at.instance_class].shifted
    return lambda at, field, by: own(at, field, by)


def _coefficient_field(grid: Any) -> Callable[..., int]:
    own = _OF[grid.instance_class]
    first = len(own.point._fields) - own.coefficients
    return lambda grid: first


def _move_plays(x: Any, at: Any, model: Any) -> Callable[..., None]:
    own = _typed(model).move_plays
    return lambda x, at, model: own(x, at, model)


@by_types(_states)
def state_count(model: FilterModel) -> int:
    """Number of states of the motion; those of the gusts follow."""
    raise NotImplementedError


@by_types(_early)
def early_count(model: FilterModel) -> int:
    """Number of outputs that the motion alone gives; the late one follows."""
    raise NotImplementedError


@by_types(_all_outputs)
def output_count(model: FilterModel) -> int:
    """Number of outputs."""
    raise NotImplementedError


@by_types(_rates)
def rates(x: Array, at: AnyPoint, model: FilterModel, out: Array) -> float:
    """x' of the motion, the gusts and the effects' states into ``out``; returns the force of the late output at the CG [m/s2].

    A play has no x': that of a lag in its place serves the linearisation, and `airtruth.tracing.model.effect_states.hold_plays`
    and `move_plays` replace it.
    """
    raise NotImplementedError


@by_types(_outputs)
def outputs(x: Array, rate: Array, force: float, at: AnyPoint, model: FilterModel, y: Array) -> None:
    """Readings of the sensors without bias, lag, delay and noise, into ``y`` [units of the outputs].

    Parameters
    ----------
    rate : (states,) x'; force : of the late output at the CG [m/s2]. Early outputs need neither.
    """
    raise NotImplementedError


@by_types(_air_at)
def air_at(grid: AnyGrid, point: int) -> AnyPoint:
    """Inputs at a point of the filter's grid."""
    raise NotImplementedError


@by_types(_signals_at)
def signals_at(x: Array, at: AnyPoint, rate: float, model: FilterModel, out: Array) -> None:
    """The signals of terms at a state into ``out``; ``rate``: x' of the first state [rad/s]."""
    raise NotImplementedError


@by_types(_coefficient_field)
def coefficient_field(grid: AnyGrid) -> int:
    """Number of the field of the first increment of a coefficient among the inputs."""
    raise NotImplementedError


@by_types(_shifted)
def shifted(at: AnyPoint, field: int, by: float) -> AnyPoint:
    """Inputs with an amount added to one of them [its unit]; controls are the first fields, coefficients the last."""
    raise NotImplementedError


@by_types(_move_plays)
def move_plays(x: Array, at: AnyPoint, model: FilterModel) -> None:
    """Move the states of plays to no more than their half width from their signals."""
    raise NotImplementedError


__all__ = [
    "MotionEquations",
    "air_at",
    "coefficient_field",
    "coefficients_of",
    "early_count",
    "equations_of",
    "equations_of_grid",
    "move_plays",
    "output_count",
    "outputs",
    "rates",
    "register",
    "shifted",
    "signals_at",
    "state_count",
]
