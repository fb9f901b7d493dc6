"""Writes a table as plain text, Markdown, LaTeX (booktabs) and CSV (long form)."""

from __future__ import annotations

import csv
import io
import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from airtruth.report.layout import MARK, Grid, Group, Row
from airtruth.report.published import SYMBOLS
from airtruth.report.tables import Table

WIDTH: Final = 120
"""Columns of the terminal that plain text is laid out for."""

CSV_COLUMNS: Final = (
    "table",
    "campaign",
    "parameter",
    "method",
    "statistic",
    "value",
    "standard_error",
    "published",
    "published_standard_error",
    "difference_in_standard_errors",
)

_SPECIAL: Final = str.maketrans(
    {
        "&": r"\&",
        "%": r"\%",
        "_": r"\_",
        "#": r"\#",
        "$": r"\$",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "\\": r"\textbackslash{}",
        "<": r"$<$",
        ">": r"$>$",
        "|": r"$|$",
    }
)


def text(grid: Grid, width: int = WIDTH) -> str:
    """Plain text; methods that do not fit side by side continue below."""
    lines = [grid.title, "=" * min(len(grid.title), width)]
    for methods in _blocks(grid, width):
        lines += ["", *_text_block(grid, (0, 1, *methods))]
    for note in grid.notes:
        lines += textwrap.wrap(note, width, initial_indent="- ", subsequent_indent="  ")
    return "\n".join(lines) + "\n"


def markdown(grid: Grid) -> str:
    """GitHub-flavoured Markdown; a group's heading is a row in bold."""
    lines = [f"### {_md(grid.title)}", "", _md_row(grid.header)]
    lines.append("|" + "|".join([" :--- ", *[" ---: "] * (len(grid.header) - 1)]) + "|")
    for group in grid.groups:
        lines.append(_md_row([f"**{group.heading}**", *[""] * (len(grid.header) - 1)], escape=False))
        lines += [_md_row([row[0].replace("  ", "&emsp;"), *row[1:]]) for row in group.rows]
    lines += ["", *(f"- {_md(note)}" for note in grid.notes)]
    return "\n".join(lines) + "\n"


def latex(grid: Grid, label: str) -> str:
    """LaTeX tables for the package booktabs: what the paper prints, and the other figures after it."""
    printed = [group for group in grid.groups if not group.supplement]
    others = [group for group in grid.groups if group.supplement]
    lines = _latex_table(grid, printed, grid.title, label, grid.notes)
    if others:
        lines += ["", *_latex_table(grid, others, f"{grid.title}: further figures", f"{label}-further", ())]
    return "\n".join(lines) + "\n"


def csv_text(table: Table) -> str:
    """Long form: one row per figure, full precision, an empty field where there is none."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for e in table.entries.values():
        printed = math.nan if e.published is None else e.published.value
        figures = (e.value, e.se, printed, e.published_se, e.z)
        cells = (repr(x) if math.isfinite(x) else "" for x in figures)
        writer.writerow([table.name, table.campaign.name, e.parameter, e.method, e.statistic, *cells])
    return out.getvalue()


def _latex_table(
    grid: Grid, groups: Iterable[Group], title: str, label: str, notes: Iterable[str]
) -> list[str]:
    columns = len(grid.header)
    lines = [
        r"\begin{table}[p]",
        r"\centering\footnotesize",
        rf"\caption{{{_tex(title)}}}",
        rf"\label{{tab:{label}}}",
        rf"\begin{{tabular}}{{l{'r' * (columns - 1)}}}",
        r"\toprule",
        " & ".join(_tex(name) for name in grid.header) + r" \\",
    ]
    for group in groups:
        lines += [r"\midrule", rf"\multicolumn{{{columns}}}{{l}}{{\emph{{{_tex(group.heading)}}}}} \\"]
        lines += [" & ".join(_tex_cells(row)) + r" \\" for row in group.rows]
    lines += [r"\bottomrule", r"\end{tabular}"]
    told = [rf"{_tex(note)}\par" for note in notes]
    if told:
        lines += ["", r"\begin{flushleft}\scriptsize", *told, r"\end{flushleft}"]
    return [*lines, r"\end{table}"]


def _blocks(grid: Grid, width: int) -> list[range]:
    """Columns of methods side by side, as even as possible."""
    first, true, *widths = (_width(grid, j) + 2 for j in range(len(grid.header)))
    room = width + 2 - first - true
    for count in range(1, len(widths) + 1):
        size = math.ceil(len(widths) / count)
        starts = range(0, len(widths), size)
        if size == 1 or all(sum(widths[i : i + size]) <= room for i in starts):
            return [range(2 + i, 2 + min(i + size, len(widths))) for i in starts]
    return []


def _width(grid: Grid, column: int) -> int:
    cells = [row[column] for group in grid.groups for row in group.rows]
    return max(len(cell) for cell in [*cells, *_header(grid.header[column])])


def _header(name: str) -> list[str]:
    """A method's name over several lines, broken at hyphens."""
    return textwrap.wrap(name, 14, break_on_hyphens=True) or [""]


def _text_block(grid: Grid, columns: Sequence[int]) -> Iterator[str]:
    widths = [_width(grid, j) for j in columns]

    def line(cells: Iterable[str]) -> str:
        first, *rest = zip(cells, widths, strict=True)
        return "  ".join([first[0].ljust(first[1]), *(cell.rjust(w) for cell, w in rest)]).rstrip()

    heads = [_header(grid.header[j]) for j in columns]
    tall = max(len(head) for head in heads)
    for i in range(tall):
        yield line([head[i - tall + len(head)] if i >= tall - len(head) else "" for head in heads])
    rule = "-" * (sum(widths) + 2 * (len(widths) - 1))
    for group in grid.groups:
        yield rule
        yield group.heading
        for row in group.rows:
            yield line([row[j] for j in columns])
    yield rule


def _md(words: str) -> str:
    return re.sub(r"([\\|*_<>])", r"\\\1", words)


def _md_row(cells: Iterable[str], escape: bool = True) -> str:
    return "| " + " | ".join(_md(cell) if escape else cell for cell in cells) + " |"


def _tex(words: str) -> str:
    return words.translate(_SPECIAL).replace("$|$$|$", r"$\|$").replace(MARK, "$^{*}$")


def _tex_cells(row: Row) -> Iterator[str]:
    label, *cells = row
    name = label.strip()
    yield (r"\quad " if label.startswith(" ") else "") + SYMBOLS.get(name, _tex(name))
    for cell in cells:
        yield re.sub(r"(?<![\w.])-(?=\d)", "$-$", _tex(cell))
