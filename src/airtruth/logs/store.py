"""The Parquet store of flight logs, and the way to the plain tables that stand beside them."""

from __future__ import annotations

import difflib
import json
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from airtruth.errors import LogError, StoreError, choices
from airtruth.logs.atomic import atomic_file, write_text
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.tables import KEY, metadata_of, read_metadata, read_table, readable, write_table
from airtruth.signals import RUN_ID, SIGNALS, TIME

Array = NDArray[np.float64]

SCHEMA: Final = 1
"""Version of the log format that is written and the newest that is read."""
RUNS_PER_GROUP: Final = 25
"""Runs in a row group; a group per run costs seven times as much to write and nine to read (250 samples)."""
CAMPAIGN_TABLES: Final = ("plan.parquet", "truth.parquet", "estimates.parquet")
"""Files beside logs that are never taken for one."""


def write_log(
    path: Path | str,
    log: FlightLog,
    *,
    dtype: Literal["float32", "float64"] = "float32",
    runs_per_group: int = RUNS_PER_GROUP,
) -> None:
    """Write a flight log, its runs sorted by name, whole or not at all.

    Parameters
    ----------
    path : file to write; its folder must exist.
    log : the log; ``metadata`` must be JSON.
    dtype : type of the channels; time is float64 always.
    runs_per_group : runs per row group, the unit of random access.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    fields = [pa.field(RUN_ID, pa.string()), _field(TIME, "float64")]
    fields += [_field(name, dtype) for name in log.channels]
    document = json.dumps({"schema": SCHEMA, **log.metadata}, allow_nan=False).encode()
    schema = pa.schema(fields, metadata={KEY: document})
    order = sorted(range(len(log.run_ids)), key=log.run_ids.__getitem__)
    with atomic_file(path) as file, _writer(file, schema) as writer:
        for first in range(0, len(order), runs_per_group):
            writer.write_table(_group(log, order[first : first + runs_per_group], schema))


def read_log(
    path: Path | str, columns: Sequence[str] | None = None, run_ids: Collection[str] | None = None
) -> FlightLog:
    """Read a flight log; `airtruth.logs.validate.validate` judges what it holds.

    Parameters
    ----------
    path : Parquet file.
    columns : channels to read, any numeric column; None reads those of the vocabulary
        (`airtruth.signals.SIGNALS`) and all other floating-point ones.
    run_ids : runs to read, in the file's order; None reads all.

    Returns
    -------
    FlightLog
        Channels (rows,) float64 in SI, C-contiguous; a missing value is NaN.

    Raises
    ------
    StoreError
        If the file cannot be read or is damaged.
    LogError
        If it is not a flight log, or lacks a column or run that was asked for.
    """
    path = Path(path)
    with readable(path), pq.ParquetFile(path, page_checksum_verification=True) as file:
        names = _channels(path, file.schema_arrow, columns)
        ids, offsets = _runs(path, file.read([RUN_ID]).column(RUN_ID))
        keep: slice | NDArray[np.int64] = slice(None)
        if run_ids is None:
            table = file.read([TIME, *names])
        else:
            ids, offsets, groups, keep = _select(path, file.metadata, ids, offsets, run_ids)
            table = file.read_row_groups(groups, [TIME, *names])
    return FlightLog(
        metadata=metadata_of(path, file.schema_arrow),
        run_ids=ids,
        offsets=offsets,
        t_s=_floats(table.column(TIME), keep),
        channels={name: _floats(table.column(name), keep) for name in names},
    )


def log_paths(place: Path | str) -> list[Path]:
    """Flight log files of a place: the file itself, those of its folder ``logs``, or those of the folder.

    Sorted by name; tables that stand beside logs (`CAMPAIGN_TABLES`) are left out.

    Raises
    ------
    StoreError
        If the place does not exist or holds no log.
    """
    place = Path(place)
    if place.is_file():
        return [place]
    if not place.exists():
        raise StoreError(f"{place}: no such file or folder; state a log (.parquet) or a folder of logs")
    folder = place / "logs" if (place / "logs").is_dir() else place
    paths = sorted(p for p in folder.glob("*.parquet") if p.name not in CAMPAIGN_TABLES)
    if not paths:
        raise StoreError(
            f"{folder}: holds no flight log (*.parquet); `airtruth fly` or `airtruth import` writes them"
        )
    return paths


def iter_logs(place: Path | str, columns: Sequence[str] | None = None) -> Iterator[FlightLog]:
    """Read the logs of a place one file at a time; see `log_paths` and `read_log`."""
    for path in log_paths(place):
        yield read_log(path, columns)


def _field(name: str, dtype: str) -> pa.Field:
    unit = "s" if name == TIME else SIGNALS[name].unit if name in SIGNALS else ""
    return pa.field(name, dtype, metadata={"unit": unit} if unit else None)


def _writer(file: BinaryIO, schema: pa.Schema) -> Any:
    return pq.ParquetWriter(
        file,
        schema,
        compression="zstd",
        use_dictionary=[RUN_ID],
        column_encoding={name: "BYTE_STREAM_SPLIT" for name in schema.names if name != RUN_ID},
        write_statistics=[RUN_ID],
        write_page_checksum=True,
    )


def _group(log: FlightLog, runs: Sequence[int], schema: pa.Schema) -> pa.Table:
    lengths = np.diff(log.offsets)[runs]
    rows = np.concatenate([np.arange(log.offsets[r], log.offsets[r + 1]) for r in runs])
    names = np.repeat(np.array([log.run_ids[r] for r in runs], dtype=object), lengths)
    arrays = [pa.array(names, pa.string()), log.t_s[rows]]
    arrays += [
        values[rows].astype(schema.field(n).type.to_pandas_dtype()) for n, values in log.channels.items()
    ]
    return pa.table([pa.array(a) for a in arrays], schema=schema)


def _channels(path: Path, schema: pa.Schema, columns: Sequence[str] | None) -> list[str]:
    lacking = [name for name in (RUN_ID, TIME) if name not in schema.names]
    if lacking:
        raise LogError(
            f"{path}: is not a flight log, it has no column {' nor '.join(lacking)} "
            f"(columns: {', '.join(schema.names[:12])}); convert it with `airtruth import`"
        )
    version = metadata_of(path, schema).get("schema", SCHEMA)
    if version != SCHEMA:
        raise LogError(f"{path}: log schema {version!r} is not known, {SCHEMA} is; use a newer airtruth")
    kinds = {f.name: f.type for f in schema}
    if not pa.types.is_floating(kinds[TIME]):
        raise LogError(f"{path}: {TIME} is {kinds[TIME]}, not a floating-point time in seconds")
    if columns is None:
        return [
            name
            for name in schema.names
            if name not in (RUN_ID, TIME)
            and (pa.types.is_floating(kinds[name]) or _numeric(name, kinds[name]))
        ]
    wanted = [name for name in dict.fromkeys(columns) if name not in (RUN_ID, TIME)]
    for name in wanted:
        if name not in kinds:
            raise LogError(f"{path}: no channel {name!r}; {choices(name, kinds.keys() - {RUN_ID, TIME})}")
        if not (pa.types.is_floating(kinds[name]) or pa.types.is_integer(kinds[name])):
            raise LogError(f"{path}: channel {name!r} is {kinds[name]}, not numeric")
    return wanted


def _numeric(name: str, kind: pa.DataType) -> bool:
    return name in SIGNALS and pa.types.is_integer(kind)


def _runs(path: Path, column: pa.ChunkedArray) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
        raise LogError(f"{path}: {RUN_ID} is {kind}, not a string")
    if column.null_count:
        row = int(np.flatnonzero(column.is_null().to_numpy())[0])
        raise LogError(f"{path}: {RUN_ID} is empty in {column.null_count} rows, the first is row {row}")
    if len(column) == 0:
        raise LogError(f"{path}: the log has no rows; fly or import it again")
    encoded = column if pa.types.is_dictionary(column.type) else column.dictionary_encode()
    encoded = encoded.unify_dictionaries().combine_chunks()
    index = encoded.indices.to_numpy()
    starts = np.flatnonzero(np.diff(index, prepend=-1))
    ids = encoded.dictionary.take(pa.array(index[starts])).to_pylist()
    return tuple(ids), np.append(starts, len(index)).astype(np.int64)


def _select(
    path: Path,
    metadata: pq.FileMetaData,
    ids: tuple[str, ...],
    offsets: NDArray[np.int64],
    wanted: Collection[str],
) -> tuple[tuple[str, ...], NDArray[np.int64], list[int], NDArray[np.int64]]:
    """Names and offsets of the wanted runs, the row groups that hold them, and their rows in those groups."""
    runs = [run for run, name in enumerate(ids) if name in set(wanted)]
    missing = sorted(set(wanted) - set(ids))
    if missing:
        near = difflib.get_close_matches(missing[0], ids, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise LogError(
            f"{path}: no run {', '.join(map(repr, missing[:5]))}; {hint}the log holds {len(ids)} runs, "
            f"{ids[0]!r} to {ids[-1]!r}"
        )
    rows = np.concatenate([np.arange(0), *(np.arange(offsets[run], offsets[run + 1]) for run in runs)])
    sizes = np.array([metadata.row_group(g).num_rows for g in range(metadata.num_row_groups)])
    ends = np.cumsum(sizes)
    group = np.searchsorted(ends, rows, side="right")
    groups, which = np.unique(group, return_inverse=True)
    begins = np.cumsum(sizes[groups]) - sizes[groups]
    keep = rows - (ends - sizes)[group] + begins[which]
    lengths = np.diff(offsets)[runs]
    return tuple(ids[r] for r in runs), np.append(0, np.cumsum(lengths)), groups.tolist(), keep


def _floats(column: pa.ChunkedArray, keep: slice | NDArray[np.int64]) -> Array:
    return np.ascontiguousarray(column.to_numpy()[keep], dtype=np.float64)


__all__ = [
    "CAMPAIGN_TABLES",
    "RUNS_PER_GROUP",
    "SCHEMA",
    "iter_logs",
    "log_paths",
    "read_log",
    "read_metadata",
    "read_table",
    "write_log",
    "write_table",
    "write_text",
]
