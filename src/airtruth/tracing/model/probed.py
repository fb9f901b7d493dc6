"""The declared aircraft at a flight condition in JSBSim: its trim, its engines and its tables of forces."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import TrimError
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.motion_parts import Signal, reference_length_m
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.disposable import isolated
from airtruth.simulation.operating_point import lateral_operating_point, operating_point
from airtruth.simulation.probe import ForceGrid, forces_at_speeds
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import Trim, trim
from airtruth.tracing.model.declared import declared_covariance
from airtruth.tracing.model.plant import FLOW, FORCES, LAYOUTS, Engines, ForceTable, Plant
from airtruth.units import DEG

Array = NDArray[np.float64]

SPEEDS: Final = np.array([0.97, 1.0, 1.03])
"""Airspeeds over the trim's at which the engines are probed [-] (judgement): a flight test's scatter."""
_MARGIN: Final = 1.2
"""Range of a table over that of the records, from its middle [-] (judgement)."""
_LEAST_RATE: Final[Mapping[str | None, float]] = {None: 0.05, "span": 0.02}
"""Least range of the axis of a rate (judgement): the pitch rate [rad/s], and p b/(2V) or r b/(2V) [-], half a degree per second
for the GTM's span."""
_RATES: Final = 7
"""Points of the axis of a rate before its breaks are added [-] (judgement: the forces are nearly linear in it)."""


def flies(aircraft: Aircraft, motion: Motion) -> bool:
    """Whether the aircraft has a JSBSim model with the controls of a motion."""
    model = aircraft.file.jsbsim
    return model is not None and all(getattr(model, control.name) is not None for control in motion.controls)


def trim_of(
    aircraft: Aircraft,
    airspeed_m_s: float,
    density_kg_m3: float,
    altitude_m: float,
    gamma_rad: float,
    motion: Motion = LONGITUDINAL,
) -> Trim:
    """Trim the declared JSBSim aircraft at a measured airspeed, for a lateral motion in six axes with the wings level.

    Raises
    ------
    TrimError
        If it cannot fly there, or has no aileron or rudder for six axes.
    """
    eas = airspeed_m_s * float(np.sqrt(density_kg_m3 / 1.225))
    at = Condition(eas, altitude_m, gamma_rad, "pitch-plane" if motion is LONGITUDINAL else "wings-level")
    return isolated(f"the trim of {aircraft.name}", trim, aircraft, at)


def with_throttle(aircraft: Aircraft, at: Trim, throttle: float) -> Trim:
    """A trim at another throttle.

    In six axes, and where a model has lateral properties, the aircraft is held straight at it, as its pilot does: the flight
    path takes the place of the throttle. Otherwise its propeller would roll it. Where no such trim exists, and for any other
    model, the throttle alone is replaced.
    """
    model = aircraft.file.jsbsim
    if at.condition.six_axes or (model is not None and model.lateral is not None):
        with contextlib.suppress(TrimError):
            return isolated(
                f"the trim of {aircraft.name}", trim, aircraft, at.condition, near=at, throttle=throttle
            )
    return replace(at, controls=replace(at.controls, throttle=throttle))


def probed(
    aircraft: Aircraft, at: Trim, alpha: tuple[float, float], elevator: tuple[float, float], q: float
) -> Plant:
    """Tables of the JSBSim aircraft in the pitch plane, on whole degrees and where its own tables break.

    At equal alpha, elevator and qhat the forces are lines over the dynamic pressure. Their constants are those of the settled
    engines at the trim's angle of attack, and change with it as they do at a held speed of the engines.

    Parameters
    ----------
    alpha, elevator : lowest and highest angle [rad]; q : largest pitch rate [rad/s].
    """

    def whole(low: float, high: float) -> Array:
        first, last = np.floor(low / DEG) - 1.0, np.ceil(high / DEG) + 1.0
        return np.arange(first, last + 1.0) * DEG

    rates = np.linspace(-1.0, 1.0, _RATES) * max(q * _MARGIN, _LEAST_RATE[None])
    offset = at.controls.command(ELEVATOR) - at.elevator_rad
    commands = whole(elevator[0] + offset, elevator[1] + offset)
    grid = ForceGrid((whole(*alpha), commands, rates), np.ones(1))
    point = isolated(f"the table of forces of {aircraft.name}", operating_point, aircraft, at, grid, SPEEDS)
    tables, power = point.tables, _engines_of(at, point.at_speeds)
    over_alpha = _lines(at, point.over_alpha)[0]
    constant = power.constant + (
        over_alpha - over_alpha[int(np.argmin(np.abs(tables.axes[0] - at.alpha_rad)))]
    )
    values = (tables.values[0] - constant[:, None, None]) / _pressure(at)
    (names,) = LAYOUTS[LONGITUDINAL.name]
    *angles, rate = tables.axes
    signals = {signal.name: signal for signal in LONGITUDINAL.signals}
    rate = rate * reference_length_m(aircraft.constants, signals[names[-1]].length) / (2.0 * at.airspeed_m_s)
    return Plant(
        aircraft=aircraft,
        motion=LONGITUDINAL,
        tables=(ForceTable(names, (*angles, rate), np.ascontiguousarray(values)),),
        constant=constant,
        trims={name: at.of(signals[name].channel) for name in names},
        neutral_rad=np.zeros(len(LONGITUDINAL.controls)),
        derivatives=point.derivatives.central,
        derivative_cov=declared_covariance(aircraft, point.derivatives.central),
        trim=at,
        power=power,
    )


def probed_lateral(aircraft: Aircraft, at: Trim, reach: Mapping[str, tuple[float, float]]) -> Plant:
    """Tables of the JSBSim aircraft in six axes over what records reach, on whole degrees and where its own tables break.

    In each state the forces are lines over the dynamic pressure, whose constants are those of the trim's signals at the same
    angle of attack: engines and propellers. The products of two signals, of which alpha is none, are left out.

    Parameters
    ----------
    reach : signal, the angle of attack among them -> lowest and highest value [rad, -].
    """
    factors = [_to_signal(aircraft, at, signal) for signal in LATERAL.signals]
    axes = tuple(
        _whole(*reach[s.name]) if s.length is None else _rates(*reach[s.name], _LEAST_RATE[s.length]) / half
        for s, half in zip(LATERAL.signals, factors, strict=True)
    )
    point = isolated(
        f"the table of lateral forces of {aircraft.name}",
        lateral_operating_point,
        aircraft,
        at,
        ForceGrid((_whole(*reach[FLOW]), *axes), SPEEDS),
    )
    tables, derivatives = point.tables, point.derivatives.central
    constant = _lines(at, tables.over_alpha)[0]
    middle = tables.over_alpha[int(np.argmin(np.abs(SPEEDS - 1.0)))]
    values = [
        (own - (constant if number == 0 else middle)[:, None]) / _pressure(at)
        for number, own in enumerate(tables.values)
    ]
    own_axes = [x * f for x, f in zip(tables.axes[1:], factors, strict=True)]
    origin = at.origin(LATERAL).tolist()
    return Plant(
        aircraft=aircraft,
        motion=LATERAL,
        tables=tuple(
            ForceTable(names, (tables.axes[0], axis), own)
            for names, (axis, own) in zip(
                LAYOUTS[LATERAL.name], _of_one_length(own_axes, values), strict=True
            )
        ),
        constant=np.ascontiguousarray(constant),
        trims={FLOW: at.alpha_rad} | dict(zip((s.name for s in LATERAL.signals), origin, strict=True)),
        neutral_rad=np.zeros(len(LATERAL.controls)),
        derivatives=derivatives,
        derivative_cov=declared_covariance(aircraft, derivatives, LATERAL),
        trim=at,
    )


def _to_signal(aircraft: Aircraft, at: Trim, signal: Signal) -> float:
    """Factor from a channel to its signal: 1 for an angle, l/(2V) for a rate."""
    half = reference_length_m(aircraft.constants, signal.length) / (2.0 * at.airspeed_m_s)
    return 1.0 if signal.length is None else half


def engines(aircraft: Aircraft, at: Trim) -> Engines:
    """The engines of the JSBSim aircraft, from three airspeeds about a trim."""
    work = f"the forces of the engines of {aircraft.name}"
    return _engines_of(at, isolated(work, forces_at_speeds, aircraft, at, SPEEDS))


def _engines_of(at: Trim, at_speeds: Array) -> Engines:
    fitted = _lines(at, at_speeds)
    return Engines(np.ascontiguousarray(fitted[0, :FORCES]), np.ascontiguousarray(fitted[:, FORCES]))


def _pressure(at: Trim) -> float:
    return 0.5 * at.density_kg_m3 * at.airspeed_m_s**2


def _lines(at: Trim, values: Array) -> Array:
    """(2, ...) values at no dynamic pressure, and slopes over it, of (speeds, ...) values at `SPEEDS`."""
    pressures = 0.5 * at.density_kg_m3 * (at.airspeed_m_s * SPEEDS) ** 2
    basis = np.column_stack([np.ones_like(pressures), pressures])
    fitted = np.linalg.lstsq(basis, values.reshape(SPEEDS.size, -1), rcond=None)[0]
    return np.asarray(fitted.reshape(2, *values.shape[1:]), dtype=np.float64)


def _whole(low: float, high: float) -> Array:
    """Whole degrees over a range and a margin [rad]."""
    middle, half = 0.5 * (low + high), 0.5 * _MARGIN * (high - low)
    first, last = np.floor((middle - half) / DEG), np.ceil((middle + half) / DEG)
    return np.arange(first, max(last, first + 1.0) + 1.0) * DEG


def _rates(low: float, high: float, least: float) -> Array:
    most = max(_MARGIN * max(abs(low), abs(high)), least)
    return np.linspace(-most, most, _RATES)


def _of_one_length(axes: Sequence[Array], values: Sequence[Array]) -> list[tuple[Array, Array]]:
    """Tables on one number of points; those with fewer get points in the middle of their widest cells, on their lines.

    Parameters
    ----------
    axes : (points,) each; values : (alpha, points, 3) each.

    Returns
    -------
    (most points,) and (alpha, most points, 3) of each.
    """
    most = max(axis.size for axis in axes)
    filled = []
    for axis, own in zip(axes, values, strict=True):
        longer = axis
        while longer.size < most:
            cell = int(np.argmax(np.diff(longer)))
            longer = np.insert(longer, cell + 1, 0.5 * (longer[cell] + longer[cell + 1]))
        low = np.clip(np.searchsorted(axis, longer, side="right") - 1, 0, axis.size - 2)
        share = ((longer - axis[low]) / (axis[low + 1] - axis[low]))[:, None]
        filled.append((longer, (1.0 - share) * own[:, low] + share * own[:, low + 1]))
    return filled


__all__ = ["SPEEDS", "engines", "flies", "probed", "probed_lateral", "trim_of", "with_throttle"]
