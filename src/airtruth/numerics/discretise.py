"""From the terms of a predictor to its exact step and its steady prediction covariance, compiled.

`assemble` and `step` take real or complex arrays: a complex step differentiates them to rounding.

Sources: E. K.-W. Chu et al., Int. J. Control 77(8), 2004 (structured doubling of the Riccati equation).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

DOUBLINGS: Final = 40
"""Most doublings of a step or of a power of a matrix."""
TINY: Final = 1e-40
"""Imaginary part of a complex step; nothing is subtracted, so it may be as small as that."""


@njit(cache=True)
def assemble(values, place, coefficient, system, process, noise):  # type: ignore[no-untyped-def]
    """Fill [[A, B], [C, D]], diag Q and diag R (of the type of ``values``, real or complex)."""
    system[:] = 0.0
    process[:] = 0.0
    noise[:] = 0.0
    for t in range(place.shape[0]):
        entry = coefficient[t] + 0.0 * values[0]
        for side in (3, 4):
            if place[t, side] >= 0:
                entry = entry * values[place[t, side]]
        if place[t, 0] == 0:
            system[place[t, 1], place[t, 2]] += entry
        elif place[t, 0] == 1:
            process[place[t, 1]] += entry
        else:
            noise[place[t, 1]] += entry


@njit(cache=True)
def multiply(a, b, out):  # type: ignore[no-untyped-def]
    """out = a b, real or complex."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = a[i, 0] * b[0, j]
            for k in range(1, a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@njit(cache=True)
def congruence(a, x, work, out):  # type: ignore[no-untyped-def]
    """out = a x a' (plain transpose), x symmetric."""
    multiply(a, x, work)
    for i in range(a.shape[0]):
        for j in range(i + 1):
            total = work[i, 0] * a[j, 0]
            for k in range(1, a.shape[1]):
                total += work[i, k] * a[j, k]
            out[i, j] = total
            out[j, i] = total


@njit(cache=True)
def step(system, process, states, dt_s, phi, early, late, noise):  # type: ignore[no-untyped-def]
    """Exact step x+ = phi x + early u + late u+ + n for inputs linear in between, n of covariance noise.

    Power series over dt/2^m, doubled m times: exp(A t), its integral and the integral of that, and
    int exp(A t) Q exp(A' t) dt.

    Parameters
    ----------
    system : (states + outputs, states + inputs); process : (states,) intensities [1/s].
    dt_s : sample period [s].
    phi, early, late, noise : (n, n), (n, inputs), (n, inputs), (n, n), written; real or complex.
    """
    n = states
    inputs = system.shape[1] - n
    size = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(system[i, j])
        size = max(size, row * dt_s)
    doublings = 0
    h = dt_s
    while size > 0.5 and doublings < DOUBLINGS:
        size *= 0.5
        h *= 0.5
        doublings += 1
    a = np.empty_like(phi)
    for i in range(n):
        for j in range(n):
            a[i, j] = system[i, j] * h
    power = np.zeros_like(phi)
    spread = np.zeros_like(phi)
    work, other = np.empty_like(phi), np.empty_like(phi)
    once, twice = np.zeros_like(phi), np.zeros_like(phi)
    phi[:] = 0.0
    noise[:] = 0.0
    for i in range(n):
        power[i, i] = 1.0
        spread[i, i] = process[i] * h
    for k in range(16):  # power = (A h)^k/k!; spread = k-th derivative of the noise covariance h^(k+1)/(k+1)!
        for i in range(n):
            for j in range(n):
                phi[i, j] += power[i, j]
                once[i, j] += power[i, j] * (h / (k + 1.0))
                twice[i, j] += power[i, j] * (h * h / ((k + 1.0) * (k + 2.0)))
                noise[i, j] += spread[i, j]
        multiply(a, power, work)
        multiply(a, spread, other)
        for i in range(n):
            for j in range(n):
                power[i, j] = work[i, j] / (k + 1.0)
                spread[i, j] = (other[i, j] + other[j, i]) / (k + 2.0)
    for _ in range(doublings):
        multiply(once, once, work)
        multiply(phi, once, other)
        for i in range(n):
            for j in range(n):
                twice[i, j] = 2.0 * twice[i, j] + work[i, j]
                once[i, j] += other[i, j]
        congruence(phi, noise, work, other)
        multiply(phi, phi, work)
        for i in range(n):
            for j in range(n):
                noise[i, j] += other[i, j]
                phi[i, j] = work[i, j]
    for i in range(n):
        for j in range(inputs):
            total = system[0, n + j] * 0.0
            ramp = total
            for k in range(n):
                total += once[i, k] * system[k, n + j]
                ramp += twice[i, k] * system[k, n + j]
            late[i, j] = ramp / dt_s
            early[i, j] = total - ramp / dt_s


@njit(cache=True)
def riccati(phi: Array, c: Array, noise: Array, variance: Array) -> Array:
    """P = phi (P - P C' (C P C' + R)^-1 C P) phi' + Q, its stabilising solution, by structured doubling.

    Parameters
    ----------
    phi, c : (n, n), (m, n).
    noise : (n, n) Q; variance : (m,) diagonal of R.
    """
    n = phi.shape[0]
    a = phi.T.copy()
    g = np.dot(np.ascontiguousarray(c.T) / variance, c)
    p = noise.copy()
    eye = np.eye(n)
    for _ in range(DOUBLINGS):
        solved = np.linalg.solve(eye + np.dot(g, p), np.hstack((a, g)))
        wa = np.ascontiguousarray(solved[:, :n])
        wg = np.ascontiguousarray(solved[:, n:])
        change = np.dot(a.T, np.dot(p, wa))
        g = g + np.dot(a, np.dot(wg, a.T))
        a = np.dot(a, wa)
        p = p + 0.5 * (change + change.T)
        settled = True
        for i in range(n):
            if abs(change[i, i]) > 1e-15 * abs(p[i, i]):
                settled = False
        if settled:
            break
    return p


@njit(cache=True, nogil=True)
def whitener(s: Array, white: Array) -> float:
    """W with W S W' = I into ``white`` (m, m), lower triangular; log|S|, nan where S is no covariance.

    Cholesky's factor by hand: what is no covariance is answered instead of raised.
    """
    m = s.shape[0]
    lower = np.zeros((m, m))
    logdet = 0.0
    for i in range(m):
        for j in range(i + 1):
            total = s[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0.0:
                    return np.nan
                lower[i, i] = np.sqrt(total)
                logdet += np.log(total)
            else:
                lower[i, j] = total / lower[j, j]
    white[:] = np.linalg.inv(lower)
    return float(logdet)
