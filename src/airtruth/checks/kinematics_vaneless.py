"""Notes of a kinematic check where alpha was computed from the channels that it would be compared with."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from airtruth.checks.result import CheckResult
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import NEEDED

_SPEED, _RATE, _NORMAL = NEEDED
COMPUTED: Final = (
    f"{LONGITUDINAL.vane} was computed from {', '.join(NEEDED)} and, where they are recorded, ax_m_s2, theta_rad and altitude_m: "
    f"it fits them by construction, which is no evidence, so errors of {_SPEED}, {_NORMAL} and ax_m_s2 are not assessed."
)
"""The first sentence of a check without a vane."""
REMEDY: Final = (
    "Compare the airspeed with ground speed on opposite headings and "
    f"{_NORMAL} with gravity at rest, or record a vane."
)
"""Advice on finding the errors that remain."""
WITHOUT_ATTITUDE: Final = f"Without theta_rad {_RATE} is not assessed either. {REMEDY}"
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
        words = (f"theta_rad follows the integral of {_RATE}; this alone was tested.", *words[1:])
        verdict = "cannot_tell"
    else:
        words = (f"theta_rad and {_RATE} were compared with each other.", *words)
    return replace(result, verdict=verdict, sentences=(COMPUTED, *words, REMEDY))


__all__ = ["COMPUTED", "WITHOUT_ATTITUDE", "untestable", "without_vane"]
