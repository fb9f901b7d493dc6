"""Parameters of docstrings for napoleon, which takes the words after a colon for a type.

The docstrings of airtruth have ``name : description``; their types are in the signatures.
"""

from __future__ import annotations

import re
from typing import Final

from sphinx.application import Sphinx

SECTIONS: Final = ("Parameters", "Attributes", "Other Parameters")
"""Sections whose entries have a name and a description on one line."""
BEFORE_NAPOLEON: Final = 400
"""Priority of the listener; napoleon has 500."""
_ENTRY: Final = re.compile(r"(?P<names>\*{0,2}\w+(?:, \*{0,2}\w+)*) : (?P<words>.*)")
_NEXT: Final = re.compile(r"; (?=\w+(?:, \w+)* : )")


def described(lines: list[str]) -> list[str]:
    """The lines with each description of a parameter in lines of its own, below the name.

    Parameters
    ----------
    lines : lines of a docstring without its indentation.
    """
    made: list[str] = []
    section = ""
    for number, line in enumerate(lines):
        if number + 1 < len(lines) and line and set(lines[number + 1]) == {"-"}:
            section = line
        entries = _NEXT.split(line) if section in SECTIONS else [line]
        for entry in entries:
            match = _ENTRY.fullmatch(entry.strip() if len(entries) > 1 else entry)
            if section in SECTIONS and match:
                made += [match["names"], "    " + match["words"]]
            else:
                made.append(entry)
    return made


def _process(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    lines[:] = described(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the listener."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _process, priority=BEFORE_NAPOLEON)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
