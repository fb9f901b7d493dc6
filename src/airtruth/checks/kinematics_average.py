"""Size of an error with an interval that allows for the errors that the records cannot separate from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.kinematics_fit import Fit
from airtruth.checks.kinematics_search import ErrorSearch

Array = NDArray[np.float64]

ODDS: Final = 0.1
"""Prior odds of an error for the average over sets [-]: judgement, one instrument error in ten is present."""
DRAWS: Final = 4000
"""Draws from the sizes of each set [-]: judgement; the ends of an interval then err by 2 % of its length."""
ONE_SIDED: Final = 4.0
"""Length of an interval over its distance from zero above which the interval of a lag or a delay, which is never
negative, is one-sided [-]: judgement; the lower end then is within a standard error of zero."""
LEAST_WEIGHT: Final = 1e-3
"""Weight of a set, relative to the largest, below which it has no part in an interval [-]: judgement."""


@dataclass(frozen=True)
class Estimate:
    """Size of an error [SI].

    Attributes
    ----------
    name : which error.
    value, std, lower, upper : mean, standard deviation and 95 % interval over all sets that contain it.
    alone : standard error with the best explanation only.
    """

    name: str
    value: float
    std: float
    lower: float
    upper: float
    alone: float


def averaged(found: ErrorSearch, name: str, usual: Mapping[str, float]) -> Estimate:
    """Size of an error, averaged over all sets that contain it.

    The weights are the posterior probabilities of the sets (J. A. Hoeting et al., *Statistical Science* 14(4), 1999,
    eqs 1 to 4), with normal priors of the usual sizes and `ODDS` for each error. The statistic is taken as quadratic
    about its least value, the limits of the sizes cut the distribution, and the deviations are those of Student's
    distribution, because the weight is an estimate.

    Where every set that contains the error ended at a limit, the interval is the whole range.
    """
    sets = [e.fit for e in found.tried if name in e.names and np.isfinite(e.fit.covariance).all()]
    if not sets:
        low, high = found.problem.limits[name]
        ended = [
            dict(zip(e.fit.names, e.fit.value, strict=True))[name] for e in found.unsound if name in e.names
        ]
        value = float(ended[0]) if ended else found.problem.start(name)
        return Estimate(name, value, (high - low) / float(np.sqrt(12.0)), low, high, high - low)
    parts = [_posterior(found, one, usual) for one in sets]
    logs = np.array([log for _, _, log in parts])
    weights = np.exp(logs - logs.max())
    values, shares = [], []
    for one, (mean, covariance, _), weight in zip(sets, parts, weights, strict=True):
        if weight < LEAST_WEIGHT:
            continue
        inside = _draws(found, one, mean, covariance)
        values.append(inside[:, one.names.index(name)])
        shares.append(np.full(len(inside), weight / DRAWS))
    drawn, share = np.concatenate(values), np.concatenate(shares)
    order = np.argsort(drawn)
    drawn, share = drawn[order], share[order] / share.sum()
    lower, upper = np.interp([0.025, 0.975], np.cumsum(share), drawn)
    limit = found.problem.limits[name][0]
    if (
        found.problem.kinematics.errors[name].kind in ("lag", "delay")
        and (lower - limit) * ONE_SIDED < upper - lower
    ):
        lower, upper = np.array([limit, np.interp(0.95, np.cumsum(share), drawn)])
    centre = float(share @ drawn)
    spread = float(np.sqrt(share @ (drawn - centre) ** 2))
    base = found.best.names | {name}
    stds = {frozenset(one.names): one.std[one.names.index(name)] for one in sets}
    alone = float(stds.get(base, min(stds.values())) * np.sqrt(found.enlargement))
    return Estimate(name, centre, spread, float(lower), float(upper), alone)


def _posterior(found: ErrorSearch, one: Fit, usual: Mapping[str, float]) -> tuple[Array, Array, float]:
    """Mean and covariance of the sizes of a set without limits, and the logarithm of its weight."""
    start = np.array([found.problem.start(n) for n in one.names])
    prior = np.diag(np.array([usual[n] for n in one.names]) ** 2)
    data = found.enlargement * one.covariance
    both = prior + data
    gain = np.linalg.solve(both, prior).T
    mean = start + gain @ (one.free - start)
    covariance = gain @ data
    step = one.value - one.free
    least = one.statistic - float(step @ np.linalg.pinv(one.covariance, rcond=1e-12, hermitian=True) @ step)
    off = one.free - start
    _, spread = np.linalg.slogdet(both)
    _, width = np.linalg.slogdet(data)
    log = -0.5 * max(least, 0.0) / found.enlargement - 0.5 * float(off @ np.linalg.solve(both, off))
    log += 0.5 * (width - spread) + len(one.names) * float(np.log(ODDS))
    return mean, 0.5 * (covariance + covariance.T), log


def _draws(found: ErrorSearch, one: Fit, mean: Array, covariance: Array) -> Array:
    """Draws of the sizes of a set inside their limits; the fitted sizes where hardly any is inside."""
    rng = np.random.default_rng(17)
    degrees = found.problem.weight.degrees
    if found.enlargement > 1.0:
        degrees = min(degrees, found.problem.weight.span.shape[1] - len(one.names))
    size = np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    tail = np.sqrt(degrees / rng.chisquare(degrees, DRAWS))
    draws = mean + size * ((rng.standard_normal((DRAWS, len(mean))) @ root.T) * tail[:, None])
    low, high = np.array([found.problem.limits[n] for n in one.names]).T
    inside = draws[((draws >= low) & (draws <= high)).all(axis=1)]
    return inside if len(inside) > DRAWS // 100 else one.value[None]


__all__ = ["Estimate", "averaged"]
