"""The fits of a search, each set of effects once.

Several steps of a search ask for the same set: as the null of a round, as an exchange, as what remains without an effect. The
table holds the best fit of each set, and answers such a question without another refit. A likelihood may have several optima,
so that a set can also be fitted from a start that is not the table's own; the best fit remains, whatever the start.
"""

from __future__ import annotations

from collections.abc import Sequence
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


class _Entry(NamedTuple):
    """A fit, and the cost of the rival against which it was made."""

    fit: PosteriorFit
    rival: float

    def answers(self, rival: float) -> bool:
        """Whether another fit would end as this one: it converged, or ended out of reach of this rival too."""
        return self.fit.converged if not self.fit.outrun else rival <= self.rival


class SetTable:
    """Fits of one problem by their set of effects.

    Parameters
    ----------
    problem : what is fitted.
    """

    def __init__(self, problem: TraceProblem) -> None:
        self.problem = problem
        self._best: dict[SetKey, _Entry] = {}
        self._tried: dict[tuple[SetKey, bytes], float] = {}
        self._exchanges: dict[SetKey, list[SetKey]] = {}

    def fit(
        self,
        hypothesis: Hypothesis,
        start: Parameters,
        *,
        rival: float = np.inf,
        only_better: bool = False,
        near: PosteriorFit | None = None,
    ) -> PosteriorFit | None:
        """The best fit of a set, made only where the table holds none; one that did not end begins where it stopped.

        Parameters and None as of `airtruth.tracing.inference.optimise.fit`.
        """
        known = self._best.get(key_of(hypothesis))
        if known is None:
            return self.fit_from(hypothesis, start, rival=rival, only_better=only_better, near=near)
        own = in_order_of(known.fit, hypothesis)
        if known.answers(rival):
            return own
        return self.fit_from(hypothesis, own.point, rival=rival, only_better=only_better, near=own)

    def fit_from(
        self,
        hypothesis: Hypothesis,
        start: Parameters,
        *,
        rival: float = np.inf,
        only_better: bool = False,
        near: PosteriorFit | None = None,
    ) -> PosteriorFit | None:
        """The fit of a set from a start, which may lead to another optimum; the table keeps the better.

        A start that was tried before leads nowhere else: the answer is the best fit of the set. Parameters and None as of
        `airtruth.tracing.inference.optimise.fit`.
        """
        key = key_of(hypothesis)
        begin = key, _in_order(start, hypothesis, sorted(hypothesis.effects, key=_name)).vector.tobytes()
        known = self._best.get(key)
        if known is not None and known.fit.converged and rival <= self._tried.get(begin, -np.inf):
            return in_order_of(known.fit, hypothesis)
        own = fit(self.problem, hypothesis, start, rival=rival, only_better=only_better, near=near)
        if own is not None:
            self._tried[begin] = rival
            if not (own.outrun and only_better):  # of no use to anyone
                self.keep(own, rival)
        return own

    def fit_from_declared(
        self,
        hypothesis: Hypothesis,
        sizes: Array,
        null: PosteriorFit,
        *,
        rival: float = np.inf,
        only_better: bool = False,
    ) -> PosteriorFit | None:
        """`fit_from` the declared aircraft, and not from a null, which may have absorbed an effect.

        It begins with the levels of noise and gusts of the null: from strong gusts these would fall for many steps far behind a
        rival, and the search would be given up.

        Parameters
        ----------
        sizes : of the effects, at which the search begins; null : a fit whose derivatives the first steps use.
        """
        start = initial_parameters(self.problem, hypothesis, sizes, _FIRST_ITERATIONS).with_levels(null.point)
        return self.fit_from(hypothesis, start, rival=rival, only_better=only_better, near=null)

    def declared(self, last: PosteriorFit) -> PosteriorFit | None:
        """The fit of the same effects under the declaration: released derivatives absorb what a wrong effect leaves."""
        if last.hypothesis.spread is None:
            return last
        return self.fit(replace(last.hypothesis, spread=None), last.point, near=last)

    def best_from(
        self,
        hypothesis: Hypothesis,
        starts: Sequence[Parameters],
        *,
        rival: float = np.inf,
        near: PosteriorFit | None = None,
    ) -> PosteriorFit | None:
        """The fit of a set that the table holds complete, else the best one from several starts; options as of `fit`."""
        known = self.best(hypothesis)
        if known is None:
            for start in starts:
                self.fit_from(hypothesis, start, rival=rival, near=near)
            if starts:
                known = self.converged(hypothesis, starts[0], rival=rival, near=near)
        return known

    def converged(
        self,
        hypothesis: Hypothesis,
        start: Parameters,
        *,
        rival: float = np.inf,
        near: PosteriorFit | None = None,
    ) -> PosteriorFit | None:
        """`fit`, continued until it converges or `_ATTEMPTS` are spent."""
        own = None
        for _ in range(_ATTEMPTS):
            own = self.fit(hypothesis, start, rival=rival, near=near)
            if own is None or own.converged:
                break
        return own

    def keep(self, fitted: PosteriorFit, rival: float = np.inf) -> None:
        """Enter a fit that was made elsewhere, where the table holds no better one.

        A fit that ended early counts only where none is complete, because its derivatives are those of a point before it.
        """
        key = key_of(fitted.hypothesis)
        known = self._best.get(key)
        if known is None or (fitted.outrun, fitted.cost) < (known.fit.outrun, known.fit.cost):
            self._best[key] = _Entry(fitted, rival)

    def best(self, hypothesis: Hypothesis) -> PosteriorFit | None:
        """The fit of a set that ended at an optimum; None where the table holds none."""
        known = self._best.get(key_of(hypothesis))
        if known is None or known.fit.outrun or not known.fit.converged:
            return None
        return in_order_of(known.fit, hypothesis)

    def exchange(self, last: PosteriorFit, tried: PosteriorFit) -> None:
        """Enter that a set has been tried in place of another."""
        self._exchanges.setdefault(key_of(last.hypothesis), []).append(key_of(tried.hypothesis))

    def exchanges(self, last: PosteriorFit) -> tuple[PosteriorFit, ...]:
        """The fits of the sets that have been tried in place of another."""
        keys = dict.fromkeys(self._exchanges.get(key_of(last.hypothesis), ()))
        return tuple(self._best[key].fit for key in keys)


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


__all__ = ["SetKey", "SetTable", "in_order_of", "key_of"]
