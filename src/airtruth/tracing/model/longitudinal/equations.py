"""Nonlinear equations of motion and of the sensors of an aircraft in gusts.

States x (`airtruth.tracing.model.parameters`): alpha over ground [rad], q [rad/s], two Dryden states of unit variance,
the upward gust as the tail meets it, three low-passed copies of the first Dryden state, then the states of effects.

The upward gust is w = sigma (1.22 x_2 - 0.52 x_3 + rolloff sum_i g_i (x_2 - x_i)). Without rolloff its spectrum is
Dryden's; with a rolloff of 1 it falls as von Karman's, with the power -5/3 instead of -2, in the band that a flight
test excites. Airspeed, density, pitch attitude, the speed without the gust along the path, and what roll, yaw and bank add to
alpha' and q' are known inputs. The angle of attack of the air is theta - asin((V_ground sin(theta - alpha) - w)/V), its
pitch rate q - (w - w_late)/(tau V) with tau = 4 b/(pi V).

Forces: tables of X, Z, M over alpha, elevator and q c/(2V) times q_bar, constants over alpha, increments of the
derivatives, and the terms of `airtruth.physics.terms`.

Sources: B. Etkin and L. D. Reid, *Dynamics of Flight*, 3rd ed., 1996, eqs 4.7,1 and 4.7,2; gusts, MIL-F-8785C, 3.7.1.1, 3.7.1.2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.cells import cell
from airtruth.numerics.compiled import inner, shared
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.sensors import vane_equation
from airtruth.tracing.model.by_motion import MotionEquations, register
from airtruth.tracing.model.effect_states import (
    add_readings,
    effect_rates,
    follow,
    has_plays,
    shape,
    signal_of,
)
from airtruth.tracing.model.gust_states import gust_of, gust_rates
from airtruth.tracing.model.kernel_input import EffectArrays, FilterModel
from airtruth.tracing.model.longitudinal.input import AircraftArrays, AirInputs, AirPoint
from airtruth.tracing.model.parameters import GUST_1, OUTPUTS
from airtruth.units import G0

Array = NDArray[np.float64]

READING: Final = len(LONGITUDINAL.coefficients)
"""First number of a reading among what a term acts on, see `EffectArrays`."""
ALPHA_DOT: Final = 3
"""Number of the signal alpha_dot_hat in `airtruth.physics.terms.SIGNALS`."""

_vane = cast("Callable[[float, float, float, float], float]", inner(vane_equation))


class AirSignals(NamedTuple):
    """Signals of aerodynamic terms, in the order of `airtruth.physics.terms.SIGNALS`.

    Attributes
    ----------
    alpha, elevator : of the air, of the surface [rad]; qhat, alpha_dot_hat : q c/(2V), alpha' c/(2V) [-]; qbar : dynamic
        pressure [Pa].
    """

    alpha: float
    elevator: float
    qhat: float
    alpha_dot_hat: float
    qbar: float


@shared
def gust(x: Array, rolloff: float) -> float:
    """Upward gust over the level of Dryden's part [-]."""
    return gust_of(x, GUST_1, rolloff)


@inner
def air_alpha(x: Array, upward: float, level_m_s: float, at: AirPoint) -> float:
    """Angle of attack of the air at the CG [rad] in an upward gust [-] of a level [m/s]."""
    sine = (math.sin(at.theta_rad - x[0]) * at.ground_m_s - level_m_s * upward) / at.airspeed_m_s
    return at.theta_rad - math.asin(min(max(sine, -1.0), 1.0))


@shared
def effective_elevator(elevator_rad: float, aircraft: AircraftArrays) -> float:
    """Deflection whose forces the tables hold [rad]."""
    neutral = aircraft.neutral_elevator_rad
    return neutral + aircraft.effectiveness * (elevator_rad - neutral)


@inner
def _look_up(
    aircraft: AircraftArrays, alpha: float, surface: float, qhat: float, qbar: float
) -> tuple[float, float, float]:
    """X, Z [N] and M [N m], trilinear in the tables."""
    values = aircraft.values
    i, si = cell(aircraft.alpha_rad, alpha)
    j, sj = cell(aircraft.elevator_rad, surface)
    n, sn = cell(aircraft.qhat, qhat)
    fx = fz = fm = 0.0
    for a in range(2):
        wa = si if a else 1.0 - si
        for b in range(2):
            w1 = wa * (sj if b else 1.0 - sj)
            w0, w1 = w1 * (1.0 - sn), w1 * sn
            fx += w0 * values[i + a, j + b, n, 0] + w1 * values[i + a, j + b, n + 1, 0]
            fz += w0 * values[i + a, j + b, n, 1] + w1 * values[i + a, j + b, n + 1, 1]
            fm += w0 * values[i + a, j + b, n, 2] + w1 * values[i + a, j + b, n + 1, 2]
    constant = aircraft.constant
    return (
        fx * qbar + (1.0 - si) * constant[i, 0] + si * constant[i + 1, 0],
        fz * qbar + (1.0 - si) * constant[i, 1] + si * constant[i + 1, 1],
        fm * qbar + (1.0 - si) * constant[i, 2] + si * constant[i + 1, 2],
    )


@inner
def terms(
    x: Array, signals: AirSignals, effects: EffectArrays, in_alpha_dot: bool, feedback: float
) -> tuple[float, float]:
    """Increments of CL and Cm by the effects' terms in alpha', or by all others.

    Parameters
    ----------
    feedback : loss of alpha_dot_hat by a unit of CL [-]; a term of CL in alpha' is part of the alpha' that it is
        proportional to.
    """
    lift = moment = 0.0
    for t in range(effects.amplitude.size):
        number = effects.term_index[t, 1]
        if (number == ALPHA_DOT) != in_alpha_dot or effects.term_index[t, 0] >= READING:
            continue
        state, amplitude = effects.term_index[t, 3], effects.amplitude[t]
        s = x[state] if state >= 0 else signal_of(signals, number)
        if in_alpha_dot and effects.term_index[t, 0] == 0:
            s /= 1.0 + amplitude * feedback
        increment = amplitude * shape(effects.term_index[t, 2], s - effects.origin[t])
        factor = effects.term_index[t, 4]
        if factor >= 0:
            increment *= signal_of(signals, factor) - effects.factor_origin[t]
        if effects.term_index[t, 0] == 0:
            lift += increment
        else:
            moment += increment
    return lift, moment


@inner
def rates(x: Array, at: AirPoint, model: FilterModel, out: Array) -> float:
    """See `airtruth.tracing.model.by_motion.rates`; returns az at the CG [m/s2]."""
    aircraft, gusts = model.aircraft, model.gusts
    v, ground, qbar = at.airspeed_m_s, at.ground_m_s, at.qbar_pa
    upward = gust(x, gusts.rolloff)
    alpha = air_alpha(x, upward, gusts.level_m_s, at)
    cosine, sine = math.cos(alpha), math.sin(alpha)
    weight = G0 * math.cos(at.theta_rad - x[0]) / ground + at.turn_rad_s
    q = x[1]
    late = (upward - x[4]) / gusts.rotary_time_s
    surface = effective_elevator(at.elevator_rad, aircraft)
    force, half = qbar * aircraft.area_m2, half_time(at, model)
    qhat = (q - gusts.rotary * gusts.level_m_s * late / v) * half
    fx, fz, fm = _look_up(aircraft, alpha, surface, qhat, qbar)
    d_alpha, d_de, more = (
        alpha - aircraft.trim_alpha_rad,
        surface - aircraft.trim_elevator_rad,
        aircraft.increments,
    )
    lift = at.lift + more[0] * d_alpha + more[1] * qhat + more[2] * d_de
    moment = at.moment + more[3] * d_alpha + more[4] * qhat + more[5] * d_de
    mass = aircraft.mass_kg
    if model.effects.amplitude.size > 0:
        for turn in range(2):  # terms in alpha' last: they take alpha' with everything else in it
            first = q + ((fz - force * lift) * cosine - fx * sine) / (mass * ground) + weight
            signals = AirSignals(alpha, surface, qhat, first * half, qbar)
            added = terms(x, signals, model.effects, turn == 1, half * force * cosine / (mass * v))
            lift, moment = lift + added[0], moment + added[1]
    fz -= force * lift
    fm += (
        force * aircraft.chord_m * (moment - aircraft.cg_shift * fz / force)
        + (aircraft.thrust_n + aircraft.thrust_slope_m2 * qbar) * aircraft.thrust_arm_m
    )
    out[0] = q + (fz * cosine - fx * sine) / (mass * ground) + weight
    out[1] = fm / aircraft.inertia_kg_m2 + at.pitch_rad_s2
    gust_rates(x, GUST_1, v, late, gusts, out)
    effect_rates(x, AirSignals(alpha, surface, qhat, out[0] * half, qbar), model, out)
    return float(fz / mass)


@inner
def half_time(at: AirPoint, model: FilterModel) -> float:
    """c/(2V) [s]."""
    return float(0.5 * model.aircraft.chord_m / at.airspeed_m_s)


@inner
def measured(x: Array, alpha: float, at: AirPoint, model: FilterModel) -> AirSignals:
    """The signals that need no acceleration."""
    surface = effective_elevator(at.elevator_rad, model.aircraft)
    qhat = x[1] * 0.5 * model.aircraft.chord_m / at.airspeed_m_s
    return AirSignals(alpha, surface, qhat, 0.0, at.qbar_pa)


@inner
def move_plays(x: Array, at: AirPoint, model: FilterModel) -> None:
    """See `airtruth.tracing.model.by_motion.move_plays`."""
    if has_plays(model.effects):
        alpha = air_alpha(x, gust(x, model.gusts.rolloff), model.gusts.level_m_s, at)
        follow(x, measured(x, alpha, at, model), model)


def settle_effects(x: Array, at: AirPoint, model: FilterModel) -> None:
    """Put the effects' states into equilibrium with the angle of attack of a state and a surface deflection."""
    for k in range(model.effects.time_s.size):
        signal, s = model.effects.state_index[k, 1], 0.0
        if signal == 0:
            s = x[0]
        elif signal == 1:
            s = effective_elevator(at.elevator_rad, model.aircraft)
        x[model.states.effect[k]] = s


@inner
def air_at(grid: AirInputs[Array], point: int) -> AirPoint:
    """Inputs at a point of the filter's grid."""
    return AirInputs(
        grid.elevator_rad[point],
        grid.airspeed_m_s[point],
        grid.ground_m_s[point],
        grid.qbar_pa[point],
        grid.theta_rad[point],
        grid.turn_rad_s[point],
        grid.pitch_rad_s2[point],
        grid.lift[point],
        grid.moment[point],
    )


@inner
def outputs(x: Array, rate: Array, az: float, at: AirPoint, model: FilterModel, y: Array) -> None:
    """alpha [rad], q [rad/s] and az [m/s2], see `airtruth.tracing.model.by_motion.outputs`."""
    scale, arm = model.sensors.scale, model.sensors.arm_m
    alpha = air_alpha(x, gust(x, model.gusts.rolloff), model.gusts.level_m_s, at)
    y[0] = _vane(alpha, x[1], arm[0], at.airspeed_m_s)
    y[1] = x[1]
    y[2] = az - arm[2] * rate[1]
    if model.effects.amplitude.size > 0:
        add_readings(x, measured(x, alpha, at, model), READING, model, y)
    for i in range(OUTPUTS):
        y[i] *= scale[i]


@inner
def signals_at(x: Array, at: AirPoint, rate: float, model: FilterModel, out: Array) -> None:
    """See `airtruth.tracing.model.by_motion.signals_at`."""
    gusts, half = model.gusts, half_time(at, model)
    upward = gust(x, gusts.rolloff)
    late = (upward - x[GUST_1 + 2]) / gusts.rotary_time_s
    out[0] = air_alpha(x, upward, gusts.level_m_s, at)
    out[1] = effective_elevator(at.elevator_rad, model.aircraft)
    out[2] = (x[1] - gusts.rotary * gusts.level_m_s * late / at.airspeed_m_s) * half
    out[3] = rate * half
    out[4] = at.qbar_pa
    out[5] = x[1] * half


@inner
def shifted(at: AirPoint, field: int, by: float) -> AirPoint:
    """See `airtruth.tracing.model.by_motion.shifted`; no effect moves the fields between the control and the coefficients."""
    return AirInputs(
        at.elevator_rad + (by if field == 0 else 0.0),
        at.airspeed_m_s,
        at.ground_m_s,
        at.qbar_pa,
        at.theta_rad,
        at.turn_rad_s,
        at.pitch_rad_s2,
        at.lift + (by if field == 7 else 0.0),
        at.moment + (by if field == 8 else 0.0),
    )


register(
    AircraftArrays,
    AirInputs,
    MotionEquations(
        states=len(LONGITUDINAL.states),
        early=len(LONGITUDINAL.outputs) - 1,
        rates=rates,
        outputs=outputs,
        air_at=air_at,
        move_plays=move_plays,
        settle=settle_effects,
        shifted=shifted,
        signals_at=signals_at,
        point=AirInputs,
        coefficients=len(LONGITUDINAL.coefficients),
    ),
)

__all__ = [
    "ALPHA_DOT",
    "READING",
    "AirSignals",
    "air_alpha",
    "air_at",
    "effective_elevator",
    "gust",
    "half_time",
    "measured",
    "rates",
    "settle_effects",
    "terms",
]
