"""Records that a model was not fitted to: innovations and free runs with only their own parameters free."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from airtruth.trace.fit import NO_WHITENER, Fit, Hypothesis, Point, Problem, parts, reduced, tangent
from airtruth.trace.kernel import CORE, linear
from airtruth.trace.lower import Lowered, lower
from airtruth.trace.model import LOCAL_STEP, L, S, local_prior, plane_of, respond, shared_prior, start
from airtruth.trace.records import Record

Array = NDArray[np.float64]

_ROUNDS: Final = 10
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
    step: Array = np.zeros(L)
    for _ in range(_ROUNDS):
        found = tangent(one, 0, hypothesis, Point(shared, own[None, :], sizes), local_only=True)
        cost = np.inf
        if found is not None:
            cost, gradient, information = parts(found, NO_WHITENER, levels=True)
            off = own - middle
            cost += 0.5 * float(off @ precision @ off)
        if found is None or not cost < best:
            step = 0.25 * step
            own = kept + step
            continue
        better, best, kept = best - cost, cost, own
        if better < 0.01:
            break
        h = information[S + k :, S + k :] + precision
        g = gradient[S + k :] + precision @ off
        step = np.asarray(-np.linalg.solve(h + damping * np.diag(np.diag(h)), g))
        step[9] = np.clip(step[9], -1.0, 1.0)
        own = own + step
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
        columns = []
        for i in _MOTION:
            moved = own.copy()
            moved[i] += LOCAL_STEP[i]
            e = respond(record, settings, low, shared, moved, free_run=True).e
            columns.append(((e - residual) * weight / LOCAL_STEP[i]).ravel())
        t = np.array(columns)
        off = (own - middle)[list(_MOTION)]
        step = -np.linalg.solve(t @ t.T + np.diag(prior), t @ (residual * weight).ravel() + prior * off)
        if not np.isfinite(step).all():
            break
        trial = own.copy()
        trial[list(_MOTION)] += step
        after = respond(record, settings, low, shared, trial, free_run=True).e
        better = float(((residual * weight) ** 2).sum() - ((after * weight) ** 2).sum())
        if not np.isfinite(better) or better < 0.0:
            break
        own, residual = trial, after
        if better < 1e-3 * float(((residual * weight) ** 2).sum()):
            break
    return residual


def floor(record: Record, problem: Problem, low: Lowered, shared: Array, local: Array) -> Array:
    """What gusts and sensors explain of a free run: (3,) standard deviations."""
    settings, plant, s = problem.settings, record.plant, record.signals
    states = sum(1 if kind == 0 else 2 for kind in low.state_index[:, 0])
    motion = CORE + states
    n = motion
    a, c = np.empty((n, n)), np.empty((3, n))
    v, density = float(s.airspeed_m_s.mean()), float(s.density_kg_m3.mean())
    x = np.zeros(n)
    x[0] = float(s.y[:, 0].mean()) - plant.alpha_shift_rad
    linear(
        x,
        float(s.elevator_rad.mean()),
        v,
        0.5 * density * v * v,
        float(s.theta_rad.mean()) - plant.alpha_shift_rad,
        motion,
        np.zeros(3),
        np.zeros(3),
        plane_of(plant, settings, low, shared, local, v),
        low.arms,
        low.scales,
        a,
        c,
    )
    process = np.zeros((n, n))
    process[2, 2] = 2.0 * v / settings.length_w_m
    noise = (settings.noise * np.exp(shared[6:9])) ** 2
    if np.linalg.eigvals(a).real.max() < 0.0:
        spread = solve_continuous_lyapunov(a, -process)
        open_loop = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", c, spread, c), 0.0) + noise)
    else:
        open_loop = 10.0 * np.sqrt(noise)
    return np.asarray(open_loop)


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
        step = (
            np.linalg.solve(rest / np.outer(scale, scale) + 1e-9 * np.eye(len(scale)), gradient / scale)
            / scale
        )
        sizes = found.point.sizes + _held(found.hypothesis, found.point.sizes, step[S:])
        return assess(
            problem, i, found.hypothesis, found.point.shared + step[:S], sizes, found.point.local[i]
        )

    assessed = problem.each(one, range(len(problem.records)))
    return np.array([a.likelihood for a in assessed]), assessed


def _held(hypothesis: Hypothesis, sizes: Array, step: Array) -> Array:
    """The step, ended where a parameter would leave its range."""
    moved = step.copy()
    for i, (effect, j) in enumerate(hypothesis.parameters):
        p = hypothesis.effects[effect].parameters[j]
        ends = sorted((p.size(p.low), p.size(p.high)))
        if p.one_sided:
            ends[0] = min(ends[0], 0.0) if not p.reciprocal else 0.0
        moved[i] = min(max(sizes[i] + step[i], ends[0]), ends[1]) - sizes[i]
    return moved


__all__ = ["Assessment", "assess", "floor", "free_run", "leave_one_out"]
