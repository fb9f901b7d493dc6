"""Records that a model was not fitted to: innovations and free runs with only their own parameters free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from airtruth.identify.kalman_step import step
from airtruth.trace.fit import (
    NO_WHITENER,
    Fit,
    Hypothesis,
    Point,
    Problem,
    at_bounds,
    fit,
    parts,
    reduced,
    tangent,
)
from airtruth.trace.kernel import CORE, OUTPUTS, is_coloured, linear, states
from airtruth.trace.lower import Lowered, lower
from airtruth.trace.model import (
    GUST_LEVEL,
    LOCAL_STEP,
    MOTION,
    S,
    Settings,
    answered,
    inputs,
    local_prior,
    plane_of,
    respond,
    sensor_noise,
    start,
)
from airtruth.trace.records import Record

Array = NDArray[np.float64]

_ROUNDS: Final = 30
_DAMPING: Final = 1e-6
_DRAWS: Final = 128


@dataclass(frozen=True)
class Assessment:
    """What one record says of a model.

    Attributes
    ----------
    likelihood : negative log-likelihood, own parameters at their best.
    innovation, free_run : (3,) root mean squares in the channels' units.
    residual : (samples, 3) of the free run; whitened : (samples, 3) innovations.
    expected : (3,) root mean squares of innovations that are nothing but gusts and noise.
    local : (10,) own parameters.
    """

    likelihood: float
    innovation: Array
    free_run: Array
    residual: Array
    whitened: Array
    expected: Array
    local: Array


def assess(
    problem: Problem,
    index: int,
    hypothesis: Hypothesis,
    shared: Array,
    sizes: Array,
    local: Array | None = None,
    settled: bool = False,
) -> Assessment:
    """Innovations and free run of one record for shared parameters and sizes that are given.

    Parameters
    ----------
    local : own parameters to begin at; settled : they are at their best already.
    """
    record, settings = problem.records[index], problem.settings
    one = Problem((record,), settings)
    kept = start(record, settings) if local is None else local.copy()
    if not settled:
        kept = _own(one, hypothesis, shared, sizes, kept)
    found = tangent(one, 0, hypothesis, Point(shared, kept[None, :], sizes), local_only=True)
    low = lower(hypothesis.change(sizes))
    response = respond(record, settings, low, shared, kept)
    if found is None:
        likelihood, whitened = np.inf, np.full_like(record.signals.y, np.nan)
    else:
        likelihood, whitened = parts(found, NO_WHITENER, levels=False)[0], found.r
    residual = free_run(record, problem, low, shared, kept, hypothesis.loose)
    with np.errstate(over="ignore", invalid="ignore"):  # of a model that leaves all bounds on this record
        innovation, free = (np.sqrt((x**2).mean(axis=0)) for x in (response.e, residual))
    return Assessment(
        likelihood=float(likelihood),
        innovation=innovation,
        free_run=free,
        residual=residual,
        whitened=whitened,
        expected=np.sqrt(np.diag(response.covariance)),
        local=kept,
    )


def _own(one: Problem, hypothesis: Hypothesis, shared: Array, sizes: Array, begin: Array) -> Array:
    """Own parameters (10,) of a single record at their best for all else given: Levenberg-Marquardt."""
    middle, precision = one.own_priors(hypothesis)[0]
    k = len(sizes)

    def at(local: Array) -> tuple[float, Array, Array] | None:
        point = Point(shared, local[None, :], sizes)
        found = tangent(one, 0, hypothesis, point, local_only=True)
        if found is None:
            return None
        cost, gradient, information = parts(found, NO_WHITENER, levels=True)
        off = local - middle
        total = cost + 0.5 * float(off @ precision @ off)
        return total, gradient[S + k :] + precision @ off, information[S + k :, S + k :] + precision

    own, damping = begin, _DAMPING
    current = at(own)
    if current is None:
        return own
    for _ in range(_ROUNDS):
        cost, gradient, information = current
        move = -np.linalg.solve(information + damping * np.diag(np.diag(information)), gradient)
        move[GUST_LEVEL] = np.clip(move[GUST_LEVEL], -1.0, 1.0)
        tried = at(own + move)
        if tried is None or not tried[0] < cost:
            damping *= 10.0
            continue
        own, current = own + move, tried
        damping = max(0.1 * damping, _DAMPING)
        if cost - tried[0] < 0.01:
            break
    return own


def free_run(
    record: Record, problem: Problem, low: Lowered, shared: Array, local: Array, loose: Sequence[int] = ()
) -> Array:
    """(samples, 3) residuals of a simulation, initial state, biases and trim coefficients at their best.

    Least squares with the channels weighted by what gusts and sensors explain of them (`floor`).

    Parameters
    ----------
    loose : derivatives of whose coefficient nothing is declared.
    """
    settings = problem.settings
    weight = 1.0 / floor(record, problem, low, shared, local)
    own = local.copy()
    own[2:4] = 0.0
    middle, precision = local_prior(record, settings, loose)
    prior = np.diag(precision)[list(MOTION)]
    residual = respond(record, settings, low, shared, own, free_run=True).e
    for _ in range(3):
        residual, t = _tangents(record, settings, low, shared, own, weight)
        off = (own - middle)[list(MOTION)]
        move = -np.linalg.solve(t @ t.T + np.diag(prior), t @ (residual * weight).ravel() + prior * off)
        if not np.isfinite(move).all():
            break
        trial = own.copy()
        trial[list(MOTION)] += move
        after = respond(record, settings, low, shared, trial, free_run=True).e
        better = float(((residual * weight) ** 2).sum() - ((after * weight) ** 2).sum())
        if not np.isfinite(better) or better < 0.0:
            break
        own, residual = trial, after
        if better < 1e-3 * float(((residual * weight) ** 2).sum()):
            break
    return residual


def floor(record: Record, problem: Problem, low: Lowered, shared: Array, local: Array) -> Array:
    """What gusts and sensors explain of a free run before anything is fitted to it: (3,) standard deviations."""
    a, c, process, noise = _linearised(record, problem.settings, low, shared, local)
    if np.linalg.eigvals(a).real.max() >= 0.0:
        return np.asarray(10.0 * np.sqrt(noise))
    spread = solve_continuous_lyapunov(a, -np.diag(process))
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", c, spread, c), 0.0) + noise))


def explained(
    record: Record,
    problem: Problem,
    low: Lowered,
    shared: Array,
    local: Array,
    seed: int,
    loose: Sequence[int] = (),
) -> Array:
    """What gusts and sensors leave of a free run once initial state, biases and trim are fitted to it: (3,) rms.

    The mean over `_DRAWS` records of the linear model in its gusts, treated as `free_run` treats the measured one.
    """
    a, c, process, noise = _linearised(record, problem.settings, low, shared, local)
    n, samples = a.shape[0], record.samples
    phi, spread = np.empty((n, n)), np.empty((n, n))
    early, late = np.empty((n, 1)), np.empty((n, 1))
    step(np.hstack([a, np.zeros((n, 1))]), process, n, record.signals.dt_s, phi, early, late, spread)
    values, vectors = np.linalg.eigh(spread)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng([seed, samples])
    x = np.zeros((n, _DRAWS))
    x[2:4] = np.linalg.cholesky(np.array([[1.0, 0.5], [0.5, 0.5]])) @ rng.standard_normal((2, _DRAWS))
    x[5:CORE] = x[2]
    if is_coloured(sensor_noise(problem.settings, shared)[1]):
        x[-OUTPUTS:] = rng.standard_normal((OUTPUTS, _DRAWS))
    y = np.empty((samples, 3, _DRAWS))
    for k in range(samples):
        y[k] = c @ x
        x = phi @ x + root @ rng.standard_normal((n, _DRAWS))
    y += np.sqrt(noise)[:, None] * rng.standard_normal(y.shape)
    weight = 1.0 / floor(record, problem, low, shared, local)
    t = _tangents(record, problem.settings, low, shared, local, weight)[1]
    prior = np.diag(np.diag(local_prior(record, problem.settings, loose)[1])[list(MOTION)])
    flat = (y * weight[:, None]).reshape(-1, _DRAWS)
    left = flat - t.T @ np.linalg.solve(t @ t.T + prior, t @ flat)
    return np.asarray(np.sqrt((left.reshape(samples, 3, _DRAWS) ** 2).mean(axis=(0, 2))) / weight)


def _linearised(
    record: Record, settings: Settings, low: Lowered, shared: Array, local: Array
) -> tuple[Array, Array, Array, Array]:
    """A (n, n), C (3, n), intensities (n,) [1/s] and white noise's variances (3,) of the motion in its gusts,
    sensors' lags, delays and slow noise included.
    """
    inner = CORE + sum(1 if kind == 0 else 2 for kind in low.state_index[:, 0])
    variance, colour = sensor_noise(settings, shared)
    n = states(inner, low.lags, low.delays, colour)
    a, c = np.empty((n, n)), np.empty((3, n))
    x = np.zeros(n)
    x[0], elevator, v, density, theta = inputs(record, low).reference.tolist()
    linear(
        x,
        elevator,
        v,
        0.5 * density * v * v,
        theta,
        inner,
        low.lags,
        low.delays,
        colour,
        plane_of(record.plant, settings, low, shared, local, v),
        low.arms,
        low.scales,
        a,
        c,
    )
    process = np.zeros(n)
    process[2] = 2.0 * v / settings.length_w_m
    if is_coloured(colour):
        process[-OUTPUTS:] = 2.0 / colour[OUTPUTS]
    return a, c, process, variance


def _tangents(
    record: Record, settings: Settings, low: Lowered, shared: Array, own: Array, weight: Array
) -> tuple[Array, Array]:
    """Residual of a free run (samples, 3) and its weighted derivatives (7, samples * 3)."""
    given = inputs(record, low)
    residual = answered(given, settings, shared, own, free_run=True).e
    columns = []
    for i in MOTION:
        moved = own.copy()
        moved[i] += LOCAL_STEP[i]
        e = answered(given, settings, shared, moved, free_run=True).e
        columns.append(((e - residual) * weight / LOCAL_STEP[i]).ravel())
    return residual, np.array(columns)


def leave_one_out(problem: Problem, found: Fit) -> tuple[Array, list[Assessment]]:
    """Each fitted record, judged by shared parameters and sizes to which it did not contribute.

    One step of scoring takes a record out of the fit: exact where the posterior is quadratic.

    Returns
    -------
    (records,) negative log-likelihoods, and the assessments.
    """
    k = len(found.point.sizes)
    pieces = [parts(t, NO_WHITENER, levels=True) for t in found.tangents]
    held = at_bounds(found.point)
    _, total, _ = reduced(problem, found.hypothesis, found.point, k, pieces, levels=True, held=held)
    one_by_one = []
    for i, piece in enumerate(pieces):
        alone = Problem((problem.records[i],), problem.settings)
        at = Point(np.zeros(S), found.point.local[i : i + 1], found.point.sizes)
        gradient, information, _ = reduced(alone, found.hypothesis, at, k, [piece], levels=True, held=held)
        information = information.copy()
        information[:S, :S] -= alone.shared_precision(found.hypothesis)
        one_by_one.append((gradient, information))

    def one(index: object) -> Assessment:
        i = int(index)  # type: ignore[call-overload]
        gradient, information = one_by_one[i]
        rest = total - information
        scale = np.sqrt(np.maximum(np.diag(rest), 1e-30))
        move = (
            np.linalg.solve(rest / np.outer(scale, scale) + 1e-9 * np.eye(len(scale)), gradient / scale)
            / scale
        )
        move[6:S] = np.clip(move[6:S], -1.0, 1.0)  # of levels, as in a search
        sizes = found.point.sizes + _held(found.hypothesis, found.point.sizes, move[S:])
        return assess(
            problem, i, found.hypothesis, found.point.shared + move[:S], sizes, found.point.local[i]
        )

    assessed = problem.each(one, range(len(problem.records)))
    return np.array([a.likelihood for a in assessed]), assessed


def one_by_the_other(problem: Problem, found: Fit) -> tuple[Array, list[Assessment]]:
    """`leave_one_out` of two records, each judged by a refit to the other: of half of what was known, one step of
    scoring can be too long, and a refit can be led astray by what the model lacks besides.
    """
    assessed = []
    for i, other in ((0, 1), (1, 0)):
        alone = Problem((problem.records[other],), problem.settings)
        there = replace(found.point, local=found.point.local[other : other + 1])
        refitted = fit(alone, found.hypothesis, there) or found
        point = refitted.point
        assessed.append(assess(problem, i, found.hypothesis, point.shared, point.sizes, found.point.local[i]))
    return np.array([a.likelihood for a in assessed]), assessed


def _held(hypothesis: Hypothesis, sizes: Array, step_: Array) -> Array:
    """The step, ended where a parameter would leave its range."""
    moved = step_.copy()
    for i, (effect, j) in enumerate(hypothesis.parameters):
        low, high = hypothesis.effects[effect].parameters[j].reach
        moved[i] = min(max(sizes[i] + step_[i], low), high) - sizes[i]
    return moved


__all__ = ["Assessment", "assess", "explained", "floor", "free_run", "leave_one_out", "one_by_the_other"]
