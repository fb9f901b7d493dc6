"""TOML and JSON files as plain values: a file that cannot be read is one sentence, whatever its bytes are."""

from __future__ import annotations

import json
import logging
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from airtruth.errors import AirtruthError, reason

LARGEST_BYTES: Final = 50_000_000
"""Size of a file that is read as a document [byte] (judgement: the largest that airtruth writes, trace.json, has 0.2 MB)."""
LARGEST_TOML_BYTES: Final = 500_000
"""Size of a TOML file [byte] (judgement: the largest of airtruth has 6 kB; a list of 10,000 values has 0.2 MB)."""
LONGEST_LINE: Final = 100_000
"""Length of a line of TOML [-]: the time to parse a dotted key grows with the square of its length."""
DEEPEST: Final = 50
"""Nesting of tables and lists [-] (judgement: the deepest file of airtruth has 6 levels)."""


def read_toml(path: Path, failure: type[AirtruthError], step: str) -> dict[str, object]:
    """Read a TOML file in UTF-8, with or without a byte-order mark.

    Parameters
    ----------
    path : the file.
    failure : class of the error.
    step : next step for a user whose file cannot be read.

    Raises
    ------
    AirtruthError
        A ``failure``: the file is missing, no regular file, too large, not UTF-8, not TOML, or nested too deeply.
    """
    text = _text(path, LARGEST_TOML_BYTES, failure, step)
    longest = max(map(len, text.splitlines()), default=0)
    if longest > LONGEST_LINE:
        raise failure(
            f"{path}: has a line of {longest} characters, where {LONGEST_LINE} are read; divide it, or {step}"
        )
    document = _parsed(path, "TOML", lambda: tomllib.loads(text), failure, step)
    assert isinstance(document, dict)
    return document


def read_json(path: Path, failure: type[AirtruthError], step: str) -> object:
    """Read a JSON file in UTF-8; see `read_toml`."""
    text = _text(path, LARGEST_BYTES, failure, step)
    return _parsed(path, "JSON", lambda: json.loads(text), failure, step)


def read_plain(path: Path, failure: type[AirtruthError], step: str) -> str:
    """Read a file of text in UTF-8; see `read_toml`."""
    return _text(path, LARGEST_BYTES, failure, step)


def _text(path: Path, largest: int, failure: type[AirtruthError], step: str) -> str:
    try:
        if path.exists() and not path.is_file():
            raise failure(f"{path}: cannot be read (is not a regular file); {step}")
        with path.open("rb") as file:
            content = file.read(largest + 1)
        if len(content) > largest:
            raise failure(f"{path}: cannot be read (has more than {largest / 1e6:g} MB); {step}")
        logging.getLogger("airtruth").debug("read %s", path)
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise failure(
            f"{path}: cannot be read (is not UTF-8: {error.reason} at byte {error.start}); save it as UTF-8, or {step}"
        ) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        words = error.strerror if isinstance(error, OSError) and error.strerror else reason(error)
        raise failure(f"{path}: cannot be read ({words}); {step}") from None


def _parsed(
    path: Path, kind: str, parse: Callable[[], object], failure: type[AirtruthError], step: str
) -> object:
    try:
        document = parse()
    except RecursionError:
        raise failure(f"{path}: not valid {kind}: nested too deeply; {step}") from None
    except ValueError as error:  # also a number of more than 4300 digits
        raise failure(f"{path}: not valid {kind}: {reason(error)}; {step}") from None
    problem = _problem(document, DEEPEST)
    if problem:
        raise failure(f"{path}: not valid {kind}: {problem}; {step}")
    return document


def _problem(document: object, deepest: int) -> str:
    """Content that no reader of a document expects, a deep nesting or an integer beyond 64 bits; "" if there is none."""
    level = [document]
    for _ in range(deepest + 1):
        if any(isinstance(entry, int) and not -(2**63) <= entry < 2**63 for entry in level):
            return "an integer is beyond 64 bits, write a smaller one"
        level = [
            child
            for entry in level
            for child in (
                entry.values()
                if isinstance(entry, Mapping)
                else entry
                if isinstance(entry, Sequence) and not isinstance(entry, str)
                else ()
            )
        ]
        if not level:
            return ""
    return f"nested more than {deepest} levels deep"


__all__ = ["DEEPEST", "read_json", "read_plain", "read_toml"]
