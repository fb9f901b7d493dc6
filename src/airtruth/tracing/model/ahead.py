"""Calls that compile four of the filter's kernels: an aircraft without forces, and a record of two samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from airtruth.tracing.model.equation_slopes import AircraftMoves
from airtruth.tracing.model.filter import innovations, path_of
from airtruth.tracing.model.flight_slopes import innovation_slopes
from airtruth.tracing.model.kernel_input import (
    AircraftArrays,
    AirPoint,
    EffectArrays,
    FilterModel,
    GridSignals,
    GustModel,
    KernelInput,
    SensorArrays,
)
from airtruth.tracing.model.linearise import FirstUpdate, linearise
from airtruth.tracing.model.parameters import CORE, OUTPUTS, SHORT_PERIOD, state_layout
from airtruth.tracing.model.sensor_slopes import GainSlopes, Moved, width_of
from airtruth.tracing.model.slopes import moving
from airtruth.tracing.model.steady import without_update
from airtruth.tracing.model.tangent import FLOWN, matrices_along

_AT: Final = AirPoint(*[1.0] * len(AirPoint._fields))
"""Inputs at a point."""


def _model() -> FilterModel:
    axis, ones, none = np.array([0.0, 1.0]), np.ones(OUTPUTS), np.empty(0)
    whole, increments = np.empty(0, dtype=np.int64), np.zeros(SHORT_PERIOD.common.derivatives.stop)
    return FilterModel(
        AircraftArrays._make(
            [*[1.0] * 12, np.zeros((2, 3)), increments, axis, axis, axis, np.zeros((2, 2, 2, 3))]
        ),
        GustModel(*[1.0] * len(GustModel._fields)),
        EffectArrays(whole.reshape(0, 6), none, none, none, whole.reshape(0, 2), none, none, none),
        SensorArrays._make([*[ones] * 7, 1.0, ones]),
        state_layout(whole, CORE, 0.0 * ones, 0.0 * ones, slow=False),
    )


def _linearise() -> None:
    linearise(np.zeros(CORE), _AT, _model(), np.empty((CORE, CORE)), np.empty((OUTPUTS, CORE)))


def _given() -> KernelInput:
    zeros = np.zeros((2, OUTPUTS))
    grid = GridSignals(*[np.ones(3)] * len(GridSignals._fields))
    return KernelInput(zeros, zeros, grid, np.empty((0, 0)), 1.0, 2, np.zeros(4), 0.0, _AT, _model())


def _filter() -> None:
    given = _given()
    innovations(given, without_update(given.model), np.empty((2, OUTPUTS)))


def _slopes() -> None:
    given, width = _given(), width_of(0)
    aircraft = AircraftMoves(1.0, np.zeros(3), np.zeros((2, 3)), 0.0, np.zeros(CORE), np.zeros(CORE))
    none = np.zeros(moving(SHORT_PERIOD, 0).size, dtype=np.int64)
    moved = Moved(
        aircraft, none, none[:OUTPUTS], np.zeros((OUTPUTS, width)), np.zeros(width), np.zeros((CORE, width))
    )
    gains = GainSlopes(
        np.zeros((1, CORE, OUTPUTS, width)),
        FirstUpdate(np.zeros((1, CORE, OUTPUTS - 1, width)), np.zeros((1, OUTPUTS - 1, width))),
        np.zeros((1, CORE, width)),
        np.zeros((1, OUTPUTS, OUTPUTS, width)),
    )
    innovation_slopes(given, moved, path_of(2, CORE, OUTPUTS), gains, 1.0)


def _tangent() -> None:
    given = _given()
    matrices_along(given, path_of(2, CORE, OUTPUTS), 1.0, np.array([1, 4]), len(FLOWN))


KERNELS: Final[tuple[tuple[str, Callable[[], None]], ...]] = (
    ("airtruth.tracing.model.linearise._differences", _linearise),
    ("airtruth.tracing.model.filter._innovations", _filter),
    ("airtruth.tracing.model.flight_slopes._along", _slopes),
    ("airtruth.tracing.model.tangent._differences", _tangent),
)
"""Full name of each kernel, and the call that compiles it."""

__all__ = ["KERNELS"]
