"""A foreign file as named arrays, and its passage between processes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from airtruth.isolation.protocol import Reply

Array = NDArray[np.float64]
T = TypeVar("T")

_PLAIN_KINDS: Final = "biufcmMSU"
"""Kinds of numpy types whose bytes can be sent; others are sent as JSON."""


@dataclass(frozen=True)
class Source:
    """A file that was read.

    Attributes
    ----------
    path : the file.
    arrays : name -> values, (rows,) or, of a matrix, (rows, columns); text columns hold strings.
    clocks : name -> times [s] of an array that brings its own.
    labels : matrix -> names of its columns, where the file states them.
    ordered : whether the arrays are the columns of one table, so that a number means one of them.
    first_line : line of the first row in a text file, 0 if it is none.
    units : name -> unit as the file states it.
    repeated : name that several columns of a table have -> their numbers; in ``arrays`` further ones have the name of
        `further_name`.
    comments : lines of a text file among its rows that are none, in order.
    dates : names of columns of dates or durations, whose values are seconds.
    notes : sentences on what the reader assumed or left out.
    """

    path: Path
    arrays: Mapping[str, NDArray[Any]]
    clocks: Mapping[str, Array] = field(default_factory=dict)
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ordered: bool = True
    first_line: int = 0
    units: Mapping[str, str] = field(default_factory=dict)
    repeated: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    comments: tuple[int, ...] = ()
    dates: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def line(self, row: int) -> int:
        """Line of a row, counted from 0, in a text file; 0 if it is none."""
        number = self.first_line + row if self.first_line else 0
        for comment in self.comments:
            number += comment <= number
        return number

    @property
    def names(self) -> tuple[str, ...]:
        """Names as the file has them, each once."""
        further = {further_name(name, n) for name, numbers in self.repeated.items() for n in numbers[1:]}
        return tuple(name for name in self.arrays if name not in further)

    @property
    def structs(self) -> tuple[str, ...]:
        """Paths of structs (groups) that hold arrays, each once."""
        found = dict.fromkeys(name.rpartition(".")[0] for name in self.arrays)
        return tuple(name for name in found if name)

    def within(self, struct: str) -> Source:
        """The arrays of one struct, named within it; none if there is no such struct."""
        start = f"{struct}."

        def inner(table: Mapping[str, T]) -> dict[str, T]:
            return {
                name.removeprefix(start): value for name, value in table.items() if name.startswith(start)
            }

        return Source(
            self.path,
            inner(self.arrays),
            inner(self.clocks),
            labels=inner(self.labels),
            ordered=False,
            units=inner(self.units),
            dates=tuple(n.removeprefix(start) for n in self.dates if n.startswith(start)),
            notes=self.notes,
        )


def further_name(name: str, number: int) -> str:
    """Key of a column whose name an earlier one has."""
    return f"{name} (column {number})"


def table_source(
    path: Path,
    names: Sequence[str],
    columns: Sequence[NDArray[Any]],
    first_line: int = 0,
    comments: Sequence[int] = (),
    dates: Sequence[str] = (),
    units: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> Source:
    """The columns of one table.

    Parameters
    ----------
    path : the file.
    names : one for each column, of which several may be equal; none if the columns are numbered.
    columns : their values.
    first_line, comments, dates, notes : as of `Source`.
    units : one for each column, "" where the file states none; () if it states none at all.
    """
    if not names:
        numbered = {f"{i}": one for i, one in enumerate(columns, 1)}
        return Source(path, numbered, first_line=first_line, comments=tuple(comments), notes=tuple(notes))
    numbers: dict[str, tuple[int, ...]] = {}
    arrays: dict[str, NDArray[Any]] = {}
    for number, (stated, values) in enumerate(zip(names, columns, strict=True), 1):
        name = stated.strip()
        arrays[further_name(name, number) if name in numbers else name] = values
        numbers[name] = (*numbers.get(name, ()), number)
    repeated = {name: several for name, several in numbers.items() if len(several) > 1}
    own = {name: unit.strip(" []()") for name, unit in zip(arrays, units, strict=False)}
    return Source(
        path,
        arrays,
        first_line=first_line,
        units={name: unit for name, unit in own.items() if unit},
        repeated=repeated,
        comments=tuple(comments),
        dates=tuple(dates),
        notes=tuple(notes),
    )


def packed(source: Source) -> Reply:
    """Return a source as a reply; an array that several names share is sent once."""
    sent: dict[int, int] = {}
    arrays: list[NDArray[Any]] = []

    def number(values: NDArray[Any]) -> int:
        if id(values) not in sent:
            sent[id(values)] = len(arrays)
            arrays.append(values)
        return sent[id(values)]

    def entry(values: NDArray[Any]) -> Any:
        return number(values) if values.dtype.kind in _PLAIN_KINDS else {"cells": [_cell(v) for v in values]}

    facts = {
        "arrays": [[name, entry(values)] for name, values in source.arrays.items()],
        "clocks": [[name, number(values)] for name, values in source.clocks.items()],
        "labels": [[name, list(names)] for name, names in source.labels.items()],
        "ordered": source.ordered,
        "first_line": source.first_line,
        "units": dict(source.units),
        "repeated": [[name, list(numbers)] for name, numbers in source.repeated.items()],
        "comments": list(source.comments),
        "dates": list(source.dates),
        "notes": list(source.notes),
    }
    return Reply(facts, tuple(arrays))


def _cell(value: Any) -> Any:
    """A cell of a column of mixed types as JSON has it."""
    if isinstance(value, np.generic):
        value = value.item()
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def unpacked(path: Path, reply: Reply) -> Source:
    """Inverse of `packed`."""

    def values(entry: Any) -> NDArray[Any]:
        return reply.arrays[entry] if isinstance(entry, int) else np.array(entry["cells"], dtype=object)

    facts = reply.facts
    return Source(
        path,
        {name: values(entry) for name, entry in facts["arrays"]},
        {name: values(entry) for name, entry in facts["clocks"]},
        labels={name: tuple(names) for name, names in facts["labels"]},
        ordered=facts["ordered"],
        first_line=facts["first_line"],
        units=facts["units"],
        repeated={name: tuple(numbers) for name, numbers in facts["repeated"]},
        comments=tuple(facts["comments"]),
        dates=tuple(facts["dates"]),
        notes=tuple(facts["notes"]),
    )


__all__ = ["Source", "further_name", "packed", "table_source", "unpacked"]
