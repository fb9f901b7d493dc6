"""Score tests: the evidence for each effect at the optimum of the null, without a refit.

With J the negative log-posterior at the null's optimum, g its slope in the effect's size and I the
information, both with the nuisance parameters eliminated, z = -g/sqrt(I) is standard normal under the null and has
mean size sqrt(I) under the effect; z^2 is then noncentral chi-square(1).

Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50-57.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from airtruth.effects.effect import Effect
from airtruth.numerics.kept import Kept
from airtruth.tracing.anomalies.flown import flown
from airtruth.tracing.inference.direction import Direction, change_along, extended_by, with_freedoms
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.sensitivities import Sensitivities
from airtruth.tracing.inference.whitening import NO_WHITENER, Whitener
from airtruth.tracing.model.response import respond

Array = NDArray[np.float64]

LOCATIONS: Final = 9
"""Number of locations at which an effect with a location is scored [-] (judgement: each costs one simulation of
every record)."""
_QUANTILES: Final = (0.02, 0.98)
"""Quantiles of the measured angle of attack between which locations lie [-] (judgement: a break outside has no samples)."""
_DRAWS: Final = 20_000
"""Number of random draws behind the p-value of an effect with a location [-] (judgement: 5 % has an error of 0.15 %)."""
_RESOLVED: Final = 0.99
"""Quantile of the draws beyond which the p-value is extrapolated [-] (judgement: 200 draws lie beyond)."""
_PERCEPTIBLE: Final = 1.0
"""Sum of squared whitened innovations that a perceptible step changes [-] (judgement: one standard deviation)."""
_GROWTH: Final = 1.5
"""Factor by which an imperceptible step grows [-] (judgement)."""


@dataclass(frozen=True)
class Score:
    """Score of one effect.

    Attributes
    ----------
    effect : the effect.
    z : signed root of the statistic at the best location, positive towards larger sizes [-].
    p_value : of the effect alone, corrected for a one-sided size and for the search over locations [-].
    size : estimate of the size by one scoring step; direction : the location of this step.
    information : information on the size, nuisance parameters eliminated.
    index : index of the direction in the table's matrix.
    """

    effect: Effect
    z: float
    p_value: float
    size: float
    direction: Direction
    information: float
    index: int

    @classmethod
    def none(cls, effect: Effect) -> Score:
        """The score of an effect that cannot be tested at a null."""
        return cls(effect, 0.0, 1.0, 0.0, Direction(effect, (), effect.parameters[0].step), 0.0, -1)


@dataclass(frozen=True)
class ScoreTable:
    """Scores of all effects.

    Attributes
    ----------
    scores : one per effect that could be tested.
    information : (directions, directions) of unit sizes, nuisance parameters eliminated.
    white : |z| of each score with the innovations taken as white, and with the effect's change of their covariance:
        an autoregression absorbs part of a large effect, and a lag in gusts shows in the scatter.
    white_sizes : estimate of each size by one scoring step then, at the score's location.
    """

    scores: tuple[Score, ...]
    information: Array
    white: tuple[float, ...]
    white_sizes: tuple[float, ...]


def directions(effect: Effect, null: PosteriorFit, problem: TraceProblem) -> list[Direction]:
    """The effect at the locations to try: a grid over the angles that the records reach; one where it has no location."""
    first, *others = effect.parameters
    if not others:
        return [Direction(effect, (), first.step)]
    location = others[0]
    rest = tuple(p.size(float(np.sqrt(p.low * p.high))) for p in others[1:])
    low, high = location.low, location.high
    if location.unit == "rad":
        angle = np.concatenate([flown(r, problem.layout.motion.flow) for r in problem.records])
        first_seen, last_seen = np.quantile(angle, _QUANTILES)
        if max(first_seen, low) < min(last_seen, high):
            low, high = max(first_seen, low), min(last_seen, high)
        grid = np.linspace(low, high, LOCATIONS)
    else:
        grid = np.geomspace(low, high, LOCATIONS)
    return [Direction(effect, (float(x), *rest), first.step) for x in grid]


class Beside(NamedTuple):
    """Directions of the effects that a fit lacks.

    Attributes
    ----------
    effects : the effects; by_effect : directions of each.
    tried : all directions, each with a step that changes the innovations.
    sensitivities : those of each record, with the directions as further common parameters.
    """

    effects: tuple[Effect, ...]
    by_effect: tuple[list[Direction], ...]
    tried: tuple[Direction, ...]
    sensitivities: tuple[Sensitivities, ...]


_BESIDE: Final = Kept[Beside](most=1)
"""The newest fit -> its directions, which the score test and the quadratic about the fit share."""


def beside(null: PosteriorFit, problem: TraceProblem, effects: Sequence[Effect]) -> Beside:
    """Directions of effects that a fit lacks, and the sensitivities along them."""
    known = _BESIDE.of(null)
    if known is not None and known.effects == tuple(effects):
        return known
    by_effect = tuple(directions(effect, null, problem) for effect in effects)
    tried = tuple(perceptible_step(d, null, problem) for own in by_effect for d in own)
    extended = tuple(extended_by(null, problem, tried)) if tried else null.sensitivities
    return _BESIDE.keep(null, Beside(tuple(effects), by_effect, tried, extended))


def table(
    null: PosteriorFit, problem: TraceProblem, effects: Sequence[Effect], whitener: Whitener, seed: int
) -> ScoreTable:
    """Scores of the effects at the optimum of a null hypothesis.

    Parameters
    ----------
    null : a fit; its sensitivities are reused.
    whitener : autoregression of its innovations.
    seed : seed of the draws behind the p-values of effects with a location.
    """
    _, by_effect, tried, extended = beside(null, problem, effects)
    gradient, information = with_freedoms(null, problem, extended, whitener, tried)
    white_gradient, white_information = with_freedoms(
        null, problem, extended, NO_WHITENER, tried, levels=True
    )
    rng = np.random.default_rng([seed, len(tried), 7])
    scores, white, white_sizes = [], [], []
    first = 0
    for own in by_effect:
        span = np.arange(first, first + len(own))
        first += len(own)
        score = _score([tried[i] for i in span], span, gradient, information, rng)
        if score is None:
            continue
        scores.append(score)
        raw = np.diag(white_information)[span]
        z = np.abs(white_gradient[span]) / np.sqrt(np.where(raw > 0.0, raw, np.inf))
        white.append(float(np.max(z)))
        here, sure = score.index, white_information[score.index, score.index]
        white_sizes.append(float(-white_gradient[here] / sure) if sure > 0.0 else score.size)
    return ScoreTable(tuple(scores), information, tuple(white), tuple(white_sizes))


def _score(
    own: Sequence[Direction],
    span: NDArray[np.int64],
    gradient: Array,
    information: Array,
    rng: np.random.Generator,
) -> Score | None:
    """Score of one effect from its directions; None where the records do not show it.

    Parameters
    ----------
    own, span : directions of the effect, and their indices in ``gradient`` and ``information``.
    """
    effect = own[0].effect
    variance = np.diag(information)[span]
    sound = variance > 0.0
    if not sound.any():
        return None
    z = np.where(sound, -gradient[span] / np.sqrt(np.where(sound, variance, 1.0)), 0.0)
    one_sided = effect.parameters[0].one_sided
    best = int(np.argmax(z if one_sided else np.abs(z)))
    return Score(
        effect=effect,
        z=float(z[best]),
        p_value=_p_value(z, best, one_sided, information[np.ix_(span, span)], rng),
        size=float(z[best] / np.sqrt(variance[best])),
        direction=own[best],
        information=float(variance[best]),
        index=int(span[best]),
    )


def perceptible_step(direction: Direction, null: PosteriorFit, problem: TraceProblem) -> Direction:
    """The direction with a step that changes the innovations: a limit has no effect until it is low enough."""
    first = direction.effect.parameters[0]
    largest = max(abs(first.size(first.low)), abs(first.size(first.high)))
    if not first.is_limit:
        return direction
    step = direction.step

    def moves(size: float) -> float:
        change = change_along(null, replace(direction, step=size))
        total = 0.0
        for record, local, tangent in zip(
            problem.records, null.point.per_record, null.sensitivities, strict=True
        ):
            moved = respond(record, problem.settings, change, null.point.common, local)
            total += float((((moved.e @ tangent.white.T) - tangent.r) ** 2).sum())
        return total

    while abs(step) < largest and moves(step) < _PERCEPTIBLE:
        step *= _GROWTH
    return replace(direction, step=min(step, largest))


def holm(p_values: Sequence[float]) -> Array:
    """Adjusted p-values (S. Holm, Scand. J. Statist. 6 (1979) 65-70).

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03]).tolist()
    [0.03, 0.06, 0.06]
    """
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
    single = float(ndtr(-top) if one_sided else 2.0 * ndtr(-top))
    if z.size == 1:
        return single
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    correlation = information / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = rng.standard_normal((_DRAWS, z.size)) @ root.T
    largest = draws.max(axis=1) if one_sided else np.abs(draws).max(axis=1)
    # beyond the resolution of the draws: the effective number of independent locations, from a level within it
    level = float(np.quantile(largest, _RESOLVED))
    count = (1.0 - _RESOLVED) / float(ndtr(-level) if one_sided else 2.0 * ndtr(-level))
    if top > level:
        return min(1.0, max(1.0, count) * single)
    return float((np.count_nonzero(largest >= top) + 1) / (_DRAWS + 1))


__all__ = ["Beside", "Score", "ScoreTable", "beside", "directions", "holm", "perceptible_step", "table"]
