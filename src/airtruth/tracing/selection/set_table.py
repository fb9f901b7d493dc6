"""The fits of a search, each set of effects once.

Several steps of a search ask for the same set. The table holds the best fit of each set, and answers such a question without
another refit. A likelihood may have several optima, so that a set can also be fitted from a start that is not the table's own;
the best fit remains, whatever the start.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.nearby import reordered, rows_of
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.model.parameters import Parameters

Array = NDArray[np.float64]

_FIRST_ITERATIONS: Final = 6
"""Iterations from the declared aircraft with gusts taken as strong [-] (judgement)."""
SAME: Final = 0.05
"""Change of the logarithm of the ratio of variances that leaves every evidence as it is [-] (judgement)."""
_ATTEMPTS: Final = 3
"""Number of refits that a fit is given to converge [-] (judgement)."""


class SetKey(NamedTuple):
    """Key of a fit of a problem, whatever its start: the effects in no order, and the derivatives that are free.

    Attributes
    ----------
    effects : of the hypothesis; unconstrained : numbers of the derivatives without a declaration.
    spread : covariance of released derivatives, as bytes; empty where they are declared.
    """

    effects: frozenset[Effect]
    unconstrained: tuple[int, ...]
    spread: bytes

    @property
    def keys(self) -> list[str]:
        """Keys of the effects."""
        return [e.key for e in self.effects]


class SetTable:
    """Fits of one problem by their set of effects.

    Parameters
    ----------
    problem : what is fitted.
    """

    def __init__(self, problem: TraceProblem) -> None:
        self.problem = problem
        self._best: dict[SetKey, PosteriorFit] = {}
        self._tried: set[tuple[SetKey, bytes]] = set()

    def fit(
        self, hypothesis: Hypothesis, start: Parameters, *, near: PosteriorFit | None = None
    ) -> PosteriorFit | None:
        """The best fit of a set, made only where the table holds none; one that did not converge begins where it stopped.

        Parameters and None as of `airtruth.tracing.inference.optimise.fit`.
        """
        known = self._best.get(key_of(hypothesis))
        if known is None:
            return self.fit_from(hypothesis, start, near=near)
        own = in_order_of(known, hypothesis)
        return own if known.converged else self.fit_from(hypothesis, own.point, near=own)

    def fit_from(
        self, hypothesis: Hypothesis, start: Parameters, *, near: PosteriorFit | None = None
    ) -> PosteriorFit | None:
        """The fit of a set from a start, which may lead to another optimum; the table keeps the better.

        A start that was tried before leads nowhere else: the answer is the best fit of the set. Parameters and None as of
        `airtruth.tracing.inference.optimise.fit`.
        """
        key = key_of(hypothesis)
        begin = key, _in_order(start, hypothesis, sorted(hypothesis.effects, key=_name)).vector.tobytes()
        known = self._best.get(key)
        if known is not None and known.converged and begin in self._tried:
            return in_order_of(known, hypothesis)
        own = fit(self.problem, hypothesis, start, near=near)
        if own is not None:
            self._tried.add(begin)
            self.keep(own)
        return own

    def fit_from_declared(
        self, hypothesis: Hypothesis, sizes: Array, null: PosteriorFit
    ) -> PosteriorFit | None:
        """`fit_from` the declared aircraft, and not from a null, which may have absorbed an effect.

        It begins with the levels of noise and gusts of the null: strong gusts would fall for many steps.

        Parameters
        ----------
        sizes : of the effects, at which the search begins; null : a fit whose derivatives the first steps use.
        """
        start = initial_parameters(self.problem, hypothesis, sizes, _FIRST_ITERATIONS).with_levels(null.point)
        return self.fit_from(hypothesis, start, near=null)

    def converged(
        self, hypothesis: Hypothesis, start: Parameters, *, near: PosteriorFit | None = None
    ) -> PosteriorFit | None:
        """`fit`, continued until it converges or `_ATTEMPTS` are spent."""
        own = None
        for _ in range(_ATTEMPTS):
            own = self.fit(hypothesis, start, near=near)
            if own is None or own.converged:
                break
        return own

    def holds_sensor_error(self, keys: Collection[str]) -> bool:
        """Whether any of some effects is an error of a sensor that the kinematics shows."""
        told = self.problem.kinematics
        return told is not None and told.shows(keys)

    def weigh_kinematics(self, temper: float) -> bool:
        """Set the weight of the likelihood of the kinematics by a ratio of variances; whether it has changed.

        The fits with an error of a sensor that the kinematics shows leave the table, because they were made with the old weight.

        Parameters
        ----------
        temper : the ratio [-].
        """
        told = self.problem.kinematics
        if told is None or abs(np.log(temper / told.temper)) < SAME:
            return False
        self.problem = replace(self.problem, kinematics=replace(told, temper=temper))
        self._best = {k: f for k, f in self._best.items() if not self.holds_sensor_error(k.keys)}
        self._tried = {at for at in self._tried if not self.holds_sensor_error(at[0].keys)}
        return True

    def keep(self, fitted: PosteriorFit) -> None:
        """Enter a fit that was made elsewhere, where the table holds no better one."""
        key = key_of(fitted.hypothesis)
        known = self._best.get(key)
        if known is None or fitted.cost < known.cost:
            self._best[key] = fitted


def key_of(hypothesis: Hypothesis) -> SetKey:
    """The row of a hypothesis in a table."""
    spread = b"" if hypothesis.spread is None else hypothesis.spread.tobytes()
    return SetKey(frozenset(hypothesis.effects), hypothesis.unconstrained, spread)


def in_order_of(fitted: PosteriorFit, hypothesis: Hypothesis) -> PosteriorFit:
    """The same fit with its effects in the order of another hypothesis."""
    if fitted.hypothesis.effects == hypothesis.effects:
        return fitted
    of, layout = fitted.hypothesis, fitted.layout
    rows = rows_of(layout.of, of, hypothesis)[: layout.marginal.stop]
    return replace(
        fitted,
        hypothesis=hypothesis,
        point=_in_order(fitted.point, of, hypothesis.effects),
        sensitivities=reordered(fitted.sensitivities, layout.of, of, hypothesis),
        covariance=fitted.covariance[np.ix_(rows, rows)],
    )


def _in_order(point: Parameters, of: Hypothesis, effects: Sequence[Effect]) -> Parameters:
    """Parameters with the sizes of the effects of a hypothesis in another order."""
    sizes = [point.sizes[of.span(e.key)] for e in effects]
    return replace(point, sizes=np.concatenate(sizes) if sizes else np.zeros(0))


def _name(effect: Effect) -> str:
    return effect.key


__all__ = ["SAME", "SetKey", "SetTable", "in_order_of", "key_of"]
