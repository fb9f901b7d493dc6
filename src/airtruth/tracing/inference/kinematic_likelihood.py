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
from airtruth.physics.sensor_errors import KINDS

Array = NDArray[np.float64]

_KEPT: Final = 256
"""Number of points whose values are kept [-] (judgement: more than the evaluations of a refit)."""


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
        key = tuple(sizes.items())
        if key not in self._known:
            errors = {**self._others, **{name: self._error(name, size) for name, size in sizes.items()}}
            along, slopes = self.search.problem.linearised(list(sizes), errors)
            if len(self._known) >= _KEPT:
                self._known.clear()
            self._known[key] = along, slopes * np.array([[self._per_size(name)] for name in sizes])
        return self._known[key]

    def _error(self, name: str, size: float) -> float:
        """Error at a size, which adds to the declared error or multiplies it."""
        declared = self.search.problem.start(name)
        return declared * (1.0 + size) if self._is_factor(name) else declared + size

    def _per_size(self, name: str) -> float:
        return self.search.problem.start(name) if self._is_factor(name) else 1.0

    def _is_factor(self, name: str) -> bool:
        return KINDS[self.search.problem.kinematics.errors[name].kind].is_factor

    @cached_property
    def _others(self) -> dict[str, float]:
        """Errors of the best set that are no effects."""
        best = self.search.best.fit
        return {n: v for n, v in zip(best.names, best.value.tolist(), strict=True) if n not in self.names}

    @cached_property
    def _none(self) -> Array:
        return self.search.problem.linearised((), self._others)[0]

    @cached_property
    def _known(self) -> dict[tuple[tuple[str, float], ...], tuple[Array, Array]]:
        return {}


__all__ = ["KinematicLikelihood", "KinematicTerms"]
