"""Maximise the posterior: a `Problems` of `airtruth.numerics.levenberg_marquardt`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.kept import Kept
from airtruth.numerics.levenberg_marquardt import SolverStatus, minimise
from airtruth.numerics.levenberg_marquardt_options import Damping, SolverOptions, Stopping
from airtruth.numerics.normal_equations import scaled_inverse, scaled_step
from airtruth.physics.terms import Change
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.nearby import begins_at, nearby, reordered
from airtruth.tracing.inference.posterior import (
    LikelihoodTerms,
    PosteriorFit,
    Priors,
    Sensitivities,
    TraceProblem,
    likelihood_terms,
    marginal_information,
    prior_cost,
    sensitivities_of,
)
from airtruth.tracing.inference.whitening import NO_WHITENER, Whitener
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.model.settings import Settings, initial_per_record

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ITERATIONS: Final = 45
"""Most iterations of a fit [-]; judgement: three times what a fit of one effect takes as a rule."""
_FIRST_ITERATIONS: Final = 4
"""Iterations with the levels held, before a search [-]; judgement."""
_LEAST_DAMPING: Final = 1e-9
"""Damping that is none but for rounding [-]."""
_SEARCH: Final = SolverOptions(
    iterations=ITERATIONS,
    damping=Damping(initial=1e-3, least=_LEAST_DAMPING, most=1e7, restart=1e-3, poor=5.0, slack=-1e-9),
    stopping=Stopping(
        promised=0.002, promised_confirm=0.5, decrease=0.01, decrease_confirm=0.05, rejected=0.05
    ),
    reuse=True,
    stale=1.0,
    creeping=0.5,
    chords=3,
    outrun=20.0,
)
"""How the posterior is searched; decreases in log-likelihood [-], judgements. A step that would gain 0.002 moves the
estimates by 0.06 standard errors, one of 0.05 by 0.3. The last 0.5 is for tables with breaks, which give the gain of
the filter, and with it the cost, small breaks too. Derivatives cost six times what a trial costs, so that they serve
until they gain less than 1, or less than half of what they promise."""
ROUGH_M_S: Final = 1.0
"""Gust level in which a search starts where nothing is known [m/s]: the records then weigh little and no start is far
(judgement)."""
_MOST_LOG_STEP: Final = 1.0
"""Largest step of a common parameter that is no derivative, and of the logarithm of a gust level [-]: a factor of e
(judgement)."""
_MOST_SIZE_STEP: Final = 0.25
"""Largest step of a size over its range [-] (judgement)."""
_RIDGE: Final = 1e-12
"""Ridge on the scaled information before it is inverted [-]; far above rounding, far below any information."""


@dataclass(frozen=True)
class Evaluated:
    """The posterior at a point: negative logarithm, and likelihood and sensitivities of each record."""

    cost: float
    terms: tuple[LikelihoodTerms, ...]
    sensitivities: tuple[Sensitivities, ...]


class _Start(NamedTuple):
    """Derivatives at the start of a search without effects, and what they depend on beside the record."""

    settings: Settings
    declared: Change
    sensitivities: Sensitivities | None


_STARTS: Final = Kept[_Start]()
"""Record -> derivatives at the start of a search."""


@dataclass(frozen=True)
class PosteriorSearch:
    """One minimisation problem over the vector of all parameters; see `Problems`.

    Attributes
    ----------
    problem, hypothesis, priors : what is fitted.
    whitener : an autoregression that is held.
    levels : whether noise and gust levels and the share of correlated noise are free.
    shape : parameters of the shape that vectors have.
    with_levels : whether derivatives in the levels are computed although the levels are held; the fit's sensitivities hold them.
    """

    problem: TraceProblem
    hypothesis: Hypothesis
    priors: Priors
    whitener: Whitener
    levels: bool
    shape: Parameters
    with_levels: bool = True

    def evaluate(self, x: Array, index: Ints, near: Sequence[Evaluated] | None) -> list[Evaluated | None]:
        """The posterior at each row; see `Problems.evaluate`."""
        return [
            self._evaluate(self.shape.of_vector(row), None if near is None else near[k])
            for k, row in enumerate(x)
        ]

    def _evaluate(self, point: Parameters, near: Evaluated | None) -> Evaluated | None:
        if not np.isfinite(point.vector).all():
            return None

        def one(i: int) -> tuple[Sensitivities, LikelihoodTerms] | None:
            old = None if near is None else near.sensitivities[i]
            made = sensitivities_of(
                self.problem, i, self.hypothesis, point, with_levels=self.with_levels, old=old
            )
            return None if made is None else (made, likelihood_terms(made, self.whitener, self.levels))

        done = [d for d in self.problem.each(one, range(len(self.problem.records))) if d is not None]
        if len(done) < len(self.problem.records):
            return None
        cost = sum(terms.cost for _, terms in done) + prior_cost(self.priors, point)
        if not np.isfinite(cost):
            return None
        return Evaluated(cost, tuple(terms for _, terms in done), tuple(made for made, _ in done))

    def step(self, x: Array, at: Sequence[Evaluated], damping: Array, index: Ints) -> tuple[Array, Array]:
        """The damped step of each row and what it promises; see `Problems.step`."""
        steps, promised = zip(
            *(
                self._step(self.shape.of_vector(row), there, float(d))
                for row, there, d in zip(x, at, damping, strict=True)
            ),
            strict=True,
        )
        return np.array(steps), np.array(promised)

    def _step(self, point: Parameters, at: Evaluated, damping: float) -> tuple[Array, float]:
        ends = self._ends(point)
        fixed = tuple(point.layout.size(k) for k in self.hypothesis.fixed)
        while True:
            gradient, information, eliminated = marginal_information(
                self.priors, point, at.terms, levels=self.levels, damping=damping, fixed=fixed
            )
            shared = scaled_step(gradient, information, damping)
            stopped = tuple(i for i, sign in ends if i not in fixed and sign * shared[i] > 0.0)
            if not stopped:
                break
            fixed += stopped
        own = np.stack([-(e.solved[:, 0] + e.solved[:, 1:] @ shared) for e in eliminated])
        level = point.of.per_record.log_gust
        own[:, level] = np.clip(own[:, level], -_MOST_LOG_STEP, _MOST_LOG_STEP)
        gain = float(-gradient @ shared)
        gain += sum(float(e.solved[:, 0] @ e.information @ e.solved[:, 0]) for e in eliminated)
        return np.concatenate([shared, own.ravel()]), 0.5 * gain

    def _ends(self, point: Parameters) -> list[tuple[int, float]]:
        """Indices of the common parameters and sizes at an end of their range, and 1 for the upper end, -1 for the lower."""
        ranges = [(i, float(point.common[i]), low, high) for i, (low, high) in point.of.common.bounds.items()]
        first = point.layout.sizes.start
        for k, size in enumerate(point.sizes):
            ranges.append((first + k, float(size), *self.hypothesis.parameter(k).ends))
        return [(i, 1.0 if at == high else -1.0) for i, at, low, high in ranges if at in (low, high)]

    def move(self, x: Array, step: Array, index: Ints) -> Array:
        """Steps taken within the plausible ranges; see `Problems.move`."""
        return np.array([self._move(row, by) for row, by in zip(x, step, strict=True)])

    def _move(self, x: Array, step: Array) -> Array:
        point, moved = self.shape.of_vector(x), x + step
        layout = point.layout
        for k, size in enumerate(point.sizes):
            low, high = self.hypothesis.parameter(k).ends
            room = _MOST_SIZE_STEP * (high - low)
            at = layout.sizes.start + k
            moved[at] = min(max(moved[at], max(low, size - room)), min(high, size + room))
        nuisance = point.of.common.nuisance
        moved[nuisance] = x[nuisance] + np.clip(step[nuisance], -_MOST_LOG_STEP, _MOST_LOG_STEP)
        for i, (low, high) in point.of.common.bounds.items():
            moved[i] = min(max(moved[i], low), high)
        return moved

    def shortfall(self, x: Array, at: Evaluated) -> float:
        """Gain in log-likelihood that a step at the least damping promises."""
        return self._step(self.shape.of_vector(x), at, _LEAST_DAMPING)[1]


def fit(
    problem: TraceProblem,
    hypothesis: Hypothesis,
    start: Parameters,
    whitener: Whitener = NO_WHITENER,
    *,
    iterations: int = ITERATIONS,
    free_levels: bool = True,
    rival: float = np.inf,
    only_better: bool = False,
    near: PosteriorFit | None = None,
) -> PosteriorFit | None:
    """The largest posterior from a start; None where not even the start can be evaluated.

    Parameters
    ----------
    whitener : an autoregression that is held; with one, levels should not be free.
    free_levels : whether noise and gust levels and the share of correlated noise are fitted.
    rival : cost of a better hypothesis; the search ends early once it is plainly out of reach.
    only_better : whether an end that does not lead the rival is of no use, so that the search ends once it will not. The
        derivatives and the covariance of such an end are those of a point before it.
    near : a fit of the same problem whose derivatives the first steps use, with other effects perhaps.
    """
    priors = problem.priors(hypothesis)
    search = PosteriorSearch(problem, hypothesis, priors, whitener, free_levels, start)
    outrun_renewed = 0.0 if only_better else np.inf
    options = replace(
        _SEARCH, iterations=iterations, outrun_renewed=outrun_renewed, renewed_outrun=not only_better
    )
    first = None if near is None else [Evaluated(near.cost, (), nearby(near, hypothesis))]
    at_near = near is not None and begins_at(near, hypothesis, start)
    solution = minimise(search, start.vector[None, :], options, rival, first, at_near)
    (at,), (x,), (status,) = solution.at, solution.x, solution.status
    if at is None:
        return None
    converged = status in (SolverStatus.CONVERGED, SolverStatus.OUTRUN, SolverStatus.STALLED)
    return PosteriorFit(
        hypothesis=hypothesis,
        point=start.of_vector(x),
        cost=at.cost,
        likelihood=np.array([t.cost for t in at.terms]),
        sensitivities=at.sensitivities,
        whitener=whitener,
        covariance=_covariance(search, at, start.of_vector(x)),
        converged=converged,
        shortfall=0.0 if converged else search.shortfall(x, at),
    )


def initial_parameters(
    problem: TraceProblem,
    hypothesis: Hypothesis,
    sizes: Array | None = None,
    iterations: int = _FIRST_ITERATIONS,
) -> Parameters:
    """Where a search starts without prior knowledge: motions fitted with the levels held in rough air.

    Parameters
    ----------
    sizes : where those of the effects start; None for zero.
    """
    own = np.stack([initial_per_record(record, problem.settings) for record in problem.records])
    own[:, problem.layout.per_record.log_gust] = np.log(ROUGH_M_S)
    first = np.zeros(len(hypothesis.parameters)) if sizes is None else sizes
    point = Parameters(np.zeros(problem.layout.common.size), own, first, problem.layout)
    priors = problem.priors(hypothesis)
    search = PosteriorSearch(
        problem, hypothesis, priors, NO_WHITENER, levels=False, shape=point, with_levels=False
    )
    options = replace(_SEARCH, iterations=iterations, renewed_end=False)
    near = None
    if hypothesis.effects:
        plain = replace(hypothesis, effects=())
        made = [_without_effects(problem, i, plain, point) for i in range(len(problem.records))]
        known = [m for m in made if m is not None]
        if len(known) == len(made):
            near = [Evaluated(np.inf, (), reordered(known, problem.layout, plain, hypothesis))]
    return point.of_vector(minimise(search, point.vector[None, :], options, near=near).x[0])


def _without_effects(
    problem: TraceProblem, index: int, plain: Hypothesis, point: Parameters
) -> Sensitivities | None:
    """Derivatives of one record at the start without effects, which every start with effects shares."""
    record = problem.records[index]
    known = _STARTS.of(record)
    if known is None or known.settings is not problem.settings or known.declared != plain.declared:
        start = replace(point, sizes=np.zeros(0))
        made = sensitivities_of(problem, index, plain, start, with_levels=False)
        known = _STARTS.keep(record, _Start(problem.settings, plain.declared, made))
    return known.sensitivities


def _covariance(search: PosteriorSearch, at: Evaluated, point: Parameters) -> Array:
    """Inverse of the marginal information."""
    fixed = tuple(point.layout.size(k) for k in search.hypothesis.fixed)
    marginal = marginal_information(search.priors, point, at.terms, levels=search.levels, fixed=fixed)
    return scaled_inverse(marginal.information, _RIDGE)


__all__ = ["ITERATIONS", "ROUGH_M_S", "Evaluated", "PosteriorSearch", "fit", "initial_parameters"]
