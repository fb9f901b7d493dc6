"""Parquet files: known by their first bytes when they are read, named .parquet when they are written."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from airtruth.errors import StoreError

SUFFIX: Final = ".parquet"
"""Suffix of a Parquet file."""
_FIRST: Final = b"PAR1"
"""First bytes of a Parquet file (Apache Parquet, File Format)."""


def is_parquet(path: Path) -> bool:
    """Whether a file begins as Parquet, whatever its name.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with path.open("rb") as file:
        return file.read(len(_FIRST)) == _FIRST


def require_suffix(path: Path, holds: str) -> None:
    """Refuse a name of a file to write that does not end in `SUFFIX`.

    Parameters
    ----------
    path : file to write.
    holds : what it will hold, for the message.

    Raises
    ------
    StoreError
        Naming a file that has the suffix.
    """
    if path.suffix != SUFFIX:
        raise StoreError(f"{path}: {holds} are a Parquet file; name it {path.with_suffix(SUFFIX).name}")


__all__ = ["SUFFIX", "is_parquet", "require_suffix"]
