"""The declared aircraft of the pitch plane as the compiled filter reads it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.compile import CompiledChange
from airtruth.tracing.model.longitudinal.input import AircraftArrays, AirInputs
from airtruth.tracing.model.packing import AirPath, Packing, turned_increments
from airtruth.tracing.model.parameters import SHORT_PERIOD, CommonEntries
from airtruth.tracing.model.plant import Plant
from airtruth.tracing.model.records import Signals

Array = NDArray[np.float64]


def pack_aircraft(
    plant: Plant, compiled: CompiledChange, common: Array, entries: CommonEntries = SHORT_PERIOD.common
) -> AircraftArrays:
    """The declared aircraft of a flight condition, with its changes and increments."""
    c, declared = plant.aircraft.constants, compiled.declared
    (table,), trims = plant.tables, plant.trims
    alpha, control, rate = table.axes
    inertia = float(common[entries.inertia])
    return AircraftArrays(
        area_m2=c.wing_area_m2,
        chord_m=c.chord_m,
        mass_kg=c.mass_kg * declared["mass"],
        inertia_kg_m2=c.inertia_yy_kg_m2 * (declared["inertia"] * (1.0 + inertia)),
        trim_alpha_rad=plant.trim_alpha_rad,
        trim_elevator_rad=trims[table.signals[1]],
        neutral_elevator_rad=float(plant.neutral_rad[0]),
        effectiveness=declared[plant.motion.controls[0].name],
        cg_shift=declared["cg"],
        thrust_arm_m=declared["thrust_arm"],
        thrust_n=float(plant.power.thrust[0]),
        thrust_slope_m2=float(plant.power.thrust[1]),
        constant=plant.constant + common[entries.thrust] * plant.power.constant,
        increments=turned_increments(plant, common, entries, inertia),
        alpha_rad=alpha,
        elevator_rad=control,
        qhat=rate,
        values=table.values,
    )


def _known(s: Signals, compiled: CompiledChange, air: AirPath) -> Sequence[Array]:
    """Known inputs of `AirInputs`."""
    return *air, *(s.coupling[:2] if s.coupling.size else np.zeros((2, len(air.theta_rad))))


PACKING: Final = Packing(AirInputs, _known, pack_aircraft)
"""Packing of records of the pitch plane."""

__all__ = ["PACKING", "pack_aircraft"]
