"""The likelihood along the place of an effect: where a break sits is seen by few samples, in several optima.

Source: W. Q. Meeker and L. A. Escobar, The American Statistician 49 (1995) 48-53 (profile likelihood
intervals).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.trace.fit import Fit, Hypothesis, Point, Problem, fit
from airtruth.trace.model import S

Array = NDArray[np.float64]

_OFFSETS: Final = (1.0, 2.0, 3.5, 5.0, 7.0)
"""Places tried on either side, in standard errors."""
_ITERATIONS: Final = 12
_LEAST: Final = 0.01
_MOST: Final = 0.12
"""Standard error taken for the grid, between these shares of the plausible range."""
_CHI2_95: Final = 3.841


@dataclass(frozen=True)
class Profile:
    """The best fits with the place held.

    Attributes
    ----------
    places : (n,) in rising order, in their size coordinate.
    rise : (n,) 2 log L below the best.
    size, std : (n,) of the effect's first parameter at each place.
    """

    places: Array
    rise: Array
    size: Array
    std: Array

    def place_interval(self) -> tuple[float, float]:
        """Outermost places that lose less than 3.84, linear in between; the grid's ends where it never loses more."""
        inside = np.flatnonzero(self.rise <= _CHI2_95)
        low, high = int(inside[0]), int(inside[-1])
        return (
            self._crossing(low, low - 1) if low else float(self.places[0]),
            self._crossing(high, high + 1) if high + 1 < len(self.places) else float(self.places[-1]),
        )

    def size_interval(self) -> tuple[float, float]:
        """Of the size, over the places inside: each with what is left of the 3.84 there."""
        inside = self.rise <= _CHI2_95
        room = self.std[inside] * np.sqrt(_CHI2_95 - self.rise[inside])
        return float((self.size[inside] - room).min()), float((self.size[inside] + room).max())

    def _crossing(self, inside: int, outside: int) -> float:
        share = (_CHI2_95 - self.rise[inside]) / (self.rise[outside] - self.rise[inside])
        return float(self.places[inside] + share * (self.places[outside] - self.places[inside]))


def place_of(effect: Effect) -> int | None:
    """Index of the effect's place among its parameters, None if it has none."""
    return next((j for j, p in enumerate(effect.parameters) if p.place), None)


def best_place(problem: Problem, found: Fit) -> tuple[Fit, Profile]:
    """The last effect of a fit along its place: the best of the optima there, and the profile about it.

    Parameters
    ----------
    found : a fit whose last effect has a place.
    """
    for _ in range(2):
        tried = _along(problem, found)
        lowest = min(tried, key=lambda f: f.cost)
        if lowest.cost > found.cost - 0.1:
            break
        again = fit(problem, found.hypothesis, lowest.point)
        if again is None or again.cost >= found.cost:
            break
        found = again
    at, first = _places(found)
    fits = sorted([*tried, found], key=lambda f: float(f.point.sizes[at]))
    costs = np.array([f.cost for f in fits])
    return found, Profile(
        np.array([f.point.sizes[at] for f in fits]),
        2.0 * (costs - costs.min()),
        np.array([f.point.sizes[first] for f in fits]),
        np.array([np.sqrt(max(f.covariance[S + first, S + first], 0.0)) for f in fits]),
    )


def _places(found: Fit) -> tuple[int, int]:
    """Where the place and the size of the last effect stand among the sizes."""
    effect = found.hypothesis.effects[-1]
    first = len(found.point.sizes) - len(effect.parameters)
    return first + (place_of(effect) or 0), first


def _along(problem: Problem, found: Fit) -> list[Fit]:
    at, _ = _places(found)
    effect = found.hypothesis.effects[-1]
    j = place_of(effect) or 0
    low, high = effect.parameters[j].ends
    std = float(np.sqrt(max(found.covariance[S + at, S + at], 0.0)))
    std = min(max(std, _LEAST * (high - low)), _MOST * (high - low))
    fits = []
    for side in (-1.0, 1.0):
        point = found.point
        for offset in _OFFSETS:
            place = float(found.point.sizes[at]) + side * offset * std
            if not low < place < high:
                break
            tried = fit(
                problem, _held(found.hypothesis, place), _at(point, at, place), iterations=_ITERATIONS
            )
            if tried is None:
                break
            fits.append(tried)
            point = tried.point
            if tried.cost - found.cost > 2.0 * _CHI2_95 and offset >= _OFFSETS[2]:
                break
    return fits


def _held(hypothesis: Hypothesis, place: float) -> Hypothesis:
    """The hypothesis with the last effect's place held: its range is that one place."""
    effect = hypothesis.effects[-1]
    j = place_of(effect) or 0
    p = effect.parameters[j]
    pinned = replace(p, low=p.value(place), high=p.value(place))
    parameters = tuple(pinned if i == j else q for i, q in enumerate(effect.parameters))
    return replace(hypothesis, effects=(*hypothesis.effects[:-1], replace(effect, parameters=parameters)))


def _at(point: Point, index: int, place: float) -> Point:
    sizes = point.sizes.copy()
    sizes[index] = place
    return replace(point, sizes=sizes)
