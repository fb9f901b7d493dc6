"""Rounds of an answer: the fit of the effects before, the scores at it, and the effect that follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.tracing.anomalies import score_test
from airtruth.tracing.anomalies.omnibus import anomalies
from airtruth.tracing.anomalies.score_test import ScoreTable
from airtruth.tracing.anomalies.significance import strongest
from airtruth.tracing.inference.derivative_likelihood import Contradiction, contradiction
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.profile import Profile
from airtruth.tracing.inference.whitening import Whitener, autoregression
from airtruth.tracing.selection.candidate import Candidate
from airtruth.tracing.selection.explanation import ExplainedDerivatives

Array = NDArray[np.float64]

_WHITENED_ITERATIONS: Final = 6
"""Iterations of a refit under an autoregression [-] (judgement: it begins next to its optimum)."""
_FAR: Final = 5.0
"""Distance in standard errors from which the refit under the autoregression is discarded [-] (judgement)."""


@dataclass(frozen=True)
class SearchRound:
    """One round: its null, the scores at it, and the effect that is accepted beside the null.

    Attributes
    ----------
    null : fit of the effects accepted so far, noise levels free; gls : the same under ``whitener``.
    omnibus : tests that name no effect.
    adjusted : Holm's p-values of the scores in the table.
    declared_test : test of the declared derivatives at the null.
    candidates : the effects that were refitted beside the null, best first.
    tied : the accepted effect, and increments that explain the records as well; empty if none was accepted.
    profile : likelihood of the accepted effect over its location; None where it has no location.
    explanation : what the answer states of the derivatives, in the last round; None where they are as declared.
    posterior : names of each set -> its posterior probability, in the last round.
    """

    null: PosteriorFit
    gls: PosteriorFit
    whitener: Whitener
    table: ScoreTable
    omnibus: tuple[HypothesisTest, ...]
    adjusted: Array
    declared_test: Contradiction
    candidates: tuple[Candidate, ...] = ()
    tied: tuple[Candidate, ...] = ()
    profile: Profile | None = None
    explanation: ExplainedDerivatives | None = None
    posterior: Mapping[tuple[str, ...], float] = field(default_factory=dict)

    @property
    def reported(self) -> PosteriorFit:
        """The fit whose sizes are reported: that under the autoregression, where it moved away from the null."""
        stayed = np.array_equal(self.gls.point.common, self.null.point.common)
        return self.null if stayed else self.gls

    @property
    def anomaly(self) -> HypothesisTest:
        """The strongest evidence of a missing effect, a score or an omnibus test; p-value by Bonferroni's rule."""
        return strongest(self.omnibus, self.table, self.adjusted)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the set that the null and the explanation of its derivatives state, sorted."""
        explained = () if self.explanation is None else self.explanation.effects
        return tuple(sorted({*(e.label for e in self.null.hypothesis.effects), *explained}))

    def p_value_of(self, where: str) -> float:
        """P-value of an omnibus test, 1 where it was not made [-]."""
        return next((a.p_value for a in self.omnibus if a.null == where), 1.0)


def scored(problem: TraceProblem, null: PosteriorFit, effects: Sequence[Effect], seed: int) -> SearchRound:
    """The round of a fit, which scores the effects that it lacks.

    Parameters
    ----------
    effects : candidates of the search; seed : seed of the random draws behind p-values.
    """
    taken = {e.key for e in null.hypothesis.effects}
    whitener = autoregression(null.innovations)
    gls = null if whitener.order == 0 else _refit_whitened(problem, null, whitener)
    table = score_test.table(gls, problem, [e for e in effects if e.key not in taken], whitener, seed)
    return SearchRound(
        null,
        gls,
        whitener,
        table,
        anomalies(gls, problem, whitener),
        score_test.holm([s.p_value for s in table.scores]),
        contradiction(problem, null),
    )


def _refit_whitened(problem: TraceProblem, null: PosteriorFit, whitener: Whitener) -> PosteriorFit:
    """The null under an autoregression; at the null's own parameters where the refit leads far away.

    An autoregression of a misfit can absorb the very motion that shows the derivatives.
    """
    again = fit(
        problem,
        null.hypothesis,
        null.point,
        whitener,
        iterations=_WHITENED_ITERATIONS,
        free_levels=False,
        near=null,
    )
    if again is not None:
        rows = null.layout.of.common.derivatives
        std = np.sqrt(np.diag(null.covariance)[rows])
        if (np.abs(again.point.common[rows] - null.point.common[rows]) < _FAR * std).all():
            return again
    return (
        fit(problem, null.hypothesis, null.point, whitener, iterations=0, free_levels=False, near=null)
        or null
    )


__all__ = ["SearchRound", "scored"]
