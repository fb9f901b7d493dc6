"""The Parquet store of flight logs."""

from __future__ import annotations

import json
import logging
import os
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from airtruth.arguments import require_whole
from airtruth.channels import RUN_ID, SIGNALS, TIME
from airtruth.errors import ConfigurationError, LogError, StoreError, choices, counted
from airtruth.logs import manifest
from airtruth.logs.atomic import atomic_file, write_text
from airtruth.logs.flight_log import FlightLog, unknown_runs
from airtruth.logs.manifest import MANIFEST
from airtruth.logs.remote import location
from airtruth.logs.tables import (
    KEY,
    metadata_of,
    opened,
    read_metadata,
    read_table,
    require_memory,
    write_table,
)
from airtruth.logs.validate import row_problems

Array = NDArray[np.float64]

SCHEMA: Final = 1
"""Version of the log format, the only one that is written and read [-]."""
RUNS_PER_GROUP: Final = 25
"""Runs per row group [-]. Measured with runs of 250 samples: a group per run takes seven times as long to write
and nine times as long to read."""
_TYPES: Final = ("float32", "float64")
"""Types of channels in a file."""
STATED_UNITS: Final = "stated_units"
"""Key of a log's metadata: column -> unit in the file's metadata, where it is not the unit of the channel."""
CAMPAIGN_TABLES: Final = ("plan.parquet", "truth.parquet", "estimates.parquet")
"""Tables in the folder of logs, which are not logs."""


def write_log(
    path: Path | str,
    log: FlightLog,
    *,
    dtype: Literal["float32", "float64"] = "float32",
    runs_per_group: int = RUNS_PER_GROUP,
) -> None:
    """Write a flight log atomically, its runs sorted by name.

    Parameters
    ----------
    path : file to write; its folder must exist.
    log : the log; its metadata must be JSON.
    dtype : type of the channels, "float32" or "float64"; time is always float64.
    runs_per_group : runs per row group, the unit of random access.

    Raises
    ------
    ConfigurationError
        If ``dtype`` is another type.
    LogError
        If the offsets do not divide the rows into runs, a channel has another number of rows, or the metadata are no JSON.
    StoreError
        If the file cannot be written.

    Examples
    --------
    >>> log = at.read_log("out/light")
    >>> at.write_log("first.parquet", log.select(log.run_ids[0]))
    >>> at.read_log("first.parquet")
    FlightLog(1 run of 5 s at 50 Hz, 11 channels: airspeed_m_s, alpha_rad, theta_rad, q_rad_s, ...)
    """
    if dtype not in _TYPES:
        raise ConfigurationError(f"{path}: dtype = {dtype!r}: {choices(str(dtype), _TYPES)}")
    require_whole("runs_per_group", runs_per_group, 1)
    fields = [pa.field(RUN_ID, pa.string()), _field(TIME, "float64")]
    fields += [_field(name, dtype) for name in log.channels]
    problems = list(row_problems(log))
    if problems:
        raise LogError(f"{path}: {'; '.join(problems)}")
    try:
        document = json.dumps({"schema": SCHEMA, **log.metadata}, allow_nan=False).encode()
    except (TypeError, ValueError) as error:
        raise LogError(
            f"{path}: the metadata are no JSON ({error}); give text, finite numbers, lists and dicts"
        ) from None
    schema = pa.schema(fields, metadata={KEY: document})
    order = sorted(range(len(log.run_ids)), key=log.run_ids.__getitem__)
    with atomic_file(path) as file, _writer(file, schema) as writer:
        for first in range(0, len(order), runs_per_group):
            writer.write_table(_group(log, order[first : first + runs_per_group], schema))


def read_log(
    path: Path | str, columns: Sequence[str] | None = None, run_ids: Collection[str] | None = None
) -> FlightLog:
    """Read a flight log; the values are not checked, see `airtruth.checks.gate`.

    Parameters
    ----------
    path : Parquet file.
    columns : channels to read, any numeric column; None reads those of the vocabulary
        (`airtruth.channels.SIGNALS`) and all other floating-point ones.
    run_ids : runs to read, in the file's order; None reads all.

    Returns
    -------
    FlightLog
        Channels (rows,) float64 in SI, C-contiguous; a missing value is NaN.

    Raises
    ------
    StoreError
        If the file cannot be read, is damaged, or has two columns of one name.
    LogError
        If it is not a flight log, or lacks a column or run that was requested.
    """
    path = location(path)
    with opened(path) as file:
        names = _channels(path, file.schema_arrow, columns)
        require_memory(path, file.metadata.num_rows, len(names) + 2 if run_ids is None else 1)
        ids, offsets = _runs(path, file.read([RUN_ID]).column(RUN_ID))
        keep: slice | NDArray[np.int64] = slice(None)
        if run_ids is None:
            table = file.read([TIME, *names])
        else:
            ids, offsets, groups, keep = _select(path, file.metadata, ids, offsets, run_ids)
            require_memory(path, sum(file.metadata.row_group(g).num_rows for g in groups), len(names) + 2)
            table = file.read_row_groups(groups, [TIME, *names])
    logging.getLogger("airtruth").debug("read %s: %d runs", path, len(ids))
    metadata = metadata_of(path, file.schema_arrow)
    stated = _stated_units(file.schema_arrow, names)
    return FlightLog(
        metadata={**metadata, STATED_UNITS: stated} if stated else metadata,
        run_ids=ids,
        offsets=offsets,
        t_s=_floats(table.column(TIME), keep),
        channels={name: _floats(table.column(name), keep) for name in names},
    )


def log_paths(path: str | os.PathLike[str]) -> list[Path]:
    """Flight log files at a path: the file itself, or those in its folder ``logs`` or in the folder.

    Parameters
    ----------
    path : log file, campaign folder, or folder of logs.

    Returns
    -------
    list of Path
        Sorted by name, without `CAMPAIGN_TABLES`.

    Raises
    ------
    StoreError
        If the path does not exist or holds no log, or a campaign folder lacks a log that its manifest records.
    """
    path = location(path)
    try:
        if path.is_file():
            return [path]
        exists = path.exists()
    except OSError:  # a name that the file system does not take
        exists = False
    if not exists:
        raise StoreError(f"{path}: no such file or folder; give a log (.parquet) or a folder of logs")
    folder = path / "logs" if (path / "logs").is_dir() else path
    paths = _logs_of(folder, "*.parquet")
    if not paths:
        below = next(iter(_logs_of(folder, "*/*.parquet")), None)
        step = (
            "`airtruth fly` or `airtruth import` writes them"
            if below is None
            else f"{below} lies in a folder below it: give that folder, or write a partitioned data set as one file"
        )
        raise StoreError(f"{folder}: holds no flight log (*.parquet); {step}")
    if folder is not path:
        _require_recorded(path, {p.name for p in paths})
    return paths


def _require_recorded(campaign: Path, present: Collection[str]) -> None:
    """Refuse a campaign folder without a log that was flown: a result would not show that runs are missing."""
    recorded: set[str] = set()
    for record in manifest.scan(campaign / MANIFEST).records:
        files = record.get("files")
        recorded |= set(files) if isinstance(files, Mapping) else set()
    names = sorted(
        name for name in recorded if name.startswith("logs/") and name.removeprefix("logs/") not in present
    )
    if names:
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        raise StoreError(
            f"{campaign / names[0]}{more}: recorded in {MANIFEST} and missing; `airtruth fly` with the same campaign and "
            f"folder writes it again, or give {campaign / 'logs'} to use the logs that are left"
        )


def _logs_of(folder: Path, pattern: str) -> list[Path]:
    return sorted(p for p in folder.glob(pattern) if p.name not in CAMPAIGN_TABLES)


def iter_logs(path: Path | str, columns: Sequence[str] | None = None) -> Iterator[FlightLog]:
    """Read the logs at a path one file at a time; see `log_paths` and `read_log`."""
    for file in log_paths(path):
        yield read_log(file, columns)


def _stated_units(schema: pa.Schema, names: Sequence[str]) -> dict[str, str]:
    """Units in the metadata of the columns, where they are not those of the channels."""
    result = {}
    for name in names:
        facts = schema.field(name).metadata or {}
        unit = (facts.get(b"unit") or facts.get(b"units") or b"").decode(errors="replace").strip()
        if name in SIGNALS and unit and unit != SIGNALS[name].unit:
            result[name] = unit
    return result


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
    repeated = [name for name, count in Counter(schema.names).items() if count > 1]
    if repeated:
        raise StoreError(
            f"{path}: column {repeated[0]!r} occurs more than once; rename or remove all but one"
        )
    lacking = [name for name in (RUN_ID, TIME) if name not in schema.names]
    if lacking:
        raise LogError(
            f"{path}: is not a flight log, it has no column {' nor '.join(lacking)} "
            f"(columns: {', '.join(schema.names[:12])}); convert it with `airtruth import`"
        )
    version = metadata_of(path, schema).get("schema", SCHEMA)
    if version != SCHEMA:
        newer = isinstance(version, int) and version > SCHEMA
        step = "use a newer airtruth" if newer else f"state schema {SCHEMA}, a number, in the metadata"
        raise LogError(f"{path}: log schema {version!r}, but this version reads schema {SCHEMA}; {step}")
    kinds = {f.name: f.type for f in schema}
    if not (pa.types.is_floating(kinds[TIME]) or pa.types.is_decimal(kinds[TIME])):
        raise LogError(
            f"{path}: {TIME} is {kinds[TIME]}, not a floating-point time in seconds; write the seconds from the start of "
            "each run as float64"
        )
    if columns is None:
        return [
            name
            for name in schema.names
            if name not in (RUN_ID, TIME)
            and (pa.types.is_floating(kinds[name]) or _is_signal(path, name, kinds[name]))
        ]
    wanted = [name for name in dict.fromkeys(columns) if name not in (RUN_ID, TIME)]
    for name in wanted:
        if name not in kinds:
            raise LogError(f"{path}: no channel {name!r}; {choices(name, kinds.keys() - {RUN_ID, TIME})}")
        _require_numeric(path, name, kinds[name])
    return wanted


def _is_signal(path: Path, name: str, kind: pa.DataType) -> bool:
    """Whether a column is a channel of the vocabulary, which has to be numeric; a column without any value is none."""
    if name not in SIGNALS or pa.types.is_null(kind):
        return False
    _require_numeric(path, name, kind)
    return True


def _require_numeric(path: Path, name: str, kind: pa.DataType) -> None:
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
        unit = f" [{SIGNALS[name].unit}]" if name in SIGNALS else ""
        raise LogError(
            f"{path}: channel {name!r} is {kind}, not numeric; write it as float64{unit}, or leave it out"
        )


def _runs(path: Path, column: pa.ChunkedArray) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if pa.types.is_string_view(kind):
        column = column.cast(pa.string())
    elif not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
        raise LogError(f"{path}: {RUN_ID} is {kind}, not a string; write the names of the runs as strings")
    if column.null_count:
        row = int(np.flatnonzero(column.is_null().to_numpy())[0])
        rows = counted(column.null_count, "row")
        raise LogError(
            f"{path}: {RUN_ID} is empty in {rows}, the first is row {row}; name the run of each row"
        )
    if len(column) == 0:
        raise LogError(f"{path}: the log has no rows; fly or import it again")
    encoded = column if pa.types.is_dictionary(column.type) else column.dictionary_encode()
    encoded = encoded.unify_dictionaries().combine_chunks()
    index = np.from_dlpack(encoded.indices)
    starts = np.flatnonzero(np.diff(index, prepend=-1))
    names = encoded.dictionary.to_pylist()
    return tuple(names[i] for i in index[starts].tolist()), np.append(starts, len(index)).astype(np.int64)


def _select(
    path: Path,
    metadata: pq.FileMetaData,
    ids: tuple[str, ...],
    offsets: NDArray[np.int64],
    wanted: Collection[str],
) -> tuple[tuple[str, ...], NDArray[np.int64], list[int], NDArray[np.int64]]:
    """Names and offsets of the wanted runs, the row groups that hold them, and their rows in those groups."""
    runs = [run for run, name in enumerate(ids) if name in set(wanted)]
    missing = set(wanted) - set(ids)
    if missing:
        raise LogError(f"{path}: {unknown_runs(missing, ids)}")
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
    if pa.types.is_decimal(column.type):
        column = column.cast(pa.float64())
    return np.ascontiguousarray(_numbers(column)[keep], dtype=np.float64)


def _numbers(column: pa.ChunkedArray) -> NDArray[Any]:
    """The column as numpy has it; `to_numpy` imports pandas, which takes longer than to identify a log."""
    kind = column.type
    plain = pa.types.is_float32(kind) or pa.types.is_float64(kind) or pa.types.is_integer(kind)
    if column.null_count or not plain or not column.num_chunks:
        return np.asarray(column.to_numpy())
    return np.concatenate([np.from_dlpack(chunk) for chunk in column.chunks])


__all__ = [
    "CAMPAIGN_TABLES",
    "RUNS_PER_GROUP",
    "SCHEMA",
    "STATED_UNITS",
    "iter_logs",
    "log_paths",
    "read_log",
    "read_metadata",
    "read_table",
    "write_log",
    "write_table",
    "write_text",
]
