"""The layout of a table of text, from its first rows: delimiter and decimal sign."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from airtruth.foreign.encoding import head_of
from airtruth.foreign.formats import SUFFIXES
from airtruth.foreign.text import WHITESPACE, delimiter_line, is_number, names_a_comment
from airtruth.importers.mapping import SourceSection

_HEAD_BYTES: Final = 65_536
"""Part of a file that is looked at [byte] (judgement: some hundred rows)."""
_PROSE: Final = 200
"""Rows that may be prose [-] (judgement)."""
_ROWS: Final = 30
"""Rows that are compared [-] (judgement)."""
_LAYOUTS: Final = {
    "csv": ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", "."), ("|", ",")),
    "table": (
        (WHITESPACE, "."),
        (WHITESPACE, ","),
        (",", "."),
        (";", "."),
        (";", ","),
        ("|", "."),
        ("|", ","),
    ),
}
"""Format that a suffix names -> delimiters and decimal signs; of equal ones the first is taken."""


def guess_layout(path: Path | str) -> SourceSection:
    """How a file is read: of a table of text the layout that finds the most numbers, of others the defaults."""
    path = Path(path)
    name = SUFFIXES.get(path.suffix.lower(), "")
    if name not in _LAYOUTS or not path.is_file():
        return SourceSection()
    rows = _first_rows(path)
    delimiter, decimal = max(_LAYOUTS[name], key=lambda layout: _numbers(rows, *layout))
    stated = {"decimal": decimal}
    if delimiter != WHITESPACE:
        stated |= {"format": "csv", "delimiter": delimiter} if name == "table" else {"delimiter": delimiter}
    return SourceSection.model_validate(stated)


def _first_rows(path: Path) -> list[str]:
    """Rows that are no comments; the last one of a part of a file may be cut."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError:  # the reader of the file reports it
        return []
    lines = head_of(head).split("\n")
    whole = lines[:-1] if len(head) == _HEAD_BYTES else lines
    rows = [line for line in whole if line.strip() and not names_a_comment(line)]
    return [line for line in rows[:_PROSE] if delimiter_line(line) is None][-_ROWS:]


def _numbers(rows: Sequence[str], delimiter: str, decimal: str) -> float:
    """Cells with a number, times their share of all cells that are not empty."""
    try:
        table = (
            [row.split() for row in rows]
            if delimiter == WHITESPACE
            else list(csv.reader(rows, delimiter=delimiter))
        )
    except csv.Error:
        return 0.0
    cells = [cell for row in table for cell in row if cell.strip()]
    found = sum(is_number(cell, decimal) for cell in cells)
    return found * found / len(cells) if cells else 0.0


__all__ = ["guess_layout"]
