"""A declared coefficient over one signal of a record, as the tables of its plant have it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion_parts import reference_length_m
from airtruth.physics.terms import AeroTerm
from airtruth.tracing.model.plant import FORCES, Plant
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
    is_state = channel in [state.channel for state in s.motion.states]
    shift = plant.alpha_shift_rad if is_state else 0.0
    over, forces = plant.along(term.signal)
    declared = _coefficient(forces, plant, term.coefficient)
    low, high = float(measured.min()), float(measured.max())
    # the linear model holds everywhere
    ends = (over[0], over[-1]) if plant.trim is not None else (low - shift, high - shift)
    return Curve(over, declared, ends, float(plant.trim_signals[number]), shift, (low, high))


def _coefficient(forces: Array, plant: Plant, name: str) -> Array:
    """A coefficient of the body axes of forces over the dynamic pressure (points, 3); one that is none of the motion is CX."""
    c, motion = plant.aircraft.constants, plant.motion
    first = FORCES - len(motion.coefficients)
    rows = {
        x.name: (first + row, x.sign * reference_length_m(c, x.length))
        for row, x in enumerate(motion.coefficients)
    }
    row, factor = rows.get(name, (0, 1.0))
    return np.asarray(forces[:, row] / (c.wing_area_m2 * factor))


__all__ = ["Curve", "angles_of", "curve_of"]
