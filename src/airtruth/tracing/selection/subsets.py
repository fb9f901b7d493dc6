"""Sets of effects that explain most in the quadratic approximation of the log-posterior about a fit.

Two effects can imitate two others, and each exchange of one of them alone explains less: no search that changes one member at
a time leaves such a set. About a fit the negative log-posterior is nearly quadratic in the sizes of all effects, of those that
it has and of those that it lacks. The quadratic gives the cost of every set of a few effects by the solution of a small
system, without a refit.

Source: J. F. Lawless and K. Singhal, Biometrics 34 (1978) 318-327 (screening of all subsets by the information at one fit).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.numerics.normal_equations import scaled_step
from airtruth.tracing.inference.direction import eliminated, extended_by
from airtruth.tracing.inference.posterior import (
    Marginal,
    PosteriorFit,
    TraceProblem,
    likelihood_terms,
    marginal_information,
)
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.explanation import REFERENCE
from airtruth.tracing.selection.score_test import directions, perceptible_step

Array = NDArray[np.float64]

_BEYOND: Final = 0.5
"""Share of its plausible range by which the quadratic may put a size beyond an end [-] (judgement: it extrapolates)."""
_SINGULAR: Final = 1e-6
"""Least share of an information that remains beside the others of a set [-] (judgement: less is no other effect)."""
_MOST_LOG_STEP: Final = 1.0
"""Largest step of the logarithm of a noise or gust level [-] (judgement: a factor of e, as in a step of a refit)."""


@dataclass(frozen=True)
class Subset:
    """A set of effects, as the quadratic predicts it.

    Attributes
    ----------
    effects, start : its effects, and the parameters where the quadratic is least with them.
    cost : negative log-posterior against that without any effect, with one for each parameter and `REFERENCE` for each effect.
    """

    effects: tuple[Effect, ...]
    start: Parameters
    cost: float


@dataclass(frozen=True)
class _Quadratic:
    """The quadratic about a fit.

    Attributes
    ----------
    last : the fit; marginal : gradient and information of common parameters, sizes, and one direction for each further effect.
    effects, columns, at : (effects,) those of the fit and the further ones, where their first size is, and its value there.
    locations : of each effect, its parameters after the size.
    """

    last: PosteriorFit
    marginal: Marginal
    effects: tuple[Effect, ...]
    columns: NDArray[np.int64]
    at: Array
    locations: tuple[Array, ...]

    def subset(self, chosen: Sequence[int], sizes: Array, cost: float) -> Subset:
        """The set of the effects with these indices."""
        x = np.zeros(len(self.at))
        x[list(chosen)] = sizes
        step = np.zeros(len(self.marginal.gradient))
        step[self.columns] = x - self.at
        rest = np.setdiff1d(np.arange(len(step)), self.columns)
        h = self.marginal.information
        push = self.marginal.gradient[rest] + h[np.ix_(rest, self.columns)] @ step[self.columns]
        step[rest] = scaled_step(push, h[np.ix_(rest, rest)], 0.0)
        point, entries = self.last.point, self.last.point.of
        common = point.common + _limited(step[: entries.common.size], entries.common.nuisance)
        own = np.stack([-(e.solved[:, 0] + e.solved[:, 1:] @ step) for e in self.marginal.eliminated])
        per_record = point.per_record + [_limited(o, entries.per_record.log_gust) for o in own]
        every = [np.array([x[i], *self.locations[i]]) for i in chosen]
        for i, own_sizes in zip(chosen, every, strict=True):
            own_sizes[0] = np.clip(own_sizes[0], *self.effects[i].parameters[0].reach)
        effects = tuple(self.effects[i] for i in chosen)
        start = Parameters(common, per_record, np.concatenate(every), entries)
        return Subset(effects, start, cost)


def subsets(
    problem: TraceProblem, last: PosteriorFit, effects: Sequence[Effect], most: int
) -> Iterator[Subset]:
    """Every plausible set of up to ``most`` effects, the one of the least cost first.

    Parameters
    ----------
    last : the fit about which the posterior is approximated; effects : those that it may lack.

    Notes
    -----
    An effect with a location has the location at which it scores highest. No set has an effect in two variants, but delays of
    several channels.
    """
    q = _quadratic(problem, last, effects)
    slope, information = eliminated(q.marginal.gradient, q.marginal.information, [int(i) for i in q.columns])
    slope = slope - information @ q.at  # where every size is zero
    found = []
    for number in range(1, min(most, len(q.effects)) + 1):
        for chosen, sizes, gain in _of_number(slope, information, q.effects, number):
            parameters = sum(len(q.effects[i].parameters) for i in chosen)
            found.append((gain + parameters + REFERENCE * number, chosen, sizes))
    for cost, chosen, sizes in sorted(found, key=lambda f: f[:2]):
        yield q.subset(chosen, sizes, cost)


def _quadratic(problem: TraceProblem, last: PosteriorFit, effects: Sequence[Effect]) -> _Quadratic:
    """The quadratic about a fit, with each further effect at the location where it scores highest."""
    members = last.hypothesis.effects
    taken = {e.key for e in members}
    by_effect = [directions(e, last, problem) for e in effects if e.key not in taken]
    tried = [perceptible_step(d, last, problem) for own in by_effect for d in own]
    terms = [likelihood_terms(s, NO_WHITENER, levels=True) for s in extended_by(last, problem, tried)]
    marginal = marginal_information(
        problem.priors(last.hypothesis), last.point, terms, levels=True, fixed=last.point.at_bounds
    )
    own_columns = [last.layout.size(last.hypothesis.span(e.key).start) for e in members]
    first = len(marginal.gradient) - len(tried)
    g, h = eliminated(marginal.gradient, marginal.information, range(first, len(marginal.gradient)))
    raw = np.diag(h)
    score = np.where(raw > 0.0, g**2 / np.where(raw > 0.0, raw, 1.0), -np.inf)
    best: list[int] = []
    at = 0
    for own in by_effect:
        leading = at + int(np.argmax(score[at : at + len(own)]))
        at += len(own)
        if np.isfinite(score[leading]):
            best.append(leading)
    kept = [*range(first), *(first + i for i in best)]
    sizes = [last.point.sizes[last.hypothesis.span(e.key)] for e in members]
    return _Quadratic(
        last,
        Marginal(
            marginal.gradient[kept],
            marginal.information[np.ix_(kept, kept)],
            tuple(e._replace(solved=e.solved[:, [0, *(1 + k for k in kept)]]) for e in marginal.eliminated),
        ),
        (*members, *(tried[i].effect for i in best)),
        np.array([*own_columns, *range(first, first + len(best))], dtype=np.int64),
        np.array([*(float(s[0]) for s in sizes), *(0.0 for _ in best)]),
        (*(s[1:] for s in sizes), *(np.array(tried[i].locations) for i in best)),
    )


def _limited(step: Array, levels: int | slice) -> Array:
    """A step with that of the logarithms of levels limited."""
    limited = step.copy()
    limited[levels] = np.clip(limited[levels], -_MOST_LOG_STEP, _MOST_LOG_STEP)
    return limited


def _of_number(
    slope: Array, information: Array, effects: Sequence[Effect], number: int
) -> Iterator[tuple[tuple[int, ...], Array, float]]:
    """Indices of the effects of each plausible set of a number, their sizes, and their cost against none."""
    apart = np.array([[_may_join(a, b) for b in effects] for a in effects])
    chosen = np.array(list(itertools.combinations(range(len(effects)), number)), dtype=np.int64)
    for i, j in itertools.combinations(range(number), 2):
        chosen = chosen[apart[chosen[:, i], chosen[:, j]]]
    sizes, costs = minima(slope, information, chosen)
    low, high = np.array([_room(e) for e in effects]).T
    plausible = np.isfinite(costs) & ((sizes >= low[chosen]) & (sizes <= high[chosen])).all(axis=1)
    for members, at, cost in zip(chosen[plausible], sizes[plausible], costs[plausible], strict=True):
        yield tuple(int(i) for i in members), at, float(cost)


def minima(slope: Array, information: Array, chosen: NDArray[np.int64]) -> tuple[Array, Array]:
    """Where a quadratic is least if all but a few of its variables are zero, for each choice of these.

    Parameters
    ----------
    slope, information : (variables,) and (variables, variables), the quadratic slope x + x information x / 2.
    chosen : (choices, number) indices of the variables that are not zero.

    Returns
    -------
    (choices, number) variables and (choices,) least values; NaN and infinity where the variables are nearly dependent.
    """
    own = information[chosen[:, :, None], chosen[:, None, :]]
    scale = np.sqrt(np.diagonal(own, axis1=1, axis2=2))
    correlation = own / (scale[:, :, None] * scale[:, None, :])
    sound = np.linalg.det(correlation) > _SINGULAR
    x, least = np.full(chosen.shape, np.nan), np.full(len(chosen), np.inf)
    own_slope = slope[chosen[sound]]
    x[sound] = -np.linalg.solve(own[sound], own_slope[:, :, None])[:, :, 0]
    least[sound] = 0.5 * (own_slope * x[sound]).sum(axis=1)
    return x, least


def _may_join(a: Effect, b: Effect) -> bool:
    """Whether two effects may be in one set: not two variants of one, but delays of two channels."""
    return a.label != b.label or (a.late_signal != b.late_signal and "" not in (a.late_signal, b.late_signal))


def _room(effect: Effect) -> tuple[float, float]:
    """Sizes between which the quadratic may put an effect."""
    low, high = effect.parameters[0].reach
    beyond = _BEYOND * (high - low)
    return low - beyond if low < 0.0 else low, high + beyond


__all__ = ["Subset", "minima", "subsets"]
