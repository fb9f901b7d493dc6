"""Tables as plain text and as Markdown."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from airtruth.table.model import Table, shown

WIDTH: Final = 120
"""Width of plain text [characters]; judgement: half of a wide screen."""

_HEADER_WIDTH: Final = 14
"""Width at which the name of a column continues on the next line [characters]; judgement: a cell with error."""


def as_text(table: Table, width: int = WIDTH) -> str:
    """Return plain text; columns that do not fit side by side continue below, under the key columns again."""
    lines = [table.title, "=" * min(len(table.title), width)]
    for columns in _blocks(table, width):
        lines += ["", *_block(table, (*range(table.keys), *columns))]
    for note in table.notes:
        lines += textwrap.wrap(note, width, initial_indent="- ", subsequent_indent="  ")
    return "\n".join(lines) + "\n"


def as_markdown(table: Table) -> str:
    """Return GitHub-flavoured Markdown; a group's heading is a row in bold."""
    lines = [f"### {_escaped(table.title)}", "", _markdown_row(_escaped(name) for name in table.columns)]
    rules = (" :--- " if table.is_text(j) else " ---: " for j in range(len(table.columns)))
    lines.append("|" + "|".join(rules) + "|")
    for group in table.groups:
        if group.heading:
            lines.append(_markdown_row([f"**{group.heading}**", *[""] * (len(table.columns) - 1)]))
        for row in group.rows:
            first, *rest = (_escaped(shown(cell)) for cell in row)
            lines.append(_markdown_row([first.replace("  ", "&emsp;"), *rest]))
    if table.notes:
        lines += ["", *(f"- {_escaped(note)}" for note in table.notes)]
    return "\n".join(lines) + "\n"


def _blocks(table: Table, width: int) -> list[range]:
    """Columns after the keys, in blocks that fit side by side, as even as possible."""
    widths = [_width(table, j) + 2 for j in range(len(table.columns))]
    keys, widths = widths[: table.keys], widths[table.keys :]
    room = width + 2 - sum(keys)
    for count in range(1, len(widths) + 1):
        size = math.ceil(len(widths) / count)
        starts = range(0, len(widths), size)
        if size == 1 or all(sum(widths[i : i + size]) <= room for i in starts):
            return [range(table.keys + i, table.keys + min(i + size, len(widths))) for i in starts]
    return [range(table.keys, table.keys)]


def _width(table: Table, column: int) -> int:
    cells = (shown(row[column]) for row in table.rows)
    return max(len(words) for words in [*cells, *_header(table.columns[column])])


def _header(name: str) -> list[str]:
    return textwrap.wrap(name, _HEADER_WIDTH, break_on_hyphens=True) or [""]


def _block(table: Table, columns: Sequence[int]) -> Iterator[str]:
    widths = [_width(table, j) for j in columns]
    left = [table.is_text(j) for j in columns]

    def line(cells: Iterable[str]) -> str:
        padded = (c.ljust(w) if at else c.rjust(w) for c, w, at in zip(cells, widths, left, strict=True))
        return "  ".join(padded).rstrip()

    heads = [_header(table.columns[j]) for j in columns]
    tall = max(len(head) for head in heads)
    for i in range(tall):
        yield line([head[i - tall + len(head)] if i >= tall - len(head) else "" for head in heads])
    rule = "-" * (sum(widths) + 2 * (len(widths) - 1))
    for group in table.groups:
        yield rule
        if group.heading:
            yield group.heading
        for row in group.rows:
            yield line([shown(row[j]) for j in columns])
    yield rule


def _escaped(words: str) -> str:
    return re.sub(r"([\\|*_<>])", r"\\\1", words)


def _markdown_row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"
