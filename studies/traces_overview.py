"""One table over several traces: verdict, effects with their sizes, held-out errors before and after."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from airtruth.table import MISSING, Cell, Group, Number, Row, Table, as_text, flat, significant, write_table
from airtruth.tracing.answer import AcceptedEffect, TraceAnswer
from airtruth.tracing.presentation.text import interval, largest_words, unit_of

NAME: Final = "traces"
"""Name of the files."""
COMPARED: Final = ("declared", "before", "after")
"""Stages of the table."""
LONG_COLUMNS: Final = ("log", "verdict", "effect", "parameter", "value", "lower", "upper")
"""Columns of the CSV file."""


def over_floor(answer: TraceAnswer, stage: str) -> float | None:
    """Innovations of a stage over the floor [-], the largest of the channels, on held-out records if there are any.

    None where the answer lacks the stage.
    """
    if stage not in answer.error.stages:
        return None
    records = "held_out" if answer.records.held_out else "fit"
    own, floor = (answer.error.stages[name].on(records) for name in (stage, "floor"))
    if own is None or floor is None:
        return None
    return max(own.innovation[c] / floor.innovation[c] for c in own.innovation)


def traces_table(answers: Mapping[str, TraceAnswer]) -> Table:
    """Lay out the table.

    Parameters
    ----------
    answers : name of the log -> its answer.
    """
    return Table(
        title="Traces",
        columns=("log", "verdict", "effect", "value (95 %)", *COMPARED, "p left"),
        groups=(
            Group(
                "Effects, and the errors over the floor",
                tuple(r for name, a in answers.items() for r in _rows(name, a)),
            ),
        ),
        notes=(
            "declared, before, after: root mean square of the innovations in held-out records over the floor of gusts "
            "and sensor noise, largest of the channels; before: derivatives and biases refitted; after: the effects "
            "too. p left: probability of the remaining anomaly.",
        ),
    )


def _rows(name: str, answer: TraceAnswer) -> Iterator[Row]:
    errors = [over_floor(answer, stage) for stage in COMPARED]
    tail: tuple[Cell, ...] = (
        *(MISSING if e is None else Number(e, digits=3) for e in errors),
        Number(answer.remaining.p_value, digits=2),
    )
    verdict = answer.verdict + (" (provisional)" if answer.provisional else "")
    lines = [line for effect in answer.effects for line in _lines(effect)] or [(MISSING, MISSING)]
    for number, (effect, size) in enumerate(lines):
        if number == 0:
            yield name, verdict, effect, size, *tail
        else:
            yield "", "", effect, size, *[""] * len(tail)


def _lines(effect: AcceptedEffect) -> Iterator[tuple[str, str]]:
    if effect.table is not None:
        yield effect.key, largest_words(effect.table, effect.over or "")
    stated = effect.parameters if effect.table is None else {}
    for number, (parameter, estimate) in enumerate(stated.items()):
        size = f"{parameter} {significant(estimate.value)} {unit_of(effect.key, parameter)}".rstrip()
        yield effect.key if number == 0 else "", f"{size} ({interval(estimate)})"
    if effect.indistinguishable_from:
        yield "", "or " + ", ".join(effect.indistinguishable_from)


def long_form(answers: Mapping[str, TraceAnswer]) -> Table:
    """Return one row per parameter of each accepted effect, in SI."""
    rows: list[Row] = []
    for name, answer in answers.items():
        if not answer.effects:
            rows.append((name, answer.verdict, *[""] * 5))
        for effect in answer.effects:
            for parameter, estimate in effect.parameters.items():
                numbers = ("" if x is None else x for x in (estimate.value, *estimate.ci95))
                rows.append((name, answer.verdict, effect.key, parameter, *numbers))
    return flat("Traces", LONG_COLUMNS, rows)


def write_traces(answers: Mapping[str, TraceAnswer], out: Path) -> tuple[str, tuple[Path, ...]]:
    """Write traces.md, traces.csv and traces.tex; return the table as plain text, and the files.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    table = traces_table(answers)
    return as_text(table), write_table(table, out, NAME, long_form(answers))


__all__ = ["NAME", "long_form", "over_floor", "traces_table", "write_traces"]
