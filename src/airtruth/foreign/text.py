"""Tables in text files."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.foreign.source import Source

WHITESPACE = r"\s+"
"""Delimiter of columns that any number of blanks separate."""


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
        raise StoreError(
            f"{path}: is not text in UTF-8 ({error.reason} at byte {error.start}); save it as UTF-8"
        ) from None
    if layout.delimiter == layout.decimal:
        raise ConfigurationError(
            f"{path}: {layout.decimal!r} is both [source] delimiter and decimal; state another delimiter"
        )
    first = layout.skip_rows
    while first < len(lines) and (not lines[first].strip() or lines[first].lstrip()[0] in "#%"):
        first += 1
    if first >= len(lines):
        raise StoreError(f"{path}: holds no rows; export it again, or lower [source] skip_rows")
    header = layout.header
    if header is None:
        cells = lines[first].split(None if layout.delimiter == WHITESPACE else layout.delimiter)
        header = not any(_is_number(cell, layout.decimal) for cell in cells)
    rows = [line for line in lines[first:] if not line.lstrip().startswith(("#", "%"))]
    plain = len(rows) == len(lines) - first
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
    arrays = {
        str(name).strip() if header else f"{i}": frame.iloc[:, i - 1].to_numpy()
        for i, name in enumerate(frame.columns, 1)
    }
    return Source(path, arrays, first_line=first + 1 + header)


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


def _is_number(text: str, decimal: str) -> bool:
    try:
        float(text.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True


__all__ = ["WHITESPACE", "TextFormat", "read_text"]
