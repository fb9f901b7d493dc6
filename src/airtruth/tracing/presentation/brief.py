"""The text that `airtruth trace` prints by default: one screen, the result first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from airtruth.table import Group, Table, as_text
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.candidates import probability
from airtruth.tracing.presentation.derivative_table import MOST_COLUMNS, derivative_table
from airtruth.tracing.presentation.error_table import MEANING, error_table
from airtruth.tracing.presentation.text import (
    candidate_lines,
    effect_line,
    opening,
    sets_line,
    wrapped,
)

MOST_LINES: Final = 40
"""Lines of the text [-] (judgement: one screen)."""
_MOST_CANDIDATES: Final = 3
"""Candidates of an answer without an effect [-] (judgement)."""
_REASON: Final = "provisional"
"""Word of a note that makes an answer provisional."""
_SHOWN: Final = ("declared", "before", "after", "floor")
"""Stages of the short table of errors."""

Block = tuple[str, ...]


def as_brief_text(answer: TraceAnswer) -> str:
    """Verdict, effects, and as much of the rest as fits into `MOST_LINES`; the last line states what is left out."""
    head = [
        tuple(opening(answer)),
        tuple(
            line
            for e in answer.effects
            for line in (effect_line(e), _significance(e.p_value, e.indistinguishable_from))
        ),
    ]
    notes = _notes(answer)
    reasons = sum(_REASON in note for note in answer.notes)
    # (rank in the room, block) in the order of the text: reasons have room first, and the next step has it before other notes
    ranked = [
        (1, _errors(answer)),
        (2, _derivatives(answer)),
        *((0, note) for note in notes[:reasons]),
        *((4, note) for note in notes[reasons:]),
        *((5, block) for block in _causes(answer)),
        (3, _outcome(answer)),
    ]
    room = MOST_LINES - sum(map(_height, head)) - _height(_more(len(notes)))
    kept: set[int] = set()
    for k in sorted(range(len(ranked)), key=lambda k: ranked[k][0]):
        if _height(ranked[k][1]) <= room:
            kept.add(k)
            room -= _height(ranked[k][1])
    left_out = sum(rank in (0, 4) for k, (rank, _) in enumerate(ranked) if k not in kept)
    blocks = [*head, *(ranked[k][1] for k in sorted(kept)), _more(left_out)]
    return "\n\n".join("\n".join(block) for block in blocks if block)


def _height(block: Sequence[str]) -> int:
    """Lines of a block with the empty line that follows it."""
    return len(block) + 1 if block else 0


def _significance(p_value: float, alike: Sequence[str]) -> str:
    words = (
        f"looks the same in these records: {', '.join(alike)}"
        if alike
        else "no other effect explains the records as well"
    )
    return f"  {probability(p_value)}; {words}"


def _errors(answer: TraceAnswer) -> Block:
    """The free run of the records that the report shows, one row for each channel."""
    table = error_table(answer)
    if not table.groups:
        return ()
    first = table.groups[0]
    columns = [0, 1, *(j for j, name in enumerate(table.columns) if name in _SHOWN)]
    rows = tuple(tuple(row[j] for j in columns) for row in first.rows)
    names = tuple(table.columns[j] for j in columns)
    note = "; ".join(MEANING[name] for name in names if name in MEANING)
    short = Table(
        f"Root mean square of the error: {first.heading.lower()}", names, (Group("", rows),), (f"{note}.",)
    )
    return _lines(short)


def _derivatives(answer: TraceAnswer) -> Block:
    """Declared and last refitted derivatives with their standard errors."""
    if not answer.derivatives.declared:
        return ()
    table = derivative_table(answer)
    shown = ("declared", "after" if answer.effects else "before")
    if len(answer.motion.parameters) <= MOST_COLUMNS:
        rows = tuple(row for row in table.rows if row[0] in shown)
        return _lines(Table(table.title, table.columns, (Group("", rows),)))
    far = set(_farthest(answer))
    columns = [0, *(j for j, name in enumerate(table.columns) if name in shown)]
    rows = tuple(tuple(row[j] for j in columns) for row in table.rows if row[0] in far)
    title = f"{table.title}, farthest from the declaration"
    return _lines(Table(title, tuple(table.columns[j] for j in columns), (Group("", rows),)))


def _farthest(answer: TraceAnswer) -> list[str]:
    """The derivatives farthest from their declaration, in declared standard deviations; the first ones without a test."""
    names = list(answer.motion.parameters)
    if answer.declared_model is not None:
        shifts = answer.declared_model.shifts
        names.sort(key=lambda name: -abs(shifts[name].sigma) if name in shifts else 0.0)
    return names[:MOST_COLUMNS]


def _lines(table: Table) -> Block:
    """A table as text without the rule below its title."""
    title, _, _, *rest = as_text(table).rstrip("\n").splitlines()
    return (title, *rest)


def _outcome(answer: TraceAnswer) -> Block:
    """Next flight and updated aircraft."""
    aircraft = [f"Updated aircraft: {answer.updated_aircraft}"] if answer.updated_aircraft else []
    return (*wrapped("Next flight", answer.next_flight), *aircraft)


def _notes(answer: TraceAnswer) -> list[Block]:
    """Notes, those first that make the answer provisional."""
    ordered = sorted(answer.notes, key=lambda note: _REASON not in note)
    return [tuple(wrapped("Note", note + ".")) for note in ordered]


def _causes(answer: TraceAnswer) -> list[Block]:
    """Sets of causes, and the foremost candidates where no effect was accepted."""
    sets = [tuple(wrapped("Sets of causes", sets_line(answer)))] if len(answer.alternatives) > 1 else []
    if answer.effects:
        return sets
    return [*sets, ("Candidates, by significance:", *candidate_lines(answer, _MOST_CANDIDATES))]


def _more(notes: int) -> Block:
    """How to see the rest."""
    left = f"{notes} more note{'s' * (notes != 1)} and all tables" if notes else "All tables"
    return (f"{left}: --verbose, `airtruth report DIR`, or in Python `result.details()`.",)


__all__ = ["MOST_LINES", "as_brief_text"]
