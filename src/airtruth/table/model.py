"""A table: title, columns, groups of rows and notes; numbers keep all their digits and carry their format."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import pandas as pd

MISSING: Final = "-"
"""Text of a cell without a finite number."""

DIGITS: Final = 4
"""Significant digits of a number without a format [-]; judgement: an estimate's error is rarely below 0.1 %."""

_WIDEST: Final = 1e5
"""Size from which a number with fixed decimals is written as a power of ten; judgement: width of a column."""

_PLAIN_EXPONENTS: Final = range(-4, 6)
"""Decimal exponents for which a number with significant digits is written without a power of ten; judgement."""


@dataclass(frozen=True)
class Number:
    """A number with the format in which people read it.

    Attributes
    ----------
    value : the number in full, NaN if there is none.
    decimals : fixed number of decimals; None for significant digits.
    digits : significant digits, where ``decimals`` is None.
    mark : text after the number, such as "*".
    """

    value: float
    decimals: int | None = None
    digits: int = DIGITS
    mark: str = ""

    def __str__(self) -> str:
        shown = (
            significant(self.value, self.digits)
            if self.decimals is None
            else fixed(self.value, self.decimals)
        )
        return shown + self.mark

    def __float__(self) -> float:
        return float(self.value)


@dataclass(frozen=True)
class Pair:
    """A number followed by a second one in brackets, as published tables print it; an estimate with its error is `Uncertain`."""

    first: Number
    second: Number

    def __str__(self) -> str:
        return f"{self.first} ({self.second})"


@dataclass(frozen=True)
class Uncertain:
    """An estimate with its standard error: ``4.526 +- 0.022``; without a finite error, the number alone."""

    value: Number
    error: Number

    def __str__(self) -> str:
        return f"{self.value} +- {self.error}" if math.isfinite(self.error.value) else str(self.value)


@dataclass(frozen=True)
class Interval:
    """A number and the ends of its 95 % interval: ``4.79 [4.37, 5.20]``."""

    value: Number
    lower: Number
    upper: Number

    def __str__(self) -> str:
        return f"{self.value} [{self.lower}, {self.upper}]"


Cell = str | float | int | Number | Pair | Uncertain | Interval
"""A cell; a bare float is shown with `DIGITS` significant digits."""

Row = tuple[Cell, ...]


@dataclass(frozen=True)
class Group:
    """Rows under one heading, "" for none; LaTeX puts the rows of a supplement into a second table."""

    heading: str
    rows: tuple[Row, ...]
    supplement: bool = False


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    title : one line.
    columns : names of the columns, with their unit where they have one.
    groups : groups of rows, each row as long as ``columns``.
    notes : sentences below the table.
    keys : number of leading columns that identify a row; text repeats them where a wide table continues below.
    """

    title: str
    columns: tuple[str, ...]
    groups: tuple[Group, ...]
    notes: tuple[str, ...] = ()
    keys: int = 1

    def __post_init__(self) -> None:
        if len(set(self.columns)) < len(self.columns):
            raise ValueError(f"table {self.title!r}: two columns have the same name: {self.columns}")
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(f"table {self.title!r}: a row does not have {len(self.columns)} cells")

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of all groups."""
        return tuple(row for group in self.groups for row in group.rows)

    @property
    def has_headings(self) -> bool:
        """Whether a group has a heading."""
        return any(group.heading for group in self.groups)

    def is_text(self, column: int) -> bool:
        """Whether a column holds text alone; writers align it to the left, as they do the first column."""
        return column == 0 or all(isinstance(row[column], str) for row in self.rows)

    def to_frame(self) -> pd.DataFrame:
        """The table as a pandas DataFrame, see `airtruth.table.to_frame`."""
        from airtruth.table.data import to_frame

        return to_frame(self)

    def __str__(self) -> str:
        from airtruth.table.text import as_text

        return as_text(self)

    def _repr_html_(self) -> str:
        from airtruth.table.html import as_html

        return as_html(self)


def flat(title: str, columns: Sequence[str], rows: Iterable[Row], notes: Iterable[str] = ()) -> Table:
    """Return a table without groups."""
    return Table(title, tuple(columns), (Group("", tuple(rows)),), tuple(notes))


def fixed(value: float, decimals: int) -> str:
    """Format a number with fixed decimals; as a power of ten from 1e5 on, which would be too wide to read."""
    if not math.isfinite(value):
        return MISSING
    return f"{value:.{decimals}f}" if abs(value) < _WIDEST else f"{value:.2e}"


def significant(value: float, digits: int = 3) -> str:
    """Format a number with significant digits; as a power of ten below 1e-4 and from 1e6 on."""
    if not math.isfinite(value):
        return MISSING
    exponent = math.floor(math.log10(abs(value))) if value else 0
    if exponent in _PLAIN_EXPONENTS:
        return f"{value:.{max(0, digits - 1 - exponent)}f}"
    return f"{value:.{digits - 1}e}"


def shown(cell: Cell) -> str:
    """Text of a cell."""
    return significant(cell, DIGITS) if isinstance(cell, float) else str(cell)


__all__ = [
    "MISSING",
    "Cell",
    "Group",
    "Interval",
    "Number",
    "Pair",
    "Row",
    "Table",
    "Uncertain",
    "fixed",
    "flat",
    "shown",
    "significant",
]
