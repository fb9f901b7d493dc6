"""Likelihood of the kinematics of the fitted records in errors of sensors, apart from the aerodynamic model.

    f(x) = (|m(x)|^2 - |m(0)|^2) / (2 e)

m are the moments of the kinematic differences at errors x (`airtruth.checks.kinematics_fit`), and e is the enlargement of their
variance. The likelihood of the filter holds the kinematics too. An inexact aerodynamic model divides it by a ratio of
variances c, but the kinematics has no part in that inexactness. The share 1 - 1/c of f is therefore added, which is c - 1 before
the division.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.kinematics_search import ErrorSearch
from airtruth.effects.effect import Effect
from airtruth.numerics.kept import Kept

Array = NDArray[np.float64]

_KEPT: Final = 256
"""Number of points that are kept of a check [-] (judgement: more than the evaluations of a refit)."""
_LINEARISED: Final = Kept[dict[tuple[tuple[str, float], ...], tuple[Array, Array]]]()
"""Search of a check -> m and its derivatives by the errors of sensors."""


class KinematicTerms(NamedTuple):
    """Value f, slope (sizes,) and Gauss-Newton information (sizes, sizes) in the first parameters of some effects."""

    value: float
    slope: Array
    information: Array


@dataclass(frozen=True)
class KinematicLikelihood:
    """The likelihood of the kinematics.

    Attributes
    ----------
    search : for the errors of sensors.
    names : errors that are effects of the library.
    temper : c of the module's formula [-].
    """

    search: ErrorSearch
    names: frozenset[str]
    temper: float = 1.0

    @property
    def weight(self) -> float:
        """Number of times that a fit counts f, whose likelihood is not divided by c [-]."""
        return self.temper - 1.0

    def shows(self, keys: Collection[str]) -> bool:
        """Whether the kinematics shows any of some effects."""
        return not self.names.isdisjoint(keys)

    def terms(self, effects: Sequence[Effect], sizes: Array) -> KinematicTerms:
        """Value, slope and information, without the weight; zero in effects that the kinematics does not show.

        Parameters
        ----------
        effects, sizes : (number,) effects and the size of the first parameter of each.
        """
        shown = [k for k, e in enumerate(effects) if e.key in self.names]
        slope, information = np.zeros(len(effects)), np.zeros((len(effects), len(effects)))
        if not shown:
            return KinematicTerms(0.0, slope, information)
        names = [effects[k].key for k in shown]
        along, slopes = self._at({n: float(sizes[k]) for n, k in zip(names, shown, strict=True)})
        none, scale = self._none, self.search.enlargement
        slope[shown] = slopes @ along / scale
        information[np.ix_(shown, shown)] = slopes @ slopes.T / scale
        return KinematicTerms(0.5 * float(along @ along - none @ none) / scale, slope, information)

    def _at(self, sizes: Mapping[str, float]) -> tuple[Array, Array]:
        """m (components,) at some sizes, and (sizes, components) its derivatives."""
        known = _LINEARISED.of(self.search)
        if known is None or len(known) >= _KEPT:
            known = _LINEARISED.keep(self.search, {})
        problem, key = self.search.problem, tuple(sizes.items())
        if key not in known:
            factors = {n: problem.start(n) for n in sizes if problem.kinematics.errors[n].is_factor}
            errors = {n: factors[n] * (1.0 + x) if n in factors else problem.start(n) + x for n, x in key}
            along, slopes = problem.linearised(list(sizes), {**self._others, **errors})
            known[key] = along, slopes * np.array([[factors.get(n, 1.0)] for n in sizes])
        return known[key]

    @cached_property
    def _others(self) -> dict[str, float]:
        """Errors of the best set that are no effects."""
        best = self.search.best.fit
        return {n: v for n, v in zip(best.names, best.value.tolist(), strict=True) if n not in self.names}

    @cached_property
    def _none(self) -> Array:
        return self.search.problem.linearised((), self._others)[0]


__all__ = ["KinematicLikelihood", "KinematicTerms"]
