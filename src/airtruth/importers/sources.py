"""Foreign files as named arrays; what the arrays mean is for the mapping to say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, LogError, StoreError, choices
from airtruth.foreign.formats import FORMATS, SUFFIXES
from airtruth.foreign.source import Source, unpacked
from airtruth.importers.mapping import Place, SourceSection
from airtruth.isolation.client import call
from airtruth.isolation.limits import limits_of
from airtruth.isolation.protocol import IsolatedError, Task

Array = NDArray[np.float64]
_UNIT: Final = re.compile(r"[\[(][^\[\]()]*[\])]\s*$")
"""Unit in brackets at the end of a name."""
_UNREAD: Final = {
    **dict.fromkeys((".zip", ".gz", ".7z", ".tar"), "unpack it, and import a file in it"),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "export the table as CSV, and import that file"),
}
"""Suffix of a file that no reader reads -> the next step."""


def open_source(path: Path | str, section: SourceSection | None = None) -> Source:
    """Read a file of any supported format, in a disposable process (`airtruth.isolation`).

    Raises
    ------
    StoreError
        If it is missing, empty, truncated or not of its format, or its reader dies or exceeds a limit.
    ConfigurationError
        If the format is unknown or its optional package is not installed.
    """
    path = Path(path)
    section = section or SourceSection()
    name = section.format or SUFFIXES.get(path.suffix.lower())
    if name is None:
        cure = _UNREAD.get(path.suffix.lower(), f"state [source] format, one of {', '.join(FORMATS)}")
        if path.is_dir():
            raise ConfigurationError(f"{path}: a folder is no log; name a file in it")
        raise ConfigurationError(f"{path}: suffix {path.suffix!r} names no format; {cure}")
    if not path.is_file():
        raise StoreError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise StoreError(f"{path}: the file is empty; export it again")
    return _isolated(path, name, section)


def _isolated(path: Path, name: str, section: SourceSection) -> Source:
    limits = limits_of(path.stat().st_size)
    layout = {
        key: getattr(section, key) for key in ("delimiter", "decimal", "skip_rows", "header", "encoding")
    }
    arguments = {"path": str(path.absolute()), "name": name, "layout": layout}
    try:
        return unpacked(path, call(Task("airtruth.foreign.formats:read", arguments, limits, FORMATS[name])))
    except IsolatedError as error:
        what = {
            "crash": f"the reader of {name} files crashed ({error.detail}), so the file is damaged; export it again",
            "time": f"is not read within {limits.seconds:.0f} s; it is damaged, or export a shorter part of the flight",
            "memory": f"reading it needs more than {limits.memory_bytes / 1e9:.1f} GB of memory; it is damaged, or "
            "export fewer channels or a shorter part of the flight",
            "start": f"the process that reads it does not start ({error.detail}); raise the limits of memory and files "
            "(ulimit -v, -n)",
        }
        raise StoreError(f"{path}: {what[error.kind]}") from None


def records(source: Source, section: SourceSection) -> list[tuple[str, Source]]:
    """Name and content of each struct that a mapping names as a record; one without a name for the whole file.

    Raises
    ------
    LogError
        If there is no such struct.
    """
    if not section.structs:
        return [("", source)]
    listed = []
    for name in section.structs:
        part = source.within(name)
        if not part.arrays:
            known = [one for one in source.structs if one]
            raise LogError(
                f"{source.path}: [source] structs: no struct {name!r}; "
                + (choices(name, known) if known else "the file holds none, so leave structs out")
            )
        listed.append((name, part))
    return listed


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
        with np.errstate(invalid="ignore", over="ignore"):  # a signalling NaN
            return values.astype(np.float64), source.clocks.get(name)
    result = np.empty(len(values))
    for row, text in enumerate(values):
        try:
            result[row] = np.nan if text is None or str(text).strip() == "" else float(text)
        except (TypeError, ValueError):
            line = f"line {source.line(row)}" if source.first_line else f"row {row + 1}"
            raise LogError(
                f"{shown}, {line}: {str(text)[:40]!r} is not a number; repair it, "
                "or set [source] skip_rows, delimiter or decimal"
            ) from None
    return result, source.clocks.get(name)


def column(source: Source, place: Place, variable: str | None = None) -> tuple[NDArray[Any], str]:
    """Values as the file has them, and the name of their array; raises `LogError` if there are none."""
    variable = place.variable or variable
    key = _without_unit(source, place.column)
    if variable is None and source.ordered and isinstance(key, int):
        if key > len(source.arrays):
            raise LogError(
                f"{source.path}: no column {key}; the file has {len(source.arrays)}, counted from 1"
            )
        name = list(source.arrays)[key - 1]
        return source.arrays[name], name
    if isinstance(key, str) and key in source.repeated and place.variable is None:
        numbers = source.repeated[key]
        raise LogError(
            f"{source.path}: {len(numbers)} columns are named {key!r}; state the number of the one that is meant, column = "
            f"{' or '.join(map(str, numbers))}"
        )
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
        raise LogError(f"{source.path}: no column {what}; {choices(str(key), source.names)}")
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


def _without_unit(source: Source, key: str | int) -> str | int:
    """Name of the one column whose name without its unit in brackets is the stated one; else the stated one."""
    if not isinstance(key, str) or key in source.arrays or not source.ordered:
        return key
    alike = [name for name in source.names if _UNIT.sub("", name).strip() == key]
    return alike[0] if len(alike) == 1 and alike[0] not in source.repeated else key


__all__ = ["FORMATS", "SUFFIXES", "Source", "column", "numbers", "open_source", "records"]
