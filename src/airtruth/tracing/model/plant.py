"""Forces of the declared aircraft over alpha, elevator and pitch rate: probed in JSBSim, or of the linear model."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import TrimError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.disposable import isolated
from airtruth.simulation.linearise import linearise
from airtruth.simulation.operating_point import operating_point
from airtruth.simulation.probe import Grid, alpha_dot_terms, forces_at_speeds
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import Trim, trim
from airtruth.tracing.model.declared import declared_covariance, stated_derivatives
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

_LIFT, _MOMENT = LONGITUDINAL.row("CL"), LONGITUDINAL.row("Cm")
"""Positions of the derivatives of lift and of the pitching moment."""
SPEEDS: Final = np.array([0.97, 1.0, 1.03])
"""Airspeeds over the trim's at which the engines are probed [-] (judgement): a flight test's scatter."""
_RATE_MARGIN: Final = 1.2
"""Range of the tables' pitch rate over the largest measured one [-] (judgement)."""
_LEAST_RATE_RAD_S: Final = 0.05
"""Least range of the tables' pitch rate [rad/s] (judgement)."""
_RATES: Final = 7
"""Points of the tables' pitch-rate axis [-] (judgement): the forces are nearly linear in it."""


@dataclass(frozen=True)
class Plant:
    """The declared aircraft about one trim, as the filter needs it.

    Attributes
    ----------
    alpha_rad, elevator_rad, qhat : axes of the tables; qhat = q c/(2V).
    values : (alpha, elevator, qhat, 3) X, Z [m2] and M [m3] of the air over the dynamic pressure.
    constant : (alpha, 3) X, Z [N] and M [N m] at no dynamic pressure, of the lines over it that the forces follow about the trim:
        those of the engines, and those that a propeller or the Mach number adds.
    engine : (3,) those of the engines at the trim.
    trim_alpha_rad, trim_elevator_rad : origin of the increments of the derivatives [rad].
    neutral_elevator_rad : deflection that an effectiveness leaves alone [rad]: zero, for the linear model its trim.
    alpha_shift_rad : subtracted from the measured alpha and theta [rad]; the linear model counts alpha from its trim.
    thrust : (2,) thrust at no dynamic pressure [N], and its slope over the dynamic pressure [m2].
    derivatives, derivative_cov : (6,) declared values and (6, 6) covariance, mass, inertia and CG
        included.
    trim : of the JSBSim aircraft, None for a linear one.
    """

    aircraft: Aircraft
    alpha_rad: Array
    elevator_rad: Array
    qhat: Array
    values: Array
    constant: Array
    engine: Array
    trim_alpha_rad: float
    trim_elevator_rad: float
    neutral_elevator_rad: float
    alpha_shift_rad: float
    thrust: Array
    derivatives: Array
    derivative_cov: Array
    trim: Trim | None

    @property
    def trim_signals(self) -> Array:
        """(signals,) origin of the increments of the derivatives, in the order of the motion [rad, -]."""
        return np.array([self.trim_alpha_rad, 0.0, self.trim_elevator_rad])

    @property
    def over_alpha(self) -> Array:
        """(alpha, 3) of the tables, at the elevator's point next to its trim and no pitch rate; on a line at the trim."""
        return self._nearest(np.moveaxis(self._steady, 1, 0), self.elevator_rad, self.trim_elevator_rad)

    @property
    def over_elevator(self) -> Array:
        """(elevator, 3) of the tables, at the angle of attack's point next to its trim and no pitch rate; on a line at the
        trim."""
        return self._nearest(self._steady, self.alpha_rad, self.trim_alpha_rad)

    @property
    def _steady(self) -> Array:
        return self._nearest(np.moveaxis(self.values, 2, 0), self.qhat, 0.0)

    def _nearest(self, rows: Array, points: Array, at: float) -> Array:
        """The row of the point next to ``at``; of the linear model, which has two points, the row between them."""
        if self.trim is not None:
            return np.asarray(rows[int(np.argmin(np.abs(points - at)))])
        share = (at - points[0]) / (points[-1] - points[0])
        return np.asarray(rows[0] + share * (rows[-1] - rows[0]))


def trim_of(
    aircraft: Aircraft, airspeed_m_s: float, density_kg_m3: float, altitude_m: float, gamma_rad: float
) -> Trim:
    """Trim the declared JSBSim aircraft at a measured airspeed.

    Raises
    ------
    TrimError
        If it cannot fly there.
    """
    eas = airspeed_m_s * float(np.sqrt(density_kg_m3 / 1.225))
    at = Condition(eas, altitude_m, gamma_rad)
    return isolated(f"the trim of {aircraft.name}", trim, aircraft, at)


def with_throttle(aircraft: Aircraft, at: Trim, throttle: float) -> Trim:
    """A trim at another throttle.

    A model with lateral properties is held straight at it, as its pilot does: the flight path takes the place of the throttle.
    Otherwise its propeller would roll it. Where no such trim exists, and for any other model, the throttle alone is replaced.
    """
    if aircraft.file.jsbsim is not None and aircraft.file.jsbsim.lateral is not None:
        with contextlib.suppress(TrimError):
            return isolated(
                f"the trim of {aircraft.name}", trim, aircraft, at.condition, near=at, throttle=throttle
            )
    return replace(at, controls=replace(at.controls, throttle=throttle))


def probed(
    aircraft: Aircraft, at: Trim, alpha: tuple[float, float], elevator: tuple[float, float], q: float
) -> Plant:
    """Tables of the JSBSim aircraft over the stated ranges, on whole degrees and where its own tables break.

    At equal alpha, elevator and qhat the forces are lines over the dynamic pressure. Their constants are those of the settled
    engines at the trim's angle of attack, and change with it as they do at a held speed of the engines.

    Parameters
    ----------
    alpha, elevator : lowest and highest angle [rad]; q : largest pitch rate [rad/s].
    """

    def whole(low: float, high: float, step: float) -> Array:
        first, last = np.floor(low / step) - 1.0, np.ceil(high / step) + 1.0
        return np.arange(first, last + 1.0) * step

    offset = at.controls.elevator_command_rad - at.elevator_rad
    rates = np.linspace(-1.0, 1.0, _RATES) * max(q * _RATE_MARGIN, _LEAST_RATE_RAD_S)
    commands = whole(elevator[0] + offset, elevator[1] + offset, DEG)
    grid = Grid(whole(alpha[0], alpha[1], DEG), commands, rates, np.ones(1))
    point = isolated(f"the table of forces of {aircraft.name}", operating_point, aircraft, at, grid, SPEEDS)
    tables, declared, constants = point.tables, point.derivatives, aircraft.constants
    power = _engines_of(at, point.at_speeds)
    constant = power.constant + _constants_over_alpha(at, tables.alpha_rad, point.over_alpha)
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    return Plant(
        aircraft=aircraft,
        alpha_rad=tables.alpha_rad,
        elevator_rad=tables.elevator_rad,
        qhat=tables.q_rad_s * constants.chord_m / (2.0 * at.airspeed_m_s),
        values=np.ascontiguousarray((tables.values[0] - constant[:, None, None]) / pressure),
        constant=constant,
        engine=power.constant,
        trim_alpha_rad=at.alpha_rad,
        trim_elevator_rad=at.elevator_rad,
        neutral_elevator_rad=0.0,
        alpha_shift_rad=0.0,
        thrust=power.thrust,
        derivatives=declared.central,
        derivative_cov=declared_covariance(aircraft, declared.central),
        trim=at,
    )


def _constants_over_alpha(at: Trim, alpha_rad: Array, forces: Array) -> Array:
    """(alpha, 3) X, Z [N] and M [N m] that do not go with the dynamic pressure, less those at the trim's angle of attack.

    ``forces`` (speeds, alpha, 3) are those at `SPEEDS`.
    """
    constant = _lines(at, forces.reshape(SPEEDS.size, -1))[0].reshape(-1, 3)
    return np.asarray(constant - constant[int(np.argmin(np.abs(alpha_rad - at.alpha_rad)))])


def _lines(at: Trim, rows: Array) -> Array:
    """(2, n) values at no dynamic pressure, and slopes over it, of (speeds, n) values at `SPEEDS`."""
    pressures = 0.5 * at.density_kg_m3 * (at.airspeed_m_s * SPEEDS) ** 2
    basis = np.column_stack([np.ones_like(pressures), pressures])
    return np.asarray(np.linalg.lstsq(basis, rows, rcond=None)[0], dtype=np.float64)


@dataclass(frozen=True)
class Engines:
    """What the engines do at a trim, lines over the dynamic pressure.

    Attributes
    ----------
    constant : (3,) X, Z [N] and M [N m] of the aircraft that do not go with the dynamic pressure.
    thrust : (2,) thrust along body x at none [N], and its slope over the dynamic pressure [m2].
    """

    constant: Array
    thrust: Array


def engines(aircraft: Aircraft, at: Trim) -> Engines:
    """The engines of the JSBSim aircraft, from three airspeeds about a trim."""
    work = f"the forces of the engines of {aircraft.name}"
    return _engines_of(at, isolated(work, forces_at_speeds, aircraft, at, SPEEDS))


def _engines_of(at: Trim, at_speeds: Array) -> Engines:
    fitted = _lines(at, at_speeds)
    return Engines(np.ascontiguousarray(fitted[0, :3]), np.ascontiguousarray(fitted[:, 3]))


def alpha_dot(plant: Plant) -> Array:
    """(2,) CL and Cm per alpha_dot c/(2V) of the declared JSBSim model, which its rate derivatives contain; 0 without one."""
    if plant.trim is None:
        return np.zeros(2)
    aircraft = plant.aircraft
    return isolated(f"the terms in alpha_dot of {aircraft.name}", alpha_dot_terms, aircraft, plant.trim)


def linear(
    aircraft: Aircraft,
    derivatives: Array,
    airspeed_m_s: float,
    density_kg_m3: float,
    alpha: float,
    elevator: float,
    power: Engines | None = None,
) -> Plant:
    """The linear short-period model about a measured trim, as tables of two points per axis.

    Parameters
    ----------
    derivatives : (6,) declared.
    alpha, elevator : the record's own trim [rad].
    power : engines, whose pitching moment that of the air balances at trim; None for none, and a thrust of a
        tenth of the weight for its arm.
    """
    engine_moment = 0.0 if power is None else float(power.constant[2])
    moment = np.array([0.0, 0.0, engine_moment])
    c = aircraft.constants
    s, chord = c.wing_area_m2, c.chord_m
    pressure = 0.5 * density_kg_m3 * airspeed_m_s**2
    axis = np.array([-1.0, 1.0])
    values = np.zeros((2, 2, 2, 3))
    for i, a in enumerate(axis):
        for j, d in enumerate(axis):
            for k, q in enumerate(axis):
                x = np.array([a, q, d])
                values[i, j, k, 1] = -s * float(derivatives[_LIFT] @ x) - c.mass_kg * G0 / pressure
                values[i, j, k, 2] = s * chord * float(derivatives[_MOMENT] @ x) - engine_moment / pressure
    return Plant(
        aircraft=aircraft,
        alpha_rad=axis,
        elevator_rad=axis + elevator,
        qhat=axis,
        values=values,
        constant=np.tile(moment, (2, 1)),
        engine=moment,
        trim_alpha_rad=0.0,
        trim_elevator_rad=elevator,
        neutral_elevator_rad=elevator,
        alpha_shift_rad=alpha,
        thrust=np.array([0.1 * c.mass_kg * G0, 0.0]) if power is None else power.thrust,
        derivatives=np.asarray(derivatives, dtype=np.float64),
        derivative_cov=declared_covariance(aircraft, np.asarray(derivatives)),
        trim=None,
    )


def declared_derivatives(aircraft: Aircraft, at: Trim | None) -> Array:
    """(6,) of the JSBSim model at a trim, or as aircraft.toml states them.

    Raises
    ------
    AircraftError
        If neither is there.
    """
    if at is not None:
        return isolated(f"the derivatives of {aircraft.name}", linearise, aircraft, at).central
    return stated_derivatives(aircraft, LONGITUDINAL)


__all__ = [
    "SPEEDS",
    "Plant",
    "alpha_dot",
    "declared_derivatives",
    "linear",
    "probed",
    "trim_of",
    "with_throttle",
]
