"""Notes of a kinematic check where alpha was computed from the channels that it would be compared with."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from airtruth.checks.result import CheckResult

COMPUTED: Final = (
    "alpha_rad was computed from airspeed_m_s, q_rad_s, az_m_s2 and, where they are recorded, ax_m_s2, theta_rad and altitude_m: "
    "it fits them by construction, which is no evidence, so errors of airspeed_m_s, az_m_s2 and ax_m_s2 are not assessed."
)
"""The first sentence of a check without a vane."""
REMEDY: Final = "Compare the airspeed with ground speed on opposite headings and az_m_s2 with gravity at rest, or record a vane."
"""Advice on finding the errors that remain."""
WITHOUT_ATTITUDE: Final = f"Without theta_rad q_rad_s is not assessed either. {REMEDY}"
"""The second sentence of a check without a vane and without a pitch attitude."""


def untestable(run_ids: Iterable[str], *sentences: str) -> CheckResult:
    """Return the result of a check in which no channel is left to compare with another.

    Parameters
    ----------
    run_ids : names of the runs; sentences : the reason.
    """
    return CheckResult(
        verdict="cannot_tell",
        run_ids=tuple(run_ids),
        findings=(),
        causes=(),
        statistic=0.0,
        degrees=0,
        p_value=1.0,
        enlargement=1.0,
        residual_rms={},
        sentences=sentences,
    )


def without_vane(result: CheckResult) -> CheckResult:
    """Return the result of a comparison of theta and q alone: it says nothing of the other channels."""
    words, verdict = result.sentences, result.verdict
    if verdict == "agrees":
        words = ("theta_rad follows the integral of q_rad_s; this alone was tested.", *words[1:])
        verdict = "cannot_tell"
    else:
        words = ("theta_rad and q_rad_s were compared with each other.", *words)
    return replace(result, verdict=verdict, sentences=(COMPUTED, *words, REMEDY))


__all__ = ["COMPUTED", "WITHOUT_ATTITUDE", "untestable", "without_vane"]
