"""The runs of a file: rows that a column names, manoeuvres, parts of a clock that starts again, or the whole."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.importers.clock import ONE, Parts
from airtruth.importers.mapping import MappingFile, Place
from airtruth.importers.series import Series
from airtruth.importers.sources import Source, column


def runs_of(
    source: Source, mapping: MappingFile, series: Mapping[str, Series], parts: Parts = ONE
) -> list[tuple[str, float, float, NDArray[np.bool_] | None]]:
    """Name, start and end on the first file's clock, and rows (where a column names them) of each run.

    Parameters
    ----------
    source, mapping : of the first file.
    series : channels of all files on the clock of the first.
    parts : parts of a clock that starts again, of which each long one is a run.

    Raises
    ------
    LogError
        If no row names a run, no time is finite, or a manoeuvre lies outside the file.
    """
    if mapping.time.run is not None:
        place = Place(column=mapping.time.run, variable=mapping.time.variable)
        names = np.array([_run_name(x) for x in column(source, place, mapping.source.variable)[0]])
        named = [n for n in dict.fromkeys(names.tolist()) if n]
        if not named:
            raise LogError(f"{source.path}: [time] run {mapping.time.run!r} is empty in every row")
        return [(str(n), -np.inf, np.inf, names == n) for n in named]
    finite = [one.t_s[np.isfinite(one.t_s)] for one in series.values()]
    edges = [(t.min(), t.max()) for t in finite if len(t)]
    if not edges:
        raise LogError(f"{source.path}: no time is finite; state [time] column and unit")
    low, high = min(e[0] for e in edges), max(e[1] for e in edges)
    if not mapping.manoeuvre:
        name = mapping.run_id or run_of_file(source)
        if not parts.several:
            return [(name, -np.inf, np.inf, None)]
        listed = enumerate(zip(parts.spans_s, parts.long, strict=True), 1)
        return [(f"{name}-{number}", *span, None) for number, (span, long) in listed if long]
    for one in mapping.manoeuvre:
        if one.end_s <= low or one.start_s >= high:
            raise LogError(
                f"{source.path}: manoeuvre {one.run_id!r} from {one.start_s:g} to {one.end_s:g} s lies outside "
                f"the file, whose clock runs from {low:g} to {high:g} s"
            )
    return [(one.run_id, one.start_s, one.end_s, None) for one in mapping.manoeuvre]


def run_of_file(source: Source) -> str:
    """Name of the file without its suffix, as the name of its run.

    Raises
    ------
    LogError
        If it is not UTF-8, which a log cannot hold.
    """
    name = source.path.stem
    if any("\ud800" <= character <= "\udfff" for character in name):
        raise LogError(
            f"{source.path}: the name of the file is not UTF-8, so it cannot be that of a run; state run_id in the mapping, "
            "or rename the file"
        )
    return name


def _run_name(cell: object) -> str:
    """Name of the run of a row, "" where the row belongs to none; numbers beside empty cells are floats."""
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return ""
    if isinstance(cell, float) and cell.is_integer():
        return str(int(cell))
    return str(cell).strip()


def require_rows(where: str, series: Mapping[str, Series], rows: int) -> None:
    """Refuse a channel that has not a sample for each row that names a run.

    Parameters
    ----------
    where : file and run, for the message.
    rows : number of rows of [time] run.

    Raises
    ------
    LogError
        Naming the channel.
    """
    for name, one in series.items():
        if not one.constant and len(one.t_s) != rows:
            raise LogError(
                f"{where}: {name} has {len(one.t_s)} samples and [time] run {rows} rows; cut runs by [[manoeuvre]] instead"
            )


__all__ = ["require_rows", "run_of_file", "runs_of"]
