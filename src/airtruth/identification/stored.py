"""Reading of estimates.parquet before a merge: rows and records that are what airtruth writes, or one sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NotRequired

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from typing_extensions import TypedDict

from airtruth.errors import StoreError
from airtruth.logs.store import read_metadata, read_table
from airtruth.logs.tables import Kind, group_ends, read_group, read_rows, require_kinds
from airtruth.physics.motion import motion_of

if TYPE_CHECKING:
    import pandas as pd

KEY: Final = "estimates"
"""Key of the file-level JSON that holds a record for each method."""
KEYS: Final = ("run_id", "method")
"""Columns that identify a row."""
_STEP: Final = "choose another --out, or replace it with --force"
"""Next step of a user whose file cannot be merged into."""


class Record(TypedDict):
    """How the rows of a method were made."""

    version: str
    options: dict[str, Any]
    joint: bool
    aircraft: str
    constants: dict[str, float]
    sensors: NotRequired[dict[str, dict[str, float]]]
    motion: NotRequired[str]
    sources: list[tuple[str, str, int]]
    notes: list[str]
    forced: list[str]


def read_stored(path: Path, rows: NDArray[np.int64] | None = None) -> tuple[pd.DataFrame, dict[str, Record]]:
    """Read the rows of a file of estimates and the record of each method that has one.

    Parameters
    ----------
    path : the file.
    rows : numbers of the rows to read, which ascend; None for all.

    Raises
    ------
    StoreError
        If the file cannot be read, or does not hold estimates as airtruth writes them.
    LogError
        If its file-level JSON is malformed.
    """
    stated = read_metadata(path).get(KEY, {})
    frame = read_table(path) if rows is None else read_rows(path, rows)
    _require_estimates(path, frame)
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


@dataclass(frozen=True)
class Stored:
    """A file of estimates.

    Attributes
    ----------
    methods : its methods, in the order of their first rows.
    records : how the rows of each method were made.
    frames : returns its rows in parts at each call.
    """

    methods: tuple[str, ...]
    records: dict[str, Record]
    frames: Callable[[], Iterable[pd.DataFrame]]


def open_stored(path: Path) -> Stored:
    """Check a file of estimates as `read_stored` does; the memory holds a row group, or all where runs are not in order.

    Raises
    ------
    StoreError, LogError
        As `read_stored`.
    """
    methods = _methods_in_order(path)
    if not methods:
        frame, records = read_stored(path)
        return Stored(tuple(dict.fromkeys(frame["method"])), records, lambda: [frame])
    _, records = read_stored(path, np.zeros(1, dtype=np.int64))
    return Stored(methods, records, lambda: (read_group(path, k) for k in range(len(group_ends(path)))))


def _methods_in_order(path: Path) -> tuple[str, ...]:
    """Methods of a file whose rows ascend by run; none where they do not, or where anything is wrong with it."""
    import pandas as pd

    methods: dict[str, None] = {}
    last = pd.DataFrame()
    try:
        for k in range(len(group_ends(path))):
            frame = read_group(path, k)
            if frame.columns.has_duplicates:
                return ()
            _require_estimates(path, frame)
            keys = pd.concat([last, frame[list(KEYS)]])
            if keys.duplicated().any() or not keys["run_id"].is_monotonic_increasing:
                return ()
            last = keys[keys["run_id"] == keys["run_id"].iloc[-1]]
            methods |= dict.fromkeys(frame["method"].unique())
    except StoreError:
        return ()
    return tuple(methods)


def _require_estimates(path: Path, frame: pd.DataFrame) -> None:
    motion = motion_of(frame.columns)
    if not {*KEYS, *motion.parameters} <= set(frame.columns):
        raise StoreError(f"{path}: is not a file of estimates; {_STEP}")
    # older files may lack the modal parameters
    names = (*motion.parameters, *(n for n in motion.modal if n in frame))
    present = [
        name + end for name in names for end in ("", "_std", "_lower", "_upper") if name + end in frame
    ]
    kinds: dict[str, Kind] = {**dict.fromkeys(KEYS, "text"), **dict.fromkeys(present, "number")}
    kinds |= {name: kind for name, kind in _OPTIONAL.items() if name in frame}
    require_kinds(path, frame, kinds, _STEP)


_OPTIONAL: Final[dict[str, Kind]] = {"converged": "flag", "iterations": "number", "status": "text"}
"""Columns that older files may lack."""

__all__ = ["KEY", "KEYS", "Record", "Stored", "open_stored", "read_stored"]
