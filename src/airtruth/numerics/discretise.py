"""From the terms of a predictor to its exact step and its steady prediction covariance, compiled.

`assemble` and `step` take real or complex arrays, so that a complex step can check `airtruth.numerics.step_slopes`.

Sources: E. K.-W. Chu et al., Int. J. Control 77(8), 2004 (structured doubling of the Riccati equation).
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import inner

Array = NDArray[np.float64]
Numbers = NDArray[Any]

ORDER: Final = 16
"""Terms of the power series of a step: the next one is below 1e-19."""
DOUBLINGS: Final = 40
"""Most doublings of a step or of a power of a matrix."""


@njit(cache=True, nogil=True, error_model="numpy")
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


@inner
def multiply(a: Numbers, b: Numbers, out: Numbers) -> None:
    """out = a b, real or complex; the inner loop runs along rows, so that it is vectorised."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = a[i, 0] * b[0, j]
        for k in range(1, a.shape[1]):
            factor = a[i, k]
            for j in range(b.shape[1]):
                out[i, j] += factor * b[k, j]


@inner
def congruence(a: Numbers, x: Numbers, work: Numbers, out: Numbers) -> None:
    """out = a x a' (plain transpose), x symmetric."""
    multiply(a, x, work)
    for i in range(a.shape[0]):
        for j in range(i + 1):
            total = work[i, 0] * a[j, 0]
            for k in range(1, a.shape[1]):
                total += work[i, k] * a[j, k]
            out[i, j] = total
            out[j, i] = total


@inner
def halvings(system: Numbers, states: int, dt_s: float) -> int:
    """Halvings of a step after which its series converges fast: the largest sum along a row of A times it is 1/2 at most."""
    size, count = 0.0, 0
    for i in range(states):
        row = 0.0
        for j in range(states):
            row += abs(system[i, j])
        size = max(size, row * dt_s)
    while size > 0.5 and count < DOUBLINGS:
        size *= 0.5
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
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
    doublings, noisy = halvings(system, n, dt_s), False
    h = dt_s * 0.5**doublings
    a = np.empty_like(phi)
    for i in range(n):
        for j in range(n):
            a[i, j] = system[i, j] * h
    power, spread = np.zeros_like(phi), np.zeros_like(phi)
    work, other = np.empty_like(phi), np.empty_like(phi)
    once, twice = np.zeros_like(phi), np.zeros_like(phi)
    for i in range(n):
        for j in range(n):
            phi[i, j] = 0.0
            noise[i, j] = 0.0
        power[i, i] = 1.0
        spread[i, i] = process[i] * h
        noisy |= process[i] != 0.0
    for k in range(
        ORDER
    ):  # power = (A h)^k/k!; spread = k-th derivative of the noise covariance h^(k+1)/(k+1)!
        for i in range(n):
            for j in range(n):
                phi[i, j] += power[i, j]
                once[i, j] += power[i, j] * (h / (k + 1.0))
                twice[i, j] += power[i, j] * (h * h / ((k + 1.0) * (k + 2.0)))
                noise[i, j] += spread[i, j]
        multiply(a, power, work)
        for i in range(n):
            for j in range(n):
                power[i, j] = work[i, j] / (k + 1.0)
        if noisy:
            multiply(a, spread, other)
            for i in range(n):
                for j in range(n):
                    spread[i, j] = (other[i, j] + other[j, i]) / (k + 2.0)
    for _ in range(doublings):
        multiply(once, once, work)
        multiply(phi, once, other)
        for i in range(n):
            for j in range(n):
                twice[i, j] = 2.0 * twice[i, j] + work[i, j]
                once[i, j] += other[i, j]
        if noisy:
            congruence(phi, noise, work, other)
            for i in range(n):
                for j in range(n):
                    noise[i, j] += other[i, j]
        multiply(phi, phi, work)
        for i in range(n):
            for j in range(n):
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


@inner
def eliminate(matrix: Array, right: Array) -> None:
    """Solve matrix x = right by Gaussian elimination with row pivots; x replaces ``right``, and ``matrix`` is used up.

    A singular matrix gives values that are not finite.
    """
    n, columns = right.shape
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(columns):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        for i in range(k + 1, n):
            share = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, n):
                matrix[i, j] -= share * matrix[k, j]
            for j in range(columns):
                right[i, j] -= share * right[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(columns):
            right[k, j] /= matrix[k, k]
        for i in range(k):
            for j in range(columns):
                right[i, j] -= matrix[i, k] * right[k, j]


@njit(cache=True, nogil=True, error_model="numpy")
def riccati(phi: Array, c: Array, noise: Array, variance: Array) -> Array:
    """P = phi (P - P C' (C P C' + R)^-1 C P) phi' + Q, its stabilising solution, by structured doubling.

    Parameters
    ----------
    phi, c : (n, n), (m, n).
    noise : (n, n) Q; variance : (m,) diagonal of R.

    Returns
    -------
    (n, n) P; not finite where a matrix of the doubling is singular.
    """
    n, m = phi.shape[0], c.shape[0]
    a, g, p = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    turned = np.empty((n, n))
    matrix, right = np.empty((n, n)), np.empty((n, 2 * n))
    solved, work, change = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            a[i, j], p[i, j] = phi[j, i], noise[i, j]
            total = 0.0
            for k in range(m):
                total += c[k, i] / variance[k] * c[k, j]
            g[i, j] = total
    for _ in range(DOUBLINGS):
        multiply(g, p, matrix)
        for i in range(n):
            matrix[i, i] += 1.0
            for j in range(n):
                right[i, j], right[i, n + j] = a[i, j], g[i, j]
        eliminate(matrix, right)
        for i in range(n):
            for j in range(n):
                turned[i, j] = a[j, i]
        for side in range(2):  # change = a' p (I + g p)^-1 a, then g += a (I + g p)^-1 g a'
            for i in range(n):
                for j in range(n):
                    solved[i, j] = right[i, side * n + j]
            if side == 0:
                multiply(p, solved, work)
                multiply(turned, work, change)
            else:
                multiply(a, solved, work)
                multiply(work, turned, solved)
                for i in range(n):
                    for j in range(n):
                        g[i, j] += solved[i, j]
        for i in range(n):
            for j in range(n):
                solved[i, j] = right[i, j]
        multiply(a, solved, work)
        settled = True
        for i in range(n):
            for j in range(n):
                a[i, j] = work[i, j]
                p[i, j] += 0.5 * (change[i, j] + change[j, i])
            if abs(change[i, i]) > 1e-15 * abs(p[i, i]):
                settled = False
        if settled:
            break
    return p


@njit(cache=True, nogil=True, error_model="numpy")
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
                lower[i, i] = math.sqrt(total)
                logdet += math.log(total)
            else:
                lower[i, j] = total / lower[j, j]
    for j in range(m):
        for i in range(m):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= lower[i, k] * white[k, j]
            white[i, j] = total / lower[i, i] if i >= j else 0.0
    return logdet
