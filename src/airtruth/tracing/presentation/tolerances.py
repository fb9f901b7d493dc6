"""The table of the free runs of a trace against the tolerances of a training simulator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Final

from airtruth.table import MISSING, Cell, Group, Number, Row, Table
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.error_table import SET_NAMES
from airtruth.tracing.stage_errors import SETS, STAGES, Excursions, Tolerances
from airtruth.units import DEG, G0

_QUANTITIES: Final = (
    ("pitch_rad", "pitch [deg]", DEG),
    ("q_rad_s", "q [deg/s]", DEG),
    ("az_m_s2", "az [g]", G0),
)
"""Field of `Excursions`, name with the display unit, and that unit in SI."""


def tolerance_table(answer: TraceAnswer) -> Table | None:
    """Largest distances of the free runs beside their tolerance, per stage, held-out records first.

    Returns
    -------
    The table; None where the answer states no tolerances.
    """
    stated = answer.tolerances
    if stated is None:
        return None
    names = [stage for stage in STAGES if stage in stated.stages]
    groups = []
    for records in SETS:
        cells = [stated.stages[name].on(records) for name in names]
        if any(cells):
            heading = f"Largest distance, free run, {SET_NAMES[records]}"
            groups.append(Group(heading, tuple(_rows(stated, cells))))
    return Table(
        title="Tolerances of a training simulator",
        columns=("", "tolerance", *names),
        groups=tuple(groups),
        notes=(
            f"Source: {stated.source} (short-period dynamics): pitch or q, and az. pitch is the integral of the "
            "distance in q from the start of the record. samples inside: mean over the records. records within: "
            "number of records that stay inside throughout. In gusts, most of a distance is the response to the gusts.",
        ),
        keys=2,
    )


def _rows(stated: Tolerances, cells: Sequence[Excursions | None]) -> Iterator[Row]:
    for name, heading, unit in _QUANTITIES:
        limit = Number(stated.limits.get(name, math.nan) / unit, digits=2)
        yield heading, limit, *_row(cells, partial(_distance, name, unit))
    yield "samples inside [%]", 100, *_row(cells, lambda e: Number(100.0 * e.share_inside, decimals=0))
    records = next(e.records for e in cells if e is not None)
    yield "records within", records, *_row(cells, lambda e: e.records_within)


def _distance(name: str, unit: float, e: Excursions) -> Cell:
    return Number(getattr(e, name) / unit, digits=3)


def _row(cells: Sequence[Excursions | None], cell: Callable[[Excursions], Cell]) -> Row:
    return tuple(MISSING if e is None else cell(e) for e in cells)


__all__ = ["tolerance_table"]
