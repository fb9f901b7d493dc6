"""Mutations of bytes, text, documents and tables, drawn from a `random.Random`.

A hypothesis strategy gives such an object as well (`hypothesis.strategies.randoms`), so the test suite draws the same
mutations.
"""

from __future__ import annotations

import copy
import datetime
import math
from collections.abc import Mapping
from random import Random
from typing import Any, Final

NUMBERS: Final = (
    0, -1, 1, 2, 7, 1e-3, 0.5, -0.0, 1e3, 1e6, 2**31, 2**63 - 1, 2**63, -(2**63), 2**70, 10**30,
    1e-300, 5e-324, 1e15, 1e155, 1e300, -1e300, 1.7e308, math.nan, math.inf, -math.inf,
)  # fmt: skip
"""Numbers that break arithmetic."""
WORDS: Final = (
    "", " ", "x", "nan", "inf", "1", "true", "none", "gtm", "../..", "/etc/passwd", "/dev/zero", "NUL", "a/b", ".",
    "é", "\u0000", "\u202e", "\U0001f6e9", "x" * 3000, "{0}", "%s", "${HOME}", "<b>", "'; --", "deg", "rad_s", "\n\n",
)  # fmt: skip
"""Words that break names, paths and messages."""
DAMAGED_BYTES: Final = (
    b"\0" * 4,
    b"\xff" * 4,
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\x80",
    b"\n",
    b",",
)
"""Bytes that break lengths and separators."""


def damaged(rng: Random, content: bytes) -> bytes:
    """Bytes with one to sixteen of them changed, inserted, removed or repeated, mostly near the ends."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 1, 2, 4, 16))):
        if not data:
            break
        _damage(rng, data)
    if rng.random() < 0.02:
        del data[rng.randrange(len(data) + 1) :]
    return bytes(data)


def _damage(rng: Random, data: bytearray) -> None:
    size = len(data)
    ends = (int(size * rng.random() ** 6), size - 1 - int(size * rng.random() ** 6), rng.randrange(size))
    at = min(max(rng.choice(ends), 0), size - 1)
    kind = rng.randrange(12)
    if kind < 4:
        data[at] ^= 1 << rng.randrange(8)
    elif kind < 6:
        data[at] = rng.choice((0, 127, 128, 255, rng.randrange(256)))
    elif kind < 8:
        part = rng.choice(DAMAGED_BYTES)
        data[at : at + len(part)] = part
    elif kind == 8:
        del data[at : at + rng.choice((1, 4, 100))]
    elif kind == 9:
        data[at:at] = data[at : at + rng.choice((1, 8, 64))]
    elif kind == 10:
        source = rng.randrange(size)
        data[at : at + 8] = data[source : source + 8]
    else:
        data[at:at] = rng.choice(DAMAGED_BYTES)


def value(rng: Random, depth: int = 0) -> Any:
    """A value of any type of TOML."""
    kind = rng.randrange(10)
    if kind < 4:
        return rng.choice(NUMBERS)
    if kind < 6:
        return rng.choice(WORDS)
    if kind == 6:
        return rng.random() < 0.5
    if kind == 7:
        return rng.choice(
            (datetime.date(2019, 7, 1), datetime.time(1, 2, 3), datetime.datetime(2019, 7, 1, 1, 2))
        )
    if depth > 2:
        return []
    if kind == 8:
        return [value(rng, depth + 1) for _ in range(rng.randrange(4))]
    return {
        rng.choice(("", "a", "value", "unit", "name", "mean")): value(rng, depth + 1)
        for _ in range(rng.randrange(3))
    }


def altered(rng: Random, document: Any) -> Any:
    """A copy of a document with one to three entries replaced, scaled, removed, renamed, added, wrapped or swapped."""
    document = copy.deepcopy(document)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        paths = list(_paths(document))
        if not paths:
            return value(rng)
        _alter(rng, document, *rng.choice(paths))
    return document


def _alter(rng: Random, document: Any, parent: Any, key: Any) -> None:
    kind = rng.randrange(12)
    old = parent[key]
    if kind < 4:
        parent[key] = value(rng)
    elif kind < 7 and isinstance(old, int | float) and not isinstance(old, bool):
        parent[key] = rng.choice(
            (-old, old * 10.0 ** rng.randrange(-9, 10), old + 1, float(old), rng.choice(NUMBERS))
        )
    elif kind < 8:
        del parent[key]
    elif isinstance(parent, dict) and kind < 10:
        word = str(key)
        cut = rng.randrange(len(word) + 1)
        name = rng.choice(
            (word[:cut] + word[cut + 1 :], word[:cut] + "x" + word[cut:], word.upper(), *WORDS[:5])
        )
        parent[name] = value(rng) if kind == 8 else parent.pop(key)
    elif kind == 10:
        parent[key] = [old] * rng.choice((0, 1, 2, 50))
    else:
        other, name = rng.choice(list(_paths(document)))
        parent[key], other[name] = copy.deepcopy(other[name]), copy.deepcopy(old)


def _paths(document: Any) -> Any:
    """Parent and key of every entry."""
    entries = (
        document.items()
        if isinstance(document, dict)
        else enumerate(document)
        if isinstance(document, list)
        else ()
    )
    for key, entry in list(entries):
        yield document, key
        yield from _paths(entry)


def toml(document: Mapping[str, Any]) -> str:
    """A document as TOML, its tables in one line each."""
    return "".join(f"{_key(name)} = {_toml(entry)}\n" for name, entry in document.items())


def _key(name: str) -> str:
    return (
        name if name and name.isascii() and name.replace("_", "").replace("-", "").isalnum() else _text(name)
    )


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04X}" for c in escaped) + '"'


def _toml(entry: Any) -> str:
    if isinstance(entry, bool):
        return str(entry).lower()
    if isinstance(entry, str):
        return _text(entry)
    if isinstance(entry, Mapping):
        return "{ " + ", ".join(f"{_key(str(k))} = {_toml(v)}" for k, v in entry.items()) + " }"
    if isinstance(entry, list | tuple):
        return "[" + ", ".join(map(_toml, entry)) + "]"
    if isinstance(entry, datetime.date | datetime.time):
        return entry.isoformat()
    return repr(entry)


def odd_text(rng: Random, text: str) -> bytes:
    """A text file in another encoding, with absurd nesting, numbers or lines, or with damaged bytes."""
    depth = rng.choice((50, 500, 5000, 100_000))
    insertions = (
        f"a = {'[' * depth}{']' * depth}\n",
        f"a = {'[' * depth}\n",
        f"a = {'{ b = ' * depth}1{' }' * depth}\n",
        f"{'a.' * depth}b = 1\n",
        f"[{'a.' * depth}b]\n",
        f"a = {'9' * depth}\n",
        f"a = 1e{'9' * depth}\n",
        f'a = "{"x" * depth}"\n',
        "a = 1\na = 2\n",
        "\u0000",
        "runs = 1979-05-27T07:32:00Z\n",
    )
    whole = (b"", b"\xef\xbb\xbf" + text.encode(), text.encode("utf-16"), text.encode("latin-1", "replace") + b"\xe9",
             text.replace("\n", "\r\n").encode(), text.replace("\n", "\r").encode(), b"\0" * 100, b"\xef\xbb\xbf")  # fmt: skip
    kind = rng.randrange(3)
    if kind == 0:
        return rng.choice(whole)
    if kind == 1:
        lines = text.splitlines(keepends=True)
        at = rng.randrange(len(lines) + 1)
        return "".join([*lines[:at], rng.choice(insertions), *lines[at:]]).encode()
    return damaged(rng, text.encode())


__all__ = ["NUMBERS", "WORDS", "altered", "damaged", "odd_text", "toml", "value"]
