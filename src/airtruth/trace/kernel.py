"""The declared aircraft in gusts as a filter: nonlinear in the motion, with the steady gain of its linearisation.

State x: alpha over ground [rad], q [rad/s], two Dryden states of unit variance, the upward gust w as the
tail meets it, three low-passed copies of the first Dryden state, states of effects, states of lagging sensors,
and where a sensor's noise is coloured a state of unit variance for each sensor's slow noise.
The gust is w = sigma (1.22 x_2 - 0.52 x_3 + rolloff sum_i g_i (x_2 - x_i)): without rolloff Dryden's; with a
rolloff of 1 its spectrum falls as von Karman's, with the power -5/3 instead of -2, in the band that a flight
test sees. Airspeed, density and pitch attitude are measured and enter as known series, and so does the speed
over ground, which lacks the gust along the path.
The air's alpha is theta - asin((V_ground sin(theta - alpha) - w)/V), its pitch rate
q - (w - w_late)/(tau V), tau = 4 b/(pi V). Between samples the motion is integrated by the classical
Runge-Kutta method, whose weights are Simpson's: the middle value of an input carries its area. The low-passed
copies and sensor lags are integrated exactly for a signal linear over half a step, and so is a delay.

Forces: tables of X, Z, M over alpha, elevator and q c/(2V) times q_bar, the engines' constants, increments of
the derivatives, and the terms of `airtruth.effects.change`. Equations of motion: see
`airtruth.physics.longitudinal`; Dryden form and rotary gust: MIL-F-8785C, 3.7.1.1 and 3.7.1.2; gain: R. E. Maine and
K. W. Iliff, NASA RP-1138 (1985).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify.kalman_step import riccati, step, whitener
from airtruth.physics.longitudinal import lower_point

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Plane = tuple[Array, Array, Array, Array, Array, Array, Array, Ints, Array, Ints, Array]
"""The aircraft and its effects: constants, declared (see the places below), increments (6,) of CLalpha, CLq,
CLde, Cmalpha, Cmq, Cmde about the trim [-]; axes of alpha, elevator, qhat, and the tables over them; then
index and value of aero terms and of states (`airtruth.trace.lower`)."""

_REORDER: Final = {"contract", "reassoc", "arcp", "nsz"}
"""Liberties of the compiler; not those that presume finite numbers, since what diverges has to be seen."""
OUTPUTS: Final = 3
LEADS: Final = 3
CORE: Final = 5 + LEADS
DELAY: Final = 8
"""States of a delay."""
_W1: Final = math.sqrt(1.5)
_W2: Final = math.sqrt(1.5) * (1.0 / math.sqrt(3.0) - 1.0)
_LEAD_RAD_S: Final = (2.1, 21.0, 217.0)
_LEAD_GAIN: Final = (0.58, 0.84, 1.39)
"""Corners and gains that turn Dryden's spectrum into von Karman's, both of 840 m at 43 m/s, within 6 % (rms 2 %)
from 0.5 to 600 rad/s, the level left free. There both are powers of the frequency, so that they serve any other
speed and length; below, a record of seconds sees next to nothing."""

# places in the vector of constants
AREA, CHORD, MASS, INERTIA, GRAVITY, ALPHA0, DE0, LENGTH_W, SIGMA_W, ROTARY, ROTARY_S, NEUTRAL, ROLLOFF = (
    range(13)
)
# factors and shifts of declared quantities
F_MASS, F_INERTIA, F_ELEVATOR, CG, THRUST_ARM, THRUST, THRUST_SLOPE, CONSTANT = range(8)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER, inline="always")
def cell(axis: Array, x: float) -> tuple[int, float]:
    """Lower point of the cell that holds x and the share of the cell below x; the end cells go on outside."""
    low = lower_point(axis, x)
    return low, (x - axis[low]) / (axis[low + 1] - axis[low])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def gust(x: Array, constants: Array) -> float:
    """The upward gust over the level of Dryden's part [-]."""
    lead = 0.0
    for i in range(LEADS):
        lead += _LEAD_GAIN[i] * (x[2] - x[5 + i])
    return float(_W1 * x[2] + _W2 * x[3] + constants[ROLLOFF] * lead)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def rates(
    x: Array,
    de: float,
    v: float,
    ground: float,
    qbar: float,
    theta: float,
    lift_more: float,
    moment_more: float,
    plane: Plane,
    out: Array,
) -> float:
    """x' of the motion, the gusts and the effects' states into ``out``; returns az at the CG [m/s2].

    Parameters
    ----------
    v, ground : speed through the air and over ground [m/s].
    lift_more, moment_more : increments of CL and Cm [-].
    plane : see `Plane`.
    """
    constants, declared, increments, alpha_axis, de_axis, q_axis, values = plane[:7]
    aero_index, aero_value, state_index, state_value = plane[7:]
    sigma, length = constants[SIGMA_W], constants[LENGTH_W]
    upward = gust(x, constants)
    climb = theta - x[0]
    sine = (math.sin(climb) * ground - sigma * upward) / v
    alpha = theta - math.asin(min(max(sine, -1.0), 1.0))
    cosine, sine = math.cos(alpha), math.sin(alpha)
    weight = constants[GRAVITY] * math.cos(climb) / ground
    q = x[1]
    late = (upward - x[4]) / constants[ROTARY_S]
    q_air = q - constants[ROTARY] * sigma * late / v
    surface = constants[NEUTRAL] + declared[F_ELEVATOR] * (de - constants[NEUTRAL])
    force = qbar * constants[AREA]
    chord = constants[CHORD]
    half = 0.5 * chord / v
    qhat = q_air * half
    i, si = cell(alpha_axis, alpha)
    j, sj = cell(de_axis, surface)
    n, sn = cell(q_axis, qhat)
    fx = fz = fm = 0.0
    for a in range(2):
        wa = si if a else 1.0 - si
        for b in range(2):
            w1 = wa * (sj if b else 1.0 - sj)
            w0, w1 = w1 * (1.0 - sn), w1 * sn
            fx += w0 * values[i + a, j + b, n, 0] + w1 * values[i + a, j + b, n + 1, 0]
            fz += w0 * values[i + a, j + b, n, 1] + w1 * values[i + a, j + b, n + 1, 1]
            fm += w0 * values[i + a, j + b, n, 2] + w1 * values[i + a, j + b, n + 1, 2]
    fx = fx * qbar + declared[CONSTANT]
    fz = fz * qbar + declared[CONSTANT + 1]
    fm = fm * qbar + declared[CONSTANT + 2]
    d_alpha, d_de = alpha - constants[ALPHA0], surface - constants[DE0]
    lift = lift_more + increments[0] * d_alpha + increments[1] * qhat + increments[2] * d_de
    moment = moment_more + increments[3] * d_alpha + increments[4] * qhat + increments[5] * d_de
    mass = constants[MASS] * declared[F_MASS]
    inertia = constants[INERTIA] * declared[F_INERTIA]
    # terms in alpha' last: they take alpha' with everything else in it
    for late_terms in range(2):
        if aero_index.shape[0] == 0:
            break
        first = q + ((fz - force * lift) * cosine - fx * sine) / (mass * ground) + weight
        for t in range(aero_index.shape[0]):
            signal = aero_index[t, 1]
            if (signal == 3) != (late_terms == 1):
                continue
            if signal == 0:
                s = alpha
            elif signal == 1:
                s = surface
            elif signal == 2:
                s = qhat
            elif signal == 3:
                s = first * half
                if aero_index[t, 0] == 0:  # the term is part of the alpha' that it is in proportion to
                    s /= 1.0 + aero_value[t, 0] * half * force * cosine / (mass * v)
            else:
                s = x[CORE + signal - 4]
            s -= aero_value[t, 1]
            shape = aero_index[t, 2]
            if shape == 1:
                s = s * s
            elif shape == 2:
                s = max(0.0, s)
            elif shape == 3:
                s = min(0.0, s)
            if aero_index[t, 0] == 0:
                lift += aero_value[t, 0] * s
            else:
                moment += aero_value[t, 0] * s
    fz -= force * lift
    fm += (
        force * chord * (moment - declared[CG] * fz / force)
        + (declared[THRUST] + declared[THRUST_SLOPE] * qbar) * declared[THRUST_ARM]
    )
    az = fz / mass
    out[0] = q + (fz * cosine - fx * sine) / (mass * ground) + weight
    out[1] = fm / inertia
    a = v / length
    out[2] = -a * x[2]
    out[3] = a * (x[2] - x[3])
    out[4] = late
    for i in range(LEADS):
        out[5 + i] = _LEAD_RAD_S[i] * (x[2] - x[5 + i])
    at = CORE
    for k in range(state_index.shape[0]):
        signal = state_index[k, 1]
        if signal == 0:
            s = alpha
        elif signal == 1:
            s = surface
        elif signal == 2:
            s = qhat
        else:
            s = out[0] * half
        if state_index[k, 0] == 0:
            out[at] = (s - x[at]) / state_value[k, 0]
            at += 1
        else:
            wn = 1.0 / state_value[k, 0]
            out[at] = x[at + 1]
            out[at + 1] = wn * wn * (s - x[at]) - 2.0 * state_value[k, 1] * wn * x[at + 1]
            at += 2
    return float(az)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER, inline="always")
def rates_at(x: Array, point: int, air: Array, plane: Plane, out: Array) -> float:
    """`rates` at a point of the filter's grid.

    Parameters
    ----------
    air : (7, points) elevator, speed through the air and over ground, dynamic pressure, pitch attitude, and
        increments of CL and Cm.
    """
    return rates(
        x,
        air[0, point],
        air[1, point],
        air[2, point],
        air[3, point],
        air[4, point],
        air[5, point],
        air[6, point],
        plane,
        out,
    )


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def outputs(
    x: Array,
    rate: Array,
    az: float,
    v: float,
    ground: float,
    theta: float,
    constants: Array,
    arms: Array,
    scales: Array,
    y: Array,
) -> None:
    """What the sensors would read without bias, lag and noise: alpha [rad], q [rad/s], az [m/s2]."""
    sine = (math.sin(theta - x[0]) * ground - constants[SIGMA_W] * gust(x, constants)) / v
    alpha = theta - math.asin(min(max(sine, -1.0), 1.0))
    y[0] = scales[0] * (alpha - x[1] * arms[0] / v)
    y[1] = scales[1] * x[1]
    y[2] = scales[2] * (az - arms[2] * rate[1])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER, inline="always")
def is_coloured(colour: Array) -> bool:
    """Whether any sensor has slow noise."""
    return bool(colour[0] > 0.0 or colour[1] > 0.0 or colour[2] > 0.0)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def states(motion: int, lags: Array, delays: Array, colour: Array) -> int:
    """States of the motion, of late sensors and of coloured noise (``colour`` as in `innovations`)."""
    n = motion
    if is_coloured(colour):
        n += OUTPUTS
    for i in range(OUTPUTS):
        if lags[i] > 0.0:
            n += 1
        if delays[i] > 0.0:
            n += DELAY
    return n


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def delayed(delay_s: float) -> Array:
    """A and B (order, order + 1) of a delay; its output is the input less twice the sum of every second state.

    exp(-s) = (1 - z)/(1 + z) with z = tanh(s/2) cut off after ``DELAY`` steps of its continued fraction, a ladder
    of integrators: the diagonal Pade approximant, to one degree up to a phase of 11 rad.

    Source: G. A. Baker and P. Graves-Morris, Pade Approximants, 2nd ed. (1996), section 4.6 (the fraction).
    """
    system = np.zeros((DELAY, DELAY + 1))
    for row in range(DELAY):
        rate = 2.0 * (2.0 * row + 1.0) / delay_s
        if row % 2 == 0:
            system[row, row + 1 : DELAY : 2] = rate
        else:
            system[row, DELAY] = rate
            system[row, 1:DELAY:2] = -rate
            system[row, 0:row:2] = -rate
    return system


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def linear(
    x: Array,
    de: float,
    v: float,
    qbar: float,
    theta: float,
    motion: int,
    lags: Array,
    delays: Array,
    colour: Array,
    plane: Plane,
    arms: Array,
    scales: Array,
    a: Array,
    c: Array,
) -> None:
    """A and C of the motion, effects' states, late sensors and slow noise about a state, by central differences.

    A delay is the Pade approximant of order `DELAY`, see `delayed`.
    """
    n = x.size
    a[:] = 0.0
    c[:] = 0.0
    up, down = np.empty(n), np.empty(n)
    y_up, y_down = np.empty(OUTPUTS), np.empty(OUTPUTS)
    moved, unit = x.copy(), np.zeros(n)
    for j in range(motion):
        # wide enough to average a table's break, so that the gain does not jump with the reference
        h = 0.01
        if j == 1:
            h = 0.05
        if j >= 2 and j < CORE:
            # a gust that moves alpha as far as above, so that no level or rolloff shifts the breaks that are met
            unit[j] = 1.0
            moves = abs(plane[0][SIGMA_W] * gust(unit, plane[0])) / v
            unit[j] = 0.0
            h = 0.01 / moves if moves > 1e-9 else 0.1
        moved[j] = x[j] + h
        az_up = rates(moved, de, v, v, qbar, theta, 0.0, 0.0, plane, up)
        outputs(moved, up, az_up, v, v, theta, plane[0], arms, scales, y_up)
        moved[j] = x[j] - h
        az_down = rates(moved, de, v, v, qbar, theta, 0.0, 0.0, plane, down)
        outputs(moved, down, az_down, v, v, theta, plane[0], arms, scales, y_down)
        moved[j] = x[j]
        for i in range(motion):
            a[i, j] = (up[i] - down[i]) / (2.0 * h)
        for i in range(OUTPUTS):
            c[i, j] = (y_up[i] - y_down[i]) / (2.0 * h)
    at = motion
    for i in range(OUTPUTS):
        if lags[i] > 0.0:
            for j in range(n):
                a[at, j] = c[i, j] / lags[i]
                c[i, j] = 0.0
            a[at, at] = -1.0 / lags[i]
            c[i, at] = 1.0
            at += 1
        if delays[i] > 0.0:
            system = delayed(delays[i])
            for row in range(DELAY):
                for j in range(n):
                    a[at + row, j] = system[row, DELAY] * c[i, j]
            a[at : at + DELAY, at : at + DELAY] = system[:, :DELAY]
            for row in range(1, DELAY, 2):
                c[i, at + row] -= 2.0
            at += DELAY
    if is_coloured(colour):
        for i in range(OUTPUTS):
            a[at + i, at + i] = -1.0 / colour[OUTPUTS]
            c[i, at + i] = colour[i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def gain(
    a: Array, c: Array, v: float, constants: Array, variance: Array, colour: Array, dt_s: float
) -> tuple[Array, Array, Array, float]:
    """Steady gain K of the update, whitener W with W S W' = I, S itself, and log|S| (nan where there is none).

    Parameters
    ----------
    a, c : as `linear` makes them; variance : (3,) of the white noise; colour : as in `innovations`.
    """
    n = a.shape[0]
    system = np.zeros((n, n + 1))
    system[:, :n] = a
    process = np.zeros(n)
    process[2] = 2.0 * v / constants[LENGTH_W]
    if is_coloured(colour):
        process[n - OUTPUTS :] = 2.0 / colour[OUTPUTS]
    phi, noise = np.empty((n, n)), np.empty((n, n))
    early, late = np.empty((n, 1)), np.empty((n, 1))
    step(system, process, n, dt_s, phi, early, late, noise)
    white = np.zeros((OUTPUTS, OUTPUTS))
    k_gain = np.zeros((n, OUTPUTS))
    s = np.zeros((OUTPUTS, OUTPUTS))
    if not (np.isfinite(phi).all() and np.isfinite(noise).all()):
        return k_gain, white, s, np.nan
    p = riccati(phi, c, noise, variance)
    pc = np.dot(p, np.ascontiguousarray(c.T))
    s = np.dot(c, pc)
    for i in range(OUTPUTS):
        s[i, i] += variance[i]
    if not np.isfinite(s).all():
        return k_gain, white, s, np.nan
    logdet = whitener(s, white)
    if not math.isfinite(logdet):
        return k_gain, white, s, np.nan
    k_gain[:] = np.dot(pc, np.dot(np.ascontiguousarray(white.T), white))
    return k_gain, white, s, logdet


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def innovations(
    y: Array,
    de: Array,
    v: Array,
    ground: Array,
    density: Array,
    theta: Array,
    lift_more: Array,
    moment_more: Array,
    output_more: Array,
    dt_s: float,
    sub: int,
    start: Array,
    bias: Array,
    offset: Array,
    k_gain: Array,
    motion: int,
    lags: Array,
    delays: Array,
    colour: Array,
    plane: Plane,
    arms: Array,
    scales: Array,
    e: Array,
) -> bool:
    """Innovations (samples, 3) of one record into ``e``; False if the motion leaves all bounds.

    Parameters
    ----------
    y : (samples, 3) alpha [rad], q [rad/s], az [m/s2].
    de, v, ground, density, theta, lift_more, moment_more : on the filter's grid, ``sub`` (even) cells per sample.
    output_more : (samples, 3) added to the outputs.
    start : (4,) initial alpha, q and gusts; bias : (3,) of the outputs; offset : (2,) CL, Cm.
    k_gain : (states, 3) of the update; zeros for a free run.
    motion : states of motion, gusts and effects.
    lags, delays, arms, scales : (3,) of the sensors.
    colour : (4,) standard deviations of the sensors' slow noise, a Gauss-Markov process, and its correlation
        time [s].
    """
    constants, declared, state_index = plane[0], plane[1], plane[9]
    noisy = is_coloured(colour)
    forget = math.exp(-dt_s / colour[OUTPUTS]) if noisy else 0.0
    n = k_gain.shape[0]
    late_sensors = n > motion + (OUTPUTS if noisy else 0)
    samples = y.shape[0]
    h = 2.0 * dt_s / sub
    air = np.empty((7, de.size))
    air[0], air[1], air[2], air[3], air[4] = de, v, ground, 0.5 * density * v * v, theta
    air[5], air[6] = offset[0] + lift_more, offset[1] + moment_more
    x = np.zeros(n)
    x[:4] = start
    x[5:CORE] = start[2]
    x[4] = gust(x, constants)
    rate, tried = np.zeros((4, n)), np.zeros(n)
    out, last, first = np.zeros(OUTPUTS), np.zeros(OUTPUTS), np.zeros(2)
    ends = np.zeros(3)
    # of the leads over half a step and a whole one, of which they are faster
    fade, level = np.empty((2, LEADS)), np.empty((2, LEADS))
    for j in range(2):
        for i in range(LEADS):
            r = _LEAD_RAD_S[i] * 0.5 * (j + 1) * h
            fade[j, i] = math.exp(-r)
            level[j, i] = (1.0 - fade[j, i]) / r
    phi = np.zeros((OUTPUTS, DELAY, DELAY))
    early, late = np.zeros((OUTPUTS, DELAY)), np.zeros((OUTPUTS, DELAY))
    held = np.zeros(DELAY)
    for i in range(OUTPUTS):
        if delays[i] > 0.0:
            transition, noise = np.empty((DELAY, DELAY)), np.empty((DELAY, DELAY))
            input0, input1 = np.empty((DELAY, 1)), np.empty((DELAY, 1))
            step(delayed(delays[i]), np.zeros(DELAY), DELAY, 0.5 * h, transition, input0, input1, noise)
            phi[i] = transition
            early[i] = input0[:, 0]
            late[i] = input1[:, 0]
    # effects' states begin in equilibrium with the first state
    at = CORE
    for k in range(state_index.shape[0]):
        signal = state_index[k, 1]
        alpha = x[0]
        surface = constants[NEUTRAL] + declared[F_ELEVATOR] * (de[0] - constants[NEUTRAL])
        s = alpha
        if signal == 1:
            s = surface
        elif signal >= 2:
            s = 0.0
        x[at] = s
        at += 1 if state_index[k, 0] == 0 else 2
    for k in range(samples):
        f = k * sub
        az = rates_at(x, f, air, plane, rate[0])
        outputs(x, rate[0], az, v[f], ground[f], theta[f], constants, arms, scales, out)
        at = motion
        for i in range(OUTPUTS):
            value = out[i]
            if lags[i] > 0.0:
                if k == 0:
                    x[at] = value
                value = x[at]
                at += 1
            if delays[i] > 0.0:
                if k == 0:
                    x[at] = value
                for row in range(1, DELAY, 2):
                    value -= 2.0 * x[at + row]
                at += DELAY
            if noisy:
                value += colour[i] * x[n - OUTPUTS + i]
            e[k, i] = y[k, i] - value - bias[i] - output_more[k, i]
        if k + 1 == samples:
            break
        for i in range(n):
            total = 0.0
            for m in range(OUTPUTS):
                total += k_gain[i, m] * e[k, m]
            x[i] += total
            if not abs(x[i]) < 1e6:
                return False
        if noisy:
            for i in range(n - OUTPUTS, n):
                x[i] *= forget
        for pair in range(sub // 2):
            f = k * sub + 2 * pair
            for stage in range(4):
                share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                g = f + (0 if stage == 0 else (2 if stage == 3 else 1))
                for m in range(motion):
                    tried[m] = x[m] + (share * h * rate[stage - 1, m] if stage > 0 else 0.0)
                if stage > 0:
                    j = 1 if stage == 3 else 0
                    for i in range(LEADS):
                        rest = (level[j, i] - fade[j, i]) * x[2] + (1.0 - level[j, i]) * tried[2]
                        tried[5 + i] = fade[j, i] * x[5 + i] + rest
                az = rates_at(tried, g, air, plane, rate[stage])
                if stage == 0 and late_sensors:
                    outputs(tried, rate[0], az, v[g], ground[g], theta[g], constants, arms, scales, last)
                    first[0], first[1] = rate[0, 0], rate[0, 1]
            for m in range(motion):
                slope = rate[0, m] + 2.0 * rate[1, m] + 2.0 * rate[2, m] + rate[3, m]
                x[m] += h / 6.0 * slope
            x[5:CORE] = tried[5:CORE]
            if late_sensors:
                g = f + 2
                az = rates_at(x, g, air, plane, rate[0])
                outputs(x, rate[0], az, v[g], ground[g], theta[g], constants, arms, scales, out)
                at = motion
                for i in range(OUTPUTS):
                    # two half steps; in between the motion's own curvature (cubic through values and slopes)
                    middle = 0.5 * (last[i] + out[i])
                    if i < 2:
                        middle += scales[i] * h / 8.0 * (first[i] - rate[0, i])
                    ends[0], ends[1], ends[2] = last[i], middle, out[i]
                    if lags[i] > 0.0:
                        r = 0.5 * h / lags[i]
                        decay = math.exp(-r)
                        mean = (1.0 - decay) / r
                        before = ends[0]
                        ends[0] = x[at]
                        for half in range(1, 3):
                            x[at] = decay * x[at] + (mean - decay) * before + (1.0 - mean) * ends[half]
                            before, ends[half] = ends[half], x[at]
                        at += 1
                    if delays[i] > 0.0:
                        for half in range(2):
                            for row in range(DELAY):
                                held[row] = x[at + row]
                            for row in range(DELAY):
                                total = early[i, row] * ends[half] + late[i, row] * ends[half + 1]
                                for m in range(DELAY):
                                    total += phi[i, row, m] * held[m]
                                x[at + row] = total
                        at += DELAY
    return True


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_REORDER)
def evaluate(
    y: Array,
    de: Array,
    v: Array,
    ground: Array,
    density: Array,
    theta: Array,
    lift_more: Array,
    moment_more: Array,
    output_more: Array,
    reference: Array,
    dt_s: float,
    sub: int,
    start: Array,
    bias: Array,
    offset: Array,
    variance: Array,
    free_run: bool,
    lags: Array,
    delays: Array,
    colour: Array,
    plane: Plane,
    arms: Array,
    scales: Array,
    e: Array,
    white: Array,
    s: Array,
) -> float:
    """Innovations of one record into ``e``, whitener and covariance into ``white`` and ``s``; log|S|, nan on failure.

    Parameters
    ----------
    reference : alpha [rad], elevator [rad], airspeed [m/s], density [kg/m3], theta [rad] at which the gain is made.
    free_run : no gain: the residuals of a simulation; ``white`` and ``s`` are left alone.
    variance : (3,) of the sensors' white noise.
    others : as in `innovations`.
    """
    constants, state_index = plane[0], plane[9]
    motion = CORE
    for k in range(state_index.shape[0]):
        motion += 1 if state_index[k, 0] == 0 else 2
    n = states(motion, lags, delays, colour)
    k_gain = np.zeros((n, OUTPUTS))
    logdet = 0.0
    if not free_run:
        x = np.zeros(n)
        x[0] = reference[0]
        at = CORE
        for k in range(state_index.shape[0]):
            if state_index[k, 1] == 0:
                x[at] = reference[0]
            elif state_index[k, 1] == 1:
                x[at] = reference[1]
            at += 1 if state_index[k, 0] == 0 else 2
        a, c = np.empty((n, n)), np.empty((OUTPUTS, n))
        speed = reference[2]
        linear(
            x,
            reference[1],
            speed,
            0.5 * reference[3] * speed * speed,
            reference[4],
            motion,
            lags,
            delays,
            colour,
            plane,
            arms,
            scales,
            a,
            c,
        )
        k_gain, w, cov, logdet = gain(a, c, speed, constants, variance, colour, dt_s)
        if not math.isfinite(logdet):
            return np.nan
        white[:] = w
        s[:] = cov
    sound = innovations(
        y,
        de,
        v,
        ground,
        density,
        theta,
        lift_more,
        moment_more,
        output_more,
        dt_s,
        sub,
        start,
        bias,
        offset,
        k_gain,
        motion,
        lags,
        delays,
        colour,
        plane,
        arms,
        scales,
        e,
    )
    return logdet if sound else np.nan
