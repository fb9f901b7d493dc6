"""Maximum a posteriori of derivatives, levels, biases, initial states and an effect's sizes over several records.

Scoring (Fisher information, differences for tangents) with a Levenberg-Marquardt damping; what belongs to
one record alone is eliminated record by record. Innovations that are not white are whitened by a vector
autoregression whose order the data choose.

Source: R. E. Maine and K. W. Iliff, NASA RP-1138 (1985); H. Luetkepohl, New Introduction to Multiple Time
Series Analysis (2005), 3.2 and 4.3, for the autoregression and its order.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.change import AeroTerm, Change
from airtruth.effects.effect import Effect
from airtruth.trace.model import (
    BOUNDS,
    GUST_LEVEL,
    LOCAL_STEP,
    NOISE,
    SHARED_STEP,
    External,
    L,
    S,
    Settings,
    active,
    answered,
    inputs,
    local_prior,
    respond,
    shared_prior,
    start,
)
from airtruth.trace.records import Record

Array = NDArray[np.float64]

ITERATIONS: Final = 45
_ENOUGH: Final = 0.002
"""A fit has converged once a step would gain less than this in log-likelihood: 0.06 standard errors."""
_NEARLY: Final = 0.05
"""The same where a step does not keep its promise: 0.3 standard errors."""
_STUCK: Final = 0.5
"""The same where no step gains anything: tables with breaks give the gain, and with it the cost, small ones too."""
_CHORDS: Final = 3
_LEAST_DAMPING: Final = 1e-9
_STALE: Final = 1.0
"""Gain in log-likelihood below which derivatives are made anew."""
_ORDERS: Final = 6
_ROUGH_M_S: Final = 1.0


@dataclass(frozen=True)
class Hypothesis:
    """The declared aircraft and some effects of free size.

    Attributes
    ----------
    declared : what aircraft.toml says of the sensors.
    effects : the effects; none is the null hypothesis.
    freed : derivatives of whose value nothing is declared, besides those that the effects set free (`loosened`).
    trim_alpha_rad : about which a curvature in alpha is counted: about any other angle it is a slope and a constant
        besides, and those are for the records to say.
    """

    declared: Change
    effects: tuple[Effect, ...] = ()
    freed: tuple[int, ...] = ()
    trim_alpha_rad: float = 0.0

    @cached_property
    def loose(self) -> tuple[int, ...]:
        """Derivatives of whose value nothing is declared; nor of the coefficient that they are of."""
        free = (i for e in self.effects for i in loosened(e, self.trim_alpha_rad))
        return tuple(sorted({*self.freed, *free}))

    @cached_property
    def parameters(self) -> tuple[tuple[int, int], ...]:
        """(effect, parameter) of each place in the vector of sizes."""
        return tuple((i, j) for i, e in enumerate(self.effects) for j in range(len(e.parameters)))

    def values(self, sizes: Array) -> list[dict[str, float]]:
        """Parameters of each effect, in their own units."""
        found: list[dict[str, float]] = [{} for _ in self.effects]
        for size, (i, j) in zip(sizes, self.parameters, strict=True):
            p = self.effects[i].parameters[j]
            found[i][p.name] = p.value(float(size))
        return found

    def change(self, sizes: Array) -> Change:
        """All that the hypothesis changes at these sizes."""
        return self.declared + self.added(sizes)

    def added(self, sizes: Array) -> Change:
        """What the effects change at these sizes, without what is declared."""
        total = Change()
        for effect, values in zip(self.effects, self.values(sizes), strict=True):
            total = total + effect.change(values)
        return replace(total, aero=tuple(self._about_trim(t) for t in total.aero))

    def _about_trim(self, term: AeroTerm) -> AeroTerm:
        return replace(term, at=self.trim_alpha_rad) if _is_curvature(term) else term

    @cached_property
    def held(self) -> tuple[int, ...]:
        """Places among shared parameters and sizes of those whose range is a single value."""
        ends = [self.effects[i].parameters[j].ends for i, j in self.parameters]
        return tuple(S + k for k, (low, high) in enumerate(ends) if low == high)

    def plus(self, effect: Effect) -> Hypothesis:
        """The hypothesis with one effect more."""
        return replace(self, effects=(*self.effects, effect))


def loosened(effect: Effect, trim_alpha_rad: float) -> tuple[int, ...]:
    """Derivatives whose declared value says nothing beside the effect.

    A curvature about another angle of attack than the trim's is a slope and a constant at the trim besides, and those
    cannot be both what is declared and so much more: which of the two the aircraft has is for the records to say.
    """
    change = effect.change({p.name: p.high for p in effect.parameters})
    bent = {t.coefficient for t in change.aero if _is_curvature(t) and t.at != trim_alpha_rad}
    return tuple(i for i, coefficient in ((0, "CL"), (3, "Cm")) if coefficient in bent)


def _is_curvature(term: AeroTerm) -> bool:
    return term.signal == "alpha" and term.shape == "quadratic"


@dataclass(frozen=True)
class Point:
    """Values of all free parameters: shared (17,), local (records, 10), sizes (k,)."""

    shared: Array
    local: Array
    sizes: Array


@dataclass(frozen=True)
class Tangent:
    """Whitened innovations of one record and their derivatives.

    Attributes
    ----------
    r : (samples, 3) whitened innovations.
    logdet : log|S|.
    t : (parameters, samples, 3) derivatives of the whitened innovations at fixed whitener; order: shared,
        sizes, local.
    w : (parameters, 3, 3) whitened derivatives of S.
    white : (3, 3).
    """

    r: Array
    logdet: float
    t: Array
    w: Array
    white: Array


@dataclass(frozen=True)
class Whitener:
    """Vector autoregression of whitened innovations: r_k - sum A_j r_(k-j), times the inverse root of what is left.

    Attributes
    ----------
    coefficients : (order, 3, 3); root : (3, 3).
    """

    coefficients: Array
    root: Array

    def apply(self, x: Array) -> Array:
        """Filter (..., samples, 3) along the samples; the first ones pass with the root alone."""
        if self.coefficients.shape[0] == 0:
            return x
        out = x.copy()
        for j, a in enumerate(self.coefficients, start=1):
            out[..., j:, :] -= x[..., :-j, :] @ a.T
        return np.asarray(out @ self.root.T)


NO_WHITENER: Final = Whitener(np.zeros((0, 3, 3)), np.eye(3))


@dataclass(frozen=True)
class Fit:
    """Where the posterior is largest.

    Attributes
    ----------
    hypothesis, point : what was fitted and where it ended.
    cost : negative log-posterior, constants left out, so that it compares hypotheses whose derivatives and trim
        coefficients are as free.
    likelihood : (records,) negative log-likelihood of each record.
    tangents : of each record at ``point``.
    whitener : of the innovations.
    covariance : (17 + k, 17 + k) of shared parameters and sizes, local ones free.
    converged : whether the search ended by its tolerance.
    shortfall : log-likelihood that an undamped step promises where it did not, else none.
    """

    hypothesis: Hypothesis
    point: Point
    cost: float
    likelihood: Array
    tangents: tuple[Tangent, ...]
    whitener: Whitener
    covariance: Array
    converged: bool
    shortfall: float = 0.0


@dataclass(frozen=True)
class Problem:
    """Records, what is declared of them, and how many threads work on them."""

    records: tuple[Record, ...]
    settings: Settings
    threads: int = 1

    def own_priors(self, hypothesis: Hypothesis) -> tuple[tuple[Array, Array], ...]:
        """Middle (10,) and precision (10, 10) of each record's own parameters."""
        loose = hypothesis.loose
        if loose not in self._own_priors:
            self._own_priors[loose] = tuple(local_prior(r, self.settings, loose) for r in self.records)
        return self._own_priors[loose]

    @cached_property
    def _own_priors(self) -> dict[tuple[int, ...], tuple[tuple[Array, Array], ...]]:
        return {}

    def shared_precision(self, hypothesis: Hypothesis) -> Array:
        """(17, 17) of the shared parameters about zero."""
        return shared_prior(self.records[0], self.settings, hypothesis.loose)

    def each(self, function, arguments: Sequence[object]) -> list:  # type: ignore[no-untyped-def, type-arg]
        """The function of each argument, in order."""
        if self.threads <= 1 or len(arguments) <= 1:
            return [function(a) for a in arguments]
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(function, arguments))


def tangent(
    problem: Problem,
    index: int,
    hypothesis: Hypothesis,
    point: Point,
    local_only: bool = False,
    old: Tangent | None = None,
) -> Tangent | None:
    """Innovations of one record and their derivatives by one-sided differences; None where the motion is lost.

    Parameters
    ----------
    local_only : differentiate for the record's own parameters alone.
    old : derivatives at a point nearby, whitened anew and kept for all but the sizes.
    """
    record, settings = problem.records[index], problem.settings
    given = inputs(record, hypothesis.change(point.sizes))
    base = answered(given, settings, point.shared, point.local[index])
    if not np.isfinite(base.logdet):
        return None
    k = len(point.sizes)
    t = np.zeros((S + k + L, *base.e.shape))
    w = np.zeros((S + k + L, 3, 3))

    def put(at: int, moved: object, h: float) -> None:
        t[at] = (moved.e - base.e) @ base.white.T / h  # type: ignore[attr-defined]
        w[at] = base.white @ ((moved.covariance - base.covariance) / h) @ base.white.T  # type: ignore[attr-defined]

    if old is not None:
        turn = np.linalg.solve(old.white.T, base.white.T)
        t[:] = old.t @ turn
        w[:] = turn.T @ old.w @ turn
    if not local_only:
        for i in active(settings) if old is None else ():
            shared = point.shared.copy()
            shared[i] += SHARED_STEP[i]
            put(i, answered(given, settings, shared, point.local[index]), SHARED_STEP[i])
        for i in range(k):
            effect, j = hypothesis.parameters[i]
            p = hypothesis.effects[effect].parameters[j]
            h = 0.02 * p.step if p.place or abs(point.sizes[i]) > p.step else p.step
            sizes = point.sizes.copy()
            sizes[i] += h
            moved = respond(record, settings, hypothesis.change(sizes), point.shared, point.local[index])
            put(S + i, moved, h)
    for i in range(L if old is None else 0):
        local = point.local[index].copy()
        local[i] += LOCAL_STEP[i]
        put(S + k + i, answered(given, settings, point.shared, local), LOCAL_STEP[i])
    if not (np.isfinite(t).all() and np.isfinite(w).all()):
        return None
    return Tangent(base.e @ base.white.T, base.logdet, t, w, base.white)


def parts(tangent_: Tangent, whitener: Whitener, levels: bool) -> tuple[float, Array, Array]:
    """Negative log-likelihood, gradient and information (parameters,) of one record.

    Parameters
    ----------
    levels : whether noise and gust levels count; an autoregression is made at fixed levels.
    """
    r, t = whitener.apply(tangent_.r), whitener.apply(tangent_.t)
    samples = r.shape[0]
    flat = t.reshape(t.shape[0], -1)
    gradient = flat @ r.ravel()
    information = flat @ flat.T
    if levels:
        moment = tangent_.r.T @ tangent_.r
        gradient = gradient + 0.5 * (
            samples * np.trace(tangent_.w, axis1=1, axis2=2) - np.einsum("pij,ij->p", tangent_.w, moment)
        )
        information = information + 0.5 * samples * np.einsum("pij,qij->pq", tangent_.w, tangent_.w)
    cost = 0.5 * samples * tangent_.logdet + 0.5 * float(r.ravel() @ r.ravel())
    return cost, gradient, information


def fit(
    problem: Problem,
    hypothesis: Hypothesis,
    begin: Point,
    whitener: Whitener = NO_WHITENER,
    iterations: int = ITERATIONS,
    free_levels: bool = True,
    rival: float = np.inf,
) -> Fit | None:
    """The largest posterior from a start; None where not even the start can be evaluated.

    Parameters
    ----------
    rival : cost of a better hypothesis: the search ends early once it is plainly out of reach.
    whitener : an autoregression that is held; with one, levels should not be free.
    free_levels : whether noise and gust levels and the share of slow noise are fitted.
    """
    point, damping = begin, 1e-3
    current = _evaluate(problem, hypothesis, point, whitener, free_levels)
    if current is None:
        return None
    converged, fresh = False, True
    for _ in range(iterations):
        cost, pieces, tangents = current
        step, gain = _step(problem, hypothesis, point, pieces, damping, free_levels)
        if gain < _ENOUGH and fresh:
            converged = _decrement(problem, hypothesis, point, pieces, free_levels) < _STUCK
            break
        trial = _moved(hypothesis, point, step)
        tried = _evaluate(problem, hypothesis, trial, whitener, free_levels, tangents)
        for _ in range(_CHORDS):
            # valleys are curved: from a poor trial one more step with the same derivatives leads back into it
            if tried is None or cost - tried[0] > 0.5 * gain:
                break
            onwards, _ = _step(problem, hypothesis, trial, tried[1], damping, free_levels)
            further = _moved(hypothesis, trial, onwards)
            again = _evaluate(problem, hypothesis, further, whitener, free_levels, tangents)
            if again is None or again[0] >= tried[0]:
                break
            trial, tried = further, again
        better = -np.inf if tried is None else cost - tried[0]
        if tried is not None and better > -1e-9:
            point, current = trial, tried
            ratio = better / max(gain, 1e-12)  # what was gained over what was promised
            damping = max(damping * (0.1 if ratio > 0.75 else 1.0 if ratio > 0.25 else 5.0), _LEAST_DAMPING)
            behind = tried[0] - rival
            if behind > 20.0 and 4.0 * better < behind:
                converged = True
                break
            if better < 0.01 and fresh:
                converged = _decrement(problem, hypothesis, point, tried[1], free_levels) < _NEARLY
                if converged:
                    break
            fresh = False
        elif fresh and _decrement(problem, hypothesis, point, pieces, free_levels) < _NEARLY:
            converged = True
            break
        else:
            damping = max(damping * 10.0, 1e-3)
        if not fresh and better < _STALE:
            # derivatives of an earlier point have done what they can
            anew = _evaluate(problem, hypothesis, point, whitener, free_levels)
            if anew is None:
                break
            current, fresh = anew, True
        if damping > 1e7:
            converged = fresh  # not even the smallest step helps
            break
    if not fresh:
        current = _evaluate(problem, hypothesis, point, whitener, free_levels) or current
    cost, pieces, tangents = current
    covariance = _covariance(problem, hypothesis, pieces, free_levels)
    likelihood = np.array([p[0] for p in pieces])
    shortfall = 0.0 if converged else _decrement(problem, hypothesis, point, pieces, free_levels)
    return Fit(hypothesis, point, cost, likelihood, tangents, whitener, covariance, converged, shortfall)


def begin(problem: Problem, hypothesis: Hypothesis, sizes: Array | None = None, iterations: int = 4) -> Point:
    """Where a search begins without anything known: motions fitted with the levels held in rough air.

    Parameters
    ----------
    sizes : where those of the effects begin; None for none.
    """
    local = np.stack([start(record, problem.settings) for record in problem.records])
    local[:, GUST_LEVEL] = np.log(_ROUGH_M_S)
    first = np.zeros(len(hypothesis.parameters)) if sizes is None else sizes
    point = Point(np.zeros(S), local, first)
    found = fit(problem, hypothesis, point, iterations=iterations, free_levels=False)
    return point if found is None else found.point


def autoregression(tangents: Sequence[Tangent]) -> Whitener:
    """Vector autoregression of the innovations of all records, its order by Schwarz's criterion."""
    total = sum(t.r.shape[0] - _ORDERS for t in tangents)
    best: tuple[float, Whitener] | None = None
    for order in range(_ORDERS + 1):
        left, right = [], []
        for t in tangents:
            n = t.r.shape[0]
            right.append(t.r[_ORDERS:])
            left.append(
                np.concatenate([t.r[_ORDERS - j : n - j] for j in range(1, order + 1)], axis=1)
                if order
                else np.zeros((n - _ORDERS, 0))
            )
        x, y = np.concatenate(left), np.concatenate(right)
        b = np.linalg.solve(x.T @ x, x.T @ y) if order else np.zeros((0, 3))
        residual = y - x @ b
        sigma = residual.T @ residual / total
        criterion = total * float(np.linalg.slogdet(sigma)[1]) + np.log(total) * 9.0 * order
        if best is None or criterion < best[0]:
            coefficients = b.T.reshape(3, order, 3).transpose(1, 0, 2) if order else np.zeros((0, 3, 3))
            root = np.linalg.inv(np.linalg.cholesky(sigma)) if order else np.eye(3)
            best = (criterion, Whitener(np.ascontiguousarray(coefficients), root))
    assert best is not None
    return best[1]


def _evaluate(  # type: ignore[no-untyped-def]
    problem: Problem,
    hypothesis: Hypothesis,
    point: Point,
    whitener: Whitener,
    levels: bool,
    old: Sequence[Tangent] | None = None,
):
    def one(index: object) -> tuple[Tangent, tuple[float, Array, Array]] | None:
        i = int(index)  # type: ignore[call-overload]
        found = tangent(problem, i, hypothesis, point, old=None if old is None else old[i])
        return None if found is None else (found, parts(found, whitener, levels))

    done = problem.each(one, range(len(problem.records)))
    if any(d is None for d in done):
        return None
    pieces = [d[1] for d in done]
    cost = sum(p[0] for p in pieces) + _prior_cost(problem, hypothesis, point)
    if not np.isfinite(cost):
        return None
    return cost, pieces, tuple(d[0] for d in done)


def _prior_cost(problem: Problem, hypothesis: Hypothesis, point: Point) -> float:
    total = 0.5 * float(point.shared @ problem.shared_precision(hypothesis) @ point.shared)
    for (middle, precision), local in zip(problem.own_priors(hypothesis), point.local, strict=True):
        off = local - middle
        total += 0.5 * float(off @ precision @ off)
    return total


def reduced(  # type: ignore[no-untyped-def]
    problem: Problem,
    hypothesis: Hypothesis,
    point: Point,
    k: int,
    pieces,
    levels: bool,
    damping: float = 0.0,
    held: Sequence[int] = (),
):
    """Gradient and information of shared parameters and sizes with the local ones eliminated.

    Parameters
    ----------
    held : places among shared parameters and sizes that do not move.

    Returns
    -------
    gradient (17 + k,), information, and of each record what back-substitution needs; priors included.
    """
    m = S + k
    gradient, information = np.zeros(m), np.zeros((m, m))
    information[:S, :S] = problem.shared_precision(hypothesis)
    gradient[:S] = information[:S, :S] @ point.shared
    back = []
    priors = problem.own_priors(hypothesis)
    for (middle, precision), local, (_, g, h) in zip(priors, point.local, pieces, strict=True):
        h_ll = h[m:, m:] + precision
        g_l = g[m:] + precision @ (local - middle)
        h_sl = h[:m, m:].copy()
        if not levels:
            h_ll[GUST_LEVEL], h_ll[:, GUST_LEVEL], h_ll[GUST_LEVEL, GUST_LEVEL] = 0.0, 0.0, 1.0
            g_l[GUST_LEVEL] = 0.0
            h_sl[:, GUST_LEVEL] = 0.0
        else:
            # of a level that the record puts at none, the observed information: J'' = 4 s^2 J_ss + 2 J' in log s
            h_ll[GUST_LEVEL, GUST_LEVEL] += 2.0 * max(g[m + GUST_LEVEL], 0.0)
        h_ll[np.diag_indices(L)] *= 1.0 + damping
        solved = np.linalg.solve(h_ll, np.column_stack([g_l, h_sl.T]))
        gradient += g[:m] - h_sl @ solved[:, 0]
        information += h[:m, :m] - h_sl @ solved[:, 1:]
        back.append((h_ll, solved))
    for i in (*(() if levels else NOISE), *held):
        information[i], information[:, i] = 0.0, 0.0
        information[i, i] = 1.0
        gradient[i] = 0.0
    return gradient, information, back


def _step(problem: Problem, hypothesis: Hypothesis, point: Point, pieces, damping: float, levels: bool):  # type: ignore[no-untyped-def]
    k = len(point.sizes)
    held = hypothesis.held
    while True:
        gradient, information, back = reduced(problem, hypothesis, point, k, pieces, levels, damping, held)
        scale = np.sqrt(np.maximum(np.diag(information), 1e-30))
        normal = information / np.outer(scale, scale) + damping * np.eye(len(scale))
        shared = -np.linalg.solve(normal, gradient / scale) / scale
        stopped = tuple(i for i in at_bounds(point) if i not in held and _outward(point, i, shared[i]))
        if not stopped:
            break
        held += stopped
    local = np.stack([-(solved[:, 0] + solved[:, 1:] @ shared) for _, solved in back])
    local[:, GUST_LEVEL] = np.clip(local[:, GUST_LEVEL], -1.0, 1.0)
    gain = float(-gradient @ shared) + sum(float(solved[:, 0] @ h_ll @ solved[:, 0]) for h_ll, solved in back)
    return Point(shared[:S], local, shared[S:]), 0.5 * gain


def at_bounds(point: Point) -> tuple[int, ...]:
    """Places of shared parameters that stand at an end of their range."""
    return tuple(i for i, ends in BOUNDS.items() if point.shared[i] in ends)


def _outward(point: Point, place: int, step: float) -> bool:
    low, high = BOUNDS[place]
    return (point.shared[place] == low and step < 0.0) or (point.shared[place] == high and step > 0.0)


def _decrement(problem: Problem, hypothesis: Hypothesis, point: Point, pieces, levels: bool) -> float:  # type: ignore[no-untyped-def]
    """What a step (nearly) without damping promises."""
    return float(_step(problem, hypothesis, point, pieces, _LEAST_DAMPING, levels)[1])


def _moved(hypothesis: Hypothesis, point: Point, step: Point) -> Point:
    """The step taken, sizes held to their plausible ranges."""
    sizes = point.sizes + step.sizes
    for i, (effect, j) in enumerate(hypothesis.parameters):
        low, high = hypothesis.effects[effect].parameters[j].ends
        room = 0.25 * (high - low)
        sizes[i] = min(max(sizes[i], max(low, point.sizes[i] - room)), min(high, point.sizes[i] + room))
    shared = point.shared + np.concatenate([step.shared[:6], np.clip(step.shared[6:], -1.0, 1.0)])
    for i, (low, high) in BOUNDS.items():
        shared[i] = min(max(shared[i], low), high)
    return Point(shared, point.local + step.local, sizes)


def _covariance(problem: Problem, hypothesis: Hypothesis, pieces, levels: bool) -> Array:  # type: ignore[no-untyped-def]
    k = len(hypothesis.parameters)
    empty = Point(
        np.zeros(S), np.stack([middle for middle, _ in problem.own_priors(hypothesis)]), np.zeros(k)
    )
    _, information, _ = reduced(problem, hypothesis, empty, k, pieces, levels, held=hypothesis.held)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-30))
    normal = information / np.outer(scale, scale) + 1e-12 * np.eye(len(scale))
    return np.asarray(np.linalg.inv(normal) / np.outer(scale, scale))


__all__ = [
    "NO_WHITENER",
    "External",
    "Fit",
    "Hypothesis",
    "Point",
    "Problem",
    "Tangent",
    "Whitener",
    "at_bounds",
    "autoregression",
    "begin",
    "fit",
    "loosened",
    "parts",
    "reduced",
    "tangent",
]
