"""Derivatives of the equations of a motion in many parameters at once, chosen by the type of its aircraft.

The last axis of every array of derivatives is that of the parameters. A motion states its derivatives by `register_slopes`;
those of a motion without them are differences of flights.

Source: A. Griewank and A. Walther, *Evaluating Derivatives*, 2nd ed. (2008), section 3.1 (forward mode, several directions).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import by_types, shared
from airtruth.physics.motion import MOTIONS
from airtruth.physics.terms import signals_of
from airtruth.tracing.model.kernel_input import AnyPoint, FilterModel
from airtruth.tracing.model.parameters import ParameterLayout

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOVERS: Final = ("rotary", "thrust", "rolloff", "inertia", "mounting", "log_gust")
"""Parameters that move any motion; the derivatives and the increments at the trim follow them in `moving`."""
ROTARY, THRUST, ROLLOFF, INERTIA, MOUNTING, LOG_GUST = range(len(MOVERS))
"""Their numbers."""
_COEFFICIENTS: Final = max(len(motion.coefficients) for motion in MOTIONS.values())
"""Most coefficients of a motion [-]."""
_SIGNALS: Final = max(len(signals_of(motion)) for motion in MOTIONS.values())
"""Most signals of the terms of a motion [-]."""


class SlopeWork(NamedTuple):
    """Derivatives of what forces and readings depend on, with the parameters as the last axis.

    Attributes
    ----------
    gust : of the gust [-].
    signal : (signals, parameters) of the signals of the terms, in the order of `airtruth.physics.terms.signals_of` the motion;
        zero for the known inputs.
    increment : (coefficients, parameters) of the coefficients beside the tables.
    """

    gust: Array
    signal: Array
    increment: Array


class MotionSlopes(NamedTuple):
    """Derivatives of one motion's equations.

    Attributes
    ----------
    rates, outputs : as `rate_slopes` and `output_slopes`, `airtruth.numerics.compiled.inner`.
    moves : (record, compiled change, common parameters, rolloff) -> what the parameters move of the aircraft.
    """

    rates: Callable[..., float]
    outputs: Callable[..., None]
    moves: Callable[..., Any]


_OF: Final[dict[type, MotionSlopes]] = {}
"""Type of an aircraft -> slopes of its motion."""


def register_slopes(aircraft: type, slopes: MotionSlopes) -> None:
    """State the slopes of a motion by the type of `FilterModel.aircraft`."""
    _OF[aircraft] = slopes


def moves_of(model: FilterModel) -> Callable[..., Any]:
    """See `MotionSlopes.moves`."""
    return _OF[type(model.aircraft)].moves


def has_slopes(model: FilterModel) -> bool:
    """Whether the motion of a model has slopes."""
    return type(model.aircraft) in _OF


@shared
def slope_work(parameters: int) -> SlopeWork:
    """Arrays for a number of parameters."""
    return SlopeWork(
        np.zeros(parameters),
        np.zeros((_SIGNALS, parameters)),
        np.zeros((_COEFFICIENTS, parameters)),
    )


def moving(layout: ParameterLayout, sizes: int) -> Ints:
    """(movers,) index of each parameter that moves the motion, as in `Layout`."""
    common, own = layout.common, layout.per_record
    first = common.size + sizes
    named = [first + own.log_gust if name == "log_gust" else common.index(name) for name in MOVERS]
    derivatives = range(*common.derivatives.indices(common.size))
    trim = (first + i for i in range(*own.trim.indices(own.size)))
    return np.array([*named, *derivatives, *trim], dtype=np.int64)


def _typed(model: Any) -> MotionSlopes:
    """Slopes by numba's type of a model."""
    return _OF[model.types[model.fields.index("aircraft")].instance_class]


def _rate_slopes(
    x: Any, d_x: Any, at: Any, model: Any, moved: Any, column: Any, out: Any, d_out: Any, work: Any
) -> Callable[..., float]:
    own = _typed(model).rates
    return lambda x, d_x, at, model, moved, column, out, d_out, work: own(
        x, d_x, at, model, moved, column, out, d_out, work
    )


def _output_slopes(
    x: Any,
    d_x: Any,
    rate: Any,
    d_rate: Any,
    at: Any,
    model: Any,
    moved: Any,
    column: Any,
    d_out: Any,
    work: Any,
) -> Callable[..., None]:
    own = _typed(model).outputs
    return lambda x, d_x, rate, d_rate, at, model, moved, column, d_out, work: own(
        x, d_x, rate, d_rate, at, model, moved, column, d_out, work
    )


@by_types(_rate_slopes)
def rate_slopes(
    x: Array,
    d_x: Array,
    at: AnyPoint,
    model: FilterModel,
    moved: Any,
    column: Ints,
    out: Array,
    d_out: Array,
    work: SlopeWork,
) -> float:
    """`airtruth.tracing.model.by_motion.rates`, and their derivatives.

    Parameters
    ----------
    d_x : (states, parameters) derivatives of the state.
    moved : what the parameters move of the aircraft, of the motion's own type.
    column : (movers,) number of each parameter of `moving` along the last axis.
    d_out : (states of the motion, gusts and effects + 1, parameters), written but for the low-passed copies of the gust, whose
        steps are exact; the last row is that of the force of the late output.
    work : written for `output_slopes` at the same state.
    """
    raise NotImplementedError


@by_types(_output_slopes)
def output_slopes(
    x: Array,
    d_x: Array,
    rate: Array,
    d_rate: Array,
    at: AnyPoint,
    model: FilterModel,
    moved: Any,
    column: Ints,
    d_out: Array,
    work: SlopeWork,
) -> None:
    """Derivatives of what the sensors read without bias, lag, delay and noise, into ``d_out`` (outputs, parameters).

    Parameters
    ----------
    rate, d_rate, work : of `rate_slopes` at the same state.
    """
    raise NotImplementedError


__all__ = [
    "INERTIA",
    "LOG_GUST",
    "MOUNTING",
    "MOVERS",
    "ROLLOFF",
    "ROTARY",
    "THRUST",
    "MotionSlopes",
    "SlopeWork",
    "has_slopes",
    "moves_of",
    "moving",
    "output_slopes",
    "rate_slopes",
    "register_slopes",
    "slope_work",
]
