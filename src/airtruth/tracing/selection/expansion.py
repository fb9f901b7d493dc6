"""The posterior about a fit as a quadratic in all parameters, the fitted effects and the further ones together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.numerics.normal_equations import scaled_step
from airtruth.tracing.anomalies.score_test import LOCATIONS, beside
from airtruth.tracing.inference.causes import Cause
from airtruth.tracing.inference.direction import eliminated
from airtruth.tracing.inference.hypothesis import unconstrained_by
from airtruth.tracing.inference.kinematic_likelihood import KinematicTerms
from airtruth.tracing.inference.posterior import (
    Marginal,
    PosteriorFit,
    TraceProblem,
    likelihood_terms,
    marginal_information,
)
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.selection.columns import EffectColumn
from airtruth.tracing.selection.evidence import Quadratic

Array = NDArray[np.float64]

_MOST_LOG_STEP: Final = 1.0
"""Largest step of the logarithm of a noise or gust level [-] (judgement: a factor of e, as in a step of a refit)."""
_FREE: Final[Mapping[int, float]] = MappingProxyType({})
"""No common parameter is given."""


@dataclass(frozen=True)
class Expansion:
    """The quadratic about a fit.

    Attributes
    ----------
    last : the fit; marginal : gradient and information of common parameters, sizes, and one direction for each further effect.
    effects, columns, at : (effects,) those of the fit and the further ones, where their first size is, and its value there.
    locations : of each effect, its parameters after the size; tried : the number of locations that were compared.
    told : what the kinematics tells of the effects at these sizes; counted : number of times that ``marginal`` counts it.
    """

    last: PosteriorFit
    marginal: Marginal
    effects: tuple[Effect, ...]
    columns: NDArray[np.int64]
    at: Array
    locations: tuple[Array, ...]
    tried: tuple[int, ...]
    told: KinematicTerms | None = None
    counted: float = 0.0

    @property
    def effects_of_fit(self) -> frozenset[str]:
        """Keys of the effects of the fit."""
        return frozenset(e.key for e in self.last.hypothesis.effects)

    @property
    def integrated(self) -> list[int]:
        """Common parameters that an evidence integrates under their prior: derivatives, inertia, and the mounting, which shows
        beside a shift of the CG alone."""
        common = self.last.point.of.common
        return [*range(common.derivatives.stop), common.inertia, common.mounting]

    def point(self, chosen: Sequence[int], sizes: Array, common: Mapping[int, float] = _FREE) -> Parameters:
        """Parameters where the quadratic is least with these effects alone.

        Parameters
        ----------
        chosen, sizes : (number,) indices of the effects and their sizes.
        common : common parameters that have another value than the least one, by their index.
        """
        x = np.zeros(len(self.at))
        x[list(chosen)] = sizes
        point, entries = self.last.point, self.last.point.of
        step = np.zeros(len(self.marginal.gradient))
        step[self.columns] = x - self.at
        given = list(common)
        step[given] = np.array(list(common.values())) - point.common[given]
        known = np.concatenate([self.columns, np.array(given, dtype=np.int64)])
        rest = np.setdiff1d(np.arange(len(step)), known)
        h = self.marginal.information
        push = self.marginal.gradient[rest] + h[np.ix_(rest, known)] @ step[known]
        step[rest] = scaled_step(push, h[np.ix_(rest, rest)], 0.0)
        moved = point.common + _limited(step[: entries.common.size], entries.common.nuisance)
        own = np.stack([-(e.solved[:, 0] + e.solved[:, 1:] @ step) for e in self.marginal.eliminated])
        per_record = point.per_record + [_limited(o, entries.per_record.log_gust) for o in own]
        every = [np.array([x[i], *self.locations[i]]) for i in chosen]
        for i, own_sizes in zip(chosen, every, strict=True):
            own_sizes[0] = np.clip(own_sizes[0], *self.effects[i].parameters[0].reach)
        return Parameters(moved, per_record, np.concatenate([np.zeros(0), *every]), entries)

    def quadratic(
        self,
        problem: TraceProblem,
        causes: Sequence[Cause],
        temper: float = 1.0,
        wrong_allowed: bool = True,
    ) -> Quadratic:
        """The likelihood alone, in the declared parameters, the sizes, and causes that change the derivatives.

        Parameters
        ----------
        temper : long-run variance of the slopes over that of white innovations [-].
        wrong_allowed : whether declarations of derivatives may be wrong.
        """
        last, hypothesis, common = self.last, self.last.hypothesis, problem.layout.common
        declared = self.integrated
        at = last.point.common[declared]
        precision = problem.priors(hypothesis).common[np.ix_(declared, declared)]
        gradient, information = self.marginal.gradient.copy(), self.marginal.information.copy()
        gradient[declared] -= precision @ at
        information[np.ix_(declared, declared)] -= precision
        known, pull, sizes = hypothesis.size_precision, hypothesis.size_pull, last.point.sizes
        rows = np.arange(len(sizes)) + last.layout.sizes.start
        gradient[rows] -= known * sizes - pull
        information[rows, rows] -= known
        stated = 0.5 * float(at @ precision @ at + known @ sizes**2) - float(pull @ sizes)
        if self.told is not None:
            more = temper - 1.0 - self.counted
            gradient[self.columns] += more * self.told.slope
            information[np.ix_(self.columns, self.columns)] += more * self.told.information
            stated -= more * self.told.value
        g, h = eliminated(gradient, information, [*declared, *self.columns.tolist()])
        x = np.concatenate([at, self.at])
        offset = last.cost - stated - float(g @ x) + 0.5 * float(x @ h @ x)
        along = np.zeros((len(x), len(causes)))
        for k, cause in enumerate(causes):
            along[common.derivatives, k] = cause.direction
        every = np.hstack([np.eye(len(x)), along])
        alone = replace(hypothesis, effects=(), spread=None, also_unconstrained=())
        return Quadratic(
            offset,
            every.T @ (g - h @ x),
            every.T @ h @ every,
            np.asarray(np.linalg.inv(problem.priors(alone).common), dtype=np.float64)[
                np.ix_(declared, declared)
            ],
            common.derivatives.stop,
            (
                *(
                    EffectColumn(
                        e,
                        locations=tuple(where),
                        tried=tried,
                        freed=unconstrained_by(e, hypothesis.trim_flow_rad, hypothesis.motion),
                    )
                    for e, where, tried in zip(self.effects, self.locations, self.tried, strict=True)
                ),
                *(EffectColumn(cause=cause) for cause in causes),
            ),
            temper,
            wrong_allowed,
        )


def expanded(problem: TraceProblem, last: PosteriorFit, effects: Sequence[Effect] = ()) -> Expansion:
    """The quadratic about a fit.

    Parameters
    ----------
    effects : those that the fit may lack, each at the location where it scores highest.
    """
    members = last.hypothesis.effects
    taken = {e.key for e in members}
    lacking = [e for e in effects if e.key not in taken]
    _, by_effect, tried, sensitivities = beside(last, problem, lacking)
    terms = [likelihood_terms(s, NO_WHITENER, levels=True) for s in sensitivities]
    marginal = marginal_information(
        problem.priors(last.hypothesis)._replace(kinematics=None),
        last.point,
        terms,
        levels=True,
        fixed=last.point.at_bounds,
    )
    own_columns = [last.layout.size(last.hypothesis.span(e.key).start) for e in members]
    first = len(marginal.gradient) - len(tried)
    g, h = eliminated(marginal.gradient, marginal.information, range(first, len(marginal.gradient)))
    raw = np.diag(h)
    score = np.where(raw > 0.0, g**2 / np.where(raw > 0.0, raw, 1.0), -np.inf)
    best: list[int] = []
    counts: list[int] = []
    at = 0
    for own in by_effect:
        leading = at + int(np.argmax(score[at : at + len(own)]))
        at += len(own)
        if np.isfinite(score[leading]):
            best.append(leading)
            counts.append(len(own))
    kept = [*range(first), *(first + i for i in best)]
    sizes = [last.point.sizes[last.hypothesis.span(e.key)] for e in members]
    compared = (*members, *(tried[i].effect for i in best))
    columns = np.array([*own_columns, *range(first, first + len(best))], dtype=np.int64)
    at_sizes = np.array([*(float(s[0]) for s in sizes), *(0.0 for _ in best)])
    gradient, information = marginal.gradient[kept], marginal.information[np.ix_(kept, kept)]
    told, counted = None, 0.0
    if problem.kinematics is not None:
        told, counted = problem.kinematics.terms(compared, at_sizes), problem.kinematics.weight
        gradient[columns] += counted * told.slope
        information[np.ix_(columns, columns)] += counted * told.information
    return Expansion(
        last,
        Marginal(
            gradient,
            information,
            tuple(e._replace(solved=e.solved[:, [0, *(1 + k for k in kept)]]) for e in marginal.eliminated),
        ),
        compared,
        columns,
        at_sizes,
        (*(s[1:] for s in sizes), *(np.array(tried[i].locations) for i in best)),
        (*(LOCATIONS if len(e.parameters) > 1 else 1 for e in members), *counts),
        told,
        counted,
    )


def _limited(step: Array, levels: int | slice) -> Array:
    """A step with that of the logarithms of levels limited."""
    limited = step.copy()
    limited[levels] = np.clip(limited[levels], -_MOST_LOG_STEP, _MOST_LOG_STEP)
    return limited


__all__ = ["Expansion", "expanded"]
