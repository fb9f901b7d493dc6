"""Innovations of a steady-state Kalman predictor, their likelihood, its gradient and its information.

For one record and one parameter vector: x' = A x + B u + w, y = C x + D u + b + v is stepped exactly from sample to
sample, the prediction covariance P is the stabilising solution of the filter's Riccati equation, and e are the
innovations of the gain that belongs to it. The initial state has covariance P about a mean x0; x0 and the output
biases b are estimated with the parameters, exactly, since e is linear in them. Then

    J = N/2 log|S| + 1/2 sum e' S^-1 e + 1/2 x0' M^-1 x0,   S = C P C' + R,

at its least value over x0 and b (M: covariance of the means that are not free). The gradient is exact to rounding:
derivatives of the step by those of its series, of P by the discrete Lyapunov equation that the differentiated Riccati
equation is, of e by the differentiated filter.

Recursions over samples are compiled; the algebra of small matrices is vectorised over runs.

Source: R. E. Maine and K. W. Iliff, "Identification of Dynamic Systems", NASA RP-1138 (1985), for the likelihood of
the innovations and its scoring.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.likelihood.filter_slopes import closed_loop, differentiated, transposed
from airtruth.identification.likelihood.kalman_kernel import (
    Drive,
    Filter,
    KalmanSignals,
    costates,
    drive_of,
    predict,
    propagate,
)
from airtruth.identification.likelihood.linearise import Matrices, matrices, slopes
from airtruth.identification.likelihood.predictor import LevelLayout
from airtruth.numerics.discretise import riccati, whitener

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

BLOCK_SAMPLES: Final = 4000
"""Samples of the runs that are filtered together [-]; judgement: their innovations stay in the processor's cache."""
RIDGE: Final = 1e-13
"""Added to the unit diagonal of the normal equations of initial means and biases [-]; judgement: an output without
memory of the start leaves its mean undetermined."""


class LikelihoodScore(NamedTuple):
    """The likelihood of runs, and the quantities that a step of scoring needs.

    Attributes
    ----------
    cost : (runs,) J; infinite where it cannot be evaluated.
    gradient : (runs, free) of J; 0 where it cannot be evaluated.
    information : (runs, free, free) Fisher information with means and biases free; NaN where it was not asked for.
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
    layout: LevelLayout,
    runs: Ints,
    z: Array,
    free: Ints,
    signals: KalmanSignals,
    dt_s: float,
    *,
    informed: bool = True,
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
    informed : whether the information is wanted; the gradient alone takes half of the time.
    """
    samples, outputs = signals.y.shape[1:]
    result = LikelihoodScore(
        np.full(runs.size, np.inf),
        np.zeros((runs.size, free.size)),
        np.full((runs.size, free.size, free.size), 0.0 if informed else np.nan),
        np.zeros((runs.size, samples, outputs)),
    )
    size = max(1, BLOCK_SAMPLES // samples)
    with np.errstate(over="ignore", invalid="ignore"):
        for first in range(0, runs.size, size):
            block = np.arange(first, min(first + size, runs.size))
            _score_block(layout, runs[block], z[block], free, signals, dt_s, block, result, informed)
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
    informed: bool,
) -> None:
    """Fill the rows ``block`` of the result where J can be evaluated."""
    steady, good = _steady(matrices(layout, runs, z, dt_s))
    runs, z, block = runs[good], z[good], block[good]
    signals = KalmanSignals(*(part[runs] for part in signals))
    samples, m = signals.y.shape[1:]
    drive = drive_of(steady.step, signals)
    base = _innovations(steady, drive)
    gram = np.matmul(np.swapaxes(base, 1, 2), base)
    states = slice(1, 1 + layout.sizes[0])
    gram[:, states, states] += layout.precision
    good = np.isfinite(gram).all(axis=(1, 2))
    if not good.all():
        runs, z, block, base, gram = runs[good], z[good], block[good], base[good], gram[good]
        signals, drive = KalmanSignals(*(part[good] for part in signals)), drive.of(good)
        steady = _chosen(steady, good)
    least = _profile(base, gram, layout.precision, samples * steady.logdet)
    result.cost[block] = least.cost
    result.innovations[block] = least.residual.reshape(-1, samples, m)
    if free.size == 0 or runs.size == 0:
        return
    # parameters that move the gain alone, as levels of noise do, come last
    acts = np.isin(free, layout.location[layout.location[:, 0] == 0, 3:])
    order = np.argsort(~acts, kind="stable")
    moved = slopes(layout, runs, z, free[order], dt_s)
    d_white, d_gain_p = differentiated(steady, moved)
    r = least.residual.reshape(-1, samples, m)
    path = _Path(*_predicted(steady, drive, least.nuisance), drive.u, r)
    unit = _per_unit(steady, moved, d_gain_p, int(acts.sum()))
    flat = d_white.reshape(*d_white.shape[:2], m * m)
    if informed:
        slope, information = _sums(steady, unit, base, least, path)
        result.information[block[:, None, None], order[:, None], order] = information + 0.5 * samples * (
            np.matmul(flat, transposed(flat))
        )
    else:
        slope = _slope(steady, unit, path)
    spread = samples * np.eye(m) - np.matmul(transposed(r), r)
    more = 0.5 * np.matmul(flat, spread.reshape(-1, m * m, 1))[:, :, 0]
    result.gradient[block[:, None], order] = slope + more


def _innovations(steady: Filter, drive: Drive) -> Array:
    """Whitened innovations of the data, and of a unit of each initial mean and bias.

    The latter are those of a system without inputs, [x; b]+ = [[phi - phi K C, -phi K], [0, I]] [x; b], e = -C x - b, from the
    powers of its matrix.

    Returns
    -------
    (runs, samples outputs, 1 + states + outputs).
    """
    runs, samples, m = drive.shown.shape
    n = steady.p.shape[1]
    _, errors = _predicted(steady, drive, np.zeros((runs, n + m)))
    made = np.empty((runs, samples * m, 1 + n + m))
    made[:, :, 0] = np.matmul(errors, transposed(steady.white)).reshape(runs, -1)
    unit = np.broadcast_to(np.eye(m), (runs, m, m))
    still = np.broadcast_to(np.eye(m, n + m, n), (runs, m, n + m))
    power = np.concatenate([np.concatenate([closed_loop(steady), -steady.gain_p], axis=2), still], axis=1)
    own = made[:, :, 1:]
    own[:, :m] = -np.matmul(steady.white, np.concatenate([steady.step.c, unit], axis=2))
    done = 1
    while done < samples:
        more = min(done, samples - done)
        own[:, done * m : (done + more) * m] = np.matmul(own[:, : more * m], power)
        power, done = np.matmul(power, power), done + more
    return made


def _predicted(steady: Filter, drive: Drive, nuisance: Array) -> tuple[Array, Array]:
    """States and innovations (runs, samples, ...) from initial means and biases."""
    states, errors = np.empty_like(drive.drive), np.empty_like(drive.shown)
    phi, c = steady.step.phi, steady.step.c
    predict(phi, c, steady.gain_p, drive.drive, drive.shown, nuisance, states, errors)
    return states, errors


class _Path(NamedTuple):
    """Trajectory of the estimated means and biases: states, innovations, inputs, whitened innovations, (runs, samples, ...)."""

    states: Array
    errors: Array
    inputs: Array
    white: Array


class _PerUnit(NamedTuple):
    """Effects of the free parameters per unit of each signal.

    Attributes
    ----------
    state : (runs, states + 3 inputs + outputs, states first) to the prediction, of the parameters that move more than the gain.
    error : (runs, outputs, states others) to the prediction, of the others.
    output : (runs, states + inputs, outputs first) to the whitened innovation.
    """

    state: Array
    error: Array
    output: Array


def _per_unit(steady: Filter, moved: Matrices, d_gain_p: Array, acting: int) -> _PerUnit:
    """Effects of parameters from derivatives of the step and of phi K, (runs, free, ...); the first ``acting`` move the model."""
    own = Matrices(*(part[:, :acting] for part in moved))
    gain_p, white = steady.gain_p[:, None], -steady.white[:, None]
    adds = [own.phi - gain_p @ own.c, -gain_p @ own.d, own.early, own.late, d_gain_p[:, :acting]]
    shows = [white @ own.c, white @ own.d]
    return _PerUnit(
        _last(np.concatenate(adds, axis=3)),
        _last(d_gain_p[:, acting:]),
        _last(np.concatenate(shows, axis=3)),
    )


def _slope(steady: Filter, unit: _PerUnit, path: _Path) -> Array:
    """Slopes (runs, free) of half the sum of squares of the innovations, by the adjoint of the differentiated filter.

    The innovations are stationary in the means and biases, so that these do not enter.
    """
    behind = np.empty_like(path.states)
    costates(closed_loop(steady), -np.matmul(steady.white, steady.step.c), path.white, behind)
    runs = len(behind)
    inputs, m = path.inputs.shape[2] // 3, path.white.shape[2]
    drives = (path.states, path.inputs, path.errors)
    by_state = np.concatenate([np.matmul(transposed(part), behind) for part in drives], axis=1)
    by_output = np.concatenate(
        [np.matmul(transposed(part), path.white) for part in (path.states, path.inputs[..., :inputs])], axis=1
    )
    slopes = []
    for each, by in ((unit.state, by_state), (unit.output, by_output), (unit.error, by_state[:, -m:])):
        slopes.append(np.matmul(by.reshape(runs, 1, -1), each.reshape(runs, by[0].size, -1))[:, 0])
    return np.concatenate([slopes[0] + slopes[1], slopes[2]], axis=1)


def _sums(steady: Filter, unit: _PerUnit, base: Array, least: _Profile, path: _Path) -> tuple[Array, Array]:
    """Slopes (runs, free) of half the sum of squares of the innovations, and their information with means and biases free."""
    runs, samples, m = path.errors.shape
    n = steady.p.shape[1]
    acting, others = unit.state.shape[2] // n, unit.error.shape[2] // n
    count, inputs = acting + others, path.inputs.shape[2] // 3
    closed, seen = (
        np.concatenate([part, np.zeros((*part.shape[:2], -n % 3))], axis=2)
        for part in (closed_loop(steady), -np.matmul(steady.white, steady.step.c))
    )
    width = 1 + n + m
    sums = np.empty((runs, count + width, count + width))
    both = np.empty((samples, m, count + width))
    by_sample = both.reshape(-1, count + width)
    # one run after another, so that these arrays stay in the processor's cache
    driving = np.empty((samples, n + 3 * inputs + m))
    driven, shown = np.empty((samples, n * acting)), np.empty((samples, m * acting))
    by_error = np.empty((samples, n * others))
    for run in range(runs):
        driving[:, :n], driving[:, n:-m], driving[:, -m:] = (
            path.states[run],
            path.inputs[run],
            path.errors[run],
        )
        np.matmul(driving, unit.state[run], out=driven)
        np.matmul(driving[:, : n + inputs], unit.output[run], out=shown)
        np.matmul(path.errors[run], unit.error[run], out=by_error)
        propagate(
            closed[run],
            seen[run],
            driven.reshape(samples, n, acting),
            by_error.reshape(samples, n, others),
            shown.reshape(samples, m, acting),
            both,
        )
        by_sample[:, count:] = base[run]
        np.matmul(by_sample.T, by_sample, out=sums[run])
    across = sums[:, :count, count:]
    at = np.concatenate([np.ones((runs, 1)), least.nuisance], axis=1)
    slope = np.matmul(across, at[:, :, None])[:, :, 0]
    scaled = across[:, :, 1:] / least.size[:, None, :]
    explained = np.matmul(scaled, np.linalg.solve(least.normal, transposed(scaled)))
    return slope, sums[:, :count, :count] - explained


def _last(slopes: Array) -> Array:
    """Derivatives (runs, free, rows, columns) with the parameter along the last axis, (runs, columns, rows free)."""
    made = np.moveaxis(slopes, 1, 3)
    return np.ascontiguousarray(np.swapaxes(made, 1, 2)).reshape(len(made), made.shape[2], -1)


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
    base : (runs, samples outputs, 1 + states + outputs) whitened innovations.
    gram : (runs, 1 + states + outputs, ...) products of its columns, with the precision of the means.
    precision : (states, states) of the initial means.
    logdet : (runs,) N log|S|.
    """
    size = np.sqrt(np.diagonal(gram, axis1=1, axis2=2)[:, 1:]) + 1e-300
    normal = gram[:, 1:, 1:] / (size[:, :, None] * size[:, None, :]) + RIDGE * np.eye(size.shape[1])
    nuisance = -np.linalg.solve(normal, (gram[:, 1:, 0] / size)[:, :, None])[:, :, 0] / size
    residual = base[..., 0] + np.matmul(base[..., 1:], nuisance[..., None])[..., 0]
    means = nuisance[:, None, : precision.shape[0]]
    prior = np.matmul(np.matmul(means, precision), np.swapaxes(means, 1, 2))[:, 0, 0]
    cost = 0.5 * (logdet + np.einsum("rk,rk->r", residual, residual) + prior)
    return _Profile(cost, nuisance, normal, size, residual)
