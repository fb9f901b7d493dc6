"""Whether a refitted effect is accepted: significant, material, and no worse on records left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from airtruth.trace.fit import Fit, Problem
from airtruth.trace.holdout import Assessment, floor, leave_one_out, one_by_the_other
from airtruth.trace.lower import lower
from airtruth.trace.model import OFFSETS, S
from airtruth.trace.sandwich import MEMORY_S, inflation, long_run
from airtruth.trace.score import Score

Array = NDArray[np.float64]

UNCONVERGED: Final = "its refit did not converge"
OUTDONE: Final = "another effect explains more"
SUPERSEDED: Final = "it explains nothing beside another effect"
IMMATERIAL: Final = "its size is immaterial"
IMPROBABLE: Final = 0.001
"""Probability below which refitted derivatives contradict those declared."""
_ERRORS: Final = 2.0
_FREE_ERRORS: Final = 3.0
"""Standard errors by which a free run may seem worse: in rough air it is mostly gusts."""
_NEXT_TO_NOTHING: Final = 0.02
_ASTRAY: Final = 1e6
"""Residual over what gusts and sensors explain, beyond which a free run has left all bounds."""
_SEVERAL: Final = 3
"""Records from which their scatter can be told; of fewer, none may lose: what one alone shows has not repeated."""
_DERIVATIVES: Final = 6


@dataclass(frozen=True)
class Candidate:
    """An effect that was refitted.

    Attributes
    ----------
    score : what put it among the leading ones.
    found : its fit, all free.
    gain : 2 log L gained over the null with derivatives as free, less 2 per parameter beyond the first.
    likelihood_gain, free_run_gain : (records,) gains on records left out: log-likelihood; squared residual
        over what gusts and sensors explain. NaN where it was not judged.
    size, std : of the first parameter in its size coordinate.
    reasons : what it fails, in words; empty if it is accepted.
    """

    score: Score
    found: Fit
    gain: float
    likelihood_gain: Array
    free_run_gain: Array
    size: float
    std: float
    reasons: tuple[str, ...]


LeftOut = tuple[Array, list[Assessment]]
"""Negative log-likelihoods (records,) and assessments of records left out."""


@dataclass(frozen=True)
class Reference:
    """The fit that an effect is judged against, on records left out.

    Attributes
    ----------
    left_out : one for every way of leaving records out: `leave_one_out`, of two records `one_by_the_other` too.
    weight : (3,) of each record, what gusts and sensors explain of its free run.
    """

    left_out: tuple[LeftOut, ...]
    weight: tuple[Array, ...]


def reference_of(problem: Problem, null: Fit) -> Reference:
    """The null as the reference of every candidate of its round."""
    low = lower(null.hypothesis.change(null.point.sizes))
    weight = tuple(
        floor(record, problem, low, null.point.shared, local)
        for record, local in zip(problem.records, null.point.local, strict=True)
    )
    return Reference(tuple(way(problem, null) for way in _ways(problem)), weight)


def _ways(problem: Problem) -> tuple[Callable[[Problem, Fit], LeftOut], ...]:
    return (leave_one_out, one_by_the_other) if len(problem.records) == 2 else (leave_one_out,)


def unjudged(s: Score, found: Fit, gain: float, *reasons: str) -> Candidate:
    """A candidate that need not be judged, and why."""
    nothing = np.full(len(found.likelihood), np.nan)
    return Candidate(s, found, gain, nothing, nothing, *_size(s, found), reasons)


def judge(
    problem: Problem, s: Score, best: Fit, gain: float, reference: Reference, least: float
) -> Candidate:
    """Judge a refitted effect.

    Parameters
    ----------
    s, best, gain : its score, its fit, and what it gained.
    reference : the fit without it.
    least : gain in 2 log L that counts as significant, were the innovations white: what they owe to one another
        is taken off it (J. T. Kent, Biometrika 69 (1982): the ratio of robust to plain variance).
    """
    first = s.effect.parameters[0]
    size, std = _size(s, best)
    excess = float(inflation(problem, best)[S + _place(s, best)])
    for way, before in zip(_ways(problem), reference.left_out, strict=True):
        likelihood, assessed = way(problem, best)
        likelihood_gain, unaided = before[0] - likelihood, before[1]
        if not _lost(likelihood_gain):
            break
    free, spread = np.zeros(len(assessed)), 0.0
    for i, (old, new, weight) in enumerate(zip(unaided, assessed, reference.weight, strict=True)):
        if not (np.abs(old.residual) < _ASTRAY * weight).all():
            free[i] = 0.0 if (np.abs(new.residual) < _ASTRAY * weight).all() else -np.inf
            continue
        gains = (((old.residual / weight) ** 2) - ((new.residual / weight) ** 2)).sum(axis=1)
        free[i] = gains.sum()
        lags = round(MEMORY_S / problem.records[i].signals.dt_s)
        spread += max(float(long_run((gains - gains.mean())[:, None], lags)[0, 0]), 0.0)
    reasons = []
    if not arrived(best, gain):
        reasons.append(UNCONVERGED)
    if gain < least * excess**2:
        reasons.append("refitted, it explains nothing significant")
    if not first.one_sided and abs(size) < _ERRORS * std * excess:
        reasons.append("refitted, its size is no more than its uncertainty")
    if _lost(likelihood_gain):
        reasons.append("it worsens the likelihood of records left out")
    if not free.sum() > -_FREE_ERRORS * np.sqrt(spread):
        reasons.append("it worsens the free run of records left out")
    if abs(size) < first.material:
        reasons.append(IMMATERIAL)
    low_end, high_end = first.reach
    span = high_end - low_end
    if high_end - size < 1e-6 * span or (size - low_end < 1e-6 * span and low_end != 0.0):
        reasons.append("its size ends at the limit of what is plausible")
    return Candidate(s, best, gain, likelihood_gain, free, size, std, tuple(reasons))


def arrived(found: Fit, gain: float) -> bool:
    """Whether a fit has converged, or lacks next to nothing of what it gained: limits and play give no smooth cost."""
    return found.converged or 2.0 * found.shortfall < _NEXT_TO_NOTHING * gain


def declared_probability(problem: Problem, found: Fit) -> float:
    """Probability of refitted derivatives as far from the declared ones, by the declared uncertainty alone.

    Source: G. E. P. Box, J. R. Statist. Soc. A 143 (1980): the prior checked by what the data make of it. The
    mode is nearer to the prior than the likelihood's maximum, so the check is conservative.
    """
    off = found.point.shared[:_DERIVATIVES]
    tight = [i for i in range(_DERIVATIVES) if i not in found.hypothesis.loose]
    declared = problem.records[0].plant.derivative_cov[np.ix_(tight, tight)]
    return float(chi2.sf(float(off[tight] @ np.linalg.solve(declared, off[tight])), len(tight)))


def own_probability(problem: Problem, found: Fit) -> float:
    """Probability of biases and trim coefficients as far from the declared ones, as `declared_probability`."""
    total = 0.0
    for (middle, precision), local in zip(
        problem.own_priors(found.hypothesis), found.point.local, strict=True
    ):
        off = (local - middle)[list(OFFSETS)]
        total += float(off**2 @ np.diag(precision)[list(OFFSETS)])
    return float(chi2.sf(total, len(OFFSETS) * len(found.point.local)))


def _size(s: Score, found: Fit) -> tuple[float, float]:
    at = _place(s, found)
    return float(found.point.sizes[at]), float(np.sqrt(found.covariance[S + at, S + at]))


def _place(s: Score, found: Fit) -> int:
    """Index of the effect's first parameter among the sizes."""
    return len(found.point.sizes) - len(s.effect.parameters)


def _lost(gains: Array) -> bool:
    """Whether records left out lose: their sum is negative by more than two of its own standard errors.

    A record that the effect alone can follow has gained, one that it cannot has lost.
    """
    if np.isnan(gains).any() or gains.min() == -np.inf:
        return True
    gains = gains[np.isfinite(gains)]
    if gains.size == 0:
        return False
    total = float(gains.sum())
    if gains.size < _SEVERAL:
        return bool(gains.min() < 0.0)
    error = float(gains.std(ddof=1) * np.sqrt(gains.size))
    return total < -_ERRORS * error
