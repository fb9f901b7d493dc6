"""Tables as HTML."""

from __future__ import annotations

import html
from collections.abc import Sequence

from airtruth.table.data import number_of
from airtruth.table.model import Row, Table, shown


def escaped(words: str) -> str:
    """Return plain text as HTML; the "+-" of a terminal becomes a sign."""
    return html.escape(words).replace("+-", "\u00b1")


def as_html(table: Table) -> str:
    """Return a table element with its caption; the notes follow as paragraphs of the class "note".

    Cells of text have the class "words", rows with a group's heading the class "group".
    """
    text = [table.is_text(j) for j in range(len(table.columns))]

    marks = [' class="words"' if left else "" for left in text]
    heads = (f"<th{mark}>{escaped(name)}</th>" for name, mark in zip(table.columns, marks, strict=True))
    lines = [
        f"<table><caption>{escaped(table.title)}</caption>",
        f"<thead><tr>{''.join(heads)}</tr></thead>",
    ]
    for group in table.groups:
        lines.append("<tbody>")
        if group.heading:
            span = f'colspan="{len(table.columns)}"'
            lines.append(f'<tr class="group"><th {span}>{escaped(group.heading)}</th></tr>')
        lines += [_cells(cells, marks) for cells in group.rows]
        lines.append("</tbody>")
    lines.append("</table>")
    lines += [f'<p class="note">{escaped(note)}</p>' for note in table.notes]
    return "\n".join(lines) + "\n"


def _cells(cells: Row, marks: Sequence[str]) -> str:
    """A row of data; a cell with a number states it in full in the attribute data-v, by which pages sort."""
    parts = []
    for cell, mark in zip(cells, marks, strict=True):
        number = number_of(cell)
        value = "" if number is None else f' data-v="{number!r}"'
        parts.append(f"<td{mark}{value}>{escaped(shown(cell))}</td>")
    return f"<tr>{''.join(parts)}</tr>"
