"""Typed reading of Parquet tables: columns of text, numbers and flags, or one error that names what is wrong."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from airtruth.errors import LogError, StoreError
from airtruth.logs.tables import source_of

Array = NDArray[np.float64]

Kind = Literal["text", "number", "flag"]
"""Kind of a column: strings, float or integer numbers, or true and false."""

_WANTED: Final[Mapping[Kind, pa.DataType]] = {
    "text": pa.string(),
    "number": pa.float64(),
    "flag": pa.bool_(),
}
"""Type to which a column of a kind is cast."""

BUFFER_BYTES: Final = 65_536
"""Bytes of a column that are read at a time [byte] (judgement): a row group of all columns need not be in memory."""


def read_columns(
    path: Path, kinds: Mapping[str, Kind], writer: str, optional: Sequence[str] = ()
) -> pa.Table:
    """Read columns of a Parquet file and cast them to string, float64 or bool.

    Parameters
    ----------
    path : the file.
    kinds : column -> kind. An empty cell becomes "" or NaN; a flag must not be empty.
    writer : command that writes the file, for messages.
    optional : columns of ``kinds`` that the file may lack.

    Raises
    ------
    StoreError
        If the file is missing or cannot be read.
    LogError
        If a column is missing, appears twice or holds another kind.
    """
    with _opened(path, writer) as file:
        wanted = _wanted(path, file.schema_arrow.names, kinds, writer, optional)
        table = file.read(wanted)
    return _cast_table(table, kinds, path, writer)


def columns_of(path: Path, writer: str = "`airtruth identify`") -> list[str]:
    """Return the names of the columns of a file.

    Raises
    ------
    StoreError
        If it is missing or cannot be read.
    """
    with _opened(path, writer) as file:
        return list(file.schema_arrow.names)


def column_parts(
    path: Path, kinds: Mapping[str, Kind], writer: str, optional: Sequence[str] = (), *, rows: int
) -> Iterator[pa.Table]:
    """Read columns as `read_columns` does, up to ``rows`` rows at a time."""
    with _opened(path, writer) as file:
        wanted = _wanted(path, file.schema_arrow.names, kinds, writer, optional)
        for batch in file.iter_batches(batch_size=rows, columns=wanted, use_threads=False):
            yield _cast_table(pa.Table.from_batches([batch]), kinds, path, writer)


@contextmanager
def _opened(path: Path, writer: str) -> Iterator[pq.ParquetFile]:
    if not path.is_file():
        raise StoreError(f"{path}: missing; {writer} writes it")
    try:
        with (
            source_of(path) as source,
            pq.ParquetFile(source, page_checksum_verification=True, buffer_size=BUFFER_BYTES) as file,
        ):
            yield file
    except (pa.ArrowException, OSError, UnicodeError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise StoreError(
            f"{path}: not a readable Parquet file ({reason}); {writer} writes it again"
        ) from error


def _wanted(
    path: Path, names: Sequence[str], kinds: Mapping[str, Kind], writer: str, optional: Sequence[str]
) -> list[str]:
    """Columns of ``kinds`` that a file has."""
    wanted = [name for name in kinds if name in names]
    missing = [name for name in kinds if name not in names and name not in optional]
    twice = [name for name in wanted if names.count(name) > 1]
    if missing or twice:
        faults = [f"column {name!r} appears twice" for name in twice] + [_missing(n, names) for n in missing]
        raise LogError(f"{path}: {'; '.join(faults)}; {writer} writes all columns that reports need")
    return wanted


def _cast_table(table: pa.Table, kinds: Mapping[str, Kind], path: Path, writer: str) -> pa.Table:
    names = table.column_names
    return pa.table({name: _cast(table.column(name), name, kinds[name], path, writer) for name in names})


def texts(table: pa.Table, name: str) -> list[str]:
    """Return a column of text."""
    return [str(value) for value in table.column(name).to_pylist()]


def numbers(table: pa.Table, names: Sequence[str]) -> Array:
    """Return columns of numbers, (rows, columns)."""
    return np.stack([table.column(name).to_numpy() for name in names], axis=1)


def flags(table: pa.Table, name: str) -> NDArray[np.bool_]:
    """Return a column of flags, (rows,)."""
    return np.asarray(table.column(name).to_pylist(), dtype=np.bool_)


def _missing(name: str, names: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.8)
    return f"column {name!r} is missing" + (f" (there is {near[0]!r})" if near else "")


def _cast(column: pa.ChunkedArray, name: str, kind: Kind, path: Path, writer: str) -> pa.ChunkedArray:
    stored = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    allowed = {
        "text": pa.types.is_string(stored) or pa.types.is_large_string(stored),
        "number": pa.types.is_floating(stored) or pa.types.is_integer(stored),
        "flag": pa.types.is_boolean(stored),
    }[kind]
    if not (allowed or pa.types.is_null(stored)):  # pyarrow gives a column without any value no type
        raise LogError(
            f"{path}: column {name!r} holds {stored}, not {_WANTED[kind]}; {writer} writes it again"
        )
    try:
        converted = column.cast(_WANTED[kind], safe=False)
        converted.validate(full=True)
    except (pa.ArrowException, UnicodeError) as error:
        raise StoreError(f"{path}: column {name!r} is damaged ({error}); {writer} writes it again") from error
    if kind == "flag":
        if converted.null_count:
            raise LogError(f"{path}: column {name!r} has empty cells; {writer} writes it again")
        return converted
    if not converted.null_count:
        return converted
    return pc.fill_null(converted, "" if kind == "text" else float("nan"))
