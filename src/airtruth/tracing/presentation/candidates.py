"""The candidates of a trace in the order of a report: accepted effects first, then by significance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from airtruth.table import MISSING, Number, Row, Table, flat, significant
from airtruth.tracing.answer import CandidateScore, TraceAnswer

_SMALLEST: Final = 1e-300
"""Probability below which only the bound is printed [-]; near the smallest number of double precision."""


@dataclass(frozen=True)
class RankedCandidate:
    """A candidate of a report.

    Attributes
    ----------
    candidate : its score.
    gain : gain in 2 log L of its refit [-]; None for a candidate that was not accepted.
    outcome : "accepted", or why it was not.
    """

    candidate: CandidateScore
    gain: float | None
    outcome: str


def ranked(answer: TraceAnswer) -> list[RankedCandidate]:
    """Every candidate: accepted effects first, with the gain of their refit, then the others by significance."""
    gains = {e.key: e.gain_2_log_likelihood for e in answer.effects}
    order = {key: i for i, key in enumerate(gains)}
    candidates = sorted(answer.candidates, key=lambda c: order.get(c.key, len(order)))
    return [RankedCandidate(c, gains.get(c.key), outcome(c, answer)) for c in candidates]


def outcome(candidate: CandidateScore, answer: TraceAnswer) -> str:
    """Why a candidate was not accepted, or that it was."""
    if candidate.why_not:
        return candidate.why_not
    leading = {e.key for e in answer.effects}
    return "accepted" if candidate.key in leading else "explains the records as well as the accepted one"


def probability(p_value: float) -> str:
    """``p = 0.012``, or ``p < 1e-300`` where the number underflows."""
    return f"p < {_SMALLEST:g}" if p_value < _SMALLEST else f"p = {significant(p_value, 2)}"


def candidate_table(answer: TraceAnswer) -> Table:
    """Score, p-value, gain of the refit and outcome of every candidate."""
    rows: list[Row] = []
    for r in ranked(answer):
        c = r.candidate
        score = Number(c.score, digits=3) if c.testable else MISSING
        p = probability(c.p_value).removeprefix("p = ").removeprefix("p ") if c.testable else MISSING
        gain = MISSING if r.gain is None else Number(r.gain, digits=3)
        rows.append((c.key, score, p, gain, r.outcome))
    return flat("Candidates", ("effect", "score", "p (Holm)", "refit gain", "outcome"), rows)


__all__ = ["RankedCandidate", "candidate_table", "outcome", "probability", "ranked"]
