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
from airtruth.tracing.inference.direction import eliminated
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.evidence import SINGULAR
from airtruth.tracing.selection.expansion import expanded
from airtruth.tracing.selection.explanation import REFERENCE

Array = NDArray[np.float64]

_BEYOND: Final = 0.5
"""Share of its plausible range by which the quadratic may put a size beyond an end [-] (judgement: it extrapolates)."""


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
    q = expanded(problem, last, effects)
    slope, information = eliminated(q.marginal.gradient, q.marginal.information, [int(i) for i in q.columns])
    slope = slope - information @ q.at  # where every size is zero
    found = []
    for number in range(1, min(most, len(q.effects)) + 1):
        for chosen, sizes, gain in _of_number(slope, information, q.effects, number):
            parameters = sum(len(q.effects[i].parameters) for i in chosen)
            found.append((gain + parameters + REFERENCE * number, chosen, sizes))
    for cost, chosen, sizes in sorted(found, key=lambda f: f[:2]):
        yield Subset(tuple(q.effects[i] for i in chosen), q.point(chosen, sizes), cost)


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
    sound = np.linalg.det(correlation) > SINGULAR
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
