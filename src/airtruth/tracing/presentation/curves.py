"""A declared coefficient over one signal of a record, as the tables of its plant have it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion import LATERAL
from airtruth.physics.motion_parts import Coefficient
from airtruth.physics.terms import AeroTerm
from airtruth.tracing.model.lateral_plant import LateralPlant
from airtruth.tracing.model.plant import Plant
from airtruth.tracing.model.records import TraceRecord

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A coefficient over an angle, the other signals at the trim and no rates.

    Attributes
    ----------
    over : (points,) of the signal as the tables count it [rad].
    declared : (points,) declared coefficient [-].
    ends : of the shown range [rad].
    trim : of the signal [rad].
    shift : that turns the signal of the tables into the measured one [rad].
    flown : smallest and largest measured value [rad].
    """

    over: Array
    declared: Array
    ends: tuple[float, float]
    trim: float
    shift: float
    flown: tuple[float, float]


def angles_of(record: TraceRecord) -> tuple[str, ...]:
    """Signals of the motion of a record that are angles."""
    return tuple(s.name for s in record.signals.motion.signals if s.length is None)


def curve_of(record: TraceRecord, term: AeroTerm) -> Curve:
    """The declared coefficient of a term over its signal, one of `angles_of` the record.

    Parameters
    ----------
    record : any record of the trace; the linear model has a line over what was measured.
    term : increment of a coefficient.
    """
    s, plant = record.signals, record.plant
    names = [signal.name for signal in s.motion.signals]
    number = names.index(term.signal)
    channel = s.motion.signals[number].channel
    outputs = s.motion.output_channels
    measured = (
        s.y[:, outputs.index(channel)]
        if channel in outputs
        else s.controls_rad[[c.channel for c in s.motion.controls].index(channel)]
    )
    coefficient = next((c for c in s.motion.coefficients if c.name == term.coefficient), None)
    is_state = channel in [state.channel for state in s.motion.states]
    shift = plant.alpha_shift_rad if is_state else 0.0
    over, declared = (
        _of_tables(plant, number, coefficient)
        if isinstance(plant, LateralPlant)
        else _of_forces(plant, is_state, coefficient)
    )
    low, high = float(measured.min()), float(measured.max())
    # the linear model holds everywhere
    ends = (over[0], over[-1]) if plant.trim is not None else (low - shift, high - shift)
    return Curve(over, declared, ends, float(plant.trim_signals[number]), shift, (low, high))


def _of_forces(plant: Plant, over_alpha: bool, coefficient: Coefficient | None) -> tuple[Array, Array]:
    """Points and declared coefficient of the pitch plane; no coefficient of the motion is the axial force."""
    c = plant.aircraft.constants
    over = plant.alpha_rad if over_alpha else plant.elevator_rad
    column = plant.over_alpha if over_alpha else plant.over_elevator
    if coefficient is None:
        return over, np.asarray(column[:, 0] / c.wing_area_m2)
    if coefficient.length is not None:
        return over, np.asarray(column[:, 2] / (c.wing_area_m2 * c.chord_m))
    return over, np.asarray(coefficient.sign * column[:, 1] / c.wing_area_m2)


def _of_tables(plant: LateralPlant, signal: int, coefficient: Coefficient | None) -> tuple[Array, Array]:
    """Points and declared coefficient of a table of the lateral-directional motion at the trim's angle of attack."""
    c = plant.aircraft.constants
    rows = [one.name for one in LATERAL.coefficients]
    row = 0 if coefficient is None else rows.index(coefficient.name)
    length = 1.0 if coefficient is None or coefficient.length is None else c.span_m
    table = plant.values[signal, :, :, row] / (c.wing_area_m2 * length)
    at = np.array([np.interp(plant.trim_alpha_rad, plant.alpha_rad, column) for column in table.T])
    return plant.points[signal], at


__all__ = ["Curve", "angles_of", "curve_of"]
