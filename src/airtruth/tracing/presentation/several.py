"""The answers of one or several motions together: text, HTML and JSON, each motion under its heading or name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from airtruth.table import escaped
from airtruth.tracing.answer import TraceAnswer

Format = Callable[[TraceAnswer], str]


def by_motion(answers: Sequence[TraceAnswer]) -> Mapping[str, Any]:
    """The content of trace.json; of several answers, name of the motion -> its content."""
    if len(answers) == 1:
        return answers[0].to_dict()
    return {answer.motion.name: answer.to_dict() for answer in answers}


def under_headings(form: Format, answers: Sequence[TraceAnswer]) -> str:
    """Each answer as text, of several ones under the heading of its motion."""
    if len(answers) == 1:
        return form(answers[0])
    return "\n\n".join(f"{answer.motion.heading}\n\n{form(answer)}" for answer in answers)


def html_under_headings(form: Format, answers: Sequence[TraceAnswer]) -> str:
    """Each answer as HTML, of several ones under the heading of its motion."""
    if len(answers) == 1:
        return form(answers[0])
    return "\n".join(f"<h2>{escaped(answer.motion.heading)}</h2>\n{form(answer)}" for answer in answers)


__all__ = ["by_motion", "html_under_headings", "under_headings"]
