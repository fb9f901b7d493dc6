"""How a record of a motion is packed for the compiled filter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.compile import CompiledChange
from airtruth.tracing.model.kernel_input import AnyAircraft, GustModel
from airtruth.tracing.model.parameters import CommonEntries
from airtruth.tracing.model.plant import Plant
from airtruth.tracing.model.records import Signals

Array = NDArray[np.float64]


class AirPath(NamedTuple):
    """Motion through the air along a record, the errors of the sensors undone; (points,) each.

    Attributes
    ----------
    airspeed_m_s, ground_m_s : speed through the air, and without the gust along the path [m/s].
    qbar_pa : dynamic pressure [Pa]; theta_rad : pitch attitude [rad].
    """

    airspeed_m_s: Array
    ground_m_s: Array
    qbar_pa: Array
    theta_rad: Array


def turned_increments(plant: Plant, common: Array, entries: CommonEntries, inertia: float) -> Array:
    """(derivatives,) increments; a relative change of the inertia at equal accelerations adds to those of its coefficients."""
    increments = common[entries.derivatives].copy()
    for row in (plant.motion.row(c.name) for c in plant.motion.coefficients if c.length is not None):
        increments[row] += inertia * (plant.turned[row] + common[row])
    return increments


class Packing(NamedTuple):
    """Packing of the records of one motion.

    Attributes
    ----------
    grid : type of the inputs along a record: controls, known inputs, increments of the coefficients.
    known : (run, change, air) -> known inputs on the filter's grid.
    aircraft : (plant, change, common parameters, their entries) -> aircraft of the filter.
    gusts : (vertical gusts, span [m]) -> gusts of the motion.
    """

    grid: Any
    known: Callable[[Signals, CompiledChange, AirPath], Sequence[Array]]
    aircraft: Callable[[Plant, CompiledChange, Array, CommonEntries], AnyAircraft]
    gusts: Callable[[GustModel, float], GustModel] = lambda vertical, span_m: vertical


__all__ = ["AirPath", "Packing", "turned_increments"]
