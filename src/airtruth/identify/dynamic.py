"""Regressions filtered by the aircraft's own dynamics: IV(f1) and IV(f2).

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (7), (8) and
(11), figure 3.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify import rows as layout
from airtruth.identify.auxiliary import bounded, respond, state_matrices
from airtruth.identify.hold import first_order_hold
from airtruth.identify.intersample import servo_bend
from airtruth.identify.options import Options
from airtruth.identify.problem import NOT_MADE, Observation, Problem, made_by, origin_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Four = tuple[float, float, float, float]
Two = tuple[float, float]


def f1_numerator(theta: Array, factors: Array) -> Array:
    """F(p) = 1/Delta(p), eq. (7): rows (n0, n1) of (n0 + n1 p)/Delta."""
    numerator = np.zeros((theta.shape[0], 2))
    numerator[:, 0] = 1.0
    return numerator


def f2_numerator(theta: Array, factors: Array) -> Array:
    """F(p) = (p + 1/T_theta2)/Delta(p), eq. (8) without k_q, which is common to all rows and cancels.

    q/de of eq. (2) = (b1 p + a10 b0 - a00 b1)/Delta, so that 1/T_theta2 = a10 b0/b1 - a00.
    """
    lift = factors[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = lift * (theta[:, 3] * theta[:, 2] / theta[:, 5] - theta[:, 0])
    return np.stack([corner, np.ones_like(corner)], axis=-1)


@njit(cache=True)
def denominator(a00: float, a01: float, a10: float, a11: float) -> tuple[float, float]:
    """Trace and determinant of Delta(p) = p^2 - trace p + det, unstable roots mirrored to the left.

    Any common filter leaves the regression true, so that a mirrored one serves where the aircraft
    itself is unstable; a stable Delta is |pI - A| as in eq. (7).
    """
    half = 0.5 * (a00 + a11)
    det = a00 * a11 - a01 * a10
    spread = np.sqrt(max(half * half - det, 0.0))
    return -(abs(half + spread) + abs(half - spread)), abs(det)


@njit(cache=True, fastmath={"contract"})
def _smooth_pair(x: Array, y: Array, ox: float, oy: float, e: Four, g: Two, h: Two, out: Array) -> None:
    """States (v, dv/dt) of 1/Delta(p) for x - ox and y - oy, into out (4, samples), from zero.

    The input of a cell is linear plus the constant that gives it the area of the cubic through four
    samples, (-v[k-2] + 13 v[k-1] + 13 v[k] - v[k+1])/24 dt. Two recursions side by side hide each
    other's latency.
    """
    e0, e1, e2, e3 = e
    c0, c1 = (g[0] + h[0]) / 24.0, (g[1] + h[1]) / 24.0
    p0, p1, q0, q1 = g[0] + c0, g[1] + c1, h[0] + c0, h[1] + c1
    last = x.size - 1
    x0 = x1 = y0 = y1 = 0.0
    out[:, 0] = 0.0
    xp, yp = x[0] - ox, y[0] - oy
    xpp, ypp = xp, yp
    xk, yk = x[1] - ox, y[1] - oy
    for k in range(1, x.size):
        after = k + 1 if k < last else last
        xn, yn = x[after] - ox, y[after] - oy
        u, v = xpp + xn, ypp + yn
        t = e0 * x0 + (e1 * x1 + ((p0 * xp + q0 * xk) - c0 * u))
        x1 = e2 * x0 + (e3 * x1 + ((p1 * xp + q1 * xk) - c1 * u))
        x0 = t
        t = e0 * y0 + (e1 * y1 + ((p0 * yp + q0 * yk) - c0 * v))
        y1 = e2 * y0 + (e3 * y1 + ((p1 * yp + q1 * yk) - c1 * v))
        y0 = t
        out[0, k], out[1, k], out[2, k], out[3, k] = x0, x1, y0, y1
        xpp, xp, xk = xp, xk, xn
        ypp, yp, yk = yp, yk, yn


@njit(cache=True, fastmath={"contract"})
def _linear_pair(x: Array, y: Array, e: Four, g: Two, h: Two, out: Array) -> None:
    """As `_smooth_pair`, for inputs that are linear between samples."""
    e0, e1, e2, e3 = e
    g0, g1 = g
    h0, h1 = h
    x0 = x1 = y0 = y1 = 0.0
    out[:, 0] = 0.0
    xp, yp = x[0], y[0]
    for k in range(1, x.size):
        xk, yk = x[k], y[k]
        t = e0 * x0 + (e1 * x1 + (g0 * xp + h0 * xk))
        x1 = e2 * x0 + (e3 * x1 + (g1 * xp + h1 * xk))
        x0 = t
        t = e0 * y0 + (e1 * y1 + (g0 * yp + h0 * yk))
        y1 = e2 * y0 + (e3 * y1 + (g1 * yp + h1 * yk))
        y0 = t
        out[0, k], out[1, k], out[2, k], out[3, k] = x0, x1, y0, y1
        xp, yp = xk, yk


@njit(cache=True, fastmath={"contract"})
def _step_and_bend(bend: Array, e: Four, k0: float, k1: float, out: Array) -> None:
    """As `_linear_pair`, for the constant 1 and for an input that is constant over each cell."""
    e0, e1, e2, e3 = e
    s0 = s1 = b0 = b1 = 0.0
    out[:, 0] = 0.0
    for k in range(1, bend.size):
        t = e0 * s0 + (e1 * s1 + k0)
        s1 = e2 * s0 + (e3 * s1 + k1)
        s0 = t
        t = e0 * b0 + (e1 * b1 + k0 * bend[k])
        b1 = e2 * b0 + (e3 * b1 + k1 * bend[k])
        b0 = t
        out[0, k], out[1, k], out[2, k], out[3, k] = s0, s1, b0, b1


@njit(cache=True, fastmath={"contract"})
def _combine(n0: float, x0: Array, n1: float, x1: Array, out: Array) -> None:
    """(n0 + n1 p) x from the states x and dx/dt."""
    for k in range(out.size):
        out[k] = n0 * x0[k] + n1 * x1[k]


@njit(cache=True, fastmath={"contract"})
def _rate(
    x: Array, jump: float, v: Array, s: Array, n0: float, n1: float, trace: float, det: float, out: Array
) -> None:
    """(n0 + n1 p) p/Delta(p) of x - x[0], from the states v of x and s of the constant 1.

    ``jump`` is what the origin leaves of the first sample: a step, which a derivative must not see.
    p^2/Delta = 1 + (trace p - det)/Delta gives the derivative of the p/Delta part.
    """
    v0, v1 = v[0], v[1]
    s0, s1 = s[0], s[1]
    c0, c1 = -n1 * det, n0 + n1 * trace
    for k in range(out.size):
        out[k] = c1 * (v1[k] - jump * s1[k]) + c0 * (v0[k] - jump * s0[k])
    if n1 != 0.0:
        for k in range(out.size):
            out[k] += n1 * (x[k] - x[0])


@njit(cache=True, fastmath={"contract"})
def _subtract(out: Array, factor: float, x: Array) -> None:
    for k in range(out.size):
        out[k] -= factor * x[k]


@njit(cache=True)
def _filter_run(
    signals: Array,
    bend: Array,
    origin: Array,
    made: Array,
    theta: Array,
    factors: Array,
    numerator: Array,
    dt_s: float,
    work: Array,
    w: Array,
) -> None:
    """Fill the rows w (10, samples) of one run, see `dynamic_problem`; work (18, samples) is scratch."""
    a00, a01, a10, a11, b0, b1 = state_matrices(theta, factors)
    trace, det = denominator(a00, a01, a10, a11)
    e, g, h = first_order_hold(0.0, 1.0, -det, trace, 0.0, 1.0, dt_s)
    alpha, q, normal, elevator = signals[0], signals[1], signals[2], signals[3]
    if made.size == 0:
        respond((a00, a01, a10, a11, b0, b1), elevator, origin[3], dt_s, work[16], work[17])
    else:
        work[16:] = made[:2]
    _smooth_pair(alpha, q, origin[0], origin[1], e, g, h, work[0:4])
    _smooth_pair(normal, elevator, origin[2], origin[3], e, g, h, work[4:8])
    _linear_pair(work[16], work[17], e, g, h, work[8:12])
    _step_and_bend(bend, e, g[0] + h[0], g[1] + h[1], work[12:16])
    n0, n1 = numerator[0], numerator[1]
    for to, state in ((0, 8), (1, 10), (2, 6), (3, 12), (4, 0), (5, 2), (6, 6), (9, 4)):
        _combine(n0, work[state], n1, work[state + 1], w[to])
    if made.size > 0:
        _linear_pair(made[2], made[2], e, g, h, work[8:12])
        _combine(n0, work[8], n1, work[9], w[2])
    _combine(n0, work[14], n1, work[15], work[16])
    _rate(alpha, alpha[0] - origin[0], work[0:2], work[12:14], n0, n1, trace, det, w[7])
    _rate(q, q[0] - origin[1], work[2:4], work[12:14], n0, n1, trace, det, w[8])
    _subtract(w[7], b0, work[16])
    _subtract(w[7], 1.0, w[5])
    _subtract(w[8], b1, work[16])


@njit(cache=True)
def _moments(
    signals: Array,
    bend: Array,
    origin: Array,
    made: Array,
    theta: Array,
    factors: Array,
    numerator: Array,
    active: Ints,
    dt_s: float,
    moments: Array,
) -> None:
    w = np.empty((10, signals.shape[2]))
    work = np.empty((18, signals.shape[2]))
    nothing = np.empty((3, 0))
    for i in range(active.size):
        r = active[i]
        external = made[i] if made.shape[0] > 0 else nothing
        _filter_run(
            signals[r], bend[r], origin[r], external, theta[i], factors[r], numerator[i], dt_s, work, w
        )
        layout.products(w[:4], w[4:], moments[i])


@njit(cache=True)
def _rows(
    signals: Array,
    bend: Array,
    origin: Array,
    made: Array,
    theta: Array,
    factors: Array,
    numerator: Array,
    active: Ints,
    dt_s: float,
    rows: Array,
) -> None:
    work = np.empty((18, signals.shape[2]))
    nothing = np.empty((3, 0))
    for i in range(active.size):
        r = active[i]
        external = made[i] if made.shape[0] > 0 else nothing
        _filter_run(
            signals[r], bend[r], origin[r], external, theta[i], factors[r], numerator[i], dt_s, work, rows[i]
        )


def dynamic_problem(
    observation: Observation, options: Options, numerator: Callable[[Array, Array], Array]
) -> Problem:
    """IV whose X, Z and y pass the filter F(p) = (n0 + n1 p)/Delta(p) of the last iteration.

    Filtered derivatives are F(p) p of the signals: no finite differences. The auxiliary model is driven
    by the measured elevator; filter and model commute (eq. 11).

    Start: filters start from zero; a derivative is that of the signal relative to its first sample.
    Then F p x = F x' holds exactly from the first sample on, whatever motion the record starts in, and
    the constant of each equation becomes the step response of F, which is the TRIM column.

    Between samples: a signal is taken linear plus the constant that gives each cell the area of the
    cubic through the four nearest samples; where the elevator is seen to be a servo behind a held
    command, `airtruth.identify.intersample.servo_bend` rebuilds its corners, and what they add to
    alpha_dot and q_dot, b F(p) bend with b of the last iteration, is moved into y.

    Parameters
    ----------
    observation, options : signals and choices.
    numerator : `f1_numerator` or `f2_numerator`.
    """
    signals, factors, dt_s = observation.signals, observation.factors, observation.dt_s
    origin = origin_of(signals, observation.window)
    bend = servo_bend(signals[:, 3])
    duration_s = dt_s * signals.shape[2]

    def instruments(theta: Array, active: Ints) -> Array:
        if options.auxiliary is None:
            return NOT_MADE
        u = signals[active, 3] - origin[active, 3, None]
        return made_by(options.auxiliary, theta, u, dt_s, observation.scale, active)

    def moments(theta: Array, active: Ints) -> Array:
        result = np.empty((active.size, 4, 7))
        made, top = instruments(theta, active), numerator(theta, factors[active])
        _moments(signals, bend, origin, made, theta, factors, top, active, dt_s, result)
        return result

    def rows(theta: Array, active: Ints) -> Array:
        result = np.empty((active.size, layout.COUNT, signals.shape[2]))
        made, top = instruments(theta, active), numerator(theta, factors[active])
        _rows(signals, bend, origin, made, theta, factors, top, active, dt_s, result)
        return result

    def usable(theta: Array, active: Ints) -> Bools:
        chosen = factors[active]
        return bounded(theta, chosen, duration_s) & np.isfinite(numerator(theta, chosen)).all(axis=1)

    failed = np.zeros(signals.shape[0], dtype=np.bool_)
    return Problem(moments=moments, usable=usable, failed=failed, rows=rows)
