"""The columns of a file with their names, units and times, as a guess reads them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.foreign.source import Source, further_name
from airtruth.importers.dictionary import DIMENSIONS, SHORT, Lexicon, Unit, compact
from airtruth.importers.mapping import TIME_UNITS
from airtruth.importers.uniform import even_times
from airtruth.logs.validate import JITTER, single_precision_s
from airtruth.units import UNITS

Array = NDArray[np.float64]

_CLOCK_STEP_S: Final = (1e-4, 2.0)
"""Steps of an unnamed column that may be the time [s] (judgement: 0.5 Hz to 10 kHz)."""
_BRACKET: Final = re.compile(r"[\[(]([^\])]*)[\])]\s*$")
"""Brackets at the end of a name, in which a unit is stated."""
_STEPS: Final = {"s": (2e-4, 3.0), "ms": (0.5, 3e3), "us": (2e2, 3e6), "ns": (2e5, 3e9)}
"""Unit of a clock -> steps that a recorder may have in it (judgement: 0.3 Hz to 5 kHz); the first that fits is taken."""


@dataclass(frozen=True)
class Column:
    """A column of a file.

    Attributes
    ----------
    key, variable : as a mapping names it.
    full : its name with path and unit.
    name : its name without path and unit.
    group : matrix, or path without the last part: columns of one group share their rows.
    unit : unit that the file states; None if it states none.
    values : (rows,).
    t_s : times that the file gives it (rows,) [s]; None if a column of the file holds them.
    date : whether it holds dates, which are read as seconds.
    unknown : words that state a unit which the knowledge lacks; "" for none.
    """

    key: str | int
    variable: str | None
    full: str
    name: str
    group: str
    unit: Unit | None
    values: Array
    t_s: Array | None
    date: bool = False
    unknown: str = ""


def columns_of(source: Source, words: Lexicon) -> Iterator[Column]:
    """Every column of numbers."""
    numbered = source.ordered and list(source.arrays) == [str(i) for i in range(1, len(source.arrays) + 1)]
    repeated = {
        further_name(name, n) if n > numbers[0] else name: (name, n)
        for name, numbers in source.repeated.items()
        for n in numbers
    }
    for name, values in source.arrays.items():
        if values.dtype.kind not in "biuf" or len(values) < 2:
            continue
        with np.errstate(invalid="ignore", over="ignore"):  # a signalling NaN
            table = values.astype(np.float64)
        if values.ndim == 2:
            labels = source.labels.get(name, ("",) * values.shape[1])
            for i, label in enumerate(labels[: values.shape[1]]):
                plain, unit = split(label, words)
                yield Column(
                    i + 1,
                    name,
                    label.strip("* "),
                    plain,
                    name,
                    unit,
                    table[:, i],
                    None,
                    unknown=_unknown(label, words),
                )
        else:
            own, number = repeated.get(name, (name, name))
            group, _, last = own.rpartition(".") if not source.first_line else ("", "", own)
            plain, unit = split(last, words)
            stated = words.unit(source.units[name]) if source.units.get(name) else None
            key: str | int = int(name) if numbered else number
            date = name in source.dates
            unknown = (
                "" if stated else _unknown(f"({text})" if (text := source.units.get(name)) else last, words)
            )
            yield Column(
                key, None, own, plain, group, stated or unit, table, source.clocks.get(name), date, unknown
            )


def split(label: str, words: Lexicon) -> tuple[str, Unit | None]:
    """ "alpha [deg]", "* STAB POS (deg TEU)", "alpha_deg" as name and unit."""
    text = label.strip("* \t")
    bracket = _BRACKET.search(text)
    if bracket and bracket.start():
        return text[: bracket.start()].strip(), words.unit(bracket[1])
    if meanings := words.meanings(compact(text)):
        own = words.unit(text)  # KTAS
        return text, own if own is not None and any(
            own.name in UNITS[DIMENSIONS[m]] for m in meanings
        ) else None
    parts = [part for part in re.split(r"[\s_,]+", text) if part]
    for count in (3, 2, 1):
        unit = words.unit("_".join(parts[-count:])) if len(parts) > count else None
        if unit:
            return "_".join(parts[:-count]), unit
    if len(parts) > 1 and parts[-1].lower() in SHORT and words.meanings(compact("".join(parts[:-1]))):
        return "_".join(parts[:-1]), Unit(SHORT[parts[-1].lower()])
    return text, None


def _unknown(label: str, words: Lexicon) -> str:
    """Words in brackets at the end of a label that are neither a known unit nor a remark."""
    bracket = _BRACKET.search(label)
    if bracket is None or words.unit(bracket[1]) is not None:
        return ""
    plain = {compact(word) for word in (bracket[1], *bracket[1].split())}
    remarks = {"", *words.context, *words.refused}
    return "" if plain & remarks or not re.search("[^\\W\\d_]", bracket[1]) else bracket[1].strip()


@dataclass(frozen=True)
class GroupClock:
    """Times of a group of columns.

    column : column with the times; None where the file gives each column its own.
    unit : its unit; t_s : its values (rows,) [s]. reason : why it is taken for the time.
    """

    column: Column
    unit: str
    t_s: Array
    reason: str


def clocks_of(columns: Sequence[Column], words: Lexicon) -> dict[str, GroupClock]:
    """Group -> its time column; "" for the whole file."""
    found: dict[str, GroupClock] = {}
    for one in columns:
        entry = words.entry(one.full)
        known = entry[0].unit if entry is not None and entry[0].channel == "t_s" else ""
        if not known and "t_s" not in words.meanings(compact(one.name)):
            continue
        if one.group in found or one.t_s is not None:
            continue
        stated = known or (one.unit.name if one.unit else "")
        stated = {"m_s": "ms"}.get(stated, stated)  # "ms" is a speed elsewhere
        if stated and stated not in TIME_UNITS:
            continue
        clock = _clock(one, "s" if one.date else stated)
        if clock is not None:
            found[one.group] = clock
    if not found and all(c.t_s is None for c in columns):
        unnamed = next((c for c in columns if _is_even(c)), None)
        if unnamed is not None:
            reason = "a column without a name that increases evenly"
            found[unnamed.group] = GroupClock(unnamed, "s", unnamed.values, reason)
    return found


def _clock(column: Column, stated: str) -> GroupClock | None:
    steps = np.diff(column.values[np.isfinite(column.values)])
    if not len(steps) or not np.any(steps > 0.0):
        return None
    step = float(np.median(steps[steps > 0.0]))
    unit = stated or next((u for u, (low, high) in _STEPS.items() if low <= step <= high), "s")
    reason = "dates" if column.date else "stated" if stated else f"assumed by its step of {step:.4g}"
    return GroupClock(column, unit, column.values * TIME_UNITS[unit], reason)


def _is_even(c: Column) -> bool:
    """Whether the values of a column without a name increase evenly, and not by one: that is a counter."""
    if (c.name and not c.name.isdigit()) or not np.isfinite(c.values).all():
        return False
    steps = np.diff(c.values)
    step = float(np.median(steps))
    if not (steps > 0.0).all() or len(steps) < 2 or (steps == 1.0).all():
        return False
    even = even_times(c.values, single_precision_s(c.values))
    return bool(np.ptp(np.diff(even)) <= JITTER * step and _CLOCK_STEP_S[0] <= step <= _CLOCK_STEP_S[1])


__all__ = ["Column", "GroupClock", "clocks_of", "columns_of", "split"]
