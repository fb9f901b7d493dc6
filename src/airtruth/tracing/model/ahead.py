"""Calls that compile four of the filter's kernels for each motion: an aircraft without forces, and a record of two samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.tracing.model.filter import innovations, path_of
from airtruth.tracing.model.flight_slopes import innovation_slopes
from airtruth.tracing.model.kernel_input import (
    EffectArrays,
    FilterModel,
    GustModel,
    KernelInput,
    SensorArrays,
)
from airtruth.tracing.model.lateral.input import LateralAircraft, LateralAirInputs
from airtruth.tracing.model.lateral.slopes import LateralMoves
from airtruth.tracing.model.linearise import FirstUpdate, linearise
from airtruth.tracing.model.longitudinal.input import AircraftArrays, AirInputs
from airtruth.tracing.model.longitudinal.slopes import AircraftMoves
from airtruth.tracing.model.parameters import ParameterLayout, core_states, state_layout
from airtruth.tracing.model.sensor_slopes import GainSlopes, Moved, width_of
from airtruth.tracing.model.slopes import moving
from airtruth.tracing.model.steady import without_update
from airtruth.tracing.model.tangent import flown_of, matrices_along

_AXIS: Final = np.array([0.0, 1.0])
"""Axis of a table."""


class _Kind(NamedTuple):
    """Types of a motion's aircraft, of its inputs, and what its parameters move."""

    motion: Motion
    aircraft: AircraftArrays | LateralAircraft
    inputs: type[Any]
    moves: AircraftMoves | LateralMoves

    @property
    def states(self) -> int:
        """Number of states."""
        return core_states(self.motion)

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return len(self.motion.outputs)

    @property
    def at(self) -> Any:
        """Inputs at a point."""
        return self.inputs(*[1.0] * len(self.inputs._fields))

    @property
    def model(self) -> FilterModel:
        """A filter without effects."""
        ones, none, whole = np.ones(self.outputs), np.empty(0), np.empty(0, dtype=np.int64)
        return FilterModel(
            self.aircraft,
            GustModel(*[1.0] * len(GustModel._fields)),
            EffectArrays(whole.reshape(0, 6), none, none, none, whole.reshape(0, 2), none, none, none),
            SensorArrays._make([*[ones] * 7, 1.0, ones]),
            state_layout(whole, self.states, 0.0 * ones, 0.0 * ones, slow=False),
        )

    @property
    def given(self) -> KernelInput:
        """A record of two samples."""
        zeros, grid = np.zeros((2, self.outputs)), self.inputs(*[np.ones(3)] * len(self.inputs._fields))
        of_start = ParameterLayout(self.motion).per_record.start
        start = np.zeros(of_start.stop - of_start.start)
        return KernelInput(zeros, zeros, grid, np.empty((0, 0)), 1.0, 2, start, 0.0, self.at, self.model)


def _pitch() -> _Kind:
    motion, forces = LONGITUDINAL, len(LONGITUDINAL.coefficients) + 1
    increments, states = np.zeros(len(motion.derivatives)), np.zeros(core_states(motion))
    table = np.zeros((2, 2, 2, forces))
    aircraft = AircraftArrays._make([*[1.0] * 12, table[0, 0], increments, _AXIS, _AXIS, _AXIS, table])
    moves = AircraftMoves(1.0, np.zeros(forces), table[0, 0], 0.0, states, states)
    return _Kind(motion, aircraft, AirInputs, moves)


def _side() -> _Kind:
    motion, forces = LATERAL, len(LATERAL.coefficients)
    increments, states = np.zeros(len(motion.derivatives)), np.zeros(core_states(motion))
    signals, controls = np.zeros(len(motion.signals)), np.zeros(len(motion.controls))
    table = np.zeros((signals.size, 2, 2, forces))
    points = np.tile(_AXIS, (signals.size, 1))
    about = [signals, controls, controls, *[0.0] * 4, table[0, 0], increments]
    aircraft = LateralAircraft._make([*[1.0] * 8, *about, _AXIS, points, table])
    moves = LateralMoves(1.0, increments, 0.0, states, states)
    return _Kind(motion, aircraft, LateralAirInputs, moves)


def _linearise(kind: _Kind) -> None:
    n, outputs = kind.states, kind.outputs
    linearise(np.zeros(n), kind.at, kind.model, np.empty((n, n)), np.empty((outputs, n)))


def _filter(kind: _Kind) -> None:
    innovations(kind.given, without_update(kind.model), np.empty((2, kind.outputs)))


def _slopes(kind: _Kind) -> None:
    n, outputs, width = kind.states, kind.outputs, width_of(0)
    none = np.zeros(moving(ParameterLayout(kind.motion), 0).size, dtype=np.int64)
    moved = Moved(
        kind.moves, none, none[:outputs], np.zeros((outputs, width)), np.zeros(width), np.zeros((n, width))
    )
    gains = GainSlopes(
        np.zeros((1, n, outputs, width)),
        FirstUpdate(np.zeros((1, n, outputs - 1, width)), np.zeros((1, outputs - 1, width))),
        np.zeros((1, n, width)),
        np.zeros((1, outputs, outputs, width)),
        np.zeros(2, dtype=np.int64),
    )
    innovation_slopes(kind.given, moved, path_of(2, n, outputs), gains, 1.0)


def _tangent(kind: _Kind) -> None:
    path = path_of(2, kind.states, kind.outputs)
    matrices_along(kind.given, path, 1.0, np.array([1, 4]), len(flown_of(kind.motion)))


_CALLS: Final[tuple[tuple[str, Callable[[_Kind], None]], ...]] = (
    ("airtruth.tracing.model.linearise._differences", _linearise),
    ("airtruth.tracing.model.filter._innovations", _filter),
    ("airtruth.tracing.model.flight_slopes._along", _slopes),
    ("airtruth.tracing.model.tangent._differences", _tangent),
)
"""Full name of each kernel, and the call that compiles it for a motion."""
KERNELS: Final[tuple[tuple[str, Callable[[], None]], ...]] = tuple(
    (name, partial(call, kind)) for kind in (_pitch(), _side()) for name, call in _CALLS
)
"""Full name of each kernel, and the call that compiles it, of the longitudinal motion first."""

__all__ = ["KERNELS"]
