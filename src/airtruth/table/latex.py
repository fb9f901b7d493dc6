"""Tables as LaTeX for the package booktabs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from airtruth.table.model import Group, Row, Table, shown

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
        "*": "$^{*}$",
    }
)
"""Characters that LaTeX reads as commands, and their replacements."""


def as_latex(table: Table, label: str, symbols: Mapping[str, str] | None = None) -> str:
    """Return LaTeX tables: the main groups, and after them the supplements in a table of their own.

    Parameters
    ----------
    label : the first table is labelled tab:LABEL, the second tab:LABEL-further.
    symbols : name in the first column -> LaTeX to print in its place.
    """
    names = symbols or {}
    main = [group for group in table.groups if not group.supplement]
    further = [group for group in table.groups if group.supplement]
    lines = _table(table, main, names, (table.title, label), table.notes)
    if further:
        heading = f"{table.title}: further figures", f"{label}-further"
        lines += ["", *_table(table, further, names, heading, ())]
    return "\n".join(lines) + "\n"


def _table(
    table: Table,
    groups: Iterable[Group],
    symbols: Mapping[str, str],
    heading: tuple[str, str],
    notes: Iterable[str],
) -> list[str]:
    """Lines of one table; ``heading`` is its title and its label."""
    title, label = heading
    count = len(table.columns)
    alignment = "".join("l" if table.is_text(j) else "r" for j in range(count))
    lines = [
        r"\begin{table}[p]",
        r"\centering\footnotesize",
        rf"\caption{{{_escaped(title)}}}",
        rf"\label{{tab:{label}}}",
        rf"\begin{{tabular}}{{{alignment}}}",
        r"\toprule",
        " & ".join(_escaped(name) for name in table.columns) + r" \\",
    ]
    for group in groups:
        lines.append(r"\midrule")
        if group.heading:
            lines.append(rf"\multicolumn{{{count}}}{{l}}{{\emph{{{_escaped(group.heading)}}}}} \\")
        lines += [" & ".join(_cells(row, symbols)) + r" \\" for row in group.rows]
    lines += [r"\bottomrule", r"\end{tabular}"]
    paragraphs = [rf"{_escaped(note)}\par" for note in notes]
    if paragraphs:
        lines += ["", r"\begin{flushleft}\scriptsize", *paragraphs, r"\end{flushleft}"]
    return [*lines, r"\end{table}"]


def _escaped(words: str) -> str:
    return words.translate(_SPECIAL).replace("$|$$|$", r"$\|$").replace("+-", r"$\pm$")


def _cells(row: Row, symbols: Mapping[str, str]) -> Iterator[str]:
    label, *cells = (shown(cell) for cell in row)
    name = label.strip()
    yield (r"\quad " if label.startswith(" ") else "") + symbols.get(name, _escaped(name))
    for cell in cells:
        yield re.sub(r"(?<![\w.])-(?=\d)", "$-$", _escaped(cell))
