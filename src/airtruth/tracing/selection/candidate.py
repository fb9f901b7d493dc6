"""An effect that was refitted beside a null, and the tests that it fails."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from airtruth.tracing.anomalies.score_test import Score
from airtruth.tracing.inference.posterior import PosteriorFit


class Refusal(StrEnum):
    """A test that a candidate fails; as a string it is the sentence of the answer."""

    UNCONVERGED = "its refit did not converge"
    OUTDONE = "another effect explains more"
    IMMATERIAL = "its size is immaterial"
    WORSE_LIKELIHOOD = "it worsens the likelihood of records left out"
    WORSE_FREE_RUN = "it worsens the free run of records left out"
    WRONG_SIGN = "its size has a sign that no aircraft has"
    BEYOND_ENDS = "its size is beyond the ends of the aircraft"
    AT_LIMIT = "its size ends at the limit of the plausible range"
    WEAK_EVIDENCE = "its evidence is not significant"
    WITHIN_ERROR = "its size is within two standard deviations"


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


__all__ = ["Candidate", "Refusal"]
