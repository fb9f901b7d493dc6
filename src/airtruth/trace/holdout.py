"""Records that a model was not fitted to: innovations and free runs with only their own parameters free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from airtruth.trace.air import Air, chosen, gusts, motion, response
from airtruth.trace.fit import NO_WHITENER, Fit, Hypothesis, Point, Problem, parts, reduced, tangent
from airtruth.trace.lower import Lowered, lower
from airtruth.trace.model import (
    LOCAL_STEP,
    L,
    S,
    Settings,
    local_prior,
    respond,
    shared_prior,
    start,
)
from airtruth.trace.records import Record

Array = NDArray[np.float64]

_ROUNDS: Final = 10
_DRAWS: Final = 128
_MOTION: Final = (0, 1, 4, 5, 6, 7, 8)
"""Own parameters that a free run leaves free: initial alpha and q, biases, trim coefficients."""


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
) -> Assessment:
    """Innovations and free run of one record for shared parameters and sizes that are given."""
    record, settings = problem.records[index], problem.settings
    own: Array = start(record, settings) if local is None else local.copy()
    one = Problem((record,), settings)
    middle, precision = local_prior(record, settings)
    k = len(sizes)
    best, damping = np.inf, 1e-6
    kept: Array = own
    move: Array = np.zeros(L)
    for _ in range(_ROUNDS):
        found = tangent(one, 0, hypothesis, Point(shared, own[None, :], sizes), local_only=True)
        cost = np.inf
        if found is not None:
            cost, gradient, information = parts(found, NO_WHITENER, levels=True)
            off = own - middle
            cost += 0.5 * float(off @ precision @ off)
        if found is None or not cost < best:
            move = 0.25 * move
            own = kept + move
            continue
        better, best, kept = best - cost, cost, own
        if better < 0.01:
            break
        h = information[S + k :, S + k :] + precision
        g = gradient[S + k :] + precision @ off
        move = np.asarray(-np.linalg.solve(h + damping * np.diag(np.diag(h)), g))
        move[9] = np.clip(move[9], -1.0, 1.0)
        own = own + move
    found = tangent(one, 0, hypothesis, Point(shared, kept[None, :], sizes), local_only=True)
    low = lower(hypothesis.change(sizes))
    response = respond(record, settings, low, shared, kept)
    if found is None:
        likelihood, whitened = np.inf, np.full_like(record.signals.y, np.nan)
    else:
        likelihood, whitened = parts(found, NO_WHITENER, levels=False)[0], found.r
    residual = free_run(record, problem, low, shared, kept)
    return Assessment(
        likelihood=float(likelihood),
        innovation=np.sqrt((response.e**2).mean(axis=0)),
        free_run=np.sqrt((residual**2).mean(axis=0)),
        residual=residual,
        whitened=whitened,
        expected=np.sqrt(np.diag(response.covariance)),
        local=kept,
    )


def free_run(record: Record, problem: Problem, low: Lowered, shared: Array, local: Array) -> Array:
    """(samples, 3) residuals of a simulation, initial state, biases and trim coefficients at their best.

    Least squares with the channels weighted by what gusts and sensors explain of them (`floor`).
    """
    settings = problem.settings
    weight = 1.0 / floor(record, problem, low, shared, local)
    own = local.copy()
    own[2:4] = 0.0
    middle, precision = local_prior(record, settings)
    prior = np.diag(precision)[list(_MOTION)]
    residual = respond(record, settings, low, shared, own, free_run=True).e
    for _ in range(3):
        residual, t = _tangents(record, settings, low, shared, own, weight)
        off = (own - middle)[list(_MOTION)]
        move = -np.linalg.solve(t @ t.T + np.diag(prior), t @ (residual * weight).ravel() + prior * off)
        if not np.isfinite(move).all():
            break
        trial = own.copy()
        trial[list(_MOTION)] += move
        after = respond(record, settings, low, shared, trial, free_run=True).e
        better = float(((residual * weight) ** 2).sum() - ((after * weight) ** 2).sum())
        if not np.isfinite(better) or better < 0.0:
            break
        own, residual = trial, after
        if better < 1e-3 * float(((residual * weight) ** 2).sum()):
            break
    return residual


def floor(record: Record, problem: Problem, low: Lowered, shared: Array, local: Array) -> Array:
    """What gusts and sensors explain of a free run before anything is fitted to it: (3,) standard deviations.

    In the filter's gusts, whatever the air's spectrum: it weights channels against one another.
    """
    m = motion(record, problem.settings, low, shared, local)
    if np.linalg.eigvals(m.a).real.max() >= 0.0:
        return np.asarray(10.0 * np.sqrt(m.variance))
    spread = solve_continuous_lyapunov(m.a, -np.diag(m.process))
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", m.c, spread, m.c), 0.0) + m.variance))


def explained(
    record: Record, problem: Problem, low: Lowered, shared: Array, local: Array, air: Air, seed: int
) -> Array:
    """What gusts and sensors leave of a free run once initial state, biases and trim are fitted to it: (3,) rms.

    The mean over `_DRAWS` records of the linear model in gusts, treated as `free_run` treats the measured one.

    Parameters
    ----------
    air : spectrum of the gusts.
    """
    m = motion(record, problem.settings, low, shared, local)
    samples, dt = record.samples, record.signals.dt_s
    rng = np.random.default_rng([seed, samples])
    w = gusts(air, m, dt, samples, _DRAWS, rng)
    y = response(m, w, dt) + np.sqrt(m.variance)[:, None] * rng.standard_normal((samples, 3, _DRAWS))
    weight = 1.0 / floor(record, problem, low, shared, local)
    t = _tangents(record, problem.settings, low, shared, local, weight)[1]
    prior = np.diag(np.diag(local_prior(record, problem.settings)[1])[list(_MOTION)])
    flat = (y * weight[:, None]).reshape(-1, _DRAWS)
    left = flat - t.T @ np.linalg.solve(t @ t.T + prior, t @ flat)
    return np.asarray(np.sqrt((left.reshape(samples, 3, _DRAWS) ** 2).mean(axis=(0, 2))) / weight)


def air_of(
    problem: Problem, hypothesis: Hypothesis, shared: Array, sizes: Array, found: Sequence[Assessment]
) -> Air:
    """The spectrum of the air in which records were flown, by their innovations under a model."""
    low = lower(hypothesis.change(sizes))
    motions = [
        motion(r, problem.settings, low, shared, a.local) for r, a in zip(problem.records, found, strict=True)
    ]
    return chosen(motions, [a.whitened for a in found], [r.signals.dt_s for r in problem.records])


def _tangents(
    record: Record, settings: Settings, low: Lowered, shared: Array, own: Array, weight: Array
) -> tuple[Array, Array]:
    """Residual of a free run (samples, 3) and its weighted derivatives (7, samples * 3)."""
    residual = respond(record, settings, low, shared, own, free_run=True).e
    columns = []
    for i in _MOTION:
        moved = own.copy()
        moved[i] += LOCAL_STEP[i]
        e = respond(record, settings, low, shared, moved, free_run=True).e
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
    _, total, _ = reduced(problem, found.point, k, pieces, levels=True)
    one_by_one = []
    for i, piece in enumerate(pieces):
        alone = Problem((problem.records[i],), problem.settings)
        at = Point(np.zeros(S), found.point.local[i : i + 1], found.point.sizes)
        gradient, information, _ = reduced(alone, at, k, [piece], levels=True)
        information = information.copy()
        information[:S, :S] -= shared_prior(alone.records[0], problem.settings)
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
        sizes = found.point.sizes + _held(found.hypothesis, found.point.sizes, move[S:])
        return assess(
            problem, i, found.hypothesis, found.point.shared + move[:S], sizes, found.point.local[i]
        )

    assessed = problem.each(one, range(len(problem.records)))
    return np.array([a.likelihood for a in assessed]), assessed


def _held(hypothesis: Hypothesis, sizes: Array, step_: Array) -> Array:
    """The step, ended where a parameter would leave its range."""
    moved = step_.copy()
    for i, (effect, j) in enumerate(hypothesis.parameters):
        low, high = hypothesis.effects[effect].parameters[j].reach
        moved[i] = min(max(sizes[i] + step_[i], low), high) - sizes[i]
    return moved


__all__ = ["Assessment", "air_of", "assess", "explained", "floor", "free_run", "leave_one_out"]
