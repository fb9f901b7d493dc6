"""Forces of the declared aircraft over the signals of a motion: a sum of tables, probed in JSBSim or of the linear model.

A table has at most three signals. The forces of the pitch plane are one table over angle of attack, elevator and pitch rate;
those of the lateral-directional motion are a table over the angle of attack and each signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import product
from operator import mul
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.motion_parts import reference_length_m
from airtruth.simulation.disposable import isolated
from airtruth.simulation.linearise import linearise
from airtruth.simulation.probe import alpha_dot_terms
from airtruth.simulation.trim import Trim
from airtruth.tracing.model.declared import declared_covariance, stated_derivatives
from airtruth.units import G0

Array = NDArray[np.float64]

FLOW: Final = "alpha"
"""Signal of the first axis of every table: the angle of attack."""
FORCES: Final = 3
"""Forces and moments of a table: X, Z and M, or Y, L and N; the coefficients of a motion are the last ones."""
LAYOUTS: Final[Mapping[str, tuple[tuple[str, ...], ...]]] = MappingProxyType(
    {
        LONGITUDINAL.name: ((FLOW, LONGITUDINAL.controls[0].name, "qhat"),),
        LATERAL.name: tuple((FLOW, signal.name) for signal in LATERAL.signals),
    }
)
"""Motion -> signals of each table, in the order of its axes."""
_ENDS: Final = np.array([-1.0, 1.0])
"""Points of an axis of the linear model, about its trim [rad, -]."""
_THRUST: Final = 0.1
"""Thrust of a linear model without engines over its weight [-] (judgement: lift over drag of ten)."""


@dataclass(frozen=True)
class ForceTable:
    """Forces of the air over the dynamic pressure.

    Attributes
    ----------
    signals : names, the angle of attack first.
    axes : (points,) ascending of each signal [rad, -].
    values : (points of each axis, 3) X, Z [m2] and M [m3], or Y [m2], L and N [m3].
    """

    signals: tuple[str, ...]
    axes: tuple[Array, ...]
    values: Array

    def __post_init__(self) -> None:
        """Refuse values that the axes do not address: compiled kernels read past the end of an array.

        Raises
        ------
        ValueError
            Naming the shapes.
        """
        expected = (*(axis.size for axis in self.axes), FORCES)
        if len(self.signals) != len(self.axes) or self.values.shape != expected:
            raise ValueError(
                f"table over {', '.join(self.signals)}: values have the shape {self.values.shape}, its axes need {expected}"
            )


@dataclass(frozen=True)
class Engines:
    """Forces of the engines at a trim, lines over the dynamic pressure.

    Attributes
    ----------
    constant : (3,) X, Z [N] and M [N m] of the aircraft that do not go with the dynamic pressure.
    thrust : (2,) thrust along body x at no dynamic pressure [N], and its slope over the dynamic pressure [m2].
    """

    constant: Array = field(default_factory=lambda: np.zeros(FORCES))
    thrust: Array = field(default_factory=lambda: np.zeros(2))


@dataclass(frozen=True)
class Plant:
    """The declared aircraft about one trim, as the filter needs it.

    Attributes
    ----------
    aircraft, motion : the aircraft, and the motion whose forces the tables have.
    tables : add up; that of the flow angle, the first one, has the part of the trim. All have one axis of the angle of attack.
    constant : (alpha, 3) forces [N] and moments [N m] at no dynamic pressure, of the lines over it that the forces follow about
        the trim: those of the engines, and those that a propeller or the Mach number adds.
    trims : signal -> value at the trim, the origin of the increments of the derivatives [rad, -].
    neutral_rad : (controls,) deflections that an effectiveness leaves alone [rad]: zero, for the linear model its trim.
    derivatives, derivative_cov : (derivatives,) declared values and their covariance, mass, inertias and CG included.
    trim : of the JSBSim aircraft, None for a linear one.
    alpha_shift_rad : subtracted from the measured angle of attack and pitch attitude [rad]; the linear model of the pitch plane
        counts them from its trim.
    power : engines at the trim, whose forces the pitch plane scales.
    mean_derivatives : (derivatives,) declared values averaged over the flight conditions of all records; None for one condition.
    """

    aircraft: Aircraft
    motion: Motion
    tables: tuple[ForceTable, ...]
    constant: Array
    trims: Mapping[str, float]
    neutral_rad: Array
    derivatives: Array
    derivative_cov: Array
    trim: Trim | None
    alpha_shift_rad: float = 0.0
    power: Engines = field(default_factory=Engines)
    mean_derivatives: Array | None = None

    def __post_init__(self) -> None:
        """Refuse arrays that do not go with the axis of the angle of attack, or with the motion.

        Raises
        ------
        ValueError
            Naming the array and the shapes.
        """
        alpha, count = self.alpha_rad.size, len(self.motion.parameters)
        for name, array, expected in (
            *((f"axis {FLOW} of a table", table.axes[0], (alpha,)) for table in self.tables),
            ("constant", self.constant, (alpha, FORCES)),
            ("neutral_rad", self.neutral_rad, (len(self.motion.controls),)),
            ("derivatives", self.derivatives, (count,)),
            ("derivative_cov", self.derivative_cov, (count, count)),
        ):
            if array.shape != expected:
                raise ValueError(f"plant: {name} has the shape {array.shape}, it needs {expected}")

    @property
    def turned(self) -> Array:
        """(derivatives,) what a relative change of the inertia at equal accelerations adds to their increments [-].

        The increments are common to all records. Those of the mean leave the differences between flight conditions to the
        inertia, which divides them all.
        """
        return self.derivatives if self.mean_derivatives is None else self.mean_derivatives

    @property
    def alpha_rad(self) -> Array:
        """(alpha,) axis of the tables [rad]."""
        return self.tables[0].axes[0]

    @property
    def trim_alpha_rad(self) -> float:
        """Angle of attack of the trim, as the tables count it [rad]."""
        return self.trims[FLOW]

    @property
    def trim_signals(self) -> Array:
        """(signals,) origin of the increments of the derivatives, in the order of the motion [rad, -]."""
        return np.array([self.trims[signal.name] for signal in self.motion.signals])

    @cached_property
    def stacked(self) -> tuple[Array, Array]:
        """Second axes (tables, points) and values (tables, alpha, points, 3) of tables of two signals and one size."""
        points = np.stack([table.axes[1] for table in self.tables])
        return points, np.ascontiguousarray(np.stack([table.values for table in self.tables]))

    def along(self, signal: str) -> tuple[Array, Array]:
        """Points of a signal [rad, -], and (points, 3) of the sum of the tables there, the other signals at the trim.

        Raises
        ------
        KeyError
            If no table has the signal.
        """
        axes = {
            name: axis for table in self.tables for name, axis in zip(table.signals, table.axes, strict=True)
        }
        axis = axes[signal]
        at = {name: np.full(axis.size, value) for name, value in self.trims.items()}
        return axis, _sum(self.tables, at | {signal: axis})


def looked_up(plant: Plant, signals: Mapping[str, Array], pressure_pa: Array) -> Array:
    """(states, 3) forces [N] and moments [N m] of a plant, linear in each signal within a cell of its tables.

    Parameters
    ----------
    signals : signal -> (states,) [rad, -]; outside the tables their end cells go on.
    pressure_pa : (states,) dynamic pressure [Pa].
    """
    total = _sum(plant.tables, signals) * pressure_pa[:, None]
    i, u = _cell(plant.alpha_rad, signals[FLOW])
    constant = (1.0 - u)[:, None] * plant.constant[i] + u[:, None] * plant.constant[i + 1]
    return np.asarray(total + constant)


def _sum(tables: tuple[ForceTable, ...], signals: Mapping[str, Array]) -> Array:
    total = np.zeros((signals[FLOW].size, FORCES))
    for table in tables:
        cells = [_cell(axis, signals[name]) for name, axis in zip(table.signals, table.axes, strict=True)]
        for corner in product((0, 1), repeat=len(cells)):
            shares = (u if upper else 1.0 - u for upper, (_, u) in zip(corner, cells, strict=True))
            at = tuple(low + upper for upper, (low, _) in zip(corner, cells, strict=True))
            total += reduce(mul, shares)[:, None] * table.values[at]
    return total


def _cell(axis: Array, x: Array) -> tuple[NDArray[np.intp], Array]:
    low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    return low, (x - axis[low]) / (axis[low + 1] - axis[low])


def linear(
    aircraft: Aircraft,
    motion: Motion,
    derivatives: Array,
    pressure_pa: float,
    start: Array,
    held: Array,
    power: Engines | None = None,
) -> Plant:
    """The linear model of a motion about a measured trim, as tables of two points per axis.

    Parameters
    ----------
    derivatives : (derivatives,) declared [-].
    pressure_pa : dynamic pressure of the trim [Pa].
    start : (signals,) the record's own trim, in the order of the motion [rad, -].
    held : (3,) forces of the air at that trim, which balance the weight [N, N m].
    power : engines, whose moment that of the air balances at the trim; None for a tenth of the weight without a moment.
    """
    c = aircraft.constants
    names = [signal.name for signal in motion.signals]
    factors = [x.sign * c.wing_area_m2 * reference_length_m(c, x.length) for x in motion.coefficients]
    moment = np.zeros(FORCES)
    if power is not None:
        moment[-1] = power.constant[-1]
    trims = {FLOW: 0.0} | dict(zip(names, start.tolist(), strict=True))
    shift, trims[FLOW] = trims[FLOW], 0.0
    tables: list[ForceTable] = []
    for own in LAYOUTS[motion.name]:
        axes = tuple(trims[name] + _ENDS for name in own)
        values = np.zeros((*[2] * len(own), FORCES))
        for corner in product((0, 1), repeat=len(own)):
            moved = dict(zip(own, _ENDS[list(corner)], strict=True))
            x = np.array([moved.get(name, 0.0) for name in names])
            rows = derivatives.reshape(motion.shape)
            values[corner][FORCES - len(rows) :] = [
                f * float(row @ x) for f, row in zip(factors, rows, strict=True)
            ]
        if not tables:
            values += (held - moment) / pressure_pa
        tables.append(ForceTable(own, axes, values))
    return Plant(
        aircraft=aircraft,
        motion=motion,
        tables=tuple(tables),
        constant=np.tile(moment, (2, 1)),
        trims=trims,
        neutral_rad=np.array([trims[control.name] for control in motion.controls]),
        derivatives=derivatives,
        derivative_cov=declared_covariance(aircraft, derivatives, motion),
        trim=None,
        alpha_shift_rad=shift,
        power=Engines(moment, np.array([_THRUST * c.mass_kg * G0, 0.0]) if power is None else power.thrust),
    )


def alpha_dot(plant: Plant) -> Array:
    """(coefficients,) per alpha_dot c/(2V) of a JSBSim model of the pitch plane, which its rate derivatives contain; else 0."""
    if plant.trim is None or plant.motion is not LONGITUDINAL:
        return np.zeros(len(plant.motion.coefficients))
    aircraft = plant.aircraft
    return isolated(f"the terms in alpha_dot of {aircraft.name}", alpha_dot_terms, aircraft, plant.trim)


def declared_derivatives(aircraft: Aircraft, at: Trim | None, motion: Motion = LONGITUDINAL) -> Array:
    """(derivatives,) of the JSBSim model at a trim, or as aircraft.toml states them [-].

    Raises
    ------
    AircraftError
        If neither is there.
    """
    if at is None:
        return stated_derivatives(aircraft, motion)
    work = f"the derivatives of the {motion.name} motion of {aircraft.name}"
    return isolated(work, linearise, aircraft, at, motion=motion).central


__all__ = [
    "FLOW",
    "FORCES",
    "LAYOUTS",
    "Engines",
    "ForceTable",
    "Plant",
    "alpha_dot",
    "declared_derivatives",
    "linear",
    "looked_up",
]
