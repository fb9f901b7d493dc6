"""Whether a refitted effect is accepted: significant, material, and no worse on records left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.trace.fit import Fit, Problem
from airtruth.trace.holdout import Assessment, floor, leave_one_out
from airtruth.trace.lower import lower
from airtruth.trace.model import S
from airtruth.trace.score import Score

Array = NDArray[np.float64]

UNCONVERGED: Final = "its refit did not converge"
IMMATERIAL: Final = "its size is immaterial"
_SIGNIFICANT: Final = 10.0
_ERRORS: Final = 2.0
_MEMORY_S: Final = 1.0


@dataclass(frozen=True)
class Candidate:
    """An effect that was refitted.

    Attributes
    ----------
    score : what put it among the leading ones.
    found : its fit, all free.
    gain : 2 log L gained over the null, less 2 per parameter beyond the first.
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


@dataclass(frozen=True)
class Reference:
    """The fit that an effect is judged against, on records left out.

    Attributes
    ----------
    likelihood, assessed : what `leave_one_out` says of it.
    weight : (3,) of each record, what gusts and sensors explain of its free run.
    """

    likelihood: Array
    assessed: tuple[Assessment, ...]
    weight: tuple[Array, ...]


def reference_of(problem: Problem, null: Fit) -> Reference:
    """The null as the reference of every candidate of its round."""
    likelihood, found = leave_one_out(problem, null)
    low = lower(null.hypothesis.change(null.point.sizes))
    weight = tuple(
        floor(record, problem, low, null.point.shared, local)
        for record, local in zip(problem.records, null.point.local, strict=True)
    )
    return Reference(likelihood, tuple(found), weight)


def outdone(s: Score, found: Fit, gain: float) -> Candidate:
    """A candidate that need not be judged: an accepted one explains more."""
    nothing = np.full(len(found.likelihood), np.nan)
    return Candidate(s, found, gain, nothing, nothing, *_size(s, found), ("another effect explains more",))


def judge(problem: Problem, s: Score, best: Fit, gain: float, reference: Reference) -> Candidate:
    """Judge a refitted effect.

    Parameters
    ----------
    s, best, gain : its score, its fit, and what it gained.
    reference : the fit without it.
    """
    first = s.effect.parameters[0]
    size, std = _size(s, best)
    likelihood, assessed = leave_one_out(problem, best)
    likelihood_gain = reference.likelihood - likelihood
    free, spread = np.zeros(len(assessed)), 0.0
    for i, (before, after, weight) in enumerate(
        zip(reference.assessed, assessed, reference.weight, strict=True)
    ):
        gains = (((before.residual / weight) ** 2) - ((after.residual / weight) ** 2)).sum(axis=1)
        free[i] = gains.sum()
        spread += long_run_variance(gains, round(_MEMORY_S / problem.records[i].signals.dt_s))
    reasons = []
    if not best.converged:
        reasons.append(UNCONVERGED)
    if gain < _SIGNIFICANT:
        reasons.append("refitted, it explains nothing significant")
    if not first.one_sided and abs(size) < _ERRORS * std:
        reasons.append("refitted, its size is no more than its uncertainty")
    if _lost(likelihood_gain):
        reasons.append("it worsens the likelihood of records left out")
    if not free.sum() > -_ERRORS * np.sqrt(spread):
        reasons.append("it worsens the free run of records left out")
    if abs(size) < first.material:
        reasons.append(IMMATERIAL)
    low_end, high_end = first.reach
    span = high_end - low_end
    if high_end - size < 1e-6 * span or (size - low_end < 1e-6 * span and low_end != 0.0):
        reasons.append("its size ends at the limit of what is plausible")
    return Candidate(s, best, gain, likelihood_gain, free, size, std, tuple(reasons))


def long_run_variance(x: Array, lags: int) -> float:
    """Variance of the sum of a serially dependent series (samples,), Bartlett weights.

    Source: W. K. Newey and K. D. West, Econometrica 55 (1987).
    """
    off = x - x.mean()
    total = float(off @ off)
    for k in range(1, min(lags, len(x) - 1) + 1):
        total += 2.0 * (1.0 - k / (lags + 1.0)) * float(off[k:] @ off[:-k])
    return max(total, 0.0)


def _size(s: Score, found: Fit) -> tuple[float, float]:
    at = len(found.point.sizes) - len(s.effect.parameters)
    return float(found.point.sizes[at]), float(np.sqrt(found.covariance[S + at, S + at]))


def _lost(gains: Array) -> bool:
    """Whether records left out lose: their sum is negative by more than two of its own standard errors."""
    total = float(gains.sum())
    if not np.isfinite(total):
        return True
    error = float(gains.std(ddof=1) * np.sqrt(gains.size)) if gains.size > 2 else 0.0
    return total < -_ERRORS * error
