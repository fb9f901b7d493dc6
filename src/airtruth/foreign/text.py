"""Tables in text files."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.foreign.source import Source, table_source

WHITESPACE = r"\s+"
"""Delimiter of columns that any number of blanks separate."""
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Marks of byte order that UTF-16 begins with."""


@dataclass(frozen=True)
class TextFormat:
    """Delimiter, decimal sign, lines to skip, and whether the first row names the columns (None: by its look)."""

    delimiter: str = ","
    decimal: str = "."
    skip_rows: int = 0
    header: bool | None = None


def read_text(path: Path, layout: TextFormat) -> Source:
    """Read a table of text in UTF-8; lines before it that begin with # or % are comments.

    Raises
    ------
    StoreError
        If the file is no text, or no table.
    ConfigurationError
        If delimiter and decimal sign are the same.
    """
    import pandas as pd

    try:
        with path.open(encoding="utf-8-sig") as file:
            lines = file.read().splitlines()
    except UnicodeDecodeError as error:
        raise StoreError(f"{path}: {_encoding(error.object, error.start)}") from None
    if "\0" in "".join(lines[:1]):
        raise StoreError(f"{path}: {_encoding(lines[0].encode(), lines[0].index(chr(0)))}")
    if layout.delimiter == layout.decimal:
        raise ConfigurationError(
            f"{path}: {layout.decimal!r} is both [source] delimiter and decimal; state another delimiter"
        )
    first = layout.skip_rows
    while first < len(lines) and (not lines[first].strip() or names_a_comment(lines[first])):
        first += 1
    if first >= len(lines):
        raise StoreError(f"{path}: holds no rows; export it again, or lower [source] skip_rows")
    header = layout.header
    if header is None:
        cells = lines[first].split(None if layout.delimiter == WHITESPACE else layout.delimiter)
        header = not any(is_number(cell, layout.decimal) for cell in cells)
    comments = [number for number, line in enumerate(lines[first:], first + 1) if names_a_comment(line)]
    rows = [line for line in lines[first:] if not names_a_comment(line)]
    plain = not comments
    _require_names(path, rows, layout.delimiter, header)
    try:
        frame = pd.read_csv(
            path if plain else io.StringIO("\n".join(rows)),
            sep=layout.delimiter,
            decimal=layout.decimal,
            header=0 if header else None,
            skiprows=first if plain else 0,
            index_col=False,
            skip_blank_lines=False,
            skipinitialspace=True,
            encoding="utf-8-sig",
        )
    except (ValueError, pd.errors.ParserError) as error:
        raise StoreError(f"{path}: is not a table ({reason(error)}); check [source] delimiter") from None
    if frame.empty:
        raise StoreError(f"{path}: holds a header and no rows; export it again")
    names = _own_names([str(name) for name in frame.columns], rows, layout.delimiter) if header else ()
    columns = [_numeric(frame.iloc[:, i].to_numpy(), layout.decimal) for i in range(frame.shape[1])]
    return table_source(path, names, columns, first_line=first + 1 + header, comments=comments)


def _numeric(values: NDArray[Any], decimal: str) -> NDArray[Any]:
    """Cells of a column that also holds text, its numbers with a decimal point: pandas leaves them as they are."""
    if decimal == "." or values.dtype.kind != "O":
        return values
    cells = [
        cell.strip().replace(decimal, ".") if isinstance(cell, str) and is_number(cell, decimal) else cell
        for cell in values
    ]
    return np.array(cells, dtype=object)


def names_a_comment(line: str) -> bool:
    """Whether a line begins with # or %."""
    return line.lstrip().startswith(("#", "%"))


def _own_names(names: list[str], rows: list[str], delimiter: str) -> list[str]:
    """Names of the header; pandas adds .1, .2 to one that is there again."""
    if delimiter == WHITESPACE:
        stated = rows[0].split()
    else:
        stated = next(csv.reader(rows, delimiter=delimiter, skipinitialspace=True), [])
    if len(stated) < len(names):
        return names
    return [
        own if own in stated[:i] and re.fullmatch(re.escape(own) + r"\.\d+", name) else name
        for i, (own, name) in enumerate(zip(stated, names, strict=False))
    ]


def _encoding(content: bytes, at: int) -> str:
    """What the encoding of a file that is not UTF-8 seems to be, and what to do."""
    if content[:2] in _UTF16_MARKS or content.count(0) > len(content) / 4:
        return "is not text in UTF-8 but probably in UTF-16; save it as UTF-8 (a spreadsheet: CSV UTF-8)"
    if re.search(rb"[\x00-\x08\x0b\x0e-\x1f]", content):
        return f"is not text in UTF-8 (byte {at + 1}); export it as text"
    sign = content[at : at + 1].decode("cp1252", "replace")
    return (
        f"is not text in UTF-8 but probably in Windows-1252 or Latin-1 (byte {at + 1} is {sign!r} there); save it as UTF-8 "
        "(a spreadsheet: CSV UTF-8)"
    )


def _require_names(path: Path, rows: list[str], delimiter: str, header: bool) -> None:
    """Refuse values without a name: a row of more cells than the header, but for empty ones at its end."""
    if delimiter == WHITESPACE or not header or len(rows) < 2:
        return
    names, cells = (next(csv.reader([row], delimiter=delimiter), []) for row in rows[:2])
    if any(cell.strip() for cell in cells[len(names) :]):
        raise StoreError(
            f"{path}: the first row has {len(cells)} values and the header {len(names)} names; check [source] delimiter and "
            "skip_rows"
        )


def is_number(text: str, decimal: str) -> bool:
    """Whether a cell holds a number with this decimal sign."""
    try:
        float(text.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True


__all__ = ["WHITESPACE", "TextFormat", "is_number", "names_a_comment", "read_text"]
