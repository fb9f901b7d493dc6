"""The answer of a trace as HTML, for notebooks and for the parts of a report."""

from __future__ import annotations

from airtruth.table import as_html, escaped
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.candidates import candidate_table
from airtruth.tracing.presentation.error_table import error_table
from airtruth.tracing.presentation.text import effect_details, effect_line, verdict


def as_trace_html(answer: TraceAnswer) -> str:
    """Verdict, effects, errors, candidates and next flight as one HTML fragment."""
    parts = [
        verdict_html(answer),
        as_html(error_table(answer)),
        as_html(candidate_table(answer)),
        f"<p>Next flight: {escaped(answer.next_flight)}</p>",
    ]
    return "\n".join(parts)


def verdict_html(answer: TraceAnswer) -> str:
    """Verdict and effects as paragraphs; the verdict has the class "verdict"."""
    paragraphs = [f'<p class="verdict">{escaped(verdict(answer))}</p>']
    for effect in answer.effects:
        lines = (line.strip() for line in effect_details(effect, answer.credit.get(effect.key)))
        details = "; ".join(lines) + "."
        line = escaped(effect_line(effect))
        paragraphs.append(f"<p><strong>{line}</strong><br>{escaped(details)}</p>")
    return "\n".join(paragraphs)


__all__ = ["as_trace_html", "verdict_html"]
