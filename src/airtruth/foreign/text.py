"""Tables in text files."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.foreign.dates import seconds_of_text
from airtruth.foreign.encoding import decoded
from airtruth.foreign.header import WHITESPACE, HeaderTable, cells_of, find_table, is_number
from airtruth.foreign.source import Source, table_source

if TYPE_CHECKING:
    import pandas as pd

_DELIMITER_LINE: Final = re.compile(r'\s*"?sep=(.)"?\s*', re.IGNORECASE)
"""First line by which a spreadsheet states the delimiter."""


@dataclass(frozen=True)
class TextFormat:
    """Delimiter, decimal sign, lines to skip, whether the first row names the columns, encoding (None: by their look)."""

    delimiter: str = ","
    decimal: str = "."
    skip_rows: int = 0
    header: bool | None = None
    encoding: str | None = None


def read_text(path: Path, layout: TextFormat) -> Source:
    """Read a table of text; lines that begin with # or % are comments.

    Prose before the table is left out, a row of units below the names is the units of the source, and dates and times of
    day are seconds. A first line ``sep=;`` states the delimiter.

    Raises
    ------
    StoreError
        If the file is no text, or no table, or its header does not fit its columns.
    ConfigurationError
        If delimiter and decimal sign are the same.
    """
    text, encoding, notes = decoded(path, layout.encoding)
    lines = text.split("\n")
    blank = []
    while lines and not lines[-1].strip():
        blank.append(lines.pop())
    first = layout.skip_rows
    stated = delimiter_line(lines[0]) if lines else None
    if stated is not None and not layout.skip_rows:
        first = 1
        if layout.delimiter == TextFormat.delimiter:
            layout = replace(layout, delimiter=stated)
    if layout.delimiter == layout.decimal:
        raise ConfigurationError(
            f"{path}: {layout.decimal!r} is both [source] delimiter and decimal; state another delimiter"
        )
    while first < len(lines) and (not lines[first].strip() or names_a_comment(lines[first])):
        first += 1
    if first >= len(lines):
        raise StoreError(f"{path}: holds no rows; export it again, or lower [source] skip_rows")
    comments = [number for number, line in enumerate(lines[first:], first + 1) if names_a_comment(line)]
    rows = [*lines[:first], *(line for line in lines[first:] if not names_a_comment(line))]
    try:
        table = find_table(rows, first, layout.delimiter, layout.decimal, layout.header)
    except ValueError as error:
        raise StoreError(f"{path}: {error}") from None
    if table.first >= len(rows):
        raise StoreError(f"{path}: holds a header and no rows; export it again")
    plain = not comments and encoding == "utf-8" and blank in ([], [""])
    frame = _frame(path, None if plain else "\n".join(rows), layout, table)
    frame = _named_columns(path, frame, table)
    columns, dates = [], []
    for i in range(frame.shape[1]):
        values, dated = _values(frame.iloc[:, i].to_numpy(), layout.decimal)
        columns.append(values)
        dates.append(dated)
    if layout.delimiter == WHITESPACE:
        _require_whole_rows(path, rows, table, columns[-1])
    passed = 0
    for number in comments:
        passed += number <= table.first + 1 + passed
    return table_source(
        path,
        table.names,
        columns,
        first_line=table.first + 1 + passed,
        comments=comments[passed:],
        dates=[name for name, dated in zip(table.names, dates, strict=False) if dated],
        units=table.units,
        notes=(*notes, *_prose(path, table)),
    )


def delimiter_line(line: str) -> str | None:
    """Delimiter that a first line ``sep=;`` states; None if it is another line."""
    found = _DELIMITER_LINE.fullmatch(line)
    return found[1] if found else None


def names_a_comment(line: str) -> bool:
    """Whether a line begins with # or %."""
    return line.lstrip().startswith(("#", "%"))


def _frame(path: Path, text: str | None, layout: TextFormat, table: HeaderTable) -> pd.DataFrame:
    """Cells of the table, from its text, or from the file."""
    import pandas as pd

    try:
        return pd.read_csv(
            path if text is None else io.StringIO(text),
            sep=layout.delimiter,
            decimal=layout.decimal,
            header=None,
            names=list(range(table.width)),
            skiprows=table.first,
            index_col=False,
            skip_blank_lines=False,
            skipinitialspace=True,
            encoding="utf-8-sig",
        )
    except (ValueError, pd.errors.ParserError, pd.errors.ParserWarning) as error:
        raise StoreError(f"{path}: is not a table ({reason(error)}); check [source] delimiter") from None


def _named_columns(path: Path, frame: pd.DataFrame, table: HeaderTable) -> pd.DataFrame:
    """Columns that have names; further ones are empty, because each row ends with a delimiter."""
    count = len(table.names) or frame.shape[1]
    if not frame.iloc[:, count:].isna().all(axis=None):
        raise StoreError(
            f"{path}: is not a table (a row has more values than the header {count} names); check [source] delimiter and "
            "skip_rows"
        )
    return frame.iloc[:, :count]


def _values(values: NDArray[Any], decimal: str) -> tuple[NDArray[Any], bool]:
    """Cells of a column, and whether they are dates; pandas leaves a column that also holds text as it is."""
    if values.dtype.kind != "O":
        return values, False
    dated = seconds_of_text(values)
    if dated is not None:
        return dated, True
    if decimal == ".":
        return values, False
    cells = [
        cell.strip().replace(decimal, ".") if isinstance(cell, str) and is_number(cell, decimal) else cell
        for cell in values
    ]
    return np.array(cells, dtype=object), False


def _require_whole_rows(path: Path, rows: list[str], table: HeaderTable, last: NDArray[Any]) -> None:
    """Refuse a row between blanks that lacks a value: its values belong to other columns."""
    import pandas as pd

    for row in np.flatnonzero(pd.isna(last)):
        line = rows[table.first + int(row)]
        count = len(cells_of(line, WHITESPACE))
        if 0 < count < table.width:
            raise StoreError(
                f"{path}: a row has {count} values where the table has {table.width} columns, so that its values cannot be "
                f"told apart: {line.strip()[:60]!r}; write NaN where a value is missing, delete the row, or export the "
                "table with commas"
            )


def _prose(path: Path, table: HeaderTable) -> list[str]:
    if table.skipped < 0:
        return []
    return [f"{path.name}: {table.skipped + 1} lines before the names of the columns were left out"]


__all__ = ["WHITESPACE", "TextFormat", "delimiter_line", "is_number", "names_a_comment", "read_text"]
