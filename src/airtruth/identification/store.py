"""estimates.parquet: estimates of several methods in one file, each with the settings that made it.

The file-level JSON under the key "airtruth" holds, under "estimates", for each method: version, options, joint,
aircraft, constants, sources (name, SHA-256 and runs of each log), notes and forced faults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import pyarrow as pa

from airtruth.errors import LogError, StoreError
from airtruth.identification.result import IdentificationResult, Settings, SpooledResult
from airtruth.identification.stored import KEY, KEYS, read_stored
from airtruth.logs.remote import location
from airtruth.logs.store import write_table
from airtruth.logs.tables import write_parts

FILE: Final = "estimates.parquet"
"""Name of the file of estimates in a campaign folder."""


def require_mergeable(
    path: Path | str, methods: Sequence[str], settings: Settings, *, force: bool = False
) -> None:
    """Refuse a file into which estimates by these methods with these settings cannot be merged.

    Parameters
    ----------
    path : file; none need exist.
    methods, settings : of the estimates.
    force : as in `write_estimates`.

    Raises
    ------
    StoreError
        Naming the difference and the cure.
    """
    _kept(location(path), methods, settings.to_dict(), force)


def write_estimates(
    path: Path | str,
    result: IdentificationResult | SpooledResult,
    *,
    force: bool = False,
    merge: bool = True,
) -> None:
    """Write estimates, or merge them into a file of estimates.

    Rows of other methods are kept. Rows of the same method and run are replaced, which requires that the file's
    rows of that method were made with the same settings (options, joint, aircraft and its constants).

    Parameters
    ----------
    path : file to write; its folder must exist.
    result : estimates.
    force : replace all rows of a method that was estimated with other settings, and the whole file if it holds
        another aircraft or no estimates.
    merge : keep the rows of the file that the estimates do not replace; False replaces the file.

    Raises
    ------
    StoreError
        If the merge is refused, or the file cannot be read or written.
    """
    path = location(path)
    settings = result.settings.to_dict()
    record = {
        "version": result.version,
        **settings,
        "sources": [[s.name, s.sha256, s.runs] for s in result.sources],
        "notes": list(result.notes),
        "forced": list(result.forced),
    }
    kept, known = _kept(path, result.methods, settings, force) if merge else _nothing()
    records = {**known, **{m: _joined(known[m], record) if m in known else record for m in result.methods}}
    metadata = {"schema": 1, KEY: records}
    if not len(kept):
        write_parts(path, (pa.Table.from_pandas(f, preserve_index=False) for f in result.frames()), metadata)
        return
    rows = result.to_frame()
    replaced = kept.set_index(list(KEYS)).index.isin(rows.set_index(list(KEYS)).index)
    write_table(path, _ordered(kept, kept[~replaced], rows), metadata)


def _kept(
    path: Path, methods: Sequence[str], settings: Mapping[str, Any], force: bool
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Rows of the file that remain, without those that ``force`` replaces, and the records of their methods."""
    nothing = _nothing()
    if not path.exists():
        return nothing
    try:
        old, records = read_stored(path)
    except (StoreError, LogError):
        if force:
            return nothing
        raise
    known: dict[str, Any] = {**records}
    other = _other_aircraft(known, settings)
    if other and not force:
        raise StoreError(
            f"{path}: holds estimates of another aircraft ({other}); choose another --out, or replace the whole "
            "file with --force"
        )
    if other:
        return nothing
    for name in methods:
        difference = _difference(known.get(name), settings) if (old["method"] == name).any() else ""
        if difference and not force:
            raise StoreError(
                f"{path}: holds estimates of {name} {difference}; choose another --out, or replace them with --force"
            )
        if difference:
            old = old[old["method"] != name]
            known.pop(name, None)
    return old, known


def _nothing() -> tuple[pd.DataFrame, dict[str, Any]]:
    return pd.DataFrame({name: pd.Series(dtype=object) for name in KEYS}), {}


def _other_aircraft(known: Mapping[str, Any], settings: Mapping[str, Any]) -> str:
    """The first constant in which the file's aircraft differs, in words; "" if none does."""
    own = settings["constants"]
    for record in known.values():
        for name, value in record["constants"].items():
            if value != own.get(name):
                return f"{name} {value:.6g} in the file, {own.get(name, np.nan):.6g} now"
    return ""


def _difference(record: Mapping[str, Any] | None, settings: Mapping[str, Any]) -> str:
    """How the settings of the file's rows differ, in words; "" if they are equal."""
    if record is None:
        return "without a record of their options"
    if record["joint"] != settings["joint"]:
        return "run by run" if settings["joint"] else "of all runs jointly"
    different = [
        f"{name} {record['options'].get(name)!r} in the file, {value!r} now"
        for name, value in settings["options"].items()
        if record["options"].get(name) != value
    ]
    return f"with other options ({'; '.join(different)})" if different else ""


def _joined(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Record of a method whose rows are kept in part: sources, notes and faults of both."""
    names = {source[0] for source in new["sources"]}
    sources = [source for source in old["sources"] if source[0] not in names]
    both = {key: list(dict.fromkeys([*old[key], *new[key]])) for key in ("notes", "forced")}
    return {**new, "sources": [*sources, *new["sources"]], **both}


def _ordered(old: pd.DataFrame, kept: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Runs in the order of their first appearance, and each with its methods in that order."""
    whole = pd.concat([part for part in (kept, rows) if len(part)], ignore_index=True)
    rank = {
        column: {name: i for i, name in enumerate(dict.fromkeys([*old[column], *rows[column]]))}
        for column in KEYS
    }
    keys = whole["run_id"].map(rank["run_id"]), whole["method"].map(rank["method"])
    return whole.iloc[np.lexsort((keys[1].to_numpy(), keys[0].to_numpy()))].reset_index(drop=True)


__all__ = ["FILE", "require_mergeable", "write_estimates"]
