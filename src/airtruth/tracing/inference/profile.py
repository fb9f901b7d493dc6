"""Profile likelihood along the location of an effect: few samples show a break, and several optima are common.

A rate limit has several optima too, where the surface is at its limit for most of a record; its size takes the place of a
location.

Source: W. Q. Meeker and L. A. Escobar, The American Statistician 49 (1995) 48-53 (profile likelihood intervals).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.parameters import Parameters

Array = NDArray[np.float64]

_OFFSETS: Final = (1.0, 2.0, 3.5, 5.0, 7.0)
"""Offsets of the locations tried on either side, in standard errors [-]; judgement."""
_WIDE: Final = 3.5
"""Offset from which a profile may end once it has fallen far enough, in standard errors [-]; judgement."""
_ITERATIONS: Final = 12
"""Most iterations at one location [-]; judgement: the fit next to it is the start."""
_LEAST: Final = 0.01
"""Smallest standard error for the grid over the plausible range [-]; judgement."""
_LEAST_LIMIT: Final = 0.01
"""Smallest standard error for the grid about a rate limit, relative to its size [-] (measured: optima of a record in calm air
lie 1.7 to 2.1 % apart)."""
_MOST: Final = 0.12
"""Largest standard error for the grid over the plausible range [-]; judgement."""
_BETTER: Final = 0.1
"""Gain in log-likelihood for which another optimum replaces the fit [-]; judgement: 0.4 standard errors."""
_RESTARTS: Final = 2
"""Most such replacements [-]; judgement."""
_CHI2_95: Final = 3.841
"""95 % quantile of chi-square with one degree of freedom [-]."""


@dataclass(frozen=True)
class Profile:
    """The best fits with the location held.

    Attributes
    ----------
    locations : (n,) in rising order, in their size coordinate.
    rise : (n,) 2 log L below the best.
    size, std : (n,) of the effect's first parameter at each location.
    """

    locations: Array
    rise: Array
    size: Array
    std: Array

    def location_interval(self) -> tuple[float, float]:
        """Outermost locations that lose less than 3.84, linear in between; an end of the grid if none loses more."""
        inside = np.flatnonzero(self.rise <= _CHI2_95)
        low, high = int(inside[0]), int(inside[-1])
        return (
            self._crossing(low, low - 1) if low else float(self.locations[0]),
            self._crossing(high, high + 1) if high + 1 < len(self.locations) else float(self.locations[-1]),
        )

    def size_interval(self) -> tuple[float, float]:
        """Interval of the size over the locations inside: each contributes the rest of its 3.84."""
        inside = self.rise <= _CHI2_95
        room = self.std[inside] * np.sqrt(_CHI2_95 - self.rise[inside])
        return float((self.size[inside] - room).min()), float((self.size[inside] + room).max())

    def _crossing(self, inside: int, outside: int) -> float:
        share = (_CHI2_95 - self.rise[inside]) / (self.rise[outside] - self.rise[inside])
        return float(self.locations[inside] + share * (self.locations[outside] - self.locations[inside]))


def location_index(effect: Effect) -> int | None:
    """Index of the effect's location, or limit, among its parameters; None if it has none."""
    return next((j for j, p in enumerate(effect.parameters) if p.is_location or p.is_limit), None)


def best_location(
    problem: TraceProblem, fitted: PosteriorFit, only_better: bool = False
) -> tuple[PosteriorFit, Profile]:
    """The best optimum of the last effect of a fit along its location, and the profile about it.

    Parameters
    ----------
    fitted : a fit whose last effect has a location.
    only_better : whether the profile itself is of no use, so that no fit is completed that will not lead.
    """
    for _ in range(_RESTARTS):
        tried = _along(problem, fitted, only_better)
        lowest = min(tried, key=lambda f: f.cost)
        if lowest.cost > fitted.cost - _BETTER:
            break
        again = fit(problem, fitted.hypothesis, lowest.point, near=lowest)
        if again is None or again.cost >= fitted.cost:
            break
        fitted = again
    location, first = _size_numbers(fitted)
    fits = sorted([*tried, fitted], key=lambda f: float(f.point.sizes[location]))
    costs = np.array([f.cost for f in fits])
    return fitted, Profile(
        np.array([f.point.sizes[location] for f in fits]),
        2.0 * (costs - costs.min()),
        np.array([f.point.sizes[first] for f in fits]),
        np.array([f.size_std(first) for f in fits]),
    )


def relocated(problem: TraceProblem, fitted: PosteriorFit, placed: str = "") -> PosteriorFit:
    """The fit with every effect that has a location at its best one beside the others.

    The location of an effect is that of the round which accepted it. A cause that was missing then may have moved it to an
    optimum that a refit beside this cause does not leave.

    Parameters
    ----------
    fitted : a fit of any effects; placed : key of an effect that is at its best location already.
    """
    for effect in fitted.hypothesis.effects:
        if location_index(effect) is None or effect.key == placed:
            continue
        moved = _with_last(problem, fitted, effect.key)
        best = None if moved is None else best_location(problem, moved, only_better=True)[0]
        if best is None or best.cost > fitted.cost - _BETTER:
            continue
        sizes = np.concatenate(
            [best.point.sizes[best.hypothesis.span(e.key)] for e in fitted.hypothesis.effects]
        )
        fitted = fit(problem, fitted.hypothesis, replace(best.point, sizes=sizes), near=best) or fitted
    return fitted


def _with_last(problem: TraceProblem, fitted: PosteriorFit, key: str) -> PosteriorFit | None:
    """The same fit, with another effect as the last."""
    effects = fitted.hypothesis.effects
    order = (*(e for e in effects if e.key != key), *(e for e in effects if e.key == key))
    sizes = np.concatenate([fitted.point.sizes[fitted.hypothesis.span(e.key)] for e in order])
    return fit(
        problem,
        replace(fitted.hypothesis, effects=order),
        replace(fitted.point, sizes=sizes),
        iterations=0,
        near=fitted,
    )


def _size_numbers(fitted: PosteriorFit) -> tuple[int, int]:
    """Indices of the location and of the size of the last effect among the sizes."""
    effect = fitted.hypothesis.effects[-1]
    first = len(fitted.point.sizes) - len(effect.parameters)
    return first + (location_index(effect) or 0), first


def _along(problem: TraceProblem, fitted: PosteriorFit, only_better: bool) -> list[PosteriorFit]:
    """Fits at locations on either side, each from the one before."""
    number, _ = _size_numbers(fitted)
    parameter = fitted.hypothesis.parameter(number)
    low, high = parameter.ends
    least = _LEAST_LIMIT * float(fitted.point.sizes[number]) if parameter.is_limit else _LEAST * (high - low)
    std = min(max(fitted.size_std(number), least), _MOST * (high - low))
    fits = []
    for side in (-1.0, 1.0):
        before = fitted
        for offset in _OFFSETS:
            location = float(fitted.point.sizes[number]) + side * offset * std
            if not low < location < high:
                break
            hypothesis = _with_location(fitted.hypothesis, location)
            start = _at(before.point, number, location)
            rival = fitted.cost - (_BETTER if only_better else 0.0)
            tried = fit(
                problem,
                hypothesis,
                start,
                iterations=_ITERATIONS,
                rival=rival,
                only_better=only_better,
                near=before,
            )
            if tried is None:
                break
            fits.append(tried)
            before = tried
            if tried.cost - fitted.cost > 2.0 * _CHI2_95 and offset >= _WIDE:
                break
    return fits


def _with_location(hypothesis: Hypothesis, location: float) -> Hypothesis:
    """The hypothesis with the range of the last effect's location reduced to a single value."""
    effect = hypothesis.effects[-1]
    j = location_index(effect) or 0
    p = effect.parameters[j]
    pinned = replace(p, low=p.value(location), high=p.value(location))
    parameters = tuple(pinned if i == j else q for i, q in enumerate(effect.parameters))
    return replace(hypothesis, effects=(*hypothesis.effects[:-1], replace(effect, parameters=parameters)))


def _at(point: Parameters, number: int, size: float) -> Parameters:
    sizes = point.sizes.copy()
    sizes[number] = size
    return replace(point, sizes=sizes)


__all__ = ["Profile", "best_location", "location_index", "relocated"]
