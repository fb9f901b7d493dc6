"""Scores: how much each effect would explain, every nuisance refitted, without refitting anything.

With J the negative log-posterior at the null's optimum, g its slope in the effect's size and I the
information, both with the nuisance eliminated, z = -g/sqrt(I) is standard normal under the null and has mean
size sqrt(I) under the effect (C. R. Rao's score test; noncentral chi-square(1) in z^2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from airtruth.effects.change import Change
from airtruth.effects.effect import Effect
from airtruth.trace.fit import NO_WHITENER, Fit, Problem, Tangent, Whitener, at_bounds, parts, reduced
from airtruth.trace.lower import lower
from airtruth.trace.model import S, respond

Array = NDArray[np.float64]

PLACES: Final = 9
_DRAWS: Final = 20_000


@dataclass(frozen=True)
class Direction:
    """One way to leave the null: an effect at one place."""

    effect: Effect
    places: tuple[float, ...]
    step: float

    def sizes(self, size: float) -> Array:
        """Vector of the effect's parameters in their size coordinates."""
        return np.array([size, *self.places])


@dataclass(frozen=True)
class Score:
    """Score of one effect.

    Attributes
    ----------
    effect : which.
    z : signed root of the statistic, positive towards larger sizes, at the best place.
    p_value : of the effect alone; one-sided sizes and the search for a place are allowed for.
    size : what one step of scoring estimates; direction : the place it was made at.
    information : of the size, nuisance eliminated.
    index : of the direction in the table's matrix.
    """

    effect: Effect
    z: float
    p_value: float
    size: float
    direction: Direction
    information: float
    index: int


@dataclass(frozen=True)
class Table:
    """Scores of all effects.

    Attributes
    ----------
    scores : one per effect that could be tested.
    information : (directions, directions) of unit sizes, nuisance eliminated: cosines and separations.
    white : |z| of each score were the innovations white, with what the effect does to their covariance: an
        autoregression takes up part of a large effect, and a lag in gusts is seen in the scatter.
    white_sizes : what one step of scoring then estimates of each effect's size, at the score's place.
    """

    scores: tuple[Score, ...]
    information: Array
    white: tuple[float, ...]
    white_sizes: tuple[float, ...]


def directions(effect: Effect, null: Fit, problem: Problem) -> list[Direction]:
    """The effect at the places to try: one if it has none, else a grid over what the records visited."""
    first, *places = effect.parameters
    if not places:
        return [Direction(effect, (), first.step)]
    place = places[0]
    rest = tuple(p.size(float(np.sqrt(p.low * p.high))) for p in places[1:])
    alpha = np.concatenate([r.signals.y[:, 0] - r.plant.alpha_shift_rad for r in problem.records])
    low, high = np.quantile(alpha, [0.02, 0.98]) if place.unit == "rad" else (place.low, place.high)
    low, high = max(low, place.low), min(high, place.high)
    if not low < high:
        low, high = place.low, place.high
    grid = np.linspace(low, high, PLACES) if place.unit == "rad" else np.geomspace(low, high, PLACES)
    return [Direction(effect, (float(x), *rest), first.step) for x in grid]


def table(null: Fit, problem: Problem, effects: Sequence[Effect], whitener: Whitener, seed: int) -> Table:
    """Scores of the effects at the optimum of a null hypothesis.

    Parameters
    ----------
    null : a fit; its tangents are reused.
    whitener : autoregression of its innovations.
    seed : of the draws that give p-values of effects with a place.
    """
    tried = [_audible(d, null, problem) for effect in effects for d in directions(effect, null, problem)]

    def one(index: object) -> Tangent:
        return _with(null, problem, int(index), tried)  # type: ignore[call-overload]

    extended = problem.each(one, range(len(problem.records)))
    k = len(null.point.sizes)
    gradient, information = _with_freedoms(null, problem, extended, whitener, k, tried)
    plain = _with_freedoms(null, problem, extended, NO_WHITENER, k, tried, levels=True)
    rng = np.random.default_rng([seed, len(tried), 7])
    scores, white, white_sizes = [], [], []
    at = 0
    for effect in effects:
        count = len(directions(effect, null, problem))
        span = np.arange(at, at + count)
        at += count
        variance = np.diag(information)[span]
        sound = variance > 0.0
        if not sound.any():
            continue
        z = np.where(sound, -gradient[span] / np.sqrt(np.where(sound, variance, 1.0)), 0.0)
        one_sided = effect.parameters[0].one_sided
        best = int(np.argmax(z if one_sided else np.abs(z)))
        p = _p_value(z, best, one_sided, information[np.ix_(span, span)], rng)
        scores.append(
            Score(
                effect,
                float(z[best]),
                p,
                float(z[best] / np.sqrt(variance[best])),
                tried[span[best]],
                float(variance[best]),
                int(span[best]),
            )
        )
        raw = np.diag(plain[1])[span]
        white.append(float(np.max(np.abs(plain[0][span]) / np.sqrt(np.where(raw > 0.0, raw, np.inf)))))
        here = int(span[best])
        white_sizes.append(float(-plain[0][here] / raw[best]) if raw[best] > 0.0 else scores[-1].size)
    return Table(tuple(scores), information, tuple(white), tuple(white_sizes))


def _audible(direction: Direction, null: Fit, problem: Problem) -> Direction:
    """The direction with a step that can be seen: a limit does nothing until it is low enough."""
    first = direction.effect.parameters[0]
    largest = max(abs(first.size(first.low)), abs(first.size(first.high)))
    if not first.is_limit:
        return direction
    step = direction.step

    def moves(size: float) -> float:
        change = _with_effect(null, replace(direction, step=size))
        total = 0.0
        for record, local, tangent in zip(problem.records, null.point.local, null.tangents, strict=True):
            moved = respond(record, problem.settings, change, null.point.shared, local)
            total += float((((moved.e @ tangent.white.T) - tangent.r) ** 2).sum())
        return total

    while abs(step) < largest and moves(step) < 1.0:
        step *= 1.5
    return replace(direction, step=min(step, largest))


def _with_effect(null: Fit, d: Direction) -> Change:
    sizes = np.concatenate([null.point.sizes, d.sizes(d.step)])
    return null.hypothesis.plus(d.effect).change(sizes)


def holm(p_values: Sequence[float]) -> Array:
    """Adjusted p-values (S. Holm, Scand. J. Statist. 6, 1979)."""
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(p.size)
    largest = 0.0
    for rank, i in enumerate(order):
        largest = max(largest, (p.size - rank) * p[i])
        adjusted[i] = min(1.0, largest)
    return adjusted


def _p_value(z: Array, best: int, one_sided: bool, information: Array, rng: np.random.Generator) -> float:
    top = z[best] if one_sided else abs(z[best])
    single = float(norm.sf(top) if one_sided else 2.0 * norm.sf(top))
    if z.size == 1:
        return single
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    correlation = information / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = rng.standard_normal((_DRAWS, z.size)) @ root.T
    largest = draws.max(axis=1) if one_sided else np.abs(draws).max(axis=1)
    # beyond what draws resolve: the effective number of independent places, from a level they do resolve
    level = float(np.quantile(largest, 0.99))
    count = 0.01 / float(norm.sf(level) if one_sided else 2.0 * norm.sf(level))
    if top > level:
        return min(1.0, max(1.0, count) * single)
    return float((np.count_nonzero(largest >= top) + 1) / (_DRAWS + 1))


def _with(null: Fit, problem: Problem, index: int, tried: Sequence[Direction]) -> Tangent:
    """The null's tangent of one record with the directions as further shared parameters."""
    record, base, k = problem.records[index], null.tangents[index], len(null.point.sizes)
    t = np.zeros((len(tried), *base.r.shape))
    w = np.zeros((len(tried), 3, 3))
    e = respond(
        record,
        problem.settings,
        null.hypothesis.change(null.point.sizes),
        null.point.shared,
        null.point.local[index],
    )
    for i, d in enumerate(tried):
        moved = respond(
            record,
            problem.settings,
            lower(_with_effect(null, d)),
            null.point.shared,
            null.point.local[index],
        )
        if not np.isfinite(moved.logdet):
            continue
        t[i] = (moved.e - e.e) @ base.white.T / d.step
        w[i] = base.white @ ((moved.covariance - e.covariance) / d.step) @ base.white.T
    return inserted(base, k, t, w)


def inserted(base: Tangent, k: int, t: Array, w: Array) -> Tangent:
    """A tangent with further directions after the ``k`` sizes: t (directions, samples, 3), w (directions, 3, 3)."""
    at = S + k
    return Tangent(
        base.r,
        base.logdet,
        np.concatenate([base.t[:at], t, base.t[at:]]),
        np.concatenate([base.w[:at], w, base.w[at:]]),
        base.white,
    )


def _with_freedoms(
    null: Fit,
    problem: Problem,
    tangents: Sequence[Tangent],
    whitener: Whitener,
    k: int,
    tried: Sequence[Direction],
    levels: bool = False,
) -> tuple[Array, Array]:
    """`projected`, each direction beside derivatives as free as its effect sets them."""
    count = len(tried)
    gradient, information = projected(null, problem, tangents, whitener, k, count, levels)
    kept = null.hypothesis.loose
    freedoms = [null.hypothesis.plus(d.effect).loose for d in tried]
    for free in sorted({f for f in freedoms if f != kept}):
        rows = [i for i, f in enumerate(freedoms) if f == free]
        freed = replace(null, hypothesis=replace(null.hypothesis, freed=free))
        g, h = projected(freed, problem, tangents, whitener, k, count, levels)
        gradient[rows] = g[rows]
        information[rows], information[:, rows] = h[rows], h[:, rows]
    return gradient, information


def projected(
    null: Fit,
    problem: Problem,
    tangents: Sequence[Tangent],
    whitener: Whitener,
    k: int,
    count: int,
    levels: bool = False,
) -> tuple[Array, Array]:
    """Gradient and information of the further directions, all nuisance eliminated, priors included."""
    pieces = [parts(t, whitener, levels) for t in tangents]
    gradient, information, _ = reduced(
        problem, null.hypothesis, null.point, k + count, pieces, levels, held=at_bounds(null.point)
    )
    return eliminated(gradient, information, range(S + k, len(gradient)))


def eliminated(gradient: Array, information: Array, kept: Sequence[int]) -> tuple[Array, Array]:
    """Gradient and information of the parameters at the places ``kept``, those at all others eliminated."""
    own = np.asarray(kept, dtype=np.int64)
    rest = np.setdiff1d(np.arange(len(gradient)), own)
    nuisance = information[np.ix_(rest, rest)]
    scale = np.sqrt(np.maximum(np.diag(nuisance), 1e-30))
    normal = nuisance / np.outer(scale, scale) + 1e-12 * np.eye(rest.size)
    across = information[np.ix_(own, rest)] / scale
    solved = np.linalg.solve(normal, np.column_stack([gradient[rest] / scale, across.T]))
    g = gradient[own] - across @ solved[:, 0]
    h = information[np.ix_(own, own)] - across @ solved[:, 1:]
    # what is left after a projection of nearly everything is rounding, not information
    small = np.diag(h) < 1e-8 * np.diag(information)[own]
    g[small], h[small], h[:, small] = 0.0, 0.0, 0.0
    return g, h


__all__ = [
    "Direction",
    "Score",
    "Table",
    "directions",
    "eliminated",
    "holm",
    "inserted",
    "projected",
    "table",
]
