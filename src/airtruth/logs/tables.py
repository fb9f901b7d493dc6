"""Plain tables (plan, truth, estimates) as Parquet files, and what every Parquet file here shares."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import pyarrow as pa
import pyarrow.parquet as pq

from airtruth.errors import LogError, StoreError, choices
from airtruth.logs.atomic import atomic_file

if TYPE_CHECKING:
    import pandas as pd

KEY: Final = b"airtruth"
"""Key of the file-level JSON."""


def write_table(
    path: Path | str, table: pa.Table | pd.DataFrame, metadata: Mapping[str, object] | None = None
) -> None:
    """Write a plain table, whole or not at all.

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
    if not isinstance(table, pa.Table):
        table = pa.Table.from_pandas(table, preserve_index=False)
    kept = dict(table.schema.metadata or {})
    if metadata is not None:
        kept[KEY] = json.dumps(metadata, allow_nan=False).encode()
    with atomic_file(path) as file:
        pq.write_table(
            table.replace_schema_metadata(kept), file, compression="zstd", write_page_checksum=True
        )


def read_table(path: Path | str, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Read a plain table, all columns or those named, in that order.

    Raises
    ------
    StoreError
        If the file cannot be read, is damaged, or lacks a column.
    """
    path = Path(path)
    with readable(path), pq.ParquetFile(path, page_checksum_verification=True) as file:
        present = file.schema_arrow.names
        for name in columns or ():
            if name not in present:
                raise StoreError(f"{path}: no column {name!r}; {choices(name, present)}")
        frame: pd.DataFrame = file.read(columns).to_pandas()
    return frame if columns is None else frame[list(columns)]


def read_metadata(path: Path | str) -> dict[str, object]:
    """The file-level JSON of a log or table, {} if it has none.

    Raises
    ------
    StoreError
        If the file cannot be read or is damaged.
    LogError
        If the JSON is malformed.
    """
    path = Path(path)
    with readable(path):
        schema = pq.read_schema(path)
    return metadata_of(path, schema)


def metadata_of(path: Path, schema: pa.Schema) -> dict[str, object]:
    """The file-level JSON of an opened file; raises `LogError` if it is malformed."""
    try:
        document = json.loads((schema.metadata or {}).get(KEY, b"{}"))
    except ValueError as error:
        raise LogError(f"{path}: the file-level JSON under 'airtruth' is malformed ({error})") from error
    if not isinstance(document, dict):
        raise LogError(f"{path}: the file-level JSON under 'airtruth' is not an object")
    return document


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Turn what pyarrow raises on a missing, foreign or damaged file into one `StoreError`."""
    try:
        yield
    except FileNotFoundError as error:
        raise StoreError(f"{path}: no such file") from error
    except PermissionError as error:
        raise StoreError(f"{path}: cannot be read; permission denied") from error
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise StoreError(
            f"{path}: is not a Parquet file, or is truncated or damaged ({reason}); write it again, "
            "or convert another format with `airtruth import`"
        ) from error


__all__ = ["KEY", "metadata_of", "read_metadata", "read_table", "readable", "write_table"]
