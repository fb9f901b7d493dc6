"""Records that differ beside the effects of an answer: a fault, a loading or a condition of single records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.homogeneity import Homogeneity

_AGREE: Final = 0.01
"""Probability of the agreement of the others from which a record is named [-] (convention)."""


def differences(test: Homogeneity, records: Sequence[str], names: bool) -> list[str]:
    """How the records differ, a sentence without a final period; none where they do not.

    Parameters
    ----------
    test : of the answer's effects; records : names of the fitted records, in its order.
    names : whether the answer has effects, which then are provisional.
    """
    if test.p_value >= CRITERION.differ:
        return []
    differ = (
        "the fitted records contradict each other in derivatives or sizes of effects "
        f"(p = {test.p_value:.2g}){', so the answer is provisional' if names else ''}"
    )
    if test.outlier is None:
        return [f"{differ}; two records do not show which of them is wrong: fly a third"]
    if test.rest_p_value < _AGREE:
        return [
            f"{differ}; no single record is the reason: look for what changes from record to record (mass, CG, flaps, wear, "
            "amplitude)"
        ]
    odd = records[test.outlier]
    return [
        f"{differ}; without {odd} the others agree (p = {test.rest_p_value:.2g}): look for a fault or another loading in {odd} "
        "alone, or for an effect that only its amplitude shows, and trace the others without it"
    ]


__all__ = ["differences"]
