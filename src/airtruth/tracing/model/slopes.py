"""Slopes of the equations of a motion, chosen by the type of its aircraft.

A slope is a row over columns: the states of the motion, the gusts and the effects first, then the parameters that move the
motion, in the order of `MOVERS`, the derivatives and the trim. A motion registers its slopes (`register_slopes`); derivatives
of a motion without them are differences of flights.

Source: A. Griewank and A. Walther, *Evaluating Derivatives*, 2nd ed. (2008), section 3.1, for the forward mode.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import by_types, shared
from airtruth.tracing.model.kernel_input import AirPoint, FilterModel
from airtruth.tracing.model.parameters import ParameterLayout

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOVERS: Final = ("rotary", "thrust", "rolloff", "inertia", "mounting", "log_gust")
"""Parameters that move any motion, in the order of their columns behind those of the states."""
ROTARY, THRUST, ROLLOFF, INERTIA, MOUNTING, LOG_GUST = range(len(MOVERS))
"""Their numbers."""


class SlopeWork(NamedTuple):
    """Slopes of what forces and readings depend on, (columns,) each.

    Attributes
    ----------
    upward, alpha, qhat, alpha_dot_hat : of the gust [-] and the signals of the terms.
    lift, moment : of the coefficients beside the tables.
    """

    upward: Array
    alpha: Array
    qhat: Array
    alpha_dot_hat: Array
    lift: Array
    moment: Array


class MotionSlopes(NamedTuple):
    """Slopes of one motion's equations; both are `airtruth.numerics.compiled.inner`.

    Attributes
    ----------
    rates, outputs : as `rate_slopes` and `output_slopes`.
    """

    rates: Callable[..., float]
    outputs: Callable[..., None]


_OF: Final[dict[type, MotionSlopes]] = {}
"""Type of an aircraft -> slopes of its motion."""


def register_slopes(aircraft: type, slopes: MotionSlopes) -> None:
    """State the slopes of a motion by the type of `FilterModel.aircraft`."""
    _OF[aircraft] = slopes


def has_slopes(model: FilterModel) -> bool:
    """Whether the motion of a model has slopes."""
    return type(model.aircraft) in _OF


@shared
def slope_work(columns: int) -> SlopeWork:
    """Arrays for a number of columns."""
    return SlopeWork(
        np.zeros(columns),
        np.zeros(columns),
        np.zeros(columns),
        np.zeros(columns),
        np.zeros(columns),
        np.zeros(columns),
    )


def moving(layout: ParameterLayout, sizes: int) -> Ints:
    """(columns behind those of the states,) index of each parameter that moves the motion, as in `Layout`."""
    common, own = layout.common, layout.per_record
    first = common.size + sizes
    named = [first + own.log_gust if name == "log_gust" else common.index(name) for name in MOVERS]
    derivatives = range(*common.derivatives.indices(common.size))
    trim = (first + i for i in range(*own.trim.indices(own.size)))
    return np.array([*named, *derivatives, *trim], dtype=np.int64)


def _typed(model: Any) -> MotionSlopes:
    """Slopes by numba's type of a model."""
    return _OF[model.types[model.fields.index("aircraft")].instance_class]


def _rate_slopes(x: Any, at: Any, model: Any, moved: Any, out: Any, slope: Any, work: Any) -> Callable[..., float]:
    own = _typed(model).rates
    return lambda x, at, model, moved, out, slope, work: own(x, at, model, moved, out, slope, work)


def _output_slopes(
    x: Any, rate: Any, at: Any, model: Any, moved: Any, slope: Any, out: Any, work: Any
) -> Callable[..., None]:
    own = _typed(model).outputs
    return lambda x, rate, at, model, moved, slope, out, work: own(x, rate, at, model, moved, slope, out, work)


@by_types(_rate_slopes)
def rate_slopes(
    x: Array, at: AirPoint, model: FilterModel, moved: Any, out: Array, slope: Array, work: SlopeWork
) -> float:
    """`airtruth.tracing.model.by_motion.rates`, and their slopes.

    Parameters
    ----------
    moved : what the parameters move of the aircraft, of the motion's own type.
    slope : (states of the motion, gusts and effects + 1, columns), written but for the low-passed copies of the gust, whose steps
        are exact; the last row is that of the force of the late output.
    work : written for `output_slopes` at the same state.
    """
    raise NotImplementedError


@by_types(_output_slopes)
def output_slopes(
    x: Array, rate: Array, at: AirPoint, model: FilterModel, moved: Any, slope: Array, out: Array, work: SlopeWork
) -> None:
    """Slopes of what the sensors read without bias, lag, delay and noise, into ``out`` (outputs, columns).

    Parameters
    ----------
    rate, slope, work : of `rate_slopes` at the same state.
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
    "moving",
    "output_slopes",
    "rate_slopes",
    "register_slopes",
    "slope_work",
]
