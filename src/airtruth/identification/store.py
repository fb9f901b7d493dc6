"""estimates.parquet: estimates of several methods in one file, each with the settings that made it.

The file-level JSON under the key "airtruth" holds, under "estimates", for each method: version, options, joint,
aircraft, constants, sensors (where errors of sensors are taken out), sources (name, SHA-256 and runs of each log),
notes and forced faults.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa

from airtruth.errors import LogError, StoreError
from airtruth.identification.result import IdentificationResult, IdentificationSettings, SpooledResult
from airtruth.identification.stored import KEY, KEYS, Stored, open_stored
from airtruth.logs import ledger
from airtruth.logs.names import ESTIMATES
from airtruth.logs.parquet import require_suffix
from airtruth.logs.remote import location
from airtruth.logs.tables import write_parts
from airtruth.physics.motion import LONGITUDINAL, Motion

if TYPE_CHECKING:
    import pandas as pd

FILES: Final[Mapping[str, str]] = ESTIMATES
"""Name of a motion -> name of its file of estimates in a campaign folder."""
FILE: Final = FILES[LONGITUDINAL.name]
"""That of the longitudinal motion."""


def beside(path: Path, motion: Motion) -> Path:
    """File of the estimates of a motion beside that of the longitudinal one.

    Examples
    --------
    >>> from airtruth.physics.motion import LATERAL
    >>> beside(Path("out/light.parquet"), LATERAL).name
    'light-lateral.parquet'
    """
    return path if motion is LONGITUDINAL else path.with_name(f"{path.stem}-{motion.name}{path.suffix}")


def require_mergeable(
    path: Path | str, methods: Sequence[str], settings: IdentificationSettings, *, force: bool = False
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
        Naming the difference and the cure; or the file is not named .parquet.
    """
    file = location(path)
    require_suffix(file, "estimates")
    _kept(file, methods, settings.to_dict(), force)


def write_estimates(
    path: Path | str,
    result: IdentificationResult | SpooledResult,
    *,
    force: bool = False,
    merge: bool = True,
) -> None:
    """Write estimates, or merge them into a file of estimates.

    Rows of other methods are kept. Rows of the same method and run are replaced, which requires that the file's
    rows of that method were made with the same settings (options, joint, aircraft, its constants and sensors).

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
        If the file is not named .parquet, the merge is refused, or it cannot be read or written.
    """
    path = location(path)
    require_suffix(path, "estimates")
    settings = result.settings.to_dict()
    record = {
        "version": result.version,
        **settings,
        "sources": [[s.name, s.sha256, s.runs] for s in result.sources],
        "notes": list(result.notes),
        "forced": list(result.forced),
    }
    with ledger.locked(path.parent):  # from the reading to the replacement
        _write(path, result, record, _kept(path, result.methods, settings, force) if merge else _NOTHING)


def _write(
    path: Path, result: IdentificationResult | SpooledResult, record: Mapping[str, Any], old: Stored
) -> None:
    """Write estimates together with those of the file that they do not replace."""
    known = old.records
    records = {**known, **{m: _joined(known[m], record) if m in known else record for m in result.methods}}
    metadata = {"schema": 1, KEY: records}
    methods = tuple(dict.fromkeys((*old.methods, *result.methods)))
    try:
        write_parts(
            path, map(_table, _merged(old, result, methods) if old.methods else result.frames()), metadata
        )
    except _OtherRunsError:
        import pandas as pd

        kept = pd.concat(list(old.frames()), ignore_index=True)
        write_parts(
            path,
            [_table(_together(kept[kept["method"].isin(old.methods)], result.to_frame(), methods))],
            metadata,
        )


def _table(frame: pd.DataFrame) -> pa.Table:
    return pa.Table.from_pandas(frame, preserve_index=False)


class _OtherRunsError(Exception):
    """File and result do not have the same runs in the same order, or have other columns."""


def _merged(
    old: Stored, result: IdentificationResult | SpooledResult, methods: Sequence[str]
) -> Iterator[pd.DataFrame]:
    """Rows of a file and of a result that have the same runs, in parts."""
    import pandas as pd

    parts = iter(old.frames())
    waiting = next(parts)
    for rows in result.frames():
        last = rows["run_id"].iloc[-1]
        while waiting.empty or waiting["run_id"].iloc[-1] <= last:
            following = next(parts, None)
            if following is None:
                break
            waiting = pd.concat([waiting, following], ignore_index=True)
        reached = waiting["run_id"] <= last
        own, waiting = waiting[reached], waiting[~reached]
        if list(own["run_id"].unique()) != list(rows["run_id"].unique()) or not own.dtypes.equals(
            rows.dtypes
        ):
            raise _OtherRunsError
        yield _together(own[own["method"].isin(old.methods)], rows, methods)
    if len(waiting) or next(parts, None) is not None:
        raise _OtherRunsError


def _together(old: pd.DataFrame, rows: pd.DataFrame, methods: Sequence[str]) -> pd.DataFrame:
    """Rows of a file, those that others replace left out, with the others: runs in the order of their first appearance."""
    import pandas as pd

    keys = list(KEYS)
    kept = old[~old.set_index(keys).index.isin(rows.set_index(keys).index)]
    whole = pd.concat([part for part in (kept, rows) if len(part)], ignore_index=True)
    runs = {name: i for i, name in enumerate(dict.fromkeys([*old["run_id"], *rows["run_id"]]))}
    rank = {name: i for i, name in enumerate(methods)}
    order = np.lexsort((whole["method"].map(rank).to_numpy(), whole["run_id"].map(runs).to_numpy()))
    return whole.iloc[order].reset_index(drop=True)


_NOTHING: Final = Stored((), {}, lambda: ())
"""A file without estimates."""


def _kept(path: Path, methods: Sequence[str], settings: Mapping[str, Any], force: bool) -> Stored:
    """The file without the methods that ``force`` replaces, whose rows the caller leaves out."""
    if not path.exists():
        return _NOTHING
    try:
        old = open_stored(path)
    except (StoreError, LogError):
        if force:
            return _NOTHING
        raise
    named = settings.get("motion", LONGITUDINAL.name)
    stored = {record.get("motion", LONGITUDINAL.name) for record in old.records.values()}
    if stored - {named}:
        if force:
            return _NOTHING
        raise StoreError(
            f"{path}: holds estimates of the {min(stored)} motion, and these are of the {named} motion; choose another --out, "
            "or replace the whole file with --force"
        )
    other = other_constants(old.records, settings["constants"])
    own = settings.get("sensors", {})
    if not other and any(record.get("sensors", {}) != own for record in old.records.values()):
        other = "which declares other errors of its instruments"
    if other and not force:
        raise StoreError(
            f"{path}: holds estimates of another aircraft ({other}); choose another --out, or replace the whole "
            "file with --force"
        )
    if other:
        return _NOTHING
    replaced = set()
    for name in methods:
        difference = _difference(old.records.get(name), settings) if name in old.methods else ""
        if difference and not force:
            raise StoreError(
                f"{path}: holds estimates of {name} {difference}; choose another --out, or replace them with --force"
            )
        if difference:
            replaced.add(name)
    for name, record in old.records.items():
        if name not in methods and name in old.methods and record["joint"] != settings["joint"]:
            if not force:
                raise StoreError(
                    f"{path}: holds estimates of {name} {_of_runs(not settings['joint'])}, and these are "
                    f"{_of_runs(settings['joint'])}; choose another --out, or replace them with --force"
                )
            replaced.add(name)
    return Stored(
        tuple(name for name in old.methods if name not in replaced),
        {name: record for name, record in old.records.items() if name not in replaced},
        old.frames,
    )


def other_constants(known: Mapping[str, Mapping[str, Any]], own: Mapping[str, float]) -> str:
    """The first constant in which the aircraft of a file of estimates differs, in words; "" if none does.

    Parameters
    ----------
    known : method -> its record in the file; own : constants of an aircraft.
    """
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
        return _of_runs(not settings["joint"])
    different = [
        f"{name} {record['options'].get(name)!r} in the file, {value!r} now"
        for name, value in settings["options"].items()
        if record["options"].get(name) != value
    ]
    return f"with other options ({'; '.join(different)})" if different else ""


def _of_runs(joint: bool) -> str:
    return "of all runs jointly" if joint else "run by run"


def _joined(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Record of a method whose rows are kept in part: sources, notes and faults of both."""
    again = {tuple(source[:2]) for source in new["sources"]}
    sources = [source for source in old["sources"] if tuple(source[:2]) not in again]
    both = {key: list(dict.fromkeys([*old[key], *new[key]])) for key in ("notes", "forced")}
    return {**new, "sources": [*sources, *new["sources"]], **both}


__all__ = ["FILE", "FILES", "beside", "other_constants", "require_mergeable", "write_estimates"]
