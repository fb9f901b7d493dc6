"""Foreign files as named arrays; what the arrays mean is for the mapping to say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, LogError, StoreError, choices
from airtruth.logs.importers.mapping import Place, SourceSection

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """A file that was read.

    Attributes
    ----------
    path : the file.
    arrays : name -> values, (rows,) or, of a matrix, (rows, columns); text columns hold strings.
    clocks : name -> times [s] of an array that brings its own.
    labels : matrix -> names of its columns, where the file tells them.
    ordered : whether the arrays are the columns of one table, so that a number means one of them.
    first_line : line of the first row in a text file, 0 if it is none.
    """

    path: Path
    arrays: Mapping[str, NDArray[Any]]
    clocks: Mapping[str, Array] = field(default_factory=dict)
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ordered: bool = True
    first_line: int = 0


def open_source(path: Path | str, section: SourceSection | None = None) -> Source:
    """Read a file of any supported format.

    Raises
    ------
    StoreError
        If it is missing, empty, truncated or not of its format.
    ConfigurationError
        If the format is unknown or its optional package is not installed.
    """
    path = Path(path)
    section = section or SourceSection()
    name = section.format or SUFFIXES.get(path.suffix.lower())
    if name is None:
        raise ConfigurationError(
            f"{path}: suffix {path.suffix!r} names no format; state [source] format, one of {', '.join(FORMATS)}"
        )
    if not path.is_file():
        raise StoreError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise StoreError(f"{path}: the file is empty; export it again")
    return FORMATS[name](path, section)


def numbers(source: Source, place: Place, variable: str | None = None) -> tuple[Array, Array | None]:
    """Values of a column (rows,) float64, and their own times [s] if the file has such.

    Raises
    ------
    LogError
        If there is no such column, or it holds text.
    """
    values, name = column(source, place, variable)
    shown = f"{source.path}: column {place.column!r}"
    if values.dtype.kind in "biuf":
        return values.astype(np.float64), source.clocks.get(name)
    result = np.empty(len(values))
    for row, text in enumerate(values):
        try:
            result[row] = np.nan if text is None or str(text).strip() == "" else float(text)
        except (TypeError, ValueError):
            line = f"line {row + source.first_line}" if source.first_line else f"row {row + 1}"
            raise LogError(
                f"{shown}, {line}: {str(text)[:40]!r} is not a number; repair it, "
                "or set [source] skip_rows, delimiter or decimal"
            ) from None
    return result, source.clocks.get(name)


def column(source: Source, place: Place, variable: str | None = None) -> tuple[NDArray[Any], str]:
    """Values as the file has them, and the name of their array; raises `LogError` if there are none."""
    variable = place.variable or variable
    key = place.column
    if variable is None and source.ordered and isinstance(key, int):
        if key > len(source.arrays):
            raise LogError(
                f"{source.path}: no column {key}; the file has {len(source.arrays)}, counted from 1"
            )
        name = list(source.arrays)[key - 1]
        return source.arrays[name], name
    if isinstance(key, str) and key in source.arrays and place.variable is None:
        values = source.arrays[key]
        if values.ndim == 2:
            raise LogError(
                f"{source.path}: {key!r} is a matrix of {values.shape[0]} x {values.shape[1]}; "
                f'state variable = "{key}" and a column number'
            )
        return values, key
    if variable is None:
        what = repr(key) if isinstance(key, str) else f"{key} (of which matrix? state variable)"
        raise LogError(f"{source.path}: no column {what}; {choices(str(key), source.arrays)}")
    if variable not in source.arrays:
        raise LogError(f"{source.path}: no variable {variable!r}; {choices(variable, source.arrays)}")
    matrix = source.arrays[variable]
    if matrix.ndim == 1:
        matrix = matrix[:, None]
    if isinstance(key, str):
        labels = source.labels.get(variable, ())
        if key not in labels:
            known = (
                choices(key, labels)
                if labels
                else f"its columns have no names, only numbers 1 to {matrix.shape[1]}"
            )
            raise LogError(f"{source.path}: no column {key!r} in {variable!r}; {known}")
        key = labels.index(key) + 1
    if key > matrix.shape[1]:
        raise LogError(
            f"{source.path}: no column {key} in {variable!r}, which has {matrix.shape[1]}, counted from 1"
        )
    return matrix[:, key - 1], variable


def _text(path: Path, section: SourceSection, delimiter: str) -> Source:
    import pandas as pd

    try:
        with path.open(encoding="utf-8-sig") as file:
            lines = file.read().splitlines()
    except UnicodeDecodeError as error:
        raise StoreError(
            f"{path}: is not text in UTF-8 ({error.reason} at byte {error.start}); save it as UTF-8"
        ) from None
    first = section.skip_rows
    while first < len(lines) and (not lines[first].strip() or lines[first].lstrip()[0] in "#%"):
        first += 1
    if first >= len(lines):
        raise StoreError(f"{path}: holds no rows; export it again, or lower [source] skip_rows")
    header = section.header
    if header is None:
        cells = lines[first].split() if delimiter == r"\s+" else lines[first].split(delimiter)
        header = not any(_is_number(cell, section.decimal) for cell in cells)
    try:
        frame = pd.read_csv(
            path,
            sep=delimiter,
            decimal=section.decimal,
            header=0 if header else None,
            skiprows=first,
            skip_blank_lines=False,
            skipinitialspace=True,
            encoding="utf-8-sig",
            comment="#" if any("#" in line for line in lines[first + 1 :]) else None,
        )
    except (ValueError, pd.errors.ParserError) as error:
        raise StoreError(f"{path}: is not a table ({str(error).strip()}); check [source] delimiter") from None
    if frame.empty:
        raise StoreError(f"{path}: holds a header and no rows; export it again")
    arrays = {
        str(name).strip() if header else f"{i}": frame.iloc[:, i - 1].to_numpy()
        for i, name in enumerate(frame.columns, 1)
    }
    return Source(path, arrays, first_line=first + 1 + header)


def _is_number(text: str, decimal: str) -> bool:
    try:
        float(text.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True


def _csv(path: Path, section: SourceSection) -> Source:
    return _text(path, section, section.delimiter)


def _table(path: Path, section: SourceSection) -> Source:
    return _text(path, section, r"\s+")


def _parquet(path: Path, section: SourceSection) -> Source:
    from airtruth.logs.tables import read_table

    frame = read_table(path)
    if frame.empty:
        raise StoreError(f"{path}: holds no rows; export it again")
    return Source(path, {str(name): frame[name].to_numpy() for name in frame.columns})


def _mat(path: Path, section: SourceSection) -> Source:
    from airtruth.logs.importers.matlab import read_mat

    arrays, labels = read_mat(path)
    return Source(path, arrays, labels=labels, ordered=False)


def _ulg(path: Path, section: SourceSection) -> Source:
    from airtruth.logs.importers.ulog import read_ulog

    arrays, clocks = read_ulog(path)
    return Source(path, arrays, clocks, ordered=False)


FORMATS: Final[dict[str, Callable[[Path, SourceSection], Source]]] = {
    "csv": _csv,
    "table": _table,
    "mat": _mat,
    "parquet": _parquet,
    "ulg": _ulg,
}
SUFFIXES: Final = {
    ".csv": "csv",
    ".txt": "table",
    ".dat": "table",
    ".asc": "table",
    ".mat": "mat",
    ".parquet": "parquet",
    ".ulg": "ulg",
}

__all__ = ["FORMATS", "SUFFIXES", "Source", "column", "numbers", "open_source"]
