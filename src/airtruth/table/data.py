"""Tables for programs: CSV, JSON and pandas, with every digit."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from airtruth.table.model import Cell, Interval, Number, Pair, Table, Uncertain, flat

if TYPE_CHECKING:
    import pandas as pd

GROUP: Final = "group"
"""Name of the column that holds the headings of the groups."""

LABEL: Final = "label"
"""Name of a column that has none in the table."""

SECOND: Final = " (in brackets)"
"""Ending of the column that holds the second numbers of a column of pairs."""

ERROR: Final = " (standard error)"
"""Ending of the column that holds the standard errors of a column of estimates."""

LOWER: Final = " (lower)"
"""Ending of the column that holds the lower ends of a column of intervals."""

UPPER: Final = " (upper)"
"""Ending of the column that holds the upper ends of a column of intervals."""


def as_csv(table: Table) -> str:
    """Return header and rows with every digit; no title, no notes, an empty field where there is no number."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names, rows = _flattened(table)
    writer.writerow(names)
    writer.writerows(
        ["" if c is None else repr(c) if isinstance(c, float) else c for c in row] for row in rows
    )
    return out.getvalue()


def as_json(table: Table) -> str:
    """Return title, notes and the rows as objects; a number that is not finite is null."""
    names, rows = _flattened(table)
    objects = [dict(zip(names, row, strict=True)) for row in rows]
    return json.dumps({"title": table.title, "notes": list(table.notes), "rows": objects}, indent=2) + "\n"


def to_frame(table: Table) -> pd.DataFrame:
    """Return a DataFrame with the columns of `as_csv`; NaN where there is no number."""
    import pandas as pd

    names, rows = _flattened(table)
    return pd.DataFrame(list(rows), columns=list(names))


def from_frame(frame: pd.DataFrame, title: str) -> Table:
    """Return a table of the columns of a DataFrame, without its index.

    Raises
    ------
    ValueError
        If two columns have the same name.
    """
    rows = (tuple(_cell(value) for value in row) for row in frame.itertuples(index=False, name=None))
    return flat(title, tuple(str(name) for name in frame.columns), rows)


def _cell(value: object) -> Cell:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value)
    return "" if value is None else str(value)


def _flattened(table: Table) -> tuple[tuple[str, ...], Iterator[tuple[str | float | int | None, ...]]]:
    """Names and rows: a column for the groups' headings if there are any, several for pairs and intervals."""
    endings = [_endings(row[j] for row in table.rows) for j in range(len(table.columns))]
    names = [GROUP] if table.has_headings else []
    for column, own in zip(table.columns, endings, strict=True):
        names += [(column or LABEL) + ending for ending in own]

    def rows() -> Iterator[tuple[str | float | int | None, ...]]:
        for group in table.groups:
            for row in group.rows:
                cells: list[str | float | int | None] = [group.heading] if table.has_headings else []
                for cell, own in zip(row, endings, strict=True):
                    parts = _parts(cell)
                    cells += [parts.get(ending) for ending in own]
                yield tuple(cells)

    return tuple(names), rows()


def _endings(cells: Iterable[Cell]) -> tuple[str, ...]:
    """Endings of the columns that hold the parts of the cells, the first empty."""
    return tuple(dict.fromkeys(["", *(ending for cell in cells for ending in _parts(cell))]))


def _parts(cell: Cell) -> dict[str, str | float | int | None]:
    """Ending of the column -> plain value; a number that is not finite is None."""
    if isinstance(cell, Pair):
        return {"": _finite(cell.first), SECOND: _finite(cell.second)}
    if isinstance(cell, Uncertain):
        return {"": _finite(cell.value), ERROR: _finite(cell.error)}
    if isinstance(cell, Interval):
        return {"": _finite(cell.value), LOWER: _finite(cell.lower), UPPER: _finite(cell.upper)}
    if isinstance(cell, Number | float):
        return {"": _finite(cell)}
    return {"": cell}


def number_of(cell: Cell) -> float | int | None:
    """The number of a cell, of a pair or an interval the first; None if it has no finite one."""
    value = _parts(cell)[""]
    return None if isinstance(value, str) else value


def _finite(number: Number | float) -> float | None:
    value = float(number)
    return value if math.isfinite(value) else None
