"""Directions in which a hypothesis leaves the null: gradient and information of the posterior along them, without a refit.

Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50-57.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.effects.effect import Effect
from airtruth.tracing.inference.posterior import (
    PosteriorFit,
    Sensitivities,
    TraceProblem,
    likelihood_terms,
    marginal_information,
)
from airtruth.tracing.inference.whitening import Whitener
from airtruth.tracing.model.compile import CompiledChange, compile_change
from airtruth.tracing.model.response import Response, respond

Array = NDArray[np.float64]

_RIDGE: Final = 1e-12
"""Addition to the diagonal of the scaled nuisance information [-]; above rounding, below any information."""
_ROUNDING: Final = 1e-8
"""Share of an information that remains after elimination and counts as rounding [-] (judgement)."""


@dataclass(frozen=True)
class Direction:
    """One way to leave the null: an effect at one location.

    Attributes
    ----------
    effect : the effect.
    locations : its parameters after the size, in their size coordinates.
    step : size at which the difference is taken.
    """

    effect: Effect
    locations: tuple[float, ...]
    step: float

    def sizes(self, size: float) -> Array:
        """Vector of the effect's parameters in their size coordinates."""
        return np.array([size, *self.locations])


def change_along(null: PosteriorFit, d: Direction) -> CompiledChange:
    """Changes of a null and of a step in a direction."""
    sizes = np.concatenate([null.point.sizes, d.sizes(d.step)])
    return compile_change(null.hypothesis.plus(d.effect).change(sizes), null.hypothesis.motion)


def extended_by(null: PosteriorFit, problem: TraceProblem, tried: Sequence[Direction]) -> list[Sensitivities]:
    """Sensitivities of each record at the null, with the directions as further common parameters."""
    plain = null.hypothesis.compiled(null.point.sizes)
    changes = [change_along(null, d) for d in tried]
    steps = [d.step for d in tried]
    return problem.each(lambda i: _with(null, problem, i, plain, changes, steps), range(len(problem.records)))


def _with(
    null: PosteriorFit,
    problem: TraceProblem,
    index: int,
    plain: CompiledChange,
    changes: Sequence[CompiledChange],
    steps: Sequence[float],
) -> Sensitivities:
    """`extended_by` of one record: the change of the null, those with a step in each direction, and the steps."""
    base = null.sensitivities[index]
    t = np.zeros((len(steps), *base.r.shape))
    w = np.zeros((len(steps), *base.white.shape))
    more = np.zeros(len(steps))

    def respond_with(change: CompiledChange) -> Response:
        own = null.point.per_record[index]
        return respond(problem.records[index], problem.settings, change, null.point.common, own)

    e = respond_with(plain)
    for i, (change, step) in enumerate(zip(changes, steps, strict=True)):
        moved = respond_with(change)
        if not np.isfinite(moved.logdet):
            continue
        t[i] = (moved.e - e.e) @ base.white.T / step
        w[i] = base.white @ ((moved.covariance - e.covariance) / step) @ base.white.T
        more[i] = (moved.more_logdet - e.more_logdet) / step
    return inserted(base, null.layout.sizes.stop, t, w, more)


def inserted(base: Sensitivities, at: int, t: Array, w: Array, more: Array | None = None) -> Sensitivities:
    """Sensitivities with further directions from an index, that after the sizes.

    Parameters
    ----------
    t, w, more : (directions, samples, outputs), (directions, outputs, outputs) and (directions,), as of `Sensitivities`;
        None is zero.
    """
    added = np.zeros(len(t)) if more is None else more
    return Sensitivities(
        base.r,
        base.logdet,
        np.concatenate([base.t[:at], t, base.t[at:]]),
        np.concatenate([base.w[:at], w, base.w[at:]]),
        base.white,
        base.more if base.more.size == 1 else np.concatenate([base.more[:at], added, base.more[at:]]),
    )


def with_freedoms(
    null: PosteriorFit,
    problem: TraceProblem,
    sensitivities: Sequence[Sensitivities],
    whitener: Whitener,
    tried: Sequence[Direction],
    levels: bool = False,
) -> tuple[Array, Array]:
    """`projected`, each direction with the derivatives that its effect leaves unconstrained."""
    gradient, information = projected(null, problem, sensitivities, whitener, levels)
    kept = null.hypothesis.unconstrained
    freedoms = [null.hypothesis.plus(d.effect).unconstrained for d in tried]
    for free in sorted({f for f in freedoms if f != kept}):
        rows = [i for i, f in enumerate(freedoms) if f == free]
        freer = replace(null, hypothesis=replace(null.hypothesis, also_unconstrained=free))
        g, h = projected(freer, problem, sensitivities, whitener, levels)
        gradient[rows] = g[rows]
        information[rows], information[:, rows] = h[rows], h[:, rows]
    return gradient, information


def projected(
    null: PosteriorFit,
    problem: TraceProblem,
    sensitivities: Sequence[Sensitivities],
    whitener: Whitener,
    levels: bool = False,
) -> tuple[Array, Array]:
    """Gradient and information of further directions, nuisance parameters eliminated, priors included.

    Parameters
    ----------
    sensitivities : of each record, with the directions after the sizes of the null.
    levels : whether noise and gust levels count.
    """
    terms = [likelihood_terms(t, whitener, levels) for t in sensitivities]
    gradient, information, _ = marginal_information(
        problem.priors(null.hypothesis), null.point, terms, levels=levels, fixed=null.point.at_bounds
    )
    return eliminated(gradient, information, range(null.layout.sizes.stop, len(gradient)))


def eliminated(gradient: Array, information: Array, kept: Sequence[int]) -> tuple[Array, Array]:
    """Gradient and information of the parameters with the indices ``kept``, all others eliminated."""
    own = np.asarray(kept, dtype=np.int64)
    rest = np.setdiff1d(np.arange(len(gradient)), own)
    nuisance = information[np.ix_(rest, rest)]
    scale = np.sqrt(np.maximum(np.diag(nuisance), 1e-30))
    normal = nuisance / np.outer(scale, scale) + _RIDGE * np.eye(rest.size)
    across = information[np.ix_(own, rest)] / scale
    solved = np.linalg.solve(normal, np.column_stack([gradient[rest] / scale, across.T]))
    g = gradient[own] - across @ solved[:, 0]
    h = information[np.ix_(own, own)] - across @ solved[:, 1:]
    small = np.diag(h) < _ROUNDING * np.diag(information)[own]
    g[small], h[small], h[:, small] = 0.0, 0.0, 0.0
    return g, h


__all__ = [
    "Direction",
    "change_along",
    "eliminated",
    "extended_by",
    "inserted",
    "projected",
    "with_freedoms",
]
