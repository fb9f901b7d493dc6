"""Forces of the declared aircraft over the signals of the lateral-directional motion: probed in JSBSim, or linear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.physics.motion import LATERAL
from airtruth.simulation.disposable import isolated
from airtruth.simulation.linearise_lateral import linearise_lateral
from airtruth.simulation.operating_point import lateral_operating_point
from airtruth.simulation.probe_lateral import LateralGrid
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import Trim, trim
from airtruth.tracing.model.declared import declared_covariance, stated_derivatives
from airtruth.tracing.model.plant import SPEEDS
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

_MARGIN: Final = 1.2
"""Range of the tables over that of the records, from its middle [-] (judgement)."""
_RATES: Final = 7
"""Points of the axis of a rate before its breaks are added [-] (judgement: the forces are nearly linear in it)."""
_LEAST_RATE: Final = 0.02
"""Least range of the axis of a rate, p b/(2V) or r b/(2V) [-] (judgement: half a degree per second for the GTM's span)."""


@dataclass(frozen=True)
class LateralPlant:
    """The declared aircraft about one trim, as the filter needs it; the tables add up, one for each signal of the motion.

    Attributes
    ----------
    alpha_rad : (alpha,) axis of the tables [rad].
    points : (signals, points) axis of each signal: beta, p b/(2V), r b/(2V), aileron, rudder [rad, -].
    values : (signals, alpha, points, 3) Y [m2], L and N [m3] of the air over the dynamic pressure; the part at the trim's beta,
        no rates and the trim's surfaces is in the table of beta alone.
    constant : (alpha, 3) Y [N], L and N [N m] at no dynamic pressure.
    trim_alpha_rad : angle of attack of the trim [rad].
    trim_signals : (signals,) origin of the increments of the derivatives [rad, -].
    neutral_rad : (controls,) deflections that an effectiveness leaves alone [rad]: zero, for the linear model its trim.
    derivatives, derivative_cov : (15,) declared values and (15, 15) covariance, mass, inertias and CG included.
    trim : of the JSBSim aircraft, None for a linear one.
    alpha_shift_rad : 0, because the tables are over the measured angle of attack; of `airtruth.tracing.model.plant.Plant`, the
        angle from which the linear model counts.
    """

    aircraft: Aircraft
    alpha_rad: Array
    points: Array
    values: Array
    constant: Array
    trim_alpha_rad: float
    trim_signals: Array
    neutral_rad: Array
    derivatives: Array
    derivative_cov: Array
    trim: Trim | None
    alpha_shift_rad: float = 0.0


@dataclass(frozen=True)
class Reach:
    """What records reach.

    Attributes
    ----------
    alpha_rad : lowest and highest angle of attack [rad].
    signals : (signals, 2) the same of beta, p b/(2V), r b/(2V), aileron, rudder [rad, -].
    """

    alpha_rad: tuple[float, float]
    signals: Array


def lateral_trim(
    aircraft: Aircraft, airspeed_m_s: float, density_kg_m3: float, altitude_m: float, gamma_rad: float
) -> Trim:
    """Trim the declared JSBSim aircraft in six axes at a measured airspeed, wings level.

    Raises
    ------
    TrimError
        If it cannot fly there, or has no aileron or rudder.
    """
    eas = airspeed_m_s * float(np.sqrt(density_kg_m3 / 1.225))
    at = Condition(eas, altitude_m, gamma_rad, "wings-level")
    return isolated(f"the trim of {aircraft.name} in six axes", trim, aircraft, at)


def probed_lateral(aircraft: Aircraft, at: Trim, reach: Reach) -> LateralPlant:
    """Tables of the JSBSim aircraft over what records reach, on whole degrees and where its own tables break.

    In each state the forces are lines over the dynamic pressure, whose constants are those of the trim's signals at the same
    angle of attack: engines and propellers. The products of two signals, of which alpha is none, are left out.
    """
    half = aircraft.constants.span_m / (2.0 * at.airspeed_m_s)
    per_signal = np.array([1.0 if s.length is None else half for s in LATERAL.signals])
    axes = tuple(
        _whole(low, high) if s.length is None else _rates(low, high) / half
        for s, (low, high) in zip(LATERAL.signals, reach.signals.tolist(), strict=True)
    )
    point = isolated(
        f"the table of lateral forces of {aircraft.name}",
        lateral_operating_point,
        aircraft,
        at,
        LateralGrid(_whole(*reach.alpha_rad), axes, SPEEDS),
    )
    tables, derivatives = point.tables, point.derivatives.central
    pressures = 0.5 * at.density_kg_m3 * (at.airspeed_m_s * SPEEDS) ** 2
    basis = np.column_stack([np.ones_like(pressures), pressures])
    rows = tables.over_alpha.reshape(SPEEDS.size, -1)
    constant = np.linalg.lstsq(basis, rows, rcond=None)[0][0].reshape(-1, 3)
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    middle = tables.over_alpha[int(np.argmin(np.abs(SPEEDS - 1.0)))]
    values = [
        (own - (constant if number == 0 else middle)[:, None]) / pressure
        for number, own in enumerate(tables.values)
    ]
    points, filled = _of_one_length([x * f for x, f in zip(tables.signals, per_signal, strict=True)], values)
    surfaces = [at.controls.sideslip_rad, 0.0, 0.0, at.aileron_rad, at.rudder_rad]
    return LateralPlant(
        aircraft=aircraft,
        alpha_rad=tables.alpha_rad,
        points=points,
        values=filled,
        constant=np.ascontiguousarray(constant),
        trim_alpha_rad=at.alpha_rad,
        trim_signals=np.array(surfaces),
        neutral_rad=np.zeros(len(LATERAL.controls)),
        derivatives=derivatives,
        derivative_cov=declared_covariance(aircraft, derivatives, LATERAL),
        trim=at,
    )


def _whole(low: float, high: float) -> Array:
    """Whole degrees over a range and a margin [rad]."""
    middle, half = 0.5 * (low + high), 0.5 * _MARGIN * (high - low)
    first, last = np.floor((middle - half) / DEG), np.ceil((middle + half) / DEG)
    return np.arange(first, max(last, first + 1.0) + 1.0) * DEG


def _rates(low: float, high: float) -> Array:
    most = max(_MARGIN * max(abs(low), abs(high)), _LEAST_RATE)
    return np.linspace(-most, most, _RATES)


def _of_one_length(axes: Sequence[Array], values: Sequence[Array]) -> tuple[Array, Array]:
    """Tables on one number of points; those with fewer get points in the middle of their widest cells, on their lines.

    Parameters
    ----------
    axes : (points,) each; values : (alpha, points, 3) each.

    Returns
    -------
    (signals, most points), (signals, alpha, most points, 3).
    """
    most = max(axis.size for axis in axes)
    points, filled = [], []
    for axis, own in zip(axes, values, strict=True):
        longer = axis
        while longer.size < most:
            cell = int(np.argmax(np.diff(longer)))
            longer = np.insert(longer, cell + 1, 0.5 * (longer[cell] + longer[cell + 1]))
        low = np.clip(np.searchsorted(axis, longer, side="right") - 1, 0, axis.size - 2)
        share = ((longer - axis[low]) / (axis[low + 1] - axis[low]))[:, None]
        points.append(longer)
        filled.append((1.0 - share) * own[:, low] + share * own[:, low + 1])
    return np.stack(points), np.ascontiguousarray(np.stack(filled))


def linear_lateral(
    aircraft: Aircraft,
    derivatives: Array,
    pressure_pa: float,
    start: Array,
    phi_rad: float,
    theta_rad: float,
) -> LateralPlant:
    """The linear lateral-directional model about a measured trim, as tables of two points per axis.

    Parameters
    ----------
    derivatives : (15,) declared [-].
    pressure_pa : dynamic pressure of the trim [Pa].
    start : (signals,) the record's own trim: the air holds the weight's side component there, without a moment [rad, -].
    phi_rad, theta_rad : bank and pitch attitude of that trim [rad].
    """
    c = aircraft.constants
    axis = np.array([-1.0, 1.0])
    scale = c.wing_area_m2 * np.array([1.0 if x.length is None else c.span_m for x in LATERAL.coefficients])
    by_signal = (derivatives.reshape(LATERAL.shape) * scale[:, None]).T
    values = np.zeros((len(LATERAL.signals), 2, 2, len(LATERAL.coefficients)))
    values += by_signal[:, None, None, :] * axis[None, None, :, None]
    values[0, :, :, 0] -= c.mass_kg * G0 * np.cos(theta_rad) * np.sin(phi_rad) / pressure_pa
    return LateralPlant(
        aircraft=aircraft,
        alpha_rad=axis,
        points=start[:, None] + axis,
        values=values,
        constant=np.zeros((2, len(LATERAL.coefficients))),
        trim_alpha_rad=0.0,
        trim_signals=start,
        neutral_rad=start[-len(LATERAL.controls) :],
        derivatives=derivatives,
        derivative_cov=declared_covariance(aircraft, derivatives, LATERAL),
        trim=None,
    )


def declared_lateral(aircraft: Aircraft, at: Trim | None) -> Array:
    """(15,) derivatives of the JSBSim model at a trim in six axes, or as aircraft.toml states them [-].

    Raises
    ------
    AircraftError
        If neither is there.
    """
    if at is None:
        return stated_derivatives(aircraft, LATERAL)
    work = f"the lateral derivatives of {aircraft.name}"
    return isolated(work, linearise_lateral, aircraft, at).central


def looked_up_lateral(plant: LateralPlant, alpha_rad: Array, signals: Array, pressure_pa: Array) -> Array:
    """(states, 3) Y [N], L and N [N m] of the tables of a plant.

    Parameters
    ----------
    alpha_rad, pressure_pa : (states,) [rad], [Pa]; signals : (states, signals) [rad, -]. The end cells of the tables go on
        outside.
    """
    i, u = _cell(plant.alpha_rad, alpha_rad)
    total = np.zeros((alpha_rad.size, 3))
    for axis, values, x in zip(plant.points, plant.values, signals.T, strict=True):
        j, v = _cell(axis, x)
        for a, b in np.ndindex(2, 2):
            share = (u if a else 1.0 - u) * (v if b else 1.0 - v)
            total += share[:, None] * values[i + a, j + b]
    constant = (1.0 - u)[:, None] * plant.constant[i] + u[:, None] * plant.constant[i + 1]
    return np.asarray(total * pressure_pa[:, None] + constant)


def _cell(axis: Array, x: Array) -> tuple[NDArray[np.intp], Array]:
    low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    return low, (x - axis[low]) / (axis[low + 1] - axis[low])


__all__ = [
    "LateralPlant",
    "Reach",
    "declared_lateral",
    "lateral_trim",
    "linear_lateral",
    "looked_up_lateral",
    "probed_lateral",
]
