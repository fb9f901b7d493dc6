"""Where the table of a text file begins: prose, names, a row of units, and then the values."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from airtruth.foreign.dates import is_time
from airtruth.foreign.unit_words import are_units

WHITESPACE: Final = r"\s+"
"""Delimiter of columns that any number of blanks separate."""
_COMPARED: Final = 20
"""Rows from the middle of a file that say what its rows hold [-] (judgement)."""
_SEARCHED: Final = 400
"""First rows among which the table begins [-] (judgement: a prose header is shorter)."""
_SHOWN: Final = 60
"""Characters of a line that an error quotes [-] (judgement)."""


@dataclass(frozen=True)
class HeaderTable:
    """Names and units of the columns of a table, and its first row.

    Attributes
    ----------
    first : index of the first row of values among the lines.
    names : one for each column; () if the columns are numbered.
    units : one for each column, as the file has them; () without a row of units.
    width : number of columns.
    skipped : index of the last line of prose before the names; -1 without prose.
    """

    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    width: int
    skipped: int = -1


def cells_of(line: str, delimiter: str) -> list[str]:
    """Cells of a row; a quoted one may hold the delimiter."""
    if delimiter == WHITESPACE:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a cell longer than the library allows
        return line.split(delimiter)


def find_table(
    lines: Sequence[str], first: int, delimiter: str, decimal: str, header: bool | None
) -> HeaderTable:
    """The table of a file.

    The rows in the middle of the file say how many columns there are, and which of them hold numbers. The values begin
    with the first row that agrees with these. The names are the last row of as many words before them; where this row
    holds units, the names are the row above it.

    Parameters
    ----------
    lines : of the file, without comments in the table.
    first : index of the first line that is looked at, which is neither empty nor a comment.
    delimiter, decimal, header : how the file is read; header None decides by the look of the rows.

    Raises
    ------
    ValueError
        If no row of names fits the columns; what, and the cure.
    """
    rows = [i for i in range(first, len(lines)) if lines[i].strip()]
    sample = [cells_of(lines[i], delimiter) for i in rows[len(rows) // 2 :][:_COMPARED]]
    width = Counter(_width(cells) for cells in sample).most_common(1)[0][0]
    numeric = {j for cells in sample for j, cell in enumerate(cells) if _is_value(cell, decimal)}
    whole = max(width, *(len(cells) for cells in sample))
    head = rows[:_SEARCHED]
    start = next((i for i in head if _is_row(cells_of(lines[i], delimiter), numeric, whole, decimal)), None)
    if header is False or (header is None and start == first):
        raw = len(cells_of(lines[first], delimiter))
        return HeaderTable(first, (), (), max(width, raw))
    before = [first] if header is True or start is None else [i for i in head if i < start]
    words = {i: _words(lines[i], delimiter, width, whole) for i in before}
    fitting = [i for i in before if (w := words[i]) is not None and not any(is_number(c, decimal) for c in w)]
    if header is True and first not in fitting and words[first] is not None:
        fitting = [first]  # numbers as names, as stated
    if not fitting:
        raise ValueError(_misfit(lines, before, delimiter, width, start))
    at = fitting[-1]
    if len(fitting) > 1 and rows.index(at) == rows.index(fitting[-2]) + 1 and are_units(words[at] or ()):
        at = fitting[-2]
    names = words[at] or []
    after = rows.index(at) + 1
    units: list[str] = []
    if after < len(rows) - 1:
        below = _words(lines[rows[after]], delimiter, len(names), len(names))
        if (
            below is not None
            and are_units(below)
            and not any(is_number(c, decimal) and c != "1" for c in below)
        ):
            units, after = below, after + 1
    begin = rows[after] if after < len(rows) else len(lines)
    prose = max((i for i in before if i < at), default=-1)
    return HeaderTable(begin, tuple(names), tuple(units), max(whole, len(names)), prose)


def _width(cells: Sequence[str]) -> int:
    """Number of cells without the empty ones at the end."""
    count = len(cells)
    while count and not cells[count - 1].strip():
        count -= 1
    return count


def _is_row(cells: Sequence[str], numeric: set[int], whole: int, decimal: str) -> bool:
    """Whether cells are a row of the table: a value or nothing wherever the rows of the middle hold values."""
    held = [cells[j].strip() for j in numeric if j < len(cells)]
    return (
        bool(numeric)
        and _width(cells) <= whole
        and any(held)
        and all(not cell or _is_value(cell, decimal) for cell in held)
        and (len(numeric) < 2 or len(cells) > 1)
    )


def _words(line: str, delimiter: str, width: int, whole: int) -> list[str] | None:
    """A row of names or units that fits the columns; None if it does not."""
    if delimiter != WHITESPACE:
        cells = cells_of(line, delimiter)
        count = _width(cells)
        fits = width <= count <= whole or (len(cells) == whole and count <= width)
        return [cell.strip() for cell in cells[: max(count, width)]] if fits else None
    for words in _readings(line):
        if len(words) == width:
            return words
    return None


def _readings(line: str) -> list[list[str]]:
    """Ways to divide a line of names between blanks: a unit in brackets belongs to the name before it."""
    glued = re.sub(r"\s+(?=[\[({][^\[\](){}]*[\])}])", "\0", line.strip())
    glued = re.sub(r"[\[({][^\[\](){}]*[\])}]", lambda match: re.sub(r"\s+", "\0", match[0]), glued)
    quoted = re.findall(r'"([^"]*)"', line)
    return [
        quoted if line.count('"') == 2 * len(quoted) and not re.sub(r'"[^"]*"', "", line).strip() else [],
        line.split(),
        [word.replace("\0", " ") for word in glued.split()],
        re.split(r"\t|\s{2,}", line.strip()),
    ]


def _misfit(
    lines: Sequence[str], before: Sequence[int], delimiter: str, width: int, start: int | None
) -> str:
    """Names that do not fit the columns, and what to do."""
    line = lines[before[-1]].strip()
    count = _width(cells_of(line, delimiter))
    kind = "words" if delimiter == WHITESPACE else "names"
    skipped = start if start is not None else before[-1] + 1
    return (
        f"the first row has {width} values and the header {count} {kind}, which are not one for each column: "
        f"{line[:_SHOWN]!r}; check [source] delimiter, correct the header to {width} names, or state [source] skip_rows = "
        f"{skipped} and header = false, and number the columns"
    )


def _is_value(text: str, decimal: str) -> bool:
    return is_number(text, decimal) or is_time(text)


def is_number(text: str, decimal: str) -> bool:
    """Whether a cell holds a number with this decimal sign."""
    try:
        float(text.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True


__all__ = ["WHITESPACE", "HeaderTable", "cells_of", "find_table", "is_number"]
