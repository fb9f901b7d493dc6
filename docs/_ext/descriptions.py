"""Descriptions of parameters: a docstring's ``name : description`` becomes a description, where napoleon reads a type."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SECTIONS: Final = ("Parameters", "Attributes")
"""Sections whose entries are ``name : description``."""
ENTRY: Final = re.compile(r"(\*{0,2}\w+(?:, \*{0,2}\w+)*) : (.+)")
"""An entry: one name or several, and the first line of the description."""


def split(lines: list[str]) -> list[str]:
    """Move the description of each entry below its name, where napoleon expects it.

    Parameters
    ----------
    lines : of a docstring without its indentation.
    """
    found: list[str] = []
    inside = False
    for number, line in enumerate(lines):
        if number + 1 < len(lines) and re.fullmatch("-{3,}", lines[number + 1]):
            inside = line in SECTIONS
        entry = ENTRY.fullmatch(line) if inside else None
        found += [entry[1], f"    {entry[2]}"] if entry else [line]
    return found


def _process(app: Sphinx, what: str, name: str, thing: object, options: Any, lines: list[str]) -> None:
    lines[:] = split(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the change before that of napoleon, whose priority is 500."""
    app.connect("autodoc-process-docstring", _process, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
