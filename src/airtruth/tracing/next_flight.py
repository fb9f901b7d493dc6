"""The flight that would tell more than the records of a trace."""

from __future__ import annotations

from collections.abc import Sequence

from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.tracing.anomalies.families import advice
from airtruth.tracing.answer import VerdictName
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.selection.candidate import Candidate


def next_flight(
    effects: Sequence[tuple[Candidate, tuple[Candidate, ...]]],
    verdict: VerdictName,
    remaining: HypothesisTest,
    learned: Sequence[str],
    motion: Motion,
) -> str:
    """The recommended next flight, in words.

    Parameters
    ----------
    effects : accepted effects, each with those that explain the records as well; verdict : of the answer.
    remaining : evidence of what the answer lacks; learned : where increments are least certain.
    motion : of the records.
    """
    if verdict == "none":
        return (
            "These records show no missing effect down to the sizes listed under detectability; larger or longer "
            "manoeuvres lower these sizes."
        )
    lines = []
    if verdict == "unexplained":
        lines.append("The declared aircraft lacks something that no candidate explains.")
    for best, others in effects:
        names = {c.score.effect.key: c.score.effect for c in (best, *others)}
        if len({e.name for e in names.values()}) > 1:
            ways: dict[str, list[str]] = {}
            for key, effect in names.items():
                ways.setdefault(effect.distinguished_by, []).append(key)
            split = " ".join(f"{', '.join(keys)}: {way}" for way, keys in ways.items() if way)
            computed = (
                " `airtruth plan --from` computes the input that separates them most."
                if motion is LONGITUDINAL
                else ""
            )
            lines.append(f"Separate {', '.join(names)} as follows. {split}{computed}")
    lines += learned
    if remaining.p_value <= CRITERION.significant:
        lines.append(f"The remaining residual shows in {remaining.null}: {advice(remaining.null, motion)}")
    return " ".join(lines) or (
        "Repeat the manoeuvre with the largest residual, with opposite "
        f"{' and '.join(c.name for c in motion.controls)} sign."
    )


__all__ = ["next_flight"]
