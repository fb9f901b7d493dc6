"""Maximum of a likelihood by Fisher scoring with a Levenberg-Marquardt damping, many groups at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identify.filter_options import (
    FilterOptions,
    declared_values,
    free_parameters,
    prior_weights,
)
from airtruth.identify.results import Status

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Scored = tuple[Array, Array, Array]
"""Negative log-likelihood (active,), its gradient (active, free), information (active, free, free)."""

_SMALLEST_DAMPING: Final = 1e-3
_LARGEST_DAMPING: Final = 1e9
_POOR: Final = 0.25
_GOOD: Final = 0.75
_LARGEST_THETA: Final = 1e6


@dataclass(frozen=True)
class Fit:
    """Maximum of the likelihood of each group of runs.

    Attributes
    ----------
    z : (groups, parameters) derivatives, then logarithms of the levels; NaN where there is none.
    covariance : (groups, free, free) inverse of the information, prior of the levels included.
    status, iterations : (groups,).
    """

    z: Array
    covariance: Array
    status: NDArray[np.int8]
    iterations: NDArray[np.int32]


def search(
    evaluate: Callable[[Array, Ints], Scored], start: Array, levels: Array, options: FilterOptions
) -> Fit:
    """Maximise the likelihood of each group, damped where a step does not help.

    Parameters
    ----------
    evaluate : (z (active, parameters), active) -> `Scored` of those groups.
    start : (groups, 6) derivatives.
    levels : (groups, levels) declared values, about which the prior is and where the search starts.
    options : which levels are estimated, their prior, and how to search.
    """
    groups, six = start.shape
    free = free_parameters(options)
    declared = declared_values(options, levels)
    weight = prior_weights(options)
    # of the free parameters, the levels: all between the derivatives and the moment of the trim
    level = slice(six, np.searchsorted(free, six + levels.shape[1]))

    def posterior(z: Array, active: Ints) -> tuple[Array, Array, Array, Array]:
        cost, gradient, information = evaluate(z, active)
        # a level that the record does not show enters J by its square s^2 alone: information ~ s^4, while
        # the curvature in log s is twice the gradient
        hidden = np.zeros_like(gradient)
        known = np.diagonal(information, axis1=1, axis2=2)
        hidden[:, level] = np.maximum(2.0 * gradient - known, 0.0)[:, level]
        off = z[:, free] - declared[np.ix_(active, free)]
        cost = cost + 0.5 * (weight * off**2).sum(axis=1)
        cost = np.where(np.isfinite(cost), cost, np.inf)
        information = information + np.diag(weight)
        return (
            cost,
            gradient + weight * off,
            information,
            information + hidden[:, :, None] * np.eye(free.size),
        )

    z = declared.copy()
    z[:, :six] = start
    status = np.full(groups, Status.DIVERGED, dtype=np.int8)
    iterations = np.zeros(groups, dtype=np.int32)
    covariance = np.full((groups, free.size, free.size), np.nan)
    damping = np.full(groups, _SMALLEST_DAMPING)
    cost = np.full(groups, np.inf)
    gradient = np.zeros((groups, free.size))
    information = np.zeros((groups, free.size, free.size))
    curvature = np.zeros_like(information)
    active = np.flatnonzero(np.isfinite(start).all(axis=1))
    if active.size:
        cost[active], gradient[active], information[active], curvature[active] = posterior(z[active], active)
    active = active[np.isfinite(cost[active])]
    status[active] = Status.MAXIMUM_ITERATIONS
    for _ in range(options.maximum_iterations):
        regular = (np.diagonal(information[active], axis1=1, axis2=2) > 0.0).all(axis=1)
        status[active[~regular]] = Status.SINGULAR
        active = active[regular]
        if not active.size:
            break
        iterations[active] += 1
        whole = _step(gradient[active], curvature[active], np.zeros(active.size))
        size = np.sqrt(np.abs((gradient[active] * whole).sum(axis=1)))
        done = size <= options.tolerance
        finished = active[done]
        z[np.ix_(finished, free)] += whole[done]
        status[finished] = Status.CONVERGED
        active = active[~done]
        if not active.size:
            break
        step = _step(gradient[active], curvature[active], damping[active])
        # a level changes by a factor of e at most at a time
        step /= np.maximum(1.0, np.abs(step[:, level]).max(axis=1, initial=0.0))[:, None]
        trial = z[active]
        trial[:, free] += step
        c, g, i, h = posterior(trial, active)
        better = c < cost[active]
        # of what the quadratic model promised; the information can be half the curvature, and a whole step
        # then only swaps one side of the minimum for the other
        bent = np.einsum("gi,gij,gj->g", step, curvature[active], step)
        promised = -(gradient[active] * step).sum(axis=1) - 0.5 * bent
        kept = (cost[active] - c) / np.maximum(promised, 1e-300)
        taken = active[better]
        z[taken], cost[taken] = trial[better], c[better]
        gradient[taken], information[taken], curvature[taken] = g[better], i[better], h[better]
        damping[active] *= np.select([~better, kept < _POOR, kept > _GOOD], [10.0, 3.0, 0.1], 1.0)
        damping = np.maximum(damping, _SMALLEST_DAMPING)
        active = active[damping[active] < _LARGEST_DAMPING]
    ended = np.isin(status, (Status.CONVERGED, Status.MAXIMUM_ITERATIONS))
    wild = ended & ~(np.abs(z[:, :six]) < _LARGEST_THETA).all(axis=1)
    status[wild] = Status.DIVERGED
    known = np.flatnonzero(ended & ~wild)
    covariance[known] = _inverse(information[known])
    z[~np.isin(np.arange(groups), known)] = np.nan
    return Fit(z, covariance, status, iterations)


def _normalised(information: Array) -> tuple[Array, Array]:
    size = np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    # keeps a factorisation from meeting an exact zero; far below what rounding leaves
    correlation = information / (size[:, :, None] * size[:, None, :]) + 1e-14 * np.eye(size.shape[1])
    return correlation, size


def _step(gradient: Array, information: Array, damping: Array) -> Array:
    correlation, size = _normalised(information)
    correlation = correlation + damping[:, None, None] * np.eye(size.shape[1])
    step: Array = -np.linalg.solve(correlation, (gradient / size)[:, :, None])[:, :, 0] / size
    return step


def _inverse(information: Array) -> Array:
    correlation, size = _normalised(information)
    inverse: Array = np.linalg.inv(correlation) / (size[:, :, None] * size[:, None, :])
    return inverse
