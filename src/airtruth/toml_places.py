"""Places of the values in the text of a TOML document, so that a change rewrites nothing else."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

Path = tuple[str | int, ...]
"""Keys from the top of a document to a value; an integer counts the items of an array."""
_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")
"""A key without quotes."""
_PLAIN: Final = re.compile(r"[^,\]}\s#]+")
"""A number, a Boolean or a date."""
_IGNORED: Final = re.compile(r"(?:\s|#[^\n]*)*")
"""White space, and comments to the ends of their lines."""
_SPACE: Final = re.compile(r"[ \t]*")
"""White space inside a line."""


@dataclass
class Places:
    """Offsets in a document.

    Attributes
    ----------
    values : path of a value -> its first character and the one behind it; tables in braces have one too.
    tables : path of a table with a header -> offset behind the line of its last entry, or of its header.
    """

    values: dict[Path, tuple[int, int]] = field(default_factory=dict)
    tables: dict[Path, int] = field(default_factory=dict)


def places(text: str) -> Places:
    """Return the places of a valid TOML document; what they are in an invalid one is undefined.

    Examples
    --------
    >>> found = places('[mass]  # as weighed\\nmass = { value = 3.0, unit = "kg" }\\n')
    >>> found.values["mass", "mass", "value"]
    (38, 41)
    """
    found = Places()
    table: Path = ()
    arrays: dict[Path, int] = {}
    at = _behind(_IGNORED, text, 0)
    while at < len(text):
        if text[at] == "[":
            several = text.startswith("[[", at)
            keys, at = _keys(text, at + 1 + several, arrays)
            if several:
                arrays[keys] = arrays.get(keys, -1) + 1
                keys = (*keys, arrays[keys])
            table, at = keys, at + 1 + several
        else:
            keys, at = _keys(text, at, {})
            at = _value(text, _behind(_SPACE, text, at + 1), (*table, *keys), found)
        line = text.find("\n", at)
        found.tables[table] = len(text) if line < 0 else line + 1
        at = _behind(_IGNORED, text, at)
    return found


def _behind(pattern: re.Pattern[str], text: str, at: int) -> int:
    match = pattern.match(text, at)
    return at if match is None else match.end()


def _keys(text: str, at: int, arrays: dict[Path, int]) -> tuple[Path, int]:
    """A dotted key and the offset of what ends it: "=" or "]"; an array of tables counts by its last item."""
    keys: Path = ()
    while True:
        at = _behind(_SPACE, text, at)
        if text[at] in "\"'":
            end = _string(text, at)
            keys += (json.loads(text[at:end]) if text[at] == '"' else text[at + 1 : end - 1],)
        else:
            end = _behind(_BARE, text, at)
            keys += (text[at:end],)
        at = _behind(_SPACE, text, end)
        if text[at] != ".":
            return keys, at
        if keys in arrays:
            keys += (arrays[keys],)
        at += 1


def _value(text: str, at: int, path: Path, found: Places) -> int:
    start = at
    if text[at] in "\"'":
        at = _string(text, at)
    elif text[at] in "[{":
        end = "]" if text[at] == "[" else "}"
        at, number = _behind(_IGNORED, text, at + 1), 0
        while text[at] != end:
            if end == "}":
                keys, at = _keys(text, at, {})
                at = _behind(_SPACE, text, at + 1)
            else:
                keys, number = (number,), number + 1
            at = _behind(_IGNORED, text, _value(text, at, (*path, *keys), found))
            if text[at] == ",":
                at = _behind(_IGNORED, text, at + 1)
        at += 1
    else:
        at = _behind(_PLAIN, text, at)
    found.values[path] = (start, at)
    return at


def _string(text: str, at: int) -> int:
    quote = text[at]
    if text.startswith(3 * quote, at):
        quote = 3 * quote
    at += len(quote)
    while not text.startswith(quote, at):
        at += 2 if quote[0] == '"' and text[at] == "\\" else 1
    at += len(quote)
    while len(quote) == 3 and text.startswith(
        quote[0], at
    ):  # quotes before the closing ones belong to the string
        at += 1
    return at


def spliced(text: str, edits: Iterator[tuple[int, int, str]] | list[tuple[int, int, str]]) -> str:
    """The text with ranges replaced, which do not overlap; of insertions at one offset the first comes first."""
    parts: list[str] = []
    last = 0
    for start, end, new in sorted(edits, key=lambda edit: edit[:2]):
        parts += [text[last:start], new]
        last = end
    return "".join([*parts, text[last:]])


__all__ = ["Path", "Places", "places", "spliced"]
