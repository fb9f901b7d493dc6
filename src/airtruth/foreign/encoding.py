"""The encoding of a text file, from its bytes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from airtruth.errors import StoreError

_UTF16_MARKS: Final = (b"\xff\xfe", b"\xfe\xff")
"""Marks of byte order that UTF-16 begins with."""
_SHOWN: Final = 40
"""Characters of a line that a note quotes [-] (judgement)."""


def decoded(path: Path, encoding: str | None = None) -> tuple[str, str, tuple[str, ...]]:
    r"""Text of a file with \n at the ends of its lines, its encoding, and a note where the encoding is assumed.

    Parameters
    ----------
    path : the file.
    encoding : as stated; None takes UTF-8, UTF-16 with a mark of byte order, or else Windows-1252.

    Raises
    ------
    StoreError
        If the file is no text, or not in the stated encoding.
    """
    content = path.read_bytes()
    if encoding is None:
        encoding = "utf-16" if content.startswith(_UTF16_MARKS) else "utf-8"
        try:
            text = _lines(content.decode(_CODECS[encoding]))
            if encoding == "utf-8" and b"\0" in content.split(b"\n", 1)[0]:
                raise StoreError(f"{path}: {_cure(content, content.index(0))}")
            return text, encoding, ()
        except UnicodeDecodeError as error:
            if encoding == "utf-16" or _no_text(content):
                raise StoreError(f"{path}: {_cure(content, error.start)}") from None
        text = _lines(_windows(content))
        return text, "windows-1252", (_assumed(path, text),)
    try:
        text = _windows(content) if encoding == "windows-1252" else content.decode(_CODECS[encoding])
    except UnicodeDecodeError as error:
        raise StoreError(
            f"{path}: is not text in {encoding} (byte {error.start + 1}); leave [source] encoding out, or state another"
        ) from None
    return _lines(text), encoding, ()


def head_of(content: bytes) -> str:
    """The beginning of a text file of any encoding, for a look at its layout."""
    if content.startswith(_UTF16_MARKS):
        return _lines(content.decode("utf-16", errors="replace"))
    return _lines(content.decode("utf-8-sig", errors="replace"))


_CODECS: Final = {"utf-8": "utf-8-sig", "utf-16": "utf-16"}
"""Encoding -> codec that removes a mark of byte order."""


def _windows(content: bytes) -> str:
    """Text in Windows-1252, its five bytes without a character as in Latin-1."""
    try:
        return content.decode("cp1252")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _lines(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _assumed(path: Path, text: str) -> str:
    line = next(
        (one for one in text.split("\n") if any(ord(character) > 127 for character in one)), ""
    ).strip()
    return (
        f"{path.name}: is not in UTF-8 and was read as Windows-1252, for example {line[:_SHOWN]!r}; if this is wrong, state "
        "[source] encoding"
    )


def _no_text(content: bytes) -> bool:
    return content.count(0) > len(content) / 4 or bool(re.search(rb"[\x00-\x08\x0b\x0e-\x1f]", content))


def _cure(content: bytes, at: int) -> str:
    """The likely encoding of a file that is not UTF-8, and what to do."""
    if content[:2] in _UTF16_MARKS or content.count(0) > len(content) / 4:
        return (
            "is not text in UTF-8 but probably in UTF-16; save it as UTF-8 (a spreadsheet: CSV UTF-8), or state "
            '[source] encoding = "utf-16"'
        )
    return f"is not text in UTF-8 (byte {at + 1}); export it as text"


__all__ = ["decoded", "head_of"]
