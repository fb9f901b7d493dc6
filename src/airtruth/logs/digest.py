"""Digests of files."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from airtruth.errors import StoreError
from airtruth.logs.remote import RemotePath, each


def sha256_of(path: Path) -> str | None:
    """Return the SHA-256 of a file in hexadecimal digits; None if there is no file of that name.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return None
    except OSError as error:
        raise StoreError(
            f"{path}: cannot be read ({error.strerror}); make it readable and run again"
        ) from None


def sha256_of_each(paths: Sequence[Path]) -> list[str | None]:
    """`sha256_of` of each file; those of a store are read side by side.

    Raises
    ------
    StoreError
        If a file cannot be read.
    """
    if any(isinstance(path, RemotePath) for path in paths):
        return each(sha256_of, paths)
    return [sha256_of(path) for path in paths]
