"""The formats by name: what `airtruth.importers.sources` calls in a disposable process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from airtruth.errors import StoreError
from airtruth.foreign.dates import is_date, seconds
from airtruth.foreign.source import Source, packed, table_source
from airtruth.foreign.text import WHITESPACE, TextFormat, read_text
from airtruth.isolation.protocol import Reply


def read(path: str, name: str, layout: Mapping[str, Any]) -> Reply:
    """Read a file of a format.

    Parameters
    ----------
    path : the file.
    name : key of `FORMATS`.
    layout : fields of `TextFormat`, which text alone uses.

    Raises
    ------
    StoreError
        If it is truncated, damaged or not of its format.
    ConfigurationError
        If the optional package of the format is not installed.
    """
    return packed(_READERS[name](Path(path), TextFormat(**layout)))


def _csv(path: Path, layout: TextFormat) -> Source:
    return read_text(path, layout)


def _table(path: Path, layout: TextFormat) -> Source:
    return read_text(path, replace(layout, delimiter=WHITESPACE))


def _parquet(path: Path, layout: TextFormat) -> Source:
    from airtruth.logs.tables import read_table

    frame = read_table(path)
    if any(name is not None for name in frame.index.names):  # pandas writes a named index as columns
        frame = frame.reset_index()
    if frame.empty:
        raise StoreError(f"{path}: holds no rows; export it again")
    parts = [frame.iloc[:, i] for i in range(frame.shape[1])]
    columns = [seconds(part) if is_date(part) else part.to_numpy() for part in parts]
    names = [str(name) for name in frame.columns]
    dates = [name for name, part in zip(names, parts, strict=True) if is_date(part)]
    return table_source(path, names, columns, dates=dates)


def _mat(path: Path, layout: TextFormat) -> Source:
    from airtruth.foreign.matlab import read_mat

    arrays, labels = read_mat(path)
    return Source(path, arrays, labels=labels, ordered=False)


def _ulg(path: Path, layout: TextFormat) -> Source:
    from airtruth.foreign.ulog import read_ulog

    arrays, clocks = read_ulog(path)
    return Source(path, arrays, clocks, ordered=False)


def _dataflash(path: Path, layout: TextFormat) -> Source:
    from airtruth.foreign.dataflash import read_dataflash

    return read_dataflash(path)


def _mdf(path: Path, layout: TextFormat) -> Source:
    from airtruth.foreign.mdf import read_mdf

    return read_mdf(path)


def _hdf5(path: Path, layout: TextFormat) -> Source:
    from airtruth.foreign.hdf5 import read_hdf5

    return read_hdf5(path)


_READERS: Final[dict[str, Callable[[Path, TextFormat], Source]]] = {
    "csv": _csv,
    "table": _table,
    "mat": _mat,
    "parquet": _parquet,
    "ulg": _ulg,
    "dataflash": _dataflash,
    "mdf": _mdf,
    "hdf5": _hdf5,
}
"""Name of a format -> its reader."""
FORMATS: Final[dict[str, tuple[str, ...]]] = {
    "csv": ("pandas",),
    "table": ("pandas",),
    "mat": ("scipy.io", "h5py"),
    "parquet": ("airtruth.logs.tables", "pandas"),
    "ulg": ("pyulog",),
    "dataflash": ("pymavlink.DFReader",),
    "mdf": ("asammdf",),
    "hdf5": ("h5py",),
}
"""Name of a format -> modules that its reader needs, some of them optional."""
SUFFIXES: Final = {
    ".csv": "csv",
    ".txt": "table",
    ".dat": "table",
    ".asc": "table",
    ".mat": "mat",
    ".parquet": "parquet",
    ".ulg": "ulg",
    ".bin": "dataflash",
    ".mf4": "mdf",
    ".mdf": "mdf",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".hdf": "hdf5",
}
"""Suffix of a file -> name of its format."""

__all__ = ["FORMATS", "SUFFIXES", "read"]
