"""Why a refitted effect is not accepted: values for the search, each with its sentence for the answer."""

from __future__ import annotations

from enum import StrEnum


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


__all__ = ["Refusal"]
