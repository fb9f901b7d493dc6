"""Derivatives of the equations of the pitch plane along those of the states, and in the parameters."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.cells import cell
from airtruth.numerics.compiled import inner
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import SIGNALS
from airtruth.tracing.model.compile import CompiledChange
from airtruth.tracing.model.gust_slopes import gust_rate_slopes, gust_weights, slopes_of_gust
from airtruth.tracing.model.kernel_input import FilterModel
from airtruth.tracing.model.longitudinal.equations import (
    ALPHA_DOT,
    READING,
    AirSignals,
    air_alpha,
    effective_elevator,
    gust,
    half_time,
    measured,
    rates,
    terms,
)
from airtruth.tracing.model.longitudinal.input import AircraftArrays, AirPoint
from airtruth.tracing.model.parameters import GUST_1, LEAD, OUTPUTS, SHORT_PERIOD
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.slopes import (
    INERTIA,
    LOG_GUST,
    MOUNTING,
    MOVERS,
    ROLLOFF,
    ROTARY,
    THRUST,
    MotionSlopes,
    SlopeWork,
    register_slopes,
)
from airtruth.tracing.model.term_slopes import add_term, effect_slopes, reading_slopes
from airtruth.units import G0

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_DERIVATIVES: Final = len(MOVERS)
"""Number of the first derivative among the columns."""
_TRIM: Final = _DERIVATIVES + len(LONGITUDINAL.derivatives)
"""Number of the first increment at the trim."""
_ROW: Final = len(LONGITUDINAL.signals)
"""Derivatives of a coefficient [-]."""
_LATE: Final = LEAD - 1
"""State of the upward gust as the tail meets it."""
_QHAT: Final = SIGNALS.index("qhat")
"""Number of the signal qhat [-]."""


class AircraftMoves(NamedTuple):
    """Derivatives of `AircraftArrays` and of the gust in the parameters.

    Attributes
    ----------
    inertia : inertia over that at no relative change [-].
    turned : (signals,) increments of the derivatives of Cm by a unit of that change [-].
    engine : (alpha, 3) X, Z [N] and M [N m] of a unit of the relative change of the thrust.
    mounting_m : distance by which a unit of the share moves the CG past the sensors [m].
    upward, lead : (core,) slopes in the states of the gust, and of what a unit of the rolloff adds to it [-].
    """

    inertia: float
    turned: Array
    engine: Array
    mounting_m: float
    upward: Array
    lead: Array


class _ForceSlopes(NamedTuple):
    """X, Z [N] and M [N m] of the tables, their slopes in alpha and qhat, and all three in the thrust."""

    x: float
    z: float
    m: float
    x_alpha: float
    z_alpha: float
    m_alpha: float
    x_qhat: float
    z_qhat: float
    m_qhat: float
    thrust: tuple[float, float, float]


@inner
def _look_up(
    aircraft: AircraftArrays, engine: Array, alpha: float, surface: float, qhat: float, qbar: float
) -> _ForceSlopes:
    """Trilinear in the tables; the slopes are those of the cell."""
    values, constant = aircraft.values, aircraft.constant
    i, si = cell(aircraft.alpha_rad, alpha)
    j, sj = cell(aircraft.elevator_rad, surface)
    n, sn = cell(aircraft.qhat, qhat)
    fx = fz = fm = ax = az = am = qx = qz = qm = 0.0
    for a in range(2):
        wa, da = si if a else 1.0 - si, 1.0 if a else -1.0
        for b in range(2):
            wb = sj if b else 1.0 - sj
            for c in range(2):
                wc, dc = sn if c else 1.0 - sn, 1.0 if c else -1.0
                x, z, m = (
                    values[i + a, j + b, n + c, 0],
                    values[i + a, j + b, n + c, 1],
                    values[i + a, j + b, n + c, 2],
                )
                w, wda, wdc = wa * wb * wc, da * wb * wc, wa * wb * dc
                fx, fz, fm = fx + w * x, fz + w * z, fm + w * m
                ax, az, am = ax + wda * x, az + wda * z, am + wda * m
                qx, qz, qm = qx + wdc * x, qz + wdc * z, qm + wdc * m
    thrust = (
        (1.0 - si) * engine[i, 0] + si * engine[i + 1, 0],
        (1.0 - si) * engine[i, 1] + si * engine[i + 1, 1],
        (1.0 - si) * engine[i, 2] + si * engine[i + 1, 2],
    )
    by_alpha = 1.0 / (aircraft.alpha_rad[i + 1] - aircraft.alpha_rad[i])
    by_qhat = qbar / (aircraft.qhat[n + 1] - aircraft.qhat[n])
    return _ForceSlopes(
        fx * qbar + (1.0 - si) * constant[i, 0] + si * constant[i + 1, 0],
        fz * qbar + (1.0 - si) * constant[i, 1] + si * constant[i + 1, 1],
        fm * qbar + (1.0 - si) * constant[i, 2] + si * constant[i + 1, 2],
        (ax * qbar + constant[i + 1, 0] - constant[i, 0]) * by_alpha,
        (az * qbar + constant[i + 1, 1] - constant[i, 1]) * by_alpha,
        (am * qbar + constant[i + 1, 2] - constant[i, 2]) * by_alpha,
        qx * by_qhat,
        qz * by_qhat,
        qm * by_qhat,
        thrust,
    )


@inner
def _all_terms(
    x: Array,
    d_x: Array,
    f: _ForceSlopes,
    own: float,
    signals: AirSignals,
    at: AirPoint,
    model: FilterModel,
    column: Ints,
    work: SlopeWork,
) -> None:
    """Add the derivatives of the effects' terms of CL and Cm; ``own``: CL of the increments without them."""
    aircraft, effects, half = model.aircraft, model.effects, half_time(at, model)
    force, alpha, mass = at.qbar_pa * aircraft.area_m2, signals.alpha, aircraft.mass_kg
    loss = half * force / (mass * at.airspeed_m_s)
    weight = G0 * math.cos(at.theta_rad - x[0]) / at.ground_m_s + at.turn_rad_s
    fz = f.z - force * (own + terms(x, signals, effects, False, 0.0)[0])
    first = x[1] + (fz * math.cos(alpha) - f.x * math.sin(alpha)) / (mass * at.ground_m_s) + weight
    turned = AirSignals(alpha, signals.elevator, signals.qhat, first * half, signals.qbar)
    for turn in range(2):  # terms in alpha' take that of all other forces
        if turn == 1:
            row = work.signal[ALPHA_DOT]
            _turning(x, d_x, fz, alpha, f, at, model, column, row, work)
            for p in range(row.size):
                row[p] *= half
        for t in range(effects.amplitude.size):
            if effects.term_index[t, 0] < READING and (effects.term_index[t, 1] == ALPHA_DOT) == (turn == 1):
                own_loss, by_alpha = loss * math.cos(alpha), -loss * math.sin(alpha)
                add_term(t, x, d_x, turned, effects, ALPHA_DOT, own_loss, by_alpha, work.signal[0], work)


@inner
def _air_slopes(
    x: Array,
    d_x: Array,
    upward: float,
    at: AirPoint,
    model: FilterModel,
    moved: AircraftMoves,
    column: Ints,
    late: Array,
    work: SlopeWork,
) -> None:
    """Derivatives of the gust, of the late gust's rate into ``late``, of alpha and of qhat."""
    gusts, v = model.gusts, at.airspeed_m_s
    sine = (math.sin(at.theta_rad - x[0]) * at.ground_m_s - gusts.level_m_s * upward) / v
    turn = 1.0 / math.sqrt(1.0 - sine * sine) if abs(sine) < 1.0 else 0.0
    half, share, rate = (
        half_time(at, model),
        turn * gusts.level_m_s / v,
        1.0 / gusts.rotary_time_s,
    )
    tail, steep = half * gusts.level_m_s / v, turn * math.cos(at.theta_rad - x[0]) * at.ground_m_s / v
    size, own, d_alpha, d_qhat = late.size, work.gust, work.signal[0], work.signal[_QHAT]
    slopes_of_gust(x, d_x, GUST_1, moved.upward, moved.lead, column[ROLLOFF], own)
    for p in range(size):
        late[p] = rate * (own[p] - d_x[_LATE, p])
    for p in range(size):
        d_alpha[p] = steep * d_x[0, p] + share * own[p]
    turning = tail * gusts.rotary
    for p in range(size):
        d_qhat[p] = half * d_x[1, p] - turning * late[p]
    behind = tail * rate * (upward - x[_LATE])
    d_alpha[column[LOG_GUST]] += share * upward
    d_qhat[column[ROTARY]] -= behind
    d_qhat[column[LOG_GUST]] -= gusts.rotary * behind


@inner
def _coefficient_slopes(
    signals: AirSignals, model: FilterModel, moved: AircraftMoves, column: Ints, work: SlopeWork
) -> None:
    """Derivatives of CL and Cm beside the tables, without the effects' terms."""
    aircraft, more = model.aircraft, model.aircraft.increments
    z_by_alpha, z_by_qhat, m_by_alpha, m_by_qhat = more[0], more[1], more[_ROW], more[_ROW + 1]
    d_alpha, d_qhat, first, second = work.signal[0], work.signal[_QHAT], work.increment[0], work.increment[1]
    for p in range(d_alpha.size):
        first[p] = z_by_alpha * d_alpha[p] + z_by_qhat * d_qhat[p]
    for p in range(d_alpha.size):
        second[p] = m_by_alpha * d_alpha[p] + m_by_qhat * d_qhat[p]
    for i in range(_ROW):
        value = signals.qhat
        if i == 0:
            value = signals.alpha - aircraft.trim_alpha_rad
        elif i == 2:
            value = signals.elevator - aircraft.trim_elevator_rad
        work.increment[0, column[_DERIVATIVES + i]] += value
        work.increment[1, column[_DERIVATIVES + _ROW + i]] += moved.inertia * value
        work.increment[1, column[INERTIA]] += moved.turned[i] * value
    work.increment[0, column[_TRIM]] += 1.0
    work.increment[1, column[_TRIM + 1]] += 1.0


@inner
def _turning(
    x: Array,
    d_x: Array,
    fz: float,
    alpha: float,
    f: _ForceSlopes,
    at: AirPoint,
    model: FilterModel,
    column: Ints,
    row: Array,
    work: SlopeWork,
) -> None:
    """Derivatives of alpha' into ``row``, where the force is ``fz`` in all."""
    cosine, sine = math.cos(alpha), math.sin(alpha)
    by = 1.0 / (model.aircraft.mass_kg * at.ground_m_s)
    by_alpha = by * (f.z_alpha * cosine - f.x_alpha * sine - fz * sine - f.x * cosine)
    by_qhat = by * (f.z_qhat * cosine - f.x_qhat * sine)
    by_first = by * at.qbar_pa * model.aircraft.area_m2 * cosine
    falls = G0 * math.sin(at.theta_rad - x[0]) / at.ground_m_s
    d_alpha, d_qhat, first = work.signal[0], work.signal[_QHAT], work.increment[0]
    for p in range(row.size):
        more = by_alpha * d_alpha[p] + by_qhat * d_qhat[p] - by_first * first[p]
        row[p] = falls * d_x[0, p] + d_x[1, p] + more
    row[column[THRUST]] += by * (f.thrust[1] * cosine - f.thrust[0] * sine)


@inner
def longitudinal_rate_slopes(
    x: Array,
    d_x: Array,
    at: AirPoint,
    model: FilterModel,
    moved: AircraftMoves,
    column: Ints,
    out: Array,
    slope: Array,
    work: SlopeWork,
) -> float:
    """See `airtruth.tracing.model.slopes.rate_slopes`."""
    az = rates(x, at, model, out)
    aircraft, gusts, motion, v = model.aircraft, model.gusts, model.states.motion, at.airspeed_m_s
    upward, half, more = gust(x, gusts.rolloff), half_time(at, model), aircraft.increments
    alpha = air_alpha(x, upward, gusts.level_m_s, at)
    surface = effective_elevator(at.elevator_rad, aircraft)
    tail = gusts.rotary * gusts.level_m_s * (upward - x[_LATE]) / (gusts.rotary_time_s * v)
    signals = AirSignals(alpha, surface, (x[1] - tail) * half, 0.0, at.qbar_pa)
    _air_slopes(x, d_x, upward, at, model, moved, column, slope[_LATE], work)
    f = _look_up(aircraft, moved.engine, alpha, surface, signals.qhat, at.qbar_pa)
    _coefficient_slopes(signals, model, moved, column, work)
    if model.effects.amplitude.size > 0:
        d_alpha, d_de = alpha - aircraft.trim_alpha_rad, surface - aircraft.trim_elevator_rad
        own = at.lift + more[0] * d_alpha + more[1] * signals.qhat + more[2] * d_de
        _all_terms(x, d_x, f, own, signals, at, model, column, work)
    mass, force = aircraft.mass_kg, at.qbar_pa * aircraft.area_m2
    arm, by = aircraft.chord_m * aircraft.cg_shift, 1.0 / aircraft.inertia_kg_m2
    _turning(x, d_x, az * mass, alpha, f, at, model, column, slope[0], work)
    z_alpha, z_qhat, z_first = f.z_alpha / mass, f.z_qhat / mass, force / mass
    d_alpha, d_qhat, first, second = work.signal[0], work.signal[_QHAT], work.increment[0], work.increment[1]
    for p in range(slope.shape[1]):
        slope[motion, p] = z_alpha * d_alpha[p] + z_qhat * d_qhat[p] - z_first * first[p]
    m_alpha, m_qhat = by * (f.m_alpha - arm * f.z_alpha), by * (f.m_qhat - arm * f.z_qhat)
    m_first, m_second = by * arm * force, by * force * aircraft.chord_m
    for p in range(slope.shape[1]):
        tables = m_alpha * d_alpha[p] + m_qhat * d_qhat[p]
        slope[1, p] = tables + m_first * first[p] + m_second * second[p]
    slope[1, column[THRUST]] += by * (f.thrust[2] - arm * f.thrust[1])
    slope[1, column[INERTIA]] -= out[1] / moved.inertia
    slope[motion, column[THRUST]] += f.thrust[1] / mass
    gust_rate_slopes(v, GUST_1, d_x, model, slope)
    effect_slopes(half, ALPHA_DOT, d_x, model, slope, work)
    return az


@inner
def longitudinal_output_slopes(
    x: Array,
    d_x: Array,
    rate: Array,
    slope: Array,
    at: AirPoint,
    model: FilterModel,
    moved: AircraftMoves,
    column: Ints,
    out: Array,
    work: SlopeWork,
) -> None:
    """See `airtruth.tracing.model.slopes.output_slopes`."""
    scale, arm, motion, v = model.sensors.scale, model.sensors.arm_m, model.states.motion, at.airspeed_m_s
    vane, ahead = arm[0] / v, arm[2]
    for p in range(out.shape[1]):
        out[0, p] = work.signal[0, p] - vane * d_x[1, p]
    for p in range(out.shape[1]):
        out[1, p] = d_x[1, p]
    for p in range(out.shape[1]):
        out[2, p] = slope[motion, p] - ahead * slope[1, p]
    out[0, column[MOUNTING]] -= x[1] / v * moved.mounting_m
    out[2, column[MOUNTING]] -= rate[1] * moved.mounting_m
    if model.effects.amplitude.size > 0:  # readings take q c/(2V) of the body and no alpha'
        half, d_qhat, d_turn = half_time(at, model), work.signal[_QHAT], work.signal[ALPHA_DOT]
        for p in range(out.shape[1]):
            d_qhat[p], d_turn[p] = half * d_x[1, p], 0.0
        alpha = air_alpha(x, gust(x, model.gusts.rolloff), model.gusts.level_m_s, at)
        reading_slopes(x, d_x, measured(x, alpha, at, model), READING, model, out, work)
    for i in range(OUTPUTS):
        if scale[i] != 1.0:
            for p in range(out.shape[1]):
                out[i, p] *= scale[i]


def pack_moves(record: TraceRecord, compiled: CompiledChange, common: Array, rolloff: float) -> AircraftMoves:
    """Derivatives of `airtruth.tracing.model.longitudinal.packing.pack_aircraft` in the parameters."""
    entries, row = SHORT_PERIOD.common, LONGITUDINAL.row("Cm")
    plant = record.plant
    upward, lead = gust_weights(GUST_1, rolloff)
    return AircraftMoves(
        inertia=1.0 + float(common[entries.inertia]),
        turned=plant.turned[row] + common[row],
        engine=np.zeros_like(plant.constant) + plant.power.constant,
        mounting_m=compiled.declared["cg"] * plant.aircraft.constants.chord_m,
        upward=upward,
        lead=lead,
    )


register_slopes(
    AircraftArrays, MotionSlopes(longitudinal_rate_slopes, longitudinal_output_slopes, pack_moves)
)

__all__ = ["AircraftMoves", "longitudinal_output_slopes", "longitudinal_rate_slopes", "pack_moves"]
