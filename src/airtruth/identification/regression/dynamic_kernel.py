"""Kernels of `airtruth.identification.regression.dynamic`: filters (n0 + n1 p)/Delta(p) over records."""

from __future__ import annotations

import math
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.regression import rows as layout
from airtruth.identification.regression.auxiliary import respond, state_matrices
from airtruth.identification.signals import ALPHA, AZ, ELEVATOR, Q
from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import inner
from airtruth.numerics.hold import first_order_hold

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Four = tuple[float, float, float, float]
Two = tuple[float, float]

_contracted = partial(inner, fastmath={"contract"})
_OF_ALPHA: Final = 0
"""Row of scratch: filter states of alpha, two rows."""
_OF_Q: Final = 2
"""Row of scratch: filter states of q."""
_OF_AZ: Final = 4
"""Row of scratch: filter states of az."""
_OF_ELEVATOR: Final = 6
"""Row of scratch: filter states of the elevator."""
_OF_MODEL_ALPHA: Final = 8
"""Row of scratch: filter states of the auxiliary model's alpha."""
_OF_MODEL_Q: Final = 10
"""Row of scratch: filter states of the auxiliary model's q."""
_OF_ONE: Final = 12
"""Row of scratch: filter states of the constant 1."""
_OF_BEND: Final = 14
"""Row of scratch: filter states of the elevator's corners."""
_MODEL: Final = 16
"""Row of scratch: alpha and q of the auxiliary model."""
_SCRATCH: Final = 18
"""Rows of scratch."""


class DynamicRecords(NamedTuple):
    """Signals of runs of one length.

    Attributes
    ----------
    signals : (runs, 4, samples) alpha [rad], q [rad/s], az [g], elevator [rad].
    bend : (runs, samples) from `airtruth.numerics.intersample.servo_bend` [rad].
    origin : (runs, 4) trim values of the signals.
    left : (runs, 4, samples) left sides at measured dynamic pressure; without runs at constant pressure.
    factors : (runs, 4) from `airtruth.identification.regression.rows.row_factors`.
    dt_s : sample period [s].
    """

    signals: Array
    bend: Array
    origin: Array
    left: Array
    factors: Array
    dt_s: float


class DynamicModel(NamedTuple):
    """Filter and auxiliary model of the active runs.

    Attributes
    ----------
    theta : (active, 6) derivatives [-].
    numerator : (active, 2) n0 and n1 of the filter.
    made : (active, 3, samples) instruments of a user's auxiliary model; without runs for the linear one.
    active : indices of the runs.
    """

    theta: Array
    numerator: Array
    made: Array
    active: Ints


@inner
def denominator(a00: float, a01: float, a10: float, a11: float) -> tuple[float, float]:
    """Trace and determinant of Delta(p) = p^2 - trace p + det, unstable roots mirrored to the left.

    The regression holds after any common filter, so that a mirrored one serves an unstable aircraft; a
    stable Delta is |pI - A| as in eq. (7).
    """
    half = 0.5 * (a00 + a11)
    det = a00 * a11 - a01 * a10
    spread = math.sqrt(max(half * half - det, 0.0))
    return -(abs(half + spread) + abs(half - spread)), abs(det)


@_contracted
def smooth_pair(x: Array, y: Array, ox: float, oy: float, e: Four, g: Two, h: Two, out: Array) -> None:
    """States (v, dv/dt) of 1/Delta(p) for x - ox and y - oy, into out (4, samples), from zero.

    The input of a cell is linear plus the constant that gives it the area of the cubic through four
    samples, (-v[k-2] + 13 v[k-1] + 13 v[k] - v[k+1])/24 dt. Two recursions run side by side because each
    waits for its own last result.
    """
    e0, e1, e2, e3 = e
    c0, c1 = (g[0] + h[0]) / 24.0, (g[1] + h[1]) / 24.0
    p0, p1, q0, q1 = g[0] + c0, g[1] + c1, h[0] + c0, h[1] + c1
    last = x.size - 1
    x0 = x1 = y0 = y1 = 0.0
    out[0, 0] = out[1, 0] = out[2, 0] = out[3, 0] = 0.0
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


@_contracted
def linear_pair(x: Array, y: Array, e: Four, g: Two, h: Two, out: Array) -> None:
    """As `smooth_pair`, for inputs that are linear between samples."""
    e0, e1, e2, e3 = e
    g0, g1 = g
    h0, h1 = h
    x0 = x1 = y0 = y1 = 0.0
    out[0, 0] = out[1, 0] = out[2, 0] = out[3, 0] = 0.0
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


@_contracted
def step_and_bend(bend: Array, e: Four, k0: float, k1: float, out: Array) -> None:
    """As `linear_pair`, for the constant 1 and for an input that is constant over each cell."""
    e0, e1, e2, e3 = e
    s0 = s1 = b0 = b1 = 0.0
    out[0, 0] = out[1, 0] = out[2, 0] = out[3, 0] = 0.0
    for k in range(1, bend.size):
        t = e0 * s0 + (e1 * s1 + k0)
        s1 = e2 * s0 + (e3 * s1 + k1)
        s0 = t
        t = e0 * b0 + (e1 * b1 + k0 * bend[k])
        b1 = e2 * b0 + (e3 * b1 + k1 * bend[k])
        b0 = t
        out[0, k], out[1, k], out[2, k], out[3, k] = s0, s1, b0, b1


@_contracted
def combine(n0: float, x0: Array, n1: float, x1: Array, out: Array) -> None:
    """(n0 + n1 p) x from the states x and dx/dt."""
    for k in range(out.size):
        out[k] = n0 * x0[k] + n1 * x1[k]


@_contracted
def rate(
    x: Array, jump: float, v: Array, s: Array, n0: float, n1: float, trace: float, det: float, out: Array
) -> None:
    """(n0 + n1 p) p/Delta(p) of x - x[0], from the states v of x and s of the constant 1.

    ``jump`` is the first sample relative to the origin: a step, which must not enter a derivative.
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


@_contracted
def subtract(out: Array, factor: float, x: Array) -> None:
    """Subtract a multiple of x from out, in place."""
    for k in range(out.size):
        out[k] -= factor * x[k]


@inner
def _filter_run(records: DynamicRecords, model: DynamicModel, index: int, work: Array, w: Array) -> None:
    """Fill the rows w (10, samples) of the active run ``index``; work (18, samples) is scratch."""
    run = model.active[index]
    signals, origin, factors = records.signals[run], records.origin[run], records.factors[run]
    dt_s = records.dt_s
    a00, a01, a10, a11, b0, b1 = state_matrices(model.theta[index], factors)
    trace, det = denominator(a00, a01, a10, a11)
    e, g, h = first_order_hold(0.0, 1.0, -det, trace, 0.0, 1.0, dt_s)
    alpha, q, normal, elevator = signals[ALPHA], signals[Q], signals[AZ], signals[ELEVATOR]
    made_alpha, made_q = work[_MODEL], work[_MODEL + 1]
    external = model.made.shape[0] > 0
    if external:
        for k in range(made_q.size):
            made_alpha[k], made_q[k] = model.made[index, 0, k], model.made[index, 1, k]
    else:
        respond((a00, a01, a10, a11, b0, b1), elevator, origin[ELEVATOR], dt_s, made_alpha, made_q)
    smooth_pair(alpha, q, origin[ALPHA], origin[Q], e, g, h, work[_OF_ALPHA:_OF_AZ])
    smooth_pair(normal, elevator, origin[AZ], origin[ELEVATOR], e, g, h, work[_OF_AZ:_OF_MODEL_ALPHA])
    linear_pair(made_alpha, made_q, e, g, h, work[_OF_MODEL_ALPHA:_OF_ONE])
    step_and_bend(records.bend[run], e, g[0] + h[0], g[1] + h[1], work[_OF_ONE:_MODEL])
    n0, n1 = model.numerator[index, 0], model.numerator[index, 1]
    for to, state in (
        (layout.Z_ALPHA, _OF_MODEL_ALPHA),
        (layout.Z_Q, _OF_MODEL_Q),
        (layout.Z_DE, _OF_ELEVATOR),
        (layout.TRIM, _OF_ONE),
        (layout.X_ALPHA, _OF_ALPHA),
        (layout.X_Q, _OF_Q),
        (layout.X_DE, _OF_ELEVATOR),
        (layout.Y_NORMAL, _OF_AZ),
    ):
        combine(n0, work[state], n1, work[state + 1], w[to])
    if external:
        own = model.made[index, 2]
        linear_pair(own, own, e, g, h, work[_OF_MODEL_ALPHA:_OF_ONE])
        combine(n0, work[_OF_MODEL_ALPHA], n1, work[_OF_MODEL_ALPHA + 1], w[layout.Z_DE])
    corners = work[_MODEL]
    combine(n0, work[_OF_BEND], n1, work[_OF_BEND + 1], corners)
    one = work[_OF_ONE:_OF_BEND]
    lift, moment = w[layout.Y_LIFT], w[layout.Y_MOMENT]
    if records.left.shape[0] == 0:
        rate(alpha, alpha[0] - origin[ALPHA], work[_OF_ALPHA:_OF_Q], one, n0, n1, trace, det, lift)
        rate(q, q[0] - origin[Q], work[_OF_Q:_OF_AZ], one, n0, n1, trace, det, moment)
        subtract(lift, 1.0, w[layout.X_Q])
    else:
        left = records.left[run]
        x, y = left[0], left[1]
        smooth_pair(x, y, 0.0, 0.0, e, g, h, work[_OF_ALPHA:_OF_AZ])
        smooth_pair(left[2], left[3], 0.0, 0.0, e, g, h, work[_OF_AZ:_OF_MODEL_ALPHA])
        rate(x, x[0], work[_OF_ALPHA:_OF_Q], one, n0, n1, trace, det, lift)
        rate(y, y[0], work[_OF_Q:_OF_AZ], one, n0, n1, trace, det, moment)
        added = work[_OF_MODEL_ALPHA]
        combine(-n0, work[_OF_AZ], -n1, work[_OF_AZ + 1], added)
        subtract(lift, 1.0, added)
        combine(-n0, work[_OF_ELEVATOR], -n1, work[_OF_ELEVATOR + 1], added)
        subtract(moment, 1.0, added)
    subtract(lift, b0, corners)
    subtract(moment, b1, corners)


@awaited
@njit(cache=True, error_model="numpy")
def _filtered(records: DynamicRecords, model: DynamicModel, rows: Array, moments: Array) -> None:
    """Filtered rows, or where ``rows`` holds one run alone, the sums of products of each run."""
    work = np.empty((_SCRATCH, records.signals.shape[2]))
    for i in range(model.active.size):
        w = rows[i if moments.shape[0] == 0 else 0]
        _filter_run(records, model, i, work, w)
        if moments.shape[0] > 0:
            layout.products(w[:4], w[4:], moments[i])


def filtered_moments(records: DynamicRecords, model: DynamicModel, moments: Array) -> None:
    """Sums of products (active, 4, 7) of the filtered rows, [Z | TRIM] against [X | Y | TRIM]."""
    _filtered(records, model, np.empty((1, layout.COUNT, records.signals.shape[2])), moments)


def filtered_rows(records: DynamicRecords, model: DynamicModel, rows: Array) -> None:
    """Filtered rows (active, 10, samples), see `airtruth.identification.regression.rows`."""
    _filtered(records, model, rows, np.empty((0, 4, 7)))
