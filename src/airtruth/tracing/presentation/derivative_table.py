"""The derivatives of a trace, declared and refitted, laid out once for every format."""

from __future__ import annotations

import math
from typing import Final

from airtruth.table import Number, Row, Table, Uncertain, flat
from airtruth.tracing.answer import TraceAnswer

MOST_COLUMNS: Final = 6
"""Most derivatives in the columns of the table [-] (judgement: more make lines that no screen holds)."""


def derivative_table(answer: TraceAnswer) -> Table:
    """Return the derivatives with their standard errors: declared, refitted without and with the effects."""
    stated = answer.derivatives
    shifts = {} if answer.declared_model is None else answer.declared_model.shifts
    refitted = ("before", "after") if answer.effects else ("before",)
    rows = [("declared", stated.declared, {name: s.declared_std for name, s in shifts.items()})]
    rows += [
        (name, getattr(stated, name), stated.after_std if name == refitted[-1] else {}) for name in refitted
    ]
    motion = answer.motion
    names = motion.parameters
    cells: list[Row] = [
        (stage, *(_estimate(values, errors, name) for name in names)) for stage, values, errors in rows
    ]
    if shifts:
        sigmas = (Number(shifts[d].sigma if d in shifts else math.nan, digits=2) for d in names)
        cells.append(("shift/declared std", *sigmas))
    columns: tuple[str, ...] = ("", *names)
    if len(names) > MOST_COLUMNS:  # one row for each derivative
        columns = ("", *(str(row[0]) for row in cells))
        cells = [(name, *(row[k] for row in cells)) for k, name in enumerate(names, start=1)]
    return flat(
        f"Derivatives at the trim [{motion.derivative_units}]",
        columns,
        cells,
        (
            "before: refitted without an effect; after: with the effects; +-: standard error, of a declared value its standard "
            "uncertainty with those of mass, inertia and CG.",
        ),
    )


def _estimate(values: dict[str, float], errors: dict[str, float], name: str) -> Uncertain:
    return Uncertain(Number(values.get(name, math.nan)), Number(errors.get(name, math.nan), digits=2))


__all__ = ["derivative_table"]
