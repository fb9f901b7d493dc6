"""Innovations of a steady-state Kalman predictor, their likelihood, its gradient and its information.

For one record and one parameter vector: x' = A x + B u + w, y = C x + D u + b + v is stepped exactly from
sample to sample, the prediction covariance P is the stabilising solution of the filter's Riccati equation,
and e are the innovations of the gain that belongs to it. The initial state has covariance P about a mean
m; m and the output biases b are estimated with the parameters, exactly, since e is linear in them. Then

    J = N/2 log|S| + 1/2 sum e' S^-1 e + 1/2 m' M^-1 m,   S = C P C' + R,

at its least value over m and b (M: covariance of the means that are not free). The gradient is that of J to
rounding: derivatives of the step by complex step, of P by the discrete Lyapunov equation that the
differentiated Riccati equation is, of e by the differentiated filter.

Source: R. E. Maine and K. W. Iliff, "Identification of Dynamic Systems", NASA RP-1138 (1985), for the
likelihood of the innovations and its scoring.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify.kalman_step import (
    DOUBLINGS,
    TINY,
    assemble,
    lyapunov,
    multiply,
    riccati,
    step,
    whitener,
)

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@njit(cache=True)
def score(
    z: Array,
    free: Ints,
    place: Ints,
    coefficient: Array,
    logarithmic: Ints,
    moves: Ints,
    precision: Array,
    sizes: tuple[int, int, int, int],
    y: Array,
    u: Array,
    bend: Array,
    dt_s: float,
    gradient: Array,
    information: Array,
    innovations: Array,
) -> float:
    """J of one record, and what a step of scoring needs.

    Parameters
    ----------
    z : (parameters,) values, logarithms where ``logarithmic`` says so.
    free : indices of the parameters to differentiate for.
    place, coefficient, logarithmic, moves, precision, sizes : of `airtruth.identify.predictor.Layout`.
    y : (samples, outputs); u : (samples, inputs).
    bend : (samples, inputs) mean of the input over the cell that ends at each sample, less the mean of
        the two samples.
    dt_s : sample period [s].
    gradient, information, innovations : (free,), (free, free), (samples, outputs), written: gradient of
        J, Fisher information with means and biases free, whitened innovations (unit covariance).

    Returns
    -------
    J; infinite where it cannot be had.
    """
    n, inputs, m, parameters = sizes
    samples = y.shape[0]
    count = free.size
    values = np.empty(parameters)
    for i in range(parameters):
        values[i] = np.exp(z[i]) if logarithmic[i] == 1 else z[i]
    system = np.empty((n + m, n + inputs))
    process, variance = np.empty(n), np.empty(m)
    phi, noise = np.empty((n, n)), np.empty((n, n))
    early, late = np.empty((n, inputs)), np.empty((n, inputs))
    assemble(values, place, coefficient, system, process, variance)
    step(system, process, n, dt_s, phi, early, late, noise)
    c = system[n:, :n].copy()
    d = system[n:, n:].copy()
    if not (np.isfinite(phi).all() and np.isfinite(noise).all() and np.isfinite(variance).all()):
        return np.inf
    p = riccati(phi, c, noise, variance)
    pc = np.dot(p, c.T)
    s = np.dot(c, pc)
    for i in range(m):
        s[i, i] += variance[i]
    if not np.isfinite(s).all():
        return np.inf
    white = np.empty((m, m))
    logdet = whitener(s, white)
    if not np.isfinite(logdet):
        return np.inf
    gain = np.dot(pc, np.dot(white.T, white))
    gain_p = np.dot(phi, gain)

    # innovations of the data and of each mean and bias
    columns = 1 + n + m
    rows = np.empty((columns + count, samples * m))
    x, following = np.zeros((n, columns)), np.empty((n, columns))
    e = np.empty((m, columns))
    for i in range(n):
        x[i, 1 + i] = 1.0
    for k in range(samples):
        for a in range(m):
            for j in range(columns):
                e[a, j] = 0.0
            for i in range(n):
                for j in range(columns):
                    e[a, j] -= c[a, i] * x[i, j]
            e[a, 0] += y[k, a]
            for i in range(inputs):
                e[a, 0] -= d[a, i] * u[k, i]
            e[a, 1 + n + a] -= 1.0
        for a in range(m):
            for j in range(columns):
                total = 0.0
                for b in range(a + 1):
                    total += white[a, b] * e[b, j]
                rows[j, k * m + a] = total
        if k + 1 < samples:
            for i in range(n):
                for j in range(columns):
                    following[i, j] = 0.0
                for h in range(n):
                    for j in range(columns):
                        following[i, j] += phi[i, h] * x[h, j]
                for a in range(m):
                    for j in range(columns):
                        following[i, j] += gain_p[i, a] * e[a, j]
                for h in range(inputs):
                    following[i, 0] += early[i, h] * (u[k, h] + bend[k + 1, h])
                    following[i, 0] += late[i, h] * (u[k + 1, h] + bend[k + 1, h])
            x[:] = following
    base = rows[:columns]
    gram = np.dot(base, base.T)
    for i in range(n):
        for j in range(n):
            gram[1 + i, 1 + j] += precision[i, j]
    if not np.isfinite(gram).all():
        return np.inf
    size = np.sqrt(np.diag(gram)[1:]) + 1e-300
    normal = gram[1:, 1:] / np.outer(size, size)
    for i in range(columns - 1):
        normal[i, i] += 1e-13  # an output without memory of the start leaves its mean undetermined
    nuisance = -np.linalg.solve(normal, gram[1:, 0] / size) / size
    r = rows[0].copy()
    for j in range(columns - 1):
        r += nuisance[j] * rows[1 + j]
    prior = 0.0
    for i in range(n):
        for j in range(n):
            prior += nuisance[i] * precision[i, j] * nuisance[j]
    innovations[:] = r.reshape(samples, m)
    cost = 0.5 * (samples * logdet + np.dot(r, r) + prior)
    if count == 0:
        return float(cost)

    # derivatives of the matrices; the last axis is the parameter, which inner loops run along
    d_phi, d_early = np.zeros((n, n, count)), np.zeros((n, inputs, count))
    d_late, d_c, d_d = np.zeros((n, inputs, count)), np.zeros((m, n, count)), np.zeros((m, inputs, count))
    d_gain = np.zeros((n, m, count))
    d_white = np.empty((count, m, m))
    powers = np.empty((DOUBLINGS, n, n))
    closed = phi - np.dot(gain_p, c)
    powers[0] = closed
    doublings = 1
    while doublings < DOUBLINGS and np.abs(powers[doublings - 1]).max() > 1e-9:
        multiply(powers[doublings - 1], powers[doublings - 1], powers[doublings])
        doublings += 1
    if doublings == DOUBLINGS and not p.any():
        doublings = 0  # nothing is filtered: P = 0 whatever the poles
    keep = np.eye(n) - np.dot(gain, c)
    filtered = p - np.dot(gain, pc.T)
    z_values = np.empty(parameters, dtype=np.complex128)
    z_system = np.empty((n + m, n + inputs), dtype=np.complex128)
    z_process, z_variance = np.empty(n, dtype=np.complex128), np.empty(m, dtype=np.complex128)
    z_phi, z_noise = np.empty((n, n), dtype=np.complex128), np.empty((n, n), dtype=np.complex128)
    z_early, z_late = np.empty((n, inputs), dtype=np.complex128), np.empty((n, inputs), dtype=np.complex128)
    work, other = np.empty((n, n)), np.empty((n, n))
    d_phi_i, d_noise_i, d_c_i = np.zeros((n, n)), np.zeros((n, n)), np.empty((m, n))
    for f in range(count):
        which = free[f]
        for i in range(parameters):
            z_values[i] = values[i]
        z_values[which] += 1j * TINY * (values[which] if logarithmic[which] == 1 else 1.0)
        assemble(z_values, place, coefficient, z_system, z_process, z_variance)
        d_phi_i[:] = 0.0
        d_noise_i[:] = 0.0
        if moves[which] == 1:
            step(z_system, z_process, n, dt_s, z_phi, z_early, z_late, z_noise)
            d_phi_i[:] = z_phi.imag / TINY
            d_noise_i[:] = z_noise.imag / TINY
            d_early[:, :, f] = z_early.imag / TINY
            d_late[:, :, f] = z_late.imag / TINY
        d_c_i[:] = z_system[n:, :n].imag / TINY
        d_phi[:, :, f] = d_phi_i
        d_c[:, :, f] = d_c_i
        d_d[:, :, f] = z_system[n:, n:].imag / TINY
        # the gain is stationary for the filtered covariance: it need not be differentiated here
        d_p = np.dot(np.dot(gain, d_c_i), np.dot(p, keep.T))
        d_p = -(d_p + d_p.T)
        for a in range(m):
            change = z_variance[a].imag / TINY
            for i in range(n):
                for j in range(n):
                    d_p[i, j] += gain[i, a] * change * gain[j, a]
        moved = np.dot(d_phi_i, np.dot(filtered, phi.T))
        d_p = np.dot(phi, np.dot(d_p, phi.T)) + moved + moved.T + d_noise_i
        lyapunov(powers, doublings, d_p, work, other)
        cross = np.dot(d_c_i, pc)
        d_s = cross + cross.T + np.dot(c, np.dot(d_p, c.T))
        for a in range(m):
            d_s[a, a] += z_variance[a].imag / TINY
        d_white[f] = np.dot(white, np.dot(d_s, white.T))
        slope = np.dot(d_p, c.T) + np.dot(p, d_c_i.T) - np.dot(gain, d_s)
        d_k = np.dot(slope, np.dot(white.T, white))
        d_gain[:, :, f] = np.dot(d_phi_i, gain) + np.dot(phi, d_k)

    # the filter differentiated along the one trajectory that means and biases leave
    state, ahead = nuisance[:n].copy(), np.empty(n)
    bias = nuisance[n:]
    dx, dx_ahead, de = np.zeros((n, count)), np.empty((n, count)), np.empty((m, count))
    now = np.empty(m)
    for k in range(samples):
        for a in range(m):
            total = y[k, a] - bias[a]
            for f in range(count):
                de[a, f] = 0.0
            for i in range(n):
                total -= c[a, i] * state[i]
                for f in range(count):
                    de[a, f] -= c[a, i] * dx[i, f] + d_c[a, i, f] * state[i]
            for i in range(inputs):
                total -= d[a, i] * u[k, i]
                for f in range(count):
                    de[a, f] -= d_d[a, i, f] * u[k, i]
            now[a] = total
        for a in range(m):
            for f in range(count):
                total = 0.0
                for b in range(a + 1):
                    total += white[a, b] * de[b, f]
                rows[columns + f, k * m + a] = total
        if k + 1 < samples:
            for i in range(n):
                total = 0.0
                for f in range(count):
                    dx_ahead[i, f] = 0.0
                for h in range(n):
                    total += phi[i, h] * state[h]
                    for f in range(count):
                        dx_ahead[i, f] += phi[i, h] * dx[h, f] + d_phi[i, h, f] * state[h]
                for a in range(m):
                    total += gain_p[i, a] * now[a]
                    for f in range(count):
                        dx_ahead[i, f] += gain_p[i, a] * de[a, f] + d_gain[i, a, f] * now[a]
                for h in range(inputs):
                    first, second = u[k, h] + bend[k + 1, h], u[k + 1, h] + bend[k + 1, h]
                    total += early[i, h] * first + late[i, h] * second
                    for f in range(count):
                        dx_ahead[i, f] += d_early[i, h, f] * first + d_late[i, h, f] * second
                ahead[i] = total
            state[:] = ahead
            dx[:] = dx_ahead

    tangents = rows[columns:]
    across = np.dot(tangents, base[1:].T) / size
    explained = np.dot(across, np.linalg.solve(normal, np.ascontiguousarray(across.T)))
    information[:] = np.dot(tangents, tangents.T) - explained
    moment = np.dot(innovations.T, innovations)
    for f in range(count):
        total = np.dot(tangents[f], r)
        for a in range(m):
            total += 0.5 * samples * d_white[f, a, a]
            for b in range(m):
                total -= 0.5 * d_white[f, a, b] * moment[a, b]
        gradient[f] = total
        for g in range(count):
            information[f, g] += 0.5 * samples * (d_white[f] * d_white[g]).sum()
    return float(cost)


@njit(cache=True)
def score_runs(
    z: Array,
    active: Ints,
    free: Ints,
    place: Ints,
    coefficient: Array,
    logarithmic: Ints,
    moves: Ints,
    precision: Array,
    sizes: tuple[int, int, int, int],
    y: Array,
    u: Array,
    bend: Array,
    dt_s: float,
    cost: Array,
    gradient: Array,
    information: Array,
) -> None:
    """`score` of the runs ``active``, each with its own row of z (active, parameters)."""
    innovations = np.empty((y.shape[1], y.shape[2]))
    for i in range(active.size):
        run = active[i]
        cost[i] = score(
            z[i],
            free,
            place,
            coefficient[run],
            logarithmic,
            moves,
            precision,
            sizes,
            y[run],
            u[run],
            bend[run],
            dt_s,
            gradient[i],
            information[i],
            innovations,
        )
