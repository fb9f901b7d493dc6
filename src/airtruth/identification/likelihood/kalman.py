"""Innovations of a steady-state Kalman predictor, their likelihood, its gradient and its information.

For one record and one parameter vector: x' = A x + B u + w, y = C x + D u + b + v is stepped exactly from sample to
sample, the prediction covariance P is the stabilising solution of the filter's Riccati equation, and e are the
innovations of the gain that belongs to it. The initial state has covariance P about a mean x0; x0 and the output
biases b are estimated with the parameters, exactly, since e is linear in them. Then

    J = N/2 log|S| + 1/2 sum e' S^-1 e + 1/2 x0' M^-1 x0,   S = C P C' + R,

at its least value over x0 and b (M: covariance of the means that are not free). The gradient is exact to rounding:
derivatives of the step by complex step, of P by the discrete Lyapunov equation that the differentiated Riccati
equation is, of e by the differentiated filter.

Recursions over samples are compiled; the algebra of small matrices is vectorised over runs.

Source: R. E. Maine and K. W. Iliff, "Identification of Dynamic Systems", NASA RP-1138 (1985), for the likelihood of
the innovations and its scoring.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.likelihood.kalman_kernel import (
    Filter,
    FilterSlopes,
    KalmanSignals,
    innovate,
    innovate_slopes,
)
from airtruth.identification.likelihood.linearise import Matrices, matrices, slopes
from airtruth.identification.likelihood.predictor import LevelLayout
from airtruth.numerics.discretise import DOUBLINGS, riccati, whitener

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

BLOCK_SAMPLES: Final = 4000
"""Samples of the runs that are filtered together [-]; judgement: their innovations stay in the processor's cache."""
FADED: Final = 1e-9
"""Largest element of a power of the closed loop that counts as zero [-]; judgement: its square is below rounding."""
RIDGE: Final = 1e-13
"""Added to the unit diagonal of the normal equations of initial means and biases [-]; judgement: an output without
memory of the start leaves its mean undetermined."""


class LikelihoodScore(NamedTuple):
    """The likelihood of runs, and the quantities that a step of scoring needs.

    Attributes
    ----------
    cost : (runs,) J; infinite where it cannot be evaluated.
    gradient : (runs, free) of J; 0 where it cannot be evaluated.
    information : (runs, free, free) Fisher information with means and biases free.
    innovations : (runs, samples, outputs) whitened: of unit covariance.
    """

    cost: Array
    gradient: Array
    information: Array
    innovations: Array


class _Profile(NamedTuple):
    """The least J over initial means and biases: they themselves, their normalised normal matrix and its scale."""

    cost: Array
    nuisance: Array
    normal: Array
    size: Array
    residual: Array


def score(
    layout: LevelLayout, runs: Ints, z: Array, free: Ints, signals: KalmanSignals, dt_s: float
) -> LikelihoodScore:
    """J of runs with its gradient and information.

    A result does not depend on the other runs.

    Parameters
    ----------
    layout : predictor of the runs.
    runs : (active,) indices of the runs to work on.
    z : (active, parameters) values, logarithms where the layout has them.
    free : indices of the parameters to differentiate for.
    signals : records of all runs.
    dt_s : sample period [s].
    """
    samples, outputs = signals.y.shape[1:]
    result = LikelihoodScore(
        np.full(runs.size, np.inf),
        np.zeros((runs.size, free.size)),
        np.zeros((runs.size, free.size, free.size)),
        np.zeros((runs.size, samples, outputs)),
    )
    size = max(1, BLOCK_SAMPLES // samples)
    with np.errstate(over="ignore", invalid="ignore"):
        for first in range(0, runs.size, size):
            block = np.arange(first, min(first + size, runs.size))
            _score_block(layout, runs[block], z[block], free, signals, dt_s, block, result)
    return result


def _score_block(
    layout: LevelLayout,
    runs: Ints,
    z: Array,
    free: Ints,
    signals: KalmanSignals,
    dt_s: float,
    block: Ints,
    result: LikelihoodScore,
) -> None:
    """Fill the rows ``block`` of the result where J can be evaluated."""
    n, _, m, _ = layout.sizes
    steady, good = _steady(matrices(layout, runs, z, dt_s))
    runs, z, block = runs[good], z[good], block[good]
    signals = KalmanSignals(*(part[runs] for part in signals))
    samples, columns = signals.y.shape[1], 1 + n + m
    rows = np.empty((runs.size, columns + free.size, samples * m))
    innovate(steady.step, steady.white, steady.gain_p, signals, rows)
    base = rows[:, :columns]
    gram = np.matmul(base, np.swapaxes(base, 1, 2))
    gram[:, 1 : 1 + n, 1 : 1 + n] += layout.precision
    good = np.isfinite(gram).all(axis=(1, 2))
    if not good.all():
        runs, z, block, rows, gram = runs[good], z[good], block[good], rows[good], gram[good]
        signals = KalmanSignals(*(part[good] for part in signals))
        steady = _chosen(steady, good)
    least = _profile(rows[:, :columns], gram, layout.precision, samples * steady.logdet)
    result.cost[block] = least.cost
    result.innovations[block] = least.residual.reshape(-1, samples, m)
    if free.size == 0 or runs.size == 0:
        return
    moved = slopes(layout, runs, z, free, dt_s)
    d_white, d_gain_p = _differentiated(steady, moved)
    last = [np.ascontiguousarray(np.moveaxis(part, 1, -1)) for part in (*moved, d_gain_p)]
    by_parameter = FilterSlopes(last[0], last[1], last[2], last[4], last[5], last[7])
    innovate_slopes(steady, by_parameter, least.nuisance, signals, rows)
    gradient, information = _scored(rows, columns, d_white, least, samples)
    result.gradient[block], result.information[block] = gradient, information


def _steady(step: Matrices) -> tuple[Filter, Bools]:
    """Filters of the runs that have one, and which runs these are."""
    runs, m, _ = step.c.shape
    finite = (
        np.isfinite(part).reshape(runs, -1).all(axis=1) for part in (step.phi, step.noise, step.variance)
    )
    good = np.logical_and.reduce(list(finite))
    p, white = np.zeros_like(step.phi), np.zeros((runs, m, m))
    logdet = np.full(runs, np.nan)
    for b in np.flatnonzero(good):
        p[b] = riccati(step.phi[b], step.c[b], step.noise[b], step.variance[b])
        s = step.c[b] @ p[b] @ step.c[b].T + np.diag(step.variance[b])
        logdet[b] = whitener(s, white[b]) if np.isfinite(s).all() else np.nan
    good &= np.isfinite(logdet)
    gain = np.matmul(p, np.swapaxes(step.c, 1, 2)) @ np.matmul(np.swapaxes(white, 1, 2), white)
    return _chosen(Filter(step, p, white, logdet, gain, np.matmul(step.phi, gain)), good), good


def _chosen(steady: Filter, good: Bools) -> Filter:
    step = Matrices(*(part[good] for part in steady.step))
    return Filter(step, *(part[good] for part in steady[1:]))


def _profile(base: Array, gram: Array, precision: Array, logdet: Array) -> _Profile:
    """Least J over initial means and biases.

    Parameters
    ----------
    base : (runs, 1 + states + outputs, samples outputs) whitened innovations.
    gram : (runs, 1 + states + outputs, ...) products of its rows, with the precision of the means.
    precision : (states, states) of the initial means.
    logdet : (runs,) N log|S|.
    """
    size = np.sqrt(np.diagonal(gram, axis1=1, axis2=2)[:, 1:]) + 1e-300
    normal = gram[:, 1:, 1:] / (size[:, :, None] * size[:, None, :]) + RIDGE * np.eye(size.shape[1])
    nuisance = -np.linalg.solve(normal, (gram[:, 1:, 0] / size)[:, :, None])[:, :, 0] / size
    residual = base[:, 0] + np.matmul(nuisance[:, None, :], base[:, 1:])[:, 0]
    means = nuisance[:, None, : precision.shape[0]]
    prior = np.matmul(np.matmul(means, precision), np.swapaxes(means, 1, 2))[:, 0, 0]
    cost = 0.5 * (logdet + np.einsum("rk,rk->r", residual, residual) + prior)
    return _Profile(cost, nuisance, normal, size, residual)


def _differentiated(steady: Filter, moved: Matrices) -> tuple[Array, Array]:
    """Derivatives W dS W' (runs, free, outputs, outputs) and of phi K (runs, free, states, outputs)."""
    phi, c = steady.step.phi[:, None], steady.step.c[:, None]
    p, white, gain = steady.p[:, None], steady.white[:, None], steady.gain[:, None]
    n = phi.shape[-1]
    keep = np.eye(n) - gain @ c
    pc = p @ _t(c)
    filtered = p - gain @ _t(pc)
    # the gain is stationary for the filtered covariance: its derivative does not enter here
    half = gain @ moved.c @ (p @ _t(keep))
    inner = (gain * moved.variance[:, :, None, :]) @ _t(gain) - half - _t(half)
    shift = moved.phi @ (filtered @ _t(phi))
    d_p = phi @ inner @ _t(phi) + shift + _t(shift) + moved.noise
    d_p = _lyapunov(
        steady.step.phi - steady.gain_p @ steady.step.c, d_p, np.asarray(steady.p.any(axis=(1, 2)))
    )
    cross = moved.c @ pc
    d_s = cross + _t(cross) + c @ d_p @ _t(c)
    outputs = np.arange(d_s.shape[-1])
    d_s[..., outputs, outputs] += moved.variance
    slope = d_p @ _t(c) + p @ _t(moved.c) - gain @ d_s
    return white @ d_s @ _t(white), moved.phi @ gain + phi @ (slope @ (_t(white) @ white))


def _t(matrix: Array) -> Array:
    return np.swapaxes(matrix, -1, -2)


def _lyapunov(closed: Array, x: Array, filtering: Bools) -> Array:
    """Solution of X = F X F' + x by doubling.

    Parameters
    ----------
    closed : (runs, n, n) F.
    x : (runs, free, n, n) symmetric.
    filtering : (runs,) False where P = 0: nothing is filtered and X = x.
    """
    runs, count, n, _ = x.shape
    power = np.where(filtering[:, None, None], closed, 0.0)
    powers = []
    for _ in range(DOUBLINGS):
        powers.append(power)
        going = np.abs(power).max(axis=(1, 2)) > FADED
        if not going.any():
            break
        power = np.where(going[:, None, None], power @ power, 0.0)
    total = np.ascontiguousarray(
        np.swapaxes(x, 1, 2)
    )  # (runs, n, free, n): a product for all parameters at once
    for part in powers:
        left = np.matmul(part, total.reshape(runs, n, count * n)).reshape(runs, n * count, n)
        total += np.matmul(left, _t(part)).reshape(runs, n, count, n)
    return np.swapaxes(total, 1, 2)


def _scored(rows: Array, columns: int, d_white: Array, least: _Profile, samples: int) -> tuple[Array, Array]:
    """Gradient (runs, free) and information (runs, free, free) of J."""
    base, tangents = rows[:, 1:columns], rows[:, columns:]
    runs, count, m, _ = d_white.shape
    across = np.matmul(tangents, _t(base)) / least.size[:, None, :]
    explained = np.matmul(across, np.linalg.solve(least.normal, _t(across)))
    flat = d_white.reshape(runs, count, m * m)
    information = np.matmul(tangents, _t(tangents)) - explained + 0.5 * samples * np.matmul(flat, _t(flat))
    r = least.residual.reshape(runs, samples, m)
    spread = samples * np.eye(m) - np.matmul(_t(r), r)
    gradient = np.matmul(tangents, least.residual[:, :, None])[:, :, 0]
    gradient += 0.5 * np.matmul(flat, spread.reshape(runs, m * m, 1))[:, :, 0]
    return gradient, information
