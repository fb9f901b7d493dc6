"""Reading of estimates.parquet before a merge: rows and records that are what airtruth writes, or one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import pandas as pd
from pydantic import TypeAdapter, ValidationError
from typing_extensions import TypedDict

from airtruth.errors import StoreError
from airtruth.logs.store import read_metadata, read_table
from airtruth.logs.tables import Kind, require_kinds
from airtruth.physics.short_period import PARAMETERS

KEY: Final = "estimates"
"""Key of the file-level JSON that holds a record for each method."""
KEYS: Final = ("run_id", "method")
"""Columns that identify a row."""
MODAL: Final = ("wn_rad_s", "zeta")
"""Columns beside the derivatives, which older files may lack."""
_STEP: Final = "choose another --out, or replace it with --force"
"""Next step of a user whose file cannot be merged into."""


class Record(TypedDict):
    """How the rows of a method were made."""

    version: str
    options: dict[str, Any]
    joint: bool
    aircraft: str
    constants: dict[str, float]
    sources: list[tuple[str, str, int]]
    notes: list[str]
    forced: list[str]


def read_stored(path: Path) -> tuple[pd.DataFrame, dict[str, Record]]:
    """Read the rows of a file of estimates and the record of each method that has one.

    Raises
    ------
    StoreError
        If the file cannot be read, or does not hold estimates as airtruth writes them.
    LogError
        If its file-level JSON is malformed.
    """
    stated = read_metadata(path).get(KEY, {})
    frame = read_table(path)
    if not {*KEYS, *PARAMETERS} <= set(frame.columns):
        raise StoreError(f"{path}: is not a file of estimates; {_STEP}")
    names = (*PARAMETERS, *(n for n in MODAL if n in frame))
    present = [
        name + end for name in names for end in ("", "_std", "_lower", "_upper") if name + end in frame
    ]
    kinds: dict[str, Kind] = {**dict.fromkeys(KEYS, "text"), **dict.fromkeys(present, "number")}
    kinds |= {name: kind for name, kind in _OPTIONAL.items() if name in frame}
    require_kinds(path, frame, kinds, _STEP)
    twice = frame.duplicated(list(KEYS))
    if twice.any():
        run, method = frame[list(KEYS)][twice].iloc[0]
        raise StoreError(f"{path}: has two rows of run {run!r} by method {method!r}; {_STEP}")
    try:
        return frame, TypeAdapter(dict[str, Record]).validate_python(stated)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise StoreError(
            f"{path}: the record of its options is damaged ({where}: {first['msg'].lower()}); {_STEP}"
        ) from None


_OPTIONAL: Final[dict[str, Kind]] = {"converged": "flag", "iterations": "number", "status": "text"}
"""Columns that older files may lack."""

__all__ = ["KEY", "KEYS", "Record", "read_stored"]
