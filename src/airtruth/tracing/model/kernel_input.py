"""Input of the compiled filter: named arrays, grouped by what they describe."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.parameters import StateLayout

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class GustModel(NamedTuple):
    """The gusts that the filter estimates, vertical in the pitch plane and from the side in the lateral-directional motion.

    Attributes
    ----------
    level_m_s : standard deviation of Dryden's part [m/s].
    length_m : scale length [m].
    rolloff : 0 for Dryden's spectrum, 1 for von Karman's [-].
    rotary : share of the rotary gusts [-].
    rotary_time_s : time the gust takes to the tail, 4 b/(pi V), of the side gust 3 b/(pi V) [s].
    roll_1_m : standard deviation of the roll gust over the level [1/m]; roll_time_s : its correlation time [s].
    """

    level_m_s: float
    length_m: float
    rolloff: float
    rotary: float
    rotary_time_s: float
    roll_1_m: float = 0.0
    roll_time_s: float = 1.0


class EffectArrays(NamedTuple):
    """Terms of coefficients and readings, and states of effects; numbers follow `airtruth.physics.terms`.

    Attributes
    ----------
    term_index : (terms, 6) what it acts on (coefficients, then readings of the outputs), signal (-1 for a state), shape,
        state (-1 for a signal), signal of its factor (-1 for none), row of ``state_index`` of the lag whose lag error x - s
        multiplies the term (-1 for none).
    amplitude, origin, factor_origin : (terms,) of each term.
    state_index : (states, 2) kind (0 lag, 1 mode, 2 play), signal.
    time_s, damping, half_width : (states,) of each state [s], [-], [unit of the signal].
    """

    term_index: Ints
    amplitude: Array
    origin: Array
    factor_origin: Array
    state_index: Ints
    time_s: Array
    damping: Array
    half_width: Array


class SensorArrays(NamedTuple):
    """Errors of the outputs of the motion, (outputs,) each.

    Attributes
    ----------
    bias : [units of the outputs]; scale : [-]; arm_m, down_m : position ahead of the CG and below it [m].
    lag_s, delay_s : [s]; 0 for none.
    variance : of the white noise [units of the outputs squared].
    slow_std : of the correlated noise, a Gauss-Markov process [units of the outputs]; slow_time_s : its correlation time [s].
    """

    bias: Array
    scale: Array
    arm_m: Array
    lag_s: Array
    delay_s: Array
    variance: Array
    slow_std: Array
    slow_time_s: float
    down_m: Array


AnyAircraft: TypeAlias = Any
"""The aircraft of a motion: `airtruth.tracing.model.longitudinal.input.AircraftArrays`, for example."""
AnyPoint: TypeAlias = Any
"""Inputs of a motion at one time: numbers."""
AnyGrid: TypeAlias = Any
"""Inputs of a motion on the filter's grid: arrays of the same names."""


class FilterModel(NamedTuple):
    """Everything that does not change along a record."""

    aircraft: AnyAircraft
    gusts: GustModel
    effects: EffectArrays
    sensors: SensorArrays
    states: StateLayout


class KernelInput(NamedTuple):
    """One record, one model.

    Attributes
    ----------
    y : (samples, outputs) measured outputs [their units]; more : (samples, outputs) added to the predicted ones.
    grid : known inputs, ``sub`` (even) cells to a sample.
    corner_rad2 : (controls, samples) variance of a surface's mean over the cell that ends at each sample, about that of the
        grid [rad2]; empty if the surfaces are known between the samples.
    dt_s : sample period [s].
    start : initial states of the motion [their units] and of the gust's filter [-].
    reference_flow_rad, reference : means of the record, about which it is linearised: of the first output, the flow angle, and of
        the inputs.
    model : see there.
    """

    y: Array
    more: Array
    grid: AnyGrid
    corner_rad2: Array
    dt_s: float
    sub: int
    start: Array
    reference_flow_rad: float
    reference: AnyPoint
    model: FilterModel


__all__ = [
    "AnyAircraft",
    "AnyGrid",
    "AnyPoint",
    "EffectArrays",
    "FilterModel",
    "GustModel",
    "KernelInput",
    "SensorArrays",
]
