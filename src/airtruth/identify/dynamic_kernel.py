"""Recursions of `airtruth.identify.dynamic`: filters (n0 + n1 p)/Delta(p) over one record."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Four = tuple[float, float, float, float]
Two = tuple[float, float]


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
def smooth_pair(x: Array, y: Array, ox: float, oy: float, e: Four, g: Two, h: Two, out: Array) -> None:
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
def linear_pair(x: Array, y: Array, e: Four, g: Two, h: Two, out: Array) -> None:
    """As `smooth_pair`, for inputs that are linear between samples."""
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
def step_and_bend(bend: Array, e: Four, k0: float, k1: float, out: Array) -> None:
    """As `linear_pair`, for the constant 1 and for an input that is constant over each cell."""
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
def combine(n0: float, x0: Array, n1: float, x1: Array, out: Array) -> None:
    """(n0 + n1 p) x from the states x and dx/dt."""
    for k in range(out.size):
        out[k] = n0 * x0[k] + n1 * x1[k]


@njit(cache=True, fastmath={"contract"})
def rate(
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
def subtract(out: Array, factor: float, x: Array) -> None:
    """Out less a multiple of x, in place."""
    for k in range(out.size):
        out[k] -= factor * x[k]
