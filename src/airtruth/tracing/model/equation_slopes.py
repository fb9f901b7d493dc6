"""Slopes of the equations of `airtruth.tracing.model.equations` in the states and the parameters."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.model.equations import (
    ALPHA_DOT,
    PLAY,
    PLAY_S,
    READING,
    Signals,
    air_alpha,
    cell,
    effective_elevator,
    gust,
    rates,
    shape,
    signal_of,
    terms,
)
from airtruth.tracing.model.kernel_input import AircraftArrays, AirPoint, FilterModel
from airtruth.tracing.model.parameters import CORE, GUST_1, LEAD, OUTPUTS
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
from airtruth.units import G0

Array = NDArray[np.float64]

_DERIVATIVES: Final = len(MOVERS)
"""First column of the derivatives, behind those of the states."""
_TRIM: Final = _DERIVATIVES + len(LONGITUDINAL.derivatives)
"""First column of the trim."""
_ROW: Final = len(LONGITUDINAL.signals)
"""Derivatives of a coefficient [-]."""
_LATE: Final = LEAD - 1
"""State of the upward gust as the tail meets it."""


class AircraftMoves(NamedTuple):
    """What the parameters move of `AircraftArrays` and of the gust.

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


class _Force(NamedTuple):
    """X, Z [N] and M [N m] of the tables, and their slopes in alpha, qhat and the thrust."""

    x: float
    z: float
    m: float
    x_alpha: float
    z_alpha: float
    m_alpha: float
    x_qhat: float
    z_qhat: float
    m_qhat: float
    x_thrust: float
    z_thrust: float
    m_thrust: float


@inner
def _look_up(
    aircraft: AircraftArrays, engine: Array, alpha: float, surface: float, qhat: float, qbar: float
) -> _Force:
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
                x, z, m = values[i + a, j + b, n + c, 0], values[i + a, j + b, n + c, 1], values[i + a, j + b, n + c, 2]
                w, wda, wdc = wa * wb * wc, da * wb * wc, wa * wb * dc
                fx, fz, fm = fx + w * x, fz + w * z, fm + w * m
                ax, az, am = ax + wda * x, az + wda * z, am + wda * m
                qx, qz, qm = qx + wdc * x, qz + wdc * z, qm + wdc * m
    by_alpha = 1.0 / (aircraft.alpha_rad[i + 1] - aircraft.alpha_rad[i])
    by_qhat = qbar / (aircraft.qhat[n + 1] - aircraft.qhat[n])
    return _Force(
        fx * qbar + (1.0 - si) * constant[i, 0] + si * constant[i + 1, 0],
        fz * qbar + (1.0 - si) * constant[i, 1] + si * constant[i + 1, 1],
        fm * qbar + (1.0 - si) * constant[i, 2] + si * constant[i + 1, 2],
        (ax * qbar + constant[i + 1, 0] - constant[i, 0]) * by_alpha,
        (az * qbar + constant[i + 1, 1] - constant[i, 1]) * by_alpha,
        (am * qbar + constant[i + 1, 2] - constant[i, 2]) * by_alpha,
        qx * by_qhat,
        qz * by_qhat,
        qm * by_qhat,
        (1.0 - si) * engine[i, 0] + si * engine[i + 1, 0],
        (1.0 - si) * engine[i, 1] + si * engine[i + 1, 1],
        (1.0 - si) * engine[i, 2] + si * engine[i + 1, 2],
    )


@inner
def _shape_slope(number: int, s: float) -> float:
    """Slope of `airtruth.physics.terms.numbered_shape`."""
    if number == 1:
        return 2.0 * s
    if number == 2:
        return 1.0 if s > 0.0 else 0.0
    if number == 3:
        return 1.0 if s < 0.0 else 0.0
    return 1.0


@inner
def _add_signal(number: int, by: float, work: SlopeWork, row: Array) -> None:
    """Add a multiple of the slopes of a signal; the surface and the dynamic pressure are known inputs."""
    if number == 0:
        for c in range(row.size):
            row[c] += by * work.alpha[c]
    elif number == 2:
        for c in range(row.size):
            row[c] += by * work.qhat[c]
    elif number == ALPHA_DOT:
        for c in range(row.size):
            row[c] += by * work.alpha_dot_hat[c]


@inner
def _add_term(t: int, x: Array, signals: Signals, model: FilterModel, feedback: float, by_alpha: float, work: SlopeWork) -> None:
    """Add the slopes of a term of CL or Cm.

    Parameters
    ----------
    feedback : loss of alpha_dot_hat by a unit of CL [-]; by_alpha : its slope in alpha.
    """
    effects = model.effects
    number, state, factor = effects.term_index[t, 1], effects.term_index[t, 3], effects.term_index[t, 4]
    amplitude, of_lift = effects.amplitude[t], effects.term_index[t, 0] == 0
    raw = x[state] if state >= 0 else signal_of(signals, number)
    loop = 1.0
    if number == ALPHA_DOT and of_lift:
        loop = 1.0 / (1.0 + amplitude * feedback)
    s = raw * loop - effects.origin[t]
    weight = signal_of(signals, factor) - effects.factor_origin[t] if factor >= 0 else 1.0
    bent = amplitude * _shape_slope(effects.term_index[t, 2], s) * weight
    row = work.lift if of_lift else work.moment
    if state >= 0:
        row[state] += bent
    else:
        _add_signal(number, bent * loop, work, row)
        if loop != 1.0:
            _add_signal(0, -bent * raw * loop * loop * amplitude * by_alpha, work, row)
    if factor >= 0:
        _add_signal(factor, amplitude * shape(effects.term_index[t, 2], s), work, row)


@inner
def _add_terms(x: Array, signals: Signals, model: FilterModel, in_alpha_dot: bool, feedback: float, by_alpha: float, work: SlopeWork) -> None:
    """Add the slopes of the terms in alpha', or of all others."""
    for t in range(model.effects.amplitude.size):
        if model.effects.term_index[t, 0] < READING and (model.effects.term_index[t, 1] == ALPHA_DOT) == in_alpha_dot:
            _add_term(t, x, signals, model, feedback, by_alpha, work)


@inner
def _air_slopes(
    x: Array, upward: float, at: AirPoint, model: FilterModel, moved: AircraftMoves, late: Array, work: SlopeWork
) -> None:
    """Slopes of the gust, of the late gust into ``late``, of alpha and of qhat."""
    gusts, motion, v = model.gusts, model.states.motion, at.airspeed_m_s
    for c in range(late.size):
        work.upward[c] = moved.upward[c] if c < CORE else 0.0
    for j in range(CORE):
        work.upward[motion + ROLLOFF] += moved.lead[j] * x[j]
    for c in range(late.size):
        late[c] = work.upward[c] / gusts.rotary_time_s
    late[_LATE] -= 1.0 / gusts.rotary_time_s
    sine = (math.sin(at.theta_rad - x[0]) * at.ground_m_s - gusts.level_m_s * upward) / v
    turn = 1.0 / math.sqrt(1.0 - sine * sine) if abs(sine) < 1.0 else 0.0
    half, share = 0.5 * model.aircraft.chord_m / v, turn * gusts.level_m_s / v
    tail = half * gusts.level_m_s / v
    for c in range(late.size):
        work.alpha[c] = share * work.upward[c]
        work.qhat[c] = -tail * gusts.rotary * late[c]
    work.alpha[0] += turn * math.cos(at.theta_rad - x[0]) * at.ground_m_s / v
    work.alpha[motion + LOG_GUST] += share * upward
    tail *= (upward - x[_LATE]) / gusts.rotary_time_s
    work.qhat[1] += half
    work.qhat[motion + ROTARY] -= tail
    work.qhat[motion + LOG_GUST] -= gusts.rotary * tail


@inner
def _coefficient_slopes(signals: Signals, model: FilterModel, moved: AircraftMoves, work: SlopeWork) -> None:
    """Slopes of CL and Cm beside the tables, without the effects' terms."""
    aircraft, motion = model.aircraft, model.states.motion
    more, d_alpha, d_de = (
        aircraft.increments,
        signals.alpha - aircraft.trim_alpha_rad,
        signals.elevator - aircraft.trim_elevator_rad,
    )
    for c in range(work.lift.size):
        work.lift[c] = more[0] * work.alpha[c] + more[1] * work.qhat[c]
        work.moment[c] = more[_ROW] * work.alpha[c] + more[_ROW + 1] * work.qhat[c]
    for i in range(_ROW):
        value = d_alpha if i == 0 else (signals.qhat if i == 1 else d_de)
        work.lift[motion + _DERIVATIVES + i] += value
        work.moment[motion + _DERIVATIVES + _ROW + i] += moved.inertia * value
        work.moment[motion + INERTIA] += moved.turned[i] * value
    work.lift[motion + _TRIM] += 1.0
    work.moment[motion + _TRIM + 1] += 1.0


@inner
def _turning(
    x: Array, fz: float, alpha: float, f: _Force, at: AirPoint, model: FilterModel, row: Array, work: SlopeWork
) -> None:
    """Slopes of alpha' into ``row``, where the force is ``fz`` in all."""
    cosine, sine = math.cos(alpha), math.sin(alpha)
    by = 1.0 / (model.aircraft.mass_kg * at.ground_m_s)
    by_alpha = by * (f.z_alpha * cosine - f.x_alpha * sine - fz * sine - f.x * cosine)
    by_qhat = by * (f.z_qhat * cosine - f.x_qhat * sine)
    by_lift = by * at.qbar_pa * model.aircraft.area_m2 * cosine
    for c in range(row.size):
        row[c] = by_alpha * work.alpha[c] + by_qhat * work.qhat[c] - by_lift * work.lift[c]
    row[0] += G0 * math.sin(at.theta_rad - x[0]) / at.ground_m_s
    row[1] += 1.0
    row[model.states.motion + THRUST] += by * (f.z_thrust * cosine - f.x_thrust * sine)


@inner
def _effect_slopes(half: float, model: FilterModel, slope: Array, work: SlopeWork) -> None:
    """Slopes of the rates of the effects' states."""
    effects = model.effects
    for c in range(work.lift.size):
        work.alpha_dot_hat[c] = half * slope[0, c]
    for k in range(effects.time_s.size):
        at, signal, wn = model.states.effect[k], effects.state_index[k, 1], 1.0 / effects.time_s[k]
        row = slope[at]
        for c in range(row.size):
            row[c] = 0.0
        if effects.state_index[k, 0] == PLAY:
            _add_signal(signal, 1.0 / PLAY_S, work, row)
            row[at] -= 1.0 / PLAY_S
        elif effects.state_index[k, 0] == 0:
            _add_signal(signal, wn, work, row)
            row[at] -= wn
        else:
            row[at + 1] = 1.0
            row = slope[at + 1]
            for c in range(row.size):
                row[c] = 0.0
            _add_signal(signal, wn * wn, work, row)
            row[at] -= wn * wn
            row[at + 1] -= 2.0 * effects.damping[k] * wn


@inner
def _all_terms(
    x: Array, f: _Force, lift: float, signals: Signals, at: AirPoint, model: FilterModel, work: SlopeWork
) -> None:
    """Add the slopes of the effects' terms of CL and Cm; ``lift``: CL of the increments without them."""
    aircraft, half = model.aircraft, 0.5 * model.aircraft.chord_m / at.airspeed_m_s
    force, alpha, mass = at.qbar_pa * aircraft.area_m2, signals.alpha, aircraft.mass_kg
    _add_terms(x, signals, model, False, 0.0, 0.0, work)
    # terms in alpha' take that of all other forces
    fz = f.z - force * (lift + terms(x, signals, model.effects, False, 0.0)[0])
    weight = G0 * math.cos(at.theta_rad - x[0]) / at.ground_m_s
    first = x[1] + (fz * math.cos(alpha) - f.x * math.sin(alpha)) / (mass * at.ground_m_s) + weight
    _turning(x, fz, alpha, f, at, model, work.alpha_dot_hat, work)
    for c in range(work.lift.size):
        work.alpha_dot_hat[c] *= half
    loss = half * force / (mass * at.airspeed_m_s)
    turned = Signals(alpha, signals.elevator, signals.qhat, first * half, signals.qbar)
    _add_terms(x, turned, model, True, loss * math.cos(alpha), -loss * math.sin(alpha), work)


@inner
def _gust_slopes(v: float, model: FilterModel, slope: Array) -> None:
    """Slopes of the rates of the gusts, but for the low-passed copies."""
    a = v / model.gusts.length_m
    for c in range(slope.shape[1]):
        slope[GUST_1, c] = slope[GUST_1 + 1, c] = 0.0
    slope[GUST_1, GUST_1], slope[GUST_1 + 1, GUST_1], slope[GUST_1 + 1, GUST_1 + 1] = -a, a, -a


@inner
def longitudinal_rate_slopes(
    x: Array, at: AirPoint, model: FilterModel, moved: AircraftMoves, out: Array, slope: Array, work: SlopeWork
) -> float:
    """See `airtruth.tracing.model.slopes.rate_slopes`."""
    az = rates(x, at, model, out)
    aircraft, gusts, motion, v = model.aircraft, model.gusts, model.states.motion, at.airspeed_m_s
    upward, half, more = gust(x, gusts.rolloff), 0.5 * aircraft.chord_m / v, aircraft.increments
    alpha = air_alpha(x, upward, gusts.level_m_s, at)
    surface = effective_elevator(at.elevator_rad, aircraft)
    tail = gusts.rotary * gusts.level_m_s * (upward - x[_LATE]) / (gusts.rotary_time_s * v)
    signals = Signals(alpha, surface, (x[1] - tail) * half, 0.0, at.qbar_pa)
    _air_slopes(x, upward, at, model, moved, slope[_LATE], work)
    f = _look_up(aircraft, moved.engine, alpha, surface, signals.qhat, at.qbar_pa)
    _coefficient_slopes(signals, model, moved, work)
    if model.effects.amplitude.size > 0:
        d_alpha, d_de = alpha - aircraft.trim_alpha_rad, surface - aircraft.trim_elevator_rad
        lift = at.lift + more[0] * d_alpha + more[1] * signals.qhat + more[2] * d_de
        _all_terms(x, f, lift, signals, at, model, work)
    mass, force, chord = aircraft.mass_kg, at.qbar_pa * aircraft.area_m2, aircraft.chord_m
    _turning(x, az * mass, alpha, f, at, model, slope[0], work)
    for c in range(slope.shape[1]):
        fz = f.z_alpha * work.alpha[c] + f.z_qhat * work.qhat[c] - force * work.lift[c]
        fm = f.m_alpha * work.alpha[c] + f.m_qhat * work.qhat[c] + force * chord * work.moment[c]
        slope[1, c] = (fm - chord * aircraft.cg_shift * fz) / aircraft.inertia_kg_m2
        slope[motion, c] = fz / mass
    slope[1, motion + THRUST] += (f.m_thrust - chord * aircraft.cg_shift * f.z_thrust) / aircraft.inertia_kg_m2
    slope[1, motion + INERTIA] -= out[1] / moved.inertia
    slope[motion, motion + THRUST] += f.z_thrust / mass
    _gust_slopes(v, model, slope)
    _effect_slopes(half, model, slope, work)
    return az


@inner
def _add_reading(t: int, x: Array, signals: Signals, model: FilterModel, work: SlopeWork, row: Array) -> None:
    """Add the slopes of an increment of a reading."""
    effects = model.effects
    number, state, behind = effects.term_index[t, 1], effects.term_index[t, 3], effects.term_index[t, 5]
    s = (x[state] if state >= 0 else signal_of(signals, number)) - effects.origin[t]
    weight = 1.0
    if behind >= 0:
        driver, own = effects.state_index[behind, 1], model.states.effect[behind]
        weight = x[own] - signal_of(signals, driver)
        value = effects.amplitude[t] * shape(effects.term_index[t, 2], s)
        row[own] += value
        _add_signal(driver, -value, work, row)
    by = effects.amplitude[t] * _shape_slope(effects.term_index[t, 2], s) * weight
    if state >= 0:
        row[state] += by
    else:
        _add_signal(number, by, work, row)


@inner
def longitudinal_output_slopes(
    x: Array,
    rate: Array,
    at: AirPoint,
    model: FilterModel,
    moved: AircraftMoves,
    slope: Array,
    out: Array,
    work: SlopeWork,
) -> None:
    """See `airtruth.tracing.model.slopes.output_slopes`."""
    scale, arm, motion, v = model.sensors.scale, model.sensors.arm_m, model.states.motion, at.airspeed_m_s
    half, effects = 0.5 * model.aircraft.chord_m / v, model.effects
    for c in range(out.shape[1]):
        out[0, c], out[1, c] = work.alpha[c], 0.0
        out[2, c] = slope[motion, c] - arm[2] * slope[1, c]
    out[0, 1] -= arm[0] / v
    out[1, 1] = 1.0
    out[0, motion + MOUNTING] -= x[1] / v * moved.mounting_m
    out[2, motion + MOUNTING] -= rate[1] * moved.mounting_m
    for c in range(out.shape[1]):  # readings take q c/(2V) of the body and no alpha'
        work.qhat[c] = work.alpha_dot_hat[c] = 0.0
    work.qhat[1] = half
    alpha = air_alpha(x, gust(x, model.gusts.rolloff), model.gusts.level_m_s, at)
    surface = effective_elevator(at.elevator_rad, model.aircraft)
    signals = Signals(alpha, surface, x[1] * half, 0.0, at.qbar_pa)
    for t in range(effects.amplitude.size):
        if effects.term_index[t, 0] >= READING:
            _add_reading(t, x, signals, model, work, out[effects.term_index[t, 0] - READING])
    for i in range(OUTPUTS):
        for c in range(out.shape[1]):
            out[i, c] *= scale[i]


register_slopes(AircraftArrays, MotionSlopes(longitudinal_rate_slopes, longitudinal_output_slopes))

__all__ = ["AircraftMoves", "longitudinal_output_slopes", "longitudinal_rate_slopes"]
