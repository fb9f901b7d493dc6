"""The derivatives of a trace, declared and refitted, laid out once for every format."""

from __future__ import annotations

import math

from airtruth.physics.short_period import PARAMETERS
from airtruth.table import Number, Table, flat
from airtruth.tracing.answer import TraceAnswer


def derivative_table(answer: TraceAnswer) -> Table:
    """Return the six derivatives: declared, refitted without and with the effects, and the last's standard deviation."""
    stated = answer.derivatives
    rows = [("declared", stated.declared, 4), ("before", stated.before, 4)]
    if answer.effects:
        rows.append(("after", stated.after, 4))
    rows.append(("std", stated.after_std, 2))
    if answer.declared_model is not None:
        shifts = answer.declared_model.shifts
        rows.insert(1, ("declared std", {name: s.declared_std for name, s in shifts.items()}, 2))
        rows.append(("shift/declared std", {name: s.sigma for name, s in shifts.items()}, 2))
    return flat(
        "Derivatives at the trim [1/rad, rates as q c/(2V)]",
        ("", *PARAMETERS),
        [
            (stage, *(Number(values.get(name, math.nan), digits=digits) for name in PARAMETERS))
            for stage, values, digits in rows
        ],
        (
            "before: refitted without an effect; after: with the effects; std: standard deviation of the last of them. "
            "declared std: mass, inertia and CG included.",
        ),
    )


__all__ = ["derivative_table"]
