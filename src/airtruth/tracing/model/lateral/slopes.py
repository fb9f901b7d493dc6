"""Derivatives of the equations of the lateral-directional motion along those of the states, and in the parameters."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.cells import cell
from airtruth.numerics.compiled import inner
from airtruth.physics.motion import LATERAL
from airtruth.tracing.model.compile import CompiledChange
from airtruth.tracing.model.gust_slopes import gust_rate_slopes, gust_weights, slopes_of_gust
from airtruth.tracing.model.gust_states import gust_of
from airtruth.tracing.model.kernel_input import FilterModel
from airtruth.tracing.model.lateral.equations import (
    BETA_DOT,
    COEFFICIENTS,
    LATE,
    ROLL,
    SIGNALS,
    STATES,
    LateralSignals,
    half_time,
    look_up,
    measured,
    of_table,
    rates,
    terms,
    turning,
    with_beta_dot,
)
from airtruth.tracing.model.lateral.input import LateralAircraft, LateralPoint
from airtruth.tracing.model.parameters import ParameterLayout
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.slopes import (
    INERTIA,
    LOG_GUST,
    MOUNTING,
    MOVERS,
    ROLLOFF,
    ROTARY,
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
_TRIM: Final = _DERIVATIVES + len(LATERAL.derivatives)
"""Number of the first increment at the trim."""
_PHAT: Final = LateralSignals._fields.index("phat")
"""Number of the signal phat [-]."""
_RHAT: Final = LateralSignals._fields.index("rhat")
"""Number of the signal rhat [-]."""


class LateralMoves(NamedTuple):
    """Derivatives of `LateralAircraft` and of the gust in the parameters.

    Attributes
    ----------
    inertia : inertias over those at no relative change [-].
    turned : (15,) increments of the derivatives by a unit of that change [-]; zero for those of CY.
    mounting_m : distance by which a unit of the share moves the CG past the sensors [m].
    side, lead : (core,) slopes in the states of the gust, and of what a unit of the rolloff adds to it [-].
    """

    inertia: float
    turned: Array
    mounting_m: float
    side: Array
    lead: Array


@inner
def _table_slope(aircraft: LateralAircraft, signals: LateralSignals, number: int, force: int) -> float:
    """Slope of Y [N], L or N [N m] of the tables in a signal: that of the cell."""
    low, share = cell(aircraft.alpha_rad, signals.alpha)
    axis, values = aircraft.points[number], aircraft.values
    j = cell(axis, of_table(signals, number))[0]
    below = values[number, low, j + 1, force] - values[number, low, j, force]
    above = values[number, low + 1, j + 1, force] - values[number, low + 1, j, force]
    return float(signals.qbar * ((1.0 - share) * below + share * above) / (axis[j + 1] - axis[j]))


@inner
def _air_slopes(
    x: Array,
    d_x: Array,
    at: LateralPoint,
    model: FilterModel,
    moved: LateralMoves,
    column: Ints,
    late: Array,
    work: SlopeWork,
) -> None:
    """Derivatives of the gust, of the late gust's rate into ``late``, of beta, phat and rhat."""
    gusts, v, own = model.gusts, at.airspeed_m_s, work.gust
    side = gust_of(x, STATES, gusts.rolloff)
    slopes_of_gust(x, d_x, STATES, moved.side, moved.lead, column[ROLLOFF], own)
    sine = (math.sin(x[0]) * at.ground_m_s - gusts.level_m_s * side) / v
    turn = 1.0 / math.sqrt(1.0 - sine * sine) if abs(sine) < 1.0 else 0.0
    steep, share = turn * math.cos(x[0]) * at.ground_m_s / v, turn * gusts.level_m_s / v
    half, rate = half_time(at, model), 1.0 / gusts.rotary_time_s
    roll, yaw = half * gusts.level_m_s * gusts.roll_1_m, half * gusts.level_m_s / v
    d_beta, d_phat, d_rhat = work.signal[0], work.signal[_PHAT], work.signal[_RHAT]
    for p in range(own.size):
        late[p] = rate * (own[p] - d_x[LATE, p])
    for p in range(own.size):
        d_beta[p] = steep * d_x[0, p] - share * own[p]
    by_roll, by_yaw = gusts.rotary * roll, gusts.rotary * yaw
    for p in range(own.size):
        d_phat[p] = half * d_x[1, p] - by_roll * d_x[ROLL, p]
    for p in range(own.size):
        d_rhat[p] = half * d_x[2, p] - by_yaw * late[p]
    behind = rate * (side - x[LATE])
    d_beta[column[LOG_GUST]] -= share * side
    d_phat[column[LOG_GUST]] -= by_roll * x[ROLL]
    d_rhat[column[LOG_GUST]] -= by_yaw * behind
    d_phat[column[ROTARY]] -= roll * x[ROLL]
    d_rhat[column[ROTARY]] -= yaw * behind


@inner
def _coefficient_slopes(
    signals: LateralSignals, model: FilterModel, moved: LateralMoves, column: Ints, work: SlopeWork
) -> None:
    """Derivatives of CY, Cl and Cn beside the tables, without the effects' terms."""
    aircraft = model.aircraft
    d_beta, d_phat, d_rhat = work.signal[0], work.signal[_PHAT], work.signal[_RHAT]
    for c in range(COEFFICIENTS):
        row, first = work.increment[c], c * SIGNALS
        by_beta, by_phat, by_rhat = (
            aircraft.increments[first],
            aircraft.increments[first + 1],
            aircraft.increments[first + 2],
        )
        for p in range(row.size):
            row[p] = by_beta * d_beta[p] + by_phat * d_phat[p] + by_rhat * d_rhat[p]
        for s in range(SIGNALS):
            away = of_table(signals, s) - aircraft.trim[s]
            row[column[_DERIVATIVES + first + s]] += away * (moved.inertia if c > 0 else 1.0)
            row[column[INERTIA]] += moved.turned[first + s] * away
        row[column[_TRIM + c]] += 1.0


@inner
def _force_slopes(
    force: int, by: float, signals: LateralSignals, model: FilterModel, row: Array, work: SlopeWork
) -> None:
    """Derivatives of Y, L or N of the air, tables and increments, into ``row``; ``by``: of a unit of its coefficient."""
    beta, phat, rhat = (
        _table_slope(model.aircraft, signals, 0, force),
        _table_slope(model.aircraft, signals, 1, force),
        _table_slope(model.aircraft, signals, 2, force),
    )
    d_beta, d_phat, d_rhat = work.signal[0], work.signal[_PHAT], work.signal[_RHAT]
    more = work.increment[force]
    for p in range(row.size):
        row[p] = beta * d_beta[p] + phat * d_phat[p] + rhat * d_rhat[p] + by * more[p]


@inner
def _turning(
    x: Array, d_x: Array, fy: float, d_fy: Array, at: LateralPoint, model: FilterModel, row: Array
) -> None:
    """Derivatives of beta' into ``row``, where the side force is ``fy`` in all and has the derivatives ``d_fy``."""
    mass, along = model.aircraft.mass_kg, at.ground_m_s * math.cos(x[0])
    sine, cosine, level = (
        math.sin(at.ground_attack_rad),
        math.cos(at.ground_attack_rad),
        G0 * math.cos(at.theta_rad),
    )
    by_roll, by_force, tangent = level * math.cos(x[3]) / along, 1.0 / (mass * along), math.tan(x[0])
    by_beta = (level * math.sin(x[3]) + fy / mass) / along * tangent
    by_beta -= at.speed_rate_1_s * (1.0 + tangent * tangent)
    for p in range(row.size):
        turned = sine * d_x[1, p] - cosine * d_x[2, p] + by_roll * d_x[3, p]
        row[p] = by_beta * d_x[0, p] + turned + by_force * d_fy[p]


@inner
def _all_terms(
    x: Array,
    d_x: Array,
    signals: LateralSignals,
    at: LateralPoint,
    model: FilterModel,
    d_fy: Array,
    work: SlopeWork,
) -> None:
    """Add the derivatives of the effects' terms of CY, Cl and Cn; ``d_fy`` is overwritten."""
    aircraft, effects, half = model.aircraft, model.effects, half_time(at, model)
    force, along = at.qbar_pa * aircraft.area_m2, at.ground_m_s * math.cos(x[0])
    gain = half * force / (aircraft.mass_kg * along)
    side = at.side + terms(x, signals, effects, False, gain)[0]
    fy = look_up(aircraft, signals)[0] + force * side
    first = turning(x, at) + fy / (aircraft.mass_kg * along)
    turned = with_beta_dot(signals, first * half)
    for turn in range(2):  # terms in beta' take that of all other forces
        if turn == 1:
            row = work.signal[BETA_DOT]
            _force_slopes(0, force, signals, model, d_fy, work)
            _turning(x, d_x, fy, d_fy, at, model, row)
            for p in range(row.size):
                row[p] *= half
        for t in range(effects.amplitude.size):
            if effects.term_index[t, 0] < COEFFICIENTS and (effects.term_index[t, 1] == BETA_DOT) == (
                turn == 1
            ):
                by_beta = -gain * math.tan(x[0])
                add_term(t, x, d_x, turned, effects, BETA_DOT, -gain, by_beta, d_x[0], work)


@inner
def lateral_rate_slopes(
    x: Array,
    d_x: Array,
    at: LateralPoint,
    model: FilterModel,
    moved: LateralMoves,
    column: Ints,
    out: Array,
    slope: Array,
    work: SlopeWork,
) -> float:
    """See `airtruth.tracing.model.slopes.rate_slopes`."""
    ay = rates(x, at, model, out)
    aircraft, gusts, motion = model.aircraft, model.gusts, model.states.motion
    mass, q = aircraft.mass_kg, at.q_rad_s
    _air_slopes(x, d_x, at, model, moved, column, slope[LATE], work)
    signals = measured(x, at, model)
    _coefficient_slopes(signals, model, moved, column, work)
    d_fy, d_fl, d_fn = slope[motion], slope[1], slope[2]
    if model.effects.amplitude.size > 0:
        _all_terms(x, d_x, signals, at, model, d_fy, work)
    force = at.qbar_pa * aircraft.area_m2
    _force_slopes(0, force, signals, model, d_fy, work)
    with_arm = force * aircraft.span_m
    _force_slopes(1, with_arm, signals, model, d_fl, work)
    _force_slopes(2, with_arm, signals, model, d_fn, work)
    _turning(x, d_x, ay * mass, d_fy, at, model, slope[0])
    ixx, iyy = aircraft.inertia_xx_kg_m2, aircraft.inertia_yy_kg_m2
    izz, ixz = aircraft.inertia_zz_kg_m2, aircraft.inertia_xz_kg_m2
    in_roll, in_yaw, across = (izz - iyy) * q, (iyy - ixx) * q, ixz * q
    arm = aircraft.cg_shift * aircraft.chord_m
    for p in range(d_fl.size):
        d_fl[p] += across * d_x[1, p] - in_roll * d_x[2, p]
    for p in range(d_fn.size):
        d_fn[p] += arm * d_fy[p] - across * d_x[2, p] - in_yaw * d_x[1, p]
    # the inertias alike: the moments of the air turn less, the coupling as before
    d_fl[column[INERTIA]] += (across * x[1] - in_roll * x[2]) / moved.inertia
    d_fn[column[INERTIA]] -= (across * x[2] + in_yaw * x[1]) / moved.inertia
    by = 1.0 / (ixx * izz - ixz * ixz)
    for p in range(d_fl.size):
        roll, yaw = d_fl[p], d_fn[p]
        d_fl[p], d_fn[p] = by * (izz * roll + ixz * yaw), by * (ixz * roll + ixx * yaw)
    d_fl[column[INERTIA]] -= out[1] / moved.inertia
    d_fn[column[INERTIA]] -= out[2] / moved.inertia
    sine, cosine, steep = math.sin(x[3]), math.cos(x[3]), math.tan(at.theta_rad)
    turned = (q * cosine - x[2] * sine) * steep
    for p in range(d_fy.size):
        slope[3, p] = d_x[1, p] + cosine * steep * d_x[2, p] + turned * d_x[3, p]
        d_fy[p] /= mass
    gust_rate_slopes(at.airspeed_m_s, STATES, d_x, model, slope)
    for p in range(d_fy.size):
        slope[ROLL, p] = -d_x[ROLL, p] / gusts.roll_time_s
    effect_slopes(half_time(at, model), BETA_DOT, d_x, model, slope, work)
    return ay


@inner
def lateral_output_slopes(
    x: Array,
    d_x: Array,
    rate: Array,
    slope: Array,
    at: LateralPoint,
    model: FilterModel,
    moved: LateralMoves,
    column: Ints,
    out: Array,
    work: SlopeWork,
) -> None:
    """See `airtruth.tracing.model.slopes.output_slopes`."""
    sensors, motion, q, d_beta = model.sensors, model.states.motion, at.q_rad_s, work.signal[0]
    vane, above = sensors.arm_m[0] / at.airspeed_m_s, sensors.down_m[0] / at.airspeed_m_s
    ahead, down, d_force = sensors.arm_m[4], sensors.down_m[4], slope[motion]
    for p in range(out.shape[1]):
        out[0, p] = d_beta[p] + vane * d_x[2, p] - above * d_x[1, p]
        out[1, p], out[2, p], out[3, p] = d_x[1, p], d_x[2, p], d_x[3, p]
        in_yaw, in_roll = slope[2, p] + q * d_x[1, p], slope[1, p] - q * d_x[2, p]
        out[4, p] = d_force[p] + ahead * in_yaw - down * in_roll
    out[0, column[MOUNTING]] += x[2] / at.airspeed_m_s * moved.mounting_m
    out[4, column[MOUNTING]] += (rate[2] + x[1] * q) * moved.mounting_m
    if model.effects.amplitude.size > 0:  # readings take no beta'
        d_turn = work.signal[BETA_DOT]
        for p in range(out.shape[1]):
            d_turn[p] = 0.0
        reading_slopes(x, d_x, measured(x, at, model), COEFFICIENTS, model, out, work)
    for i in range(out.shape[0]):
        for p in range(out.shape[1]):
            out[i, p] *= sensors.scale[i]


def pack_lateral_moves(
    record: TraceRecord, compiled: CompiledChange, common: Array, rolloff: float
) -> LateralMoves:
    """Derivatives of `airtruth.tracing.model.lateral.packing.pack_lateral` in the parameters."""
    entries, plant = ParameterLayout(LATERAL).common, record.plant
    turned = np.zeros(len(LATERAL.derivatives))
    for row in (LATERAL.row(x.name) for x in LATERAL.coefficients if x.length is not None):
        turned[row] = plant.turned[row] + common[row]
    side, lead = gust_weights(STATES, rolloff)
    return LateralMoves(
        inertia=1.0 + float(common[entries.inertia]),
        turned=turned,
        mounting_m=compiled.declared["cg"] * plant.aircraft.constants.chord_m,
        side=side,
        lead=lead,
    )


register_slopes(LateralAircraft, MotionSlopes(lateral_rate_slopes, lateral_output_slopes, pack_lateral_moves))

__all__ = ["LateralMoves", "lateral_output_slopes", "lateral_rate_slopes", "pack_lateral_moves"]
