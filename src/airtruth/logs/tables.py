"""Plain tables (plan, truth, estimates) as Parquet files, and the parts that all Parquet files share."""

from __future__ import annotations

import errno
import importlib
import io
import json
import os
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from airtruth.errors import LogError, StoreError, choices, reason
from airtruth.logs.atomic import atomic_file
from airtruth.logs.remote import RemotePath, answered, location

if TYPE_CHECKING:
    import pandas as pd

KEY: Final = b"airtruth"
"""Key of the file-level JSON in the Parquet metadata (contract 1)."""


def write_table(
    path: Path | str, table: pa.Table | pd.DataFrame, metadata: Mapping[str, object] | None = None
) -> None:
    """Write a plain table atomically.

    Parameters
    ----------
    path : file to write; its folder must exist.
    table : pyarrow table or pandas frame (its index is dropped).
    metadata : facts about the table, JSON; kept under the key "airtruth".

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    with atomic_file(path) as file:
        _write(table, file, metadata)


def table_bytes(table: pa.Table | pd.DataFrame) -> bytes:
    """Return the content of the file that `write_table` writes."""
    buffer = io.BytesIO()
    _write(table, buffer, None)
    return buffer.getvalue()


def read_table(path: Path | str, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Read a plain table, all columns or those named, in that order.

    Raises
    ------
    StoreError
        If the file cannot be read, is damaged, or lacks a column.
    """
    path = location(path)
    with opened(path) as file:
        present = file.schema_arrow.names
        for name, count in Counter(present).items():
            if count > 1:
                raise StoreError(f"{path}: column {name!r} occurs more than once; write the file again")
        for name in columns or ():
            if name not in present:
                raise StoreError(f"{path}: no column {name!r}; {choices(name, present)}")
        require_memory(path, file.metadata.num_rows, len(present if columns is None else columns))
        frame = _to_pandas(path, file.read(columns, use_threads=False))
    return frame if columns is None else frame[list(columns)]


def group_ends(path: Path | str) -> NDArray[np.int64]:
    """Number of rows up to the end of each row group of a plain table, (groups,).

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    with opened(location(path)) as file:
        sizes = [file.metadata.row_group(k).num_rows for k in range(file.metadata.num_row_groups)]
    return np.cumsum(sizes, dtype=np.int64)


def read_group(path: Path | str, group: int) -> pd.DataFrame:
    """Read one row group of a plain table.

    Raises
    ------
    StoreError
        If the file cannot be read, or the group is damaged.
    """
    path = location(path)
    with opened(path) as file:
        return _to_pandas(path, file.read_row_group(group, use_threads=False))


def read_rows(path: Path | str, rows: NDArray[np.int64]) -> pd.DataFrame:
    """Read rows of a plain table by their numbers, which ascend; the memory holds one row group.

    Raises
    ------
    StoreError
        If the file cannot be read, or is damaged there.
    """
    import pandas as pd

    ends = group_ends(path)
    group_of = np.searchsorted(ends, rows, side="right")
    parts: list[pd.DataFrame] = [
        read_group(path, k).iloc[rows[group_of == k] - (ends[k - 1] if k else 0)]
        for k in np.unique(group_of).tolist()
    ]
    whole: pd.DataFrame = pd.concat(parts, ignore_index=True)
    return whole


ROWS_PER_GROUP: Final = 8_192
"""Rows of a row group [-] (judgement: some 3 MB in memory, and few enough groups that a query skips them)."""


def write_parts(
    path: Path | str, parts: Iterable[pa.Table], metadata: Mapping[str, object] | None = None
) -> int:
    """Write tables of one schema one after another as one file, atomically; the memory holds one row group.

    The bytes depend on the rows alone, not on how they are divided into parts.

    Parameters
    ----------
    path : file to write; its folder must exist.
    parts : the tables, at least one; the first one's metadata are kept.
    metadata : as in `write_table`.

    Returns
    -------
    int
        Number of rows.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    waiting: list[pa.Table] = []
    rows = written = 0
    with atomic_file(path) as file, ExitStack() as stack:
        writer = None
        for part in parts:
            if writer is None:
                schema = part.schema.with_metadata(_metadata(part, metadata))
                writer = stack.enter_context(
                    pq.ParquetWriter(file, schema, compression="zstd", write_page_checksum=True)
                )
            waiting.append(part.cast(schema))
            rows += part.num_rows
            while rows - written >= ROWS_PER_GROUP:
                writer.write_table(_taken(waiting, ROWS_PER_GROUP))
                written += ROWS_PER_GROUP
        if writer is not None and (rows > written or not rows):
            writer.write_table(_taken(waiting, rows - written))
    return rows


def _taken(waiting: list[pa.Table], rows: int) -> pa.Table:
    """Take the first rows of tables as one table; a column at a time, so that the memory does not hold them twice."""
    whole = pa.concat_tables(waiting)
    schema, columns = whole.schema, [column.chunks for column in whole.slice(0, rows).columns]
    waiting[:] = [whole.slice(rows)] if whole.num_rows > rows else []
    del whole
    joined: list[pa.Array] = []
    while columns:
        chunks = columns.pop(0)
        joined.append(pa.concat_arrays(chunks) if chunks else pa.array([], schema.field(len(joined)).type))
        del chunks
    return pa.Table.from_arrays(joined, schema=schema)


Kind = Literal["text", "number", "flag"]
"""Kind of a column: strings, numbers, or true and false."""


def require_kinds(path: Path | str, frame: pd.DataFrame, kinds: Mapping[str, Kind], step: str) -> None:
    """Refuse a table that lacks a column, or holds another kind of values in it.

    Parameters
    ----------
    path, frame : the file and what was read from it.
    kinds : column -> kind.
    step : next step of the user.

    Raises
    ------
    StoreError
        Naming the first such column.
    """
    for name, kind in kinds.items():
        if name not in frame:
            raise StoreError(f"{path}: no column {name!r}; {step}")
        if not _is_kind(frame[name], kind):
            raise StoreError(
                f"{path}: column {name!r} holds {frame[name].dtype}, not a {kind} in each row; {step}"
            )


def _is_kind(values: pd.Series[Any], kind: Kind) -> bool:
    from pandas.api import types

    if kind == "text":
        return not values.isna().any() and types.infer_dtype(values) in ("string", "empty")
    is_flag = types.is_bool_dtype(values.dtype)
    return is_flag if kind == "flag" else types.is_numeric_dtype(values.dtype) and not is_flag


def read_metadata(path: Path | str) -> dict[str, object]:
    """Read the file-level JSON of a log or table, {} if it has none.

    Raises
    ------
    StoreError
        If the file cannot be read or is damaged.
    LogError
        If the JSON is malformed.
    """
    path = location(path)
    with readable(path), source_of(path) as source:
        schema = pq.read_schema(source)
    return metadata_of(path, schema)


def metadata_of(path: Path, schema: pa.Schema) -> dict[str, object]:
    """Parse the file-level JSON of an open file; raises `LogError` if it is malformed."""
    try:
        document = json.loads((schema.metadata or {}).get(KEY, b"{}"))
    except (ValueError, RecursionError) as error:
        raise LogError(f"{path}: the file-level JSON under 'airtruth' is malformed ({error})") from error
    if not isinstance(document, dict):
        raise LogError(f"{path}: the file-level JSON under 'airtruth' is not an object")
    return document


_NO_THREAD: Final = "Failed to launch worker thread"
"""Words of pyarrow's error where the system refuses a thread, which takes some MB of address space."""
BYTES_PER_VALUE: Final = 16
"""Memory for reading one number [byte]: a float64 in the table of pyarrow and its copy in the log."""


@contextmanager
def opened(path: Path) -> Iterator[pq.ParquetFile]:
    """Open a Parquet file whose column names and checksums are verified, see `readable`."""
    with (
        readable(path),
        source_of(path) as source,
        pq.ParquetFile(source, page_checksum_verification=True) as file,
    ):
        yield file


@contextmanager
def source_of(path: Path) -> Iterator[Path | BinaryIO]:
    """Argument for pyarrow: the path, or the opened file of a store or where the path's name is not UTF-8."""
    if isinstance(path, RemotePath):
        with path.opened() as file:
            yield file
        return
    try:
        str(path).encode()
    except UnicodeEncodeError:
        with path.open("rb") as file:
            yield file
        return
    yield path


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Turn any error of pyarrow on a missing, foreign or damaged file into a `StoreError`."""
    try:
        yield
    except FileNotFoundError as error:
        raise StoreError(f"{path}: no such file") from error
    except PermissionError as error:
        raise StoreError(f"{path}: cannot be read; permission denied") from error
    except UnicodeError as error:
        raise StoreError(
            f"{path}: a column name or text is not UTF-8 ({error}); write the file again with UTF-8 names"
        ) from error
    except (OSError, pa.ArrowException) as error:
        if isinstance(path, RemotePath) and not isinstance(error, pa.ArrowException):
            with answered(path):
                raise
        if "worker thread" in str(error):
            raise StoreError(
                f"{path}: cannot be read; no thread can be started: raise the limits of memory and processes (ulimit -v, -u)"
            ) from None
        if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
            raise StoreError(
                f"{path}: cannot be read; too many files are open: raise the limit (ulimit -n)"
            ) from None
        if _NO_THREAD in str(error) or isinstance(error, pa.ArrowMemoryError):
            raise StoreError(
                f"{path}: cannot be read for lack of memory or threads; raise the limits (ulimit -v, ulimit -u) and run "
                "again"
            ) from error
        raise StoreError(
            f"{path}: is not a Parquet file, or is truncated or damaged ({reason(error)}); write it again, "
            "or convert another format with `airtruth import`"
        ) from error


def require_memory(path: Path, rows: int, columns: int) -> None:
    """Refuse to read more numbers than the memory of this machine holds: a file of some kB can declare any number.

    Raises
    ------
    StoreError
        Naming both sizes and the next step.
    """
    needed, present = rows * columns * BYTES_PER_VALUE, _memory_bytes()
    if needed > present:
        raise StoreError(
            f"{path}: declares {rows} rows, which need {needed / 1e9:.3g} GB of memory where {present / 1e9:.3g} GB "
            "exist; write it again if it should be short, or divide it into several files"
        )


def _memory_bytes() -> int:
    """Memory of this machine [byte], less where the process is limited; unlimited where the system does not tell."""
    sizes = [sys.maxsize]
    try:
        sizes.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        resource = importlib.import_module("resource")
    except (AttributeError, ImportError, OSError, ValueError):  # not a POSIX system
        return sizes[-1]
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return min(sizes if soft == resource.RLIM_INFINITY else [*sizes, soft])


def _metadata(table: pa.Table, metadata: Mapping[str, object] | None) -> dict[bytes, bytes]:
    kept = dict(table.schema.metadata or {})
    if metadata is not None:
        kept[KEY] = json.dumps(metadata, allow_nan=False).encode()
    return kept


def _write(table: pa.Table | pd.DataFrame, file: BinaryIO, metadata: Mapping[str, object] | None) -> None:
    if not isinstance(table, pa.Table):
        table = pa.Table.from_pandas(table, preserve_index=False)
    kept = _metadata(table, metadata)
    pq.write_table(
        table.replace_schema_metadata(kept),
        file,
        row_group_size=ROWS_PER_GROUP,
        compression="zstd",
        write_page_checksum=True,
    )


def _to_pandas(path: Path, table: pa.Table) -> pd.DataFrame:
    try:
        frame: pd.DataFrame = table.to_pandas(use_threads=False)
    except (pa.ArrowException, UnicodeError):
        raise
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise StoreError(
            f"{path}: the pandas metadata of the file is damaged ({type(error).__name__}: {error}); "
            "write the file again"
        ) from error
    return frame


__all__ = [
    "KEY",
    "ROWS_PER_GROUP",
    "group_ends",
    "metadata_of",
    "opened",
    "read_group",
    "read_metadata",
    "read_rows",
    "read_table",
    "readable",
    "require_memory",
    "source_of",
    "table_bytes",
    "write_parts",
    "write_table",
]
