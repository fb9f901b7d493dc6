"""An effect that was refitted beside a null."""

from __future__ import annotations

from dataclasses import dataclass

from airtruth.tracing.anomalies.score_test import Score
from airtruth.tracing.inference.posterior import PosteriorFit


@dataclass(frozen=True)
class Candidate:
    """A refitted effect.

    Attributes
    ----------
    score, fit : its score at the null, and the fit with all parameters free.
    gain : gain in 2 log L over the null, less 2 for each parameter beyond the first.
    reasons : tests that it fails, in words; empty if it is accepted.
    """

    score: Score
    fit: PosteriorFit
    gain: float
    reasons: tuple[str, ...] = ()


__all__ = ["Candidate"]
