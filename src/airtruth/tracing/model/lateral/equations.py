"""Nonlinear equations of the lateral-directional motion and of its sensors in side gusts.

States x: beta over ground [rad], p, r [rad/s], phi [rad], two Dryden states of unit variance, the side gust as the fin meets it,
three low-passed copies of the first Dryden state, the roll gust of unit variance, then the states of effects. Airspeed, the
speed without the gust along the path, angle of attack, pitch attitude, pitch rate and the specific forces along x and z are known
inputs.

    beta' = p sin(alpha) - r cos(alpha) + (Y/m + g cos(theta) sin(phi))/(V cos(beta)) - V'/V tan(beta)
    Ixx p' - Ixz r' = L + Ixz p q - (Izz - Iyy) q r,   Izz r' - Ixz p' = N - Ixz q r - (Iyy - Ixx) p q
    phi' = p + (q sin(phi) + r cos(phi)) tan(theta),   ay = Y/m + x (r' + p q) - z (p' - q r)

with V, alpha and beta over ground. The gust v to the right has the filter of the vertical one
(`airtruth.tracing.model.gust_states`). The beta of the air is asin((V_ground sin(beta) - v)/V), its yaw rate
r - (v - v_late)/(tau V) with tau = 3 b/(pi V), its roll rate p - p_gust; p_gust is that of MIL-F-8785C, its level that of v
(`airtruth.physics.lateral_gusts`). Both rotary gusts have the share ``rotary``.

Forces: for each signal a table of Y, L, N over alpha and the signal, times q_bar; constants over alpha; increments of the
derivatives; terms of `airtruth.physics.terms`. A CG that moves aft takes Y along; one that moves to the right by d leaves the
other forces at its left, with the moments L = -d m az and N = d m ax of the measured specific forces, which follow the gusts. A
normal force that acts farther left by e adds L = -e m az.

Sources: B. L. Stevens and F. L. Lewis, Aircraft Control and Simulation, 2nd ed., 2003, table 2.5-1; V. Klein and E. A. Morelli,
Aircraft System Identification, AIAA, 2006, 3.2; gusts, MIL-F-8785C, 3.7.1.2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.cells import cell
from airtruth.numerics.compiled import inner, shared
from airtruth.physics.motion import LATERAL
from airtruth.physics.sensors import side_vane_equation
from airtruth.tracing.model.by_motion import MotionEquations
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
from airtruth.tracing.model.lateral.input import LateralAircraft, LateralAirInputs, LateralPoint
from airtruth.tracing.model.parameters import core_of
from airtruth.units import G0

Array = NDArray[np.float64]

STATES: Final = len(LATERAL.states)
"""Number of states of the motion [-]."""
COEFFICIENTS: Final = len(LATERAL.coefficients)
"""Number of coefficients, and first number of a reading among what a term acts on [-]."""
SIGNALS: Final = len(LATERAL.signals)
"""Number of signals that have a table [-]."""
LATE: Final = STATES + 2
"""State of the gust at the fin [-]."""
ROLL: Final = core_of(STATES)
"""State of the roll gust [-]."""
BETA_DOT: Final = 5
"""Number of the signal beta_dot_hat [-]."""

_vane = cast(
    "Callable[[float, float, float, float, float, float], float]",
    inner(side_vane_equation),
)


class LateralSignals(NamedTuple):
    """Signals of aerodynamic terms, in the order of `airtruth.physics.terms.signals_of` the motion.

    Attributes
    ----------
    beta : of the air [rad]; aileron, rudder : surfaces [rad].
    phat, rhat, beta_dot_hat : p b/(2V), r b/(2V) of the air, beta' b/(2V) [-].
    qbar : dynamic pressure [Pa]; alpha : angle of attack [rad].
    """

    beta: float
    aileron: float
    rudder: float
    phat: float
    rhat: float
    beta_dot_hat: float
    qbar: float
    alpha: float


@inner
def air_beta(x: Array, side: float, level_m_s: float, at: LateralPoint) -> float:
    """Sideslip of the air at the CG [rad] in a side gust [-] of a level [m/s]."""
    sine = (math.sin(x[0]) * at.ground_m_s - level_m_s * side) / at.airspeed_m_s
    return math.asin(min(max(sine, -1.0), 1.0))


@shared
def effective_deflection(rad: float, control: int, aircraft: LateralAircraft) -> float:
    """Deflection whose forces the tables hold [rad]."""
    neutral = aircraft.neutral_rad[control]
    return float(neutral + aircraft.effectiveness[control] * (rad - neutral))


@inner
def half_time(at: LateralPoint, model: FilterModel) -> float:
    """b/(2V) [s]."""
    return float(0.5 * model.aircraft.span_m / at.airspeed_m_s)


@inner
def turning(x: Array, at: LateralPoint) -> float:
    """beta' without the side force [rad/s]."""
    moved, level = at.ground_m_s * math.cos(x[0]), G0 * math.cos(at.theta_rad)
    return float(
        x[1] * math.sin(at.ground_attack_rad)
        - x[2] * math.cos(at.ground_attack_rad)
        + level * math.sin(x[3]) / moved
        - at.speed_rate_1_s * math.tan(x[0])
    )


@inner
def measured(x: Array, at: LateralPoint, model: FilterModel) -> LateralSignals:
    """The signals but beta', which needs the forces."""
    aircraft, gusts = model.aircraft, model.gusts
    side, v = gust_of(x, STATES, gusts.rolloff), at.airspeed_m_s
    half, turned = half_time(at, model), gusts.rotary * gusts.level_m_s
    late = (side - x[LATE]) / gusts.rotary_time_s
    return LateralSignals(
        air_beta(x, side, gusts.level_m_s, at),
        effective_deflection(at.aileron_rad, 0, aircraft),
        effective_deflection(at.rudder_rad, 1, aircraft),
        (x[1] - turned * gusts.roll_1_m * x[ROLL]) * half,
        (x[2] - turned * late / v) * half,
        0.0,
        at.qbar_pa,
        at.alpha_rad,
    )


@inner
def of_table(signals: LateralSignals, number: int) -> float:
    """Signal of a table, in the order of the motion."""
    if number == 0:
        return signals.beta
    if number == 1:
        return signals.phat
    if number == 2:
        return signals.rhat
    return signals.aileron if number == 3 else signals.rudder


@inner
def look_up(aircraft: LateralAircraft, signals: LateralSignals) -> tuple[float, float, float]:
    """Y [N], L and N [N m] of the tables, each linear in alpha and its signal, with the increments of the derivatives."""
    low, share = cell(aircraft.alpha_rad, signals.alpha)
    values, constant, more = aircraft.values, aircraft.constant, aircraft.increments
    fy = fl = fn = cy = cl = cn = 0.0
    for s in range(SIGNALS):
        x = of_table(signals, s)
        j, sj = cell(aircraft.points[s], x)
        for a in range(2):
            wa = share if a else 1.0 - share
            w0, w1 = wa * (1.0 - sj), wa * sj
            fy += w0 * values[s, low + a, j, 0] + w1 * values[s, low + a, j + 1, 0]
            fl += w0 * values[s, low + a, j, 1] + w1 * values[s, low + a, j + 1, 1]
            fn += w0 * values[s, low + a, j, 2] + w1 * values[s, low + a, j + 1, 2]
        away = x - aircraft.trim[s]
        cy += more[s] * away
        cl += more[SIGNALS + s] * away
        cn += more[2 * SIGNALS + s] * away
    force = signals.qbar * aircraft.area_m2
    moment = force * aircraft.span_m
    return (
        fy * signals.qbar + (1.0 - share) * constant[low, 0] + share * constant[low + 1, 0] + force * cy,
        fl * signals.qbar + (1.0 - share) * constant[low, 1] + share * constant[low + 1, 1] + moment * cl,
        fn * signals.qbar + (1.0 - share) * constant[low, 2] + share * constant[low + 1, 2] + moment * cn,
    )


@inner
def terms(
    x: Array, signals: LateralSignals, effects: EffectArrays, in_beta_dot: bool, feedback: float
) -> tuple[float, float, float]:
    """Increments of CY, Cl and Cn by the effects' terms in beta', or by all others.

    Parameters
    ----------
    feedback : gain of beta_dot_hat by a unit of CY [-]; a term of CY in beta' is part of the beta' that it is proportional to.
    """
    side = roll = yaw = 0.0
    for t in range(effects.amplitude.size):
        acts_on, number = effects.term_index[t, 0], effects.term_index[t, 1]
        if (number == BETA_DOT) != in_beta_dot or acts_on >= COEFFICIENTS:
            continue
        state, amplitude = effects.term_index[t, 3], effects.amplitude[t]
        s = x[state] if state >= 0 else signal_of(signals, number)
        if in_beta_dot and acts_on == 0:
            s /= 1.0 - amplitude * feedback
        increment = amplitude * shape(effects.term_index[t, 2], s - effects.origin[t])
        factor = effects.term_index[t, 4]
        if factor >= 0:
            increment *= signal_of(signals, factor) - effects.factor_origin[t]
        if acts_on == 0:
            side += increment
        elif acts_on == 1:
            roll += increment
        else:
            yaw += increment
    return side, roll, yaw


@inner
def with_beta_dot(signals: LateralSignals, beta_dot_hat: float) -> LateralSignals:
    return LateralSignals(
        signals.beta,
        signals.aileron,
        signals.rudder,
        signals.phat,
        signals.rhat,
        beta_dot_hat,
        signals.qbar,
        signals.alpha,
    )


@inner
def rates(x: Array, at: LateralPoint, model: FilterModel, out: Array) -> float:
    """See `airtruth.tracing.model.by_motion.rates`; returns ay at the CG [m/s2]."""
    aircraft, gusts = model.aircraft, model.gusts
    p, r, q, mass = x[1], x[2], at.q_rad_s, aircraft.mass_kg
    signals = measured(x, at, model)
    fy, fl, fn = look_up(aircraft, signals)
    force = at.qbar_pa * aircraft.area_m2
    half, moved = half_time(at, model), at.ground_m_s * math.cos(x[0])
    unforced = turning(x, at)
    side, roll, yaw = at.side, at.roll, at.yaw
    if model.effects.amplitude.size > 0:
        for turn in range(2):  # terms in beta' last: they take beta' with everything else in it
            first = unforced + (fy + force * side) / (mass * moved)
            own = with_beta_dot(signals, first * half)
            added = terms(x, own, model.effects, turn == 1, half * force / (mass * moved))
            side, roll, yaw = side + added[0], roll + added[1], yaw + added[2]
    fy += force * side
    fl += force * aircraft.span_m * roll - mass * aircraft.load_y_m * at.down_m_s2
    fn += (
        force * aircraft.span_m * yaw
        + aircraft.cg_shift * aircraft.chord_m * fy
        + mass * aircraft.cg_y_m * at.forward_m_s2
        + aircraft.yaw_moment_n_m
    )
    ixx, iyy = aircraft.inertia_xx_kg_m2, aircraft.inertia_yy_kg_m2
    izz, ixz = aircraft.inertia_zz_kg_m2, aircraft.inertia_xz_kg_m2
    fl += ixz * p * q - (izz - iyy) * q * r
    fn -= ixz * q * r + (iyy - ixx) * p * q
    determinant = ixx * izz - ixz * ixz
    out[0] = unforced + fy / (mass * moved)
    out[1] = (izz * fl + ixz * fn) / determinant
    out[2] = (ixz * fl + ixx * fn) / determinant
    out[3] = p + (q * math.sin(x[3]) + r * math.cos(x[3])) * math.tan(at.theta_rad)
    late = (gust_of(x, STATES, gusts.rolloff) - x[LATE]) / gusts.rotary_time_s
    gust_rates(x, STATES, at.airspeed_m_s, late, gusts, out)
    out[ROLL] = -x[ROLL] / gusts.roll_time_s
    effect_rates(x, with_beta_dot(signals, out[0] * half), model, out)
    return float(fy / mass)


@inner
def outputs(x: Array, rate: Array, ay: float, at: LateralPoint, model: FilterModel, y: Array) -> None:
    """beta [rad], p, r [rad/s], phi [rad] and ay [m/s2], see `airtruth.tracing.model.by_motion.outputs`."""
    scale, arm, down = model.sensors.scale, model.sensors.arm_m, model.sensors.down_m
    side = gust_of(x, STATES, model.gusts.rolloff)
    beta = air_beta(x, side, model.gusts.level_m_s, at)
    y[0] = _vane(beta, x[1], x[2], arm[0], down[0], at.airspeed_m_s)
    y[1], y[2], y[3] = x[1], x[2], x[3]
    y[4] = ay + arm[4] * (rate[2] + x[1] * at.q_rad_s) - down[4] * (rate[1] - at.q_rad_s * x[2])
    if model.effects.amplitude.size > 0:
        add_readings(x, measured(x, at, model), COEFFICIENTS, model, y)
    for i in range(y.size):
        y[i] *= scale[i]


@inner
def air_at(grid: LateralAirInputs[Array], point: int) -> LateralPoint:
    """Inputs at a point of the filter's grid."""
    return LateralAirInputs(
        aileron_rad=grid.aileron_rad[point],
        rudder_rad=grid.rudder_rad[point],
        airspeed_m_s=grid.airspeed_m_s[point],
        ground_m_s=grid.ground_m_s[point],
        qbar_pa=grid.qbar_pa[point],
        alpha_rad=grid.alpha_rad[point],
        ground_attack_rad=grid.ground_attack_rad[point],
        theta_rad=grid.theta_rad[point],
        q_rad_s=grid.q_rad_s[point],
        speed_rate_1_s=grid.speed_rate_1_s[point],
        forward_m_s2=grid.forward_m_s2[point],
        down_m_s2=grid.down_m_s2[point],
        side=grid.side[point],
        roll=grid.roll[point],
        yaw=grid.yaw[point],
    )


@inner
def signals_at(x: Array, at: LateralPoint, rate: float, model: FilterModel, out: Array) -> None:
    """See `airtruth.tracing.model.by_motion.signals_at`."""
    half, own = half_time(at, model), measured(x, at, model)
    out[0], out[1], out[2], out[3], out[4] = own.beta, own.aileron, own.rudder, own.phat, own.rhat
    out[5], out[6], out[7] = rate * half, own.qbar, own.alpha
    out[8], out[9] = x[1] * half, x[2] * half


@inner
def shifted(at: LateralPoint, field: int, by: float) -> LateralPoint:
    """See `airtruth.tracing.model.by_motion.shifted`; the fields between the controls and the coefficients stay."""
    return LateralAirInputs(
        aileron_rad=at.aileron_rad + (by if field == 0 else 0.0),
        rudder_rad=at.rudder_rad + (by if field == 1 else 0.0),
        airspeed_m_s=at.airspeed_m_s,
        ground_m_s=at.ground_m_s,
        qbar_pa=at.qbar_pa,
        alpha_rad=at.alpha_rad,
        ground_attack_rad=at.ground_attack_rad,
        theta_rad=at.theta_rad,
        q_rad_s=at.q_rad_s,
        speed_rate_1_s=at.speed_rate_1_s,
        forward_m_s2=at.forward_m_s2,
        down_m_s2=at.down_m_s2,
        side=at.side + (by if field == 12 else 0.0),
        roll=at.roll + (by if field == 13 else 0.0),
        yaw=at.yaw + (by if field == 14 else 0.0),
    )


@inner
def move_plays(x: Array, at: LateralPoint, model: FilterModel) -> None:
    """See `airtruth.tracing.model.by_motion.move_plays`."""
    if has_plays(model.effects):
        follow(x, measured(x, at, model), model)


def settle_effects(x: Array, at: LateralPoint, model: FilterModel) -> None:
    """Put the effects' states into equilibrium with the sideslip of a state, the surfaces and the angle of attack."""
    still = LateralSignals(
        float(x[0]),
        effective_deflection(at.aileron_rad, 0, model.aircraft),
        effective_deflection(at.rudder_rad, 1, model.aircraft),
        *(0.0, 0.0, 0.0),
        at.qbar_pa,
        at.alpha_rad,
    )
    for k in range(model.effects.time_s.size):
        x[model.states.effect[k]] = still[model.effects.state_index[k, 1]]


EQUATIONS: Final = MotionEquations(
    states=STATES,
    early=len(LATERAL.outputs) - 1,
    rates=rates,
    outputs=outputs,
    air_at=air_at,
    move_plays=move_plays,
    settle=settle_effects,
    shifted=shifted,
    signals_at=signals_at,
    point=LateralAirInputs,
    coefficients=COEFFICIENTS,
    has_roll_gust=True,
)
"""The equations of the lateral-directional motion."""

__all__ = [
    "BETA_DOT",
    "COEFFICIENTS",
    "EQUATIONS",
    "LATE",
    "ROLL",
    "SIGNALS",
    "STATES",
    "LateralSignals",
    "air_beta",
    "effective_deflection",
    "half_time",
    "look_up",
    "measured",
    "of_table",
    "rates",
    "terms",
    "turning",
    "with_beta_dot",
]
