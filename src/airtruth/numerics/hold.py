"""Exact discretisation of a two-state system whose input is linear between samples (first-order hold)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner

Array = NDArray[np.float64]
Four = tuple[float, float, float, float]


@inner
def _times(p: float, r: float, x: float, y: float, trace: float, det: float) -> tuple[float, float]:
    """(p I + r A)(x I + y A), by A^2 = trace A - det I."""
    return p * x - det * r * y, p * y + r * x + trace * r * y


@inner
def first_order_hold(
    a00: float, a01: float, a10: float, a11: float, b0: float, b1: float, dt_s: float
) -> tuple[Four, tuple[float, float], tuple[float, float]]:
    """Matrices of x[k+1] = E x[k] + g u[k] + h u[k+1] for x' = A x + b u, u linear in between.

    E = exp(A dt), h = (1/dt) int_0^dt exp(A (dt - t)) t dt b, g + h = int_0^dt exp(A t) dt b: the
    exact solution, from power series of A (dt / 2^m) that are doubled m times, so that neither a
    double root nor A = 0 is special.

    Parameters
    ----------
    a00, a01, a10, a11, b0, b1 : A [1/s] and b.
    dt_s : sample period [s].

    Returns
    -------
    (E00, E01, E10, E11), (g0, g1), (h0, h1).
    """
    trace = a00 + a11
    det = a00 * a11 - a01 * a10
    size = (abs(a00) + abs(a01) + abs(a10) + abs(a11)) * dt_s
    step = dt_s
    doublings = 0
    while size > 0.5 and doublings < 60:
        size *= 0.5
        step *= 0.5
        doublings += 1
    # exp, its integral and the integral of that, each as (x I + y A); A^k = p I + r A
    p, r, factor = 1.0, 0.0, 1.0
    e0 = e1 = i0 = i1 = j0 = j1 = 0.0
    for k in range(18):
        e0 += factor * p
        e1 += factor * r
        i0 += factor * p * step / (k + 1.0)
        i1 += factor * r * step / (k + 1.0)
        j0 += factor * p * step * step / ((k + 1.0) * (k + 2.0))
        j1 += factor * r * step * step / ((k + 1.0) * (k + 2.0))
        p, r = -det * r, p + trace * r
        factor *= step / (k + 1.0)
    for _ in range(doublings):
        s0, s1 = _times(i0, i1, i0, i1, trace, det)
        j0, j1 = 2.0 * j0 + s0, 2.0 * j1 + s1
        i0, i1 = _times(i0, i1, e0 + 1.0, e1, trace, det)
        e0, e1 = _times(e0, e1, e0, e1, trace, det)
    ab0 = a00 * b0 + a01 * b1
    ab1 = a10 * b0 + a11 * b1
    h0 = (j0 * b0 + j1 * ab0) / dt_s
    h1 = (j0 * b1 + j1 * ab1) / dt_s
    g0 = i0 * b0 + i1 * ab0 - h0
    g1 = i0 * b1 + i1 * ab1 - h1
    return (e0 + e1 * a00, e1 * a01, e1 * a10, e0 + e1 * a11), (g0, g1), (h0, h1)
