"""Change the text of an aircraft.toml: what a change does not concern stays, with its units, comments and order."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any, Final

from airtruth.aircraft import AircraftFile, toml
from airtruth.aircraft.origin import SHARE, rounded
from airtruth.physics.terms import entries
from airtruth.quantity import Quantity, Strict
from airtruth.toml_places import Path, Places, places, spliced
from airtruth.toml_values import toml_value
from airtruth.units import UNITS

_SAME: Final = 1e-12
"""Largest relative difference of two equal numbers [-]: a conversion to another unit and back rounds twice."""
_BYTE_ORDER: Final = "\ufeff"
"""Byte-order mark."""


def patched(text: str, file: AircraftFile, heading: str) -> str:
    """The text of an aircraft.toml with the content of another one.

    A quantity keeps its unit; one with a new standard deviation is rounded to a thousandth of that. A document whose
    notation cannot be changed in place, as one with a table for each quantity, is written in SI throughout.

    Parameters
    ----------
    text : a valid aircraft.toml.
    file : what it has to hold; nothing that the text states may be absent.
    heading : comment to put at its head.
    """
    body = text.removeprefix(_BYTE_ORDER)
    newline = "\r\n" if "\r\n" in body else "\n"
    new = _changed(body, file, newline)
    if new is None:
        return toml.write(file, heading)
    head = "".join(f"# {line}".rstrip() + newline for line in heading.splitlines())
    return text[: len(text) - len(body)] + head + new


_Edit = tuple[int, int, str] | None
"""First character to replace, the one behind the last, and the text; None if the notation is not known."""


def _changed(text: str, file: AircraftFile, newline: str) -> str | None:
    """The text with the content of a file, None where edits cannot give it."""
    try:
        edits = list(_edits(text, file))
        new = spliced(text, [(a, b, t.replace("\n", newline)) for a, b, t in filter(None, edits)])
        same = None not in edits and _same(AircraftFile.model_validate(tomllib.loads(new)), file)
    except ValueError:  # the file has changed since it was read, or the edits do not know its notation
        return None
    return new if same else None


def _edits(text: str, new: AircraftFile) -> Iterator[_Edit]:
    raw = tomllib.loads(text)
    old, found = AircraftFile.model_validate(raw), places(text)
    added: dict[Path, list[str]] = {}
    for path, value in _leaves(new):
        before = _at(old, path)
        if before == value:
            continue
        if isinstance(value, Quantity):
            unit = toml.unit_of(path)
            if path in found.values:
                factor = _factor(unit, str(_at(raw, path).get("unit", unit)))
                yield from _quantity(found, path, before, value, factor)
            elif path in found.tables:
                yield None
            else:
                short = value.model_copy(update={"std": float(f"{value.std:.3g}")})
                added.setdefault(path[:-1], []).append(f"{path[-1]} = {toml.quantity(short, unit)}")
        elif isinstance(value, tuple) and path[0] == "dynamics":
            known = before or ()
            if path in found.values or value[: len(known)] != known:
                yield None
            elif len(value) > len(known):
                yield _items(text, found, path, value[len(known) :])
        elif path in found.values:
            yield (*found.values[path], toml_value(value))
        else:
            added.setdefault(path[:-1], []).append(f"{path[-1]} = {toml_value(value)}")
    for table, lines in added.items():
        yield _entries(text, found, table, lines)


def _quantity(found: Places, path: Path, before: Quantity, value: Quantity, factor: float) -> Iterator[_Edit]:
    std = value.std if value.std != before.std else None
    entries = {"value": _number(value.value, factor, std)} if value.value != before.value else {}
    if std is not None:
        entries["std"] = repr(float(f"{std / factor:.3g}"))
    if value.source != before.source:
        entries["source"] = toml_value(value.source)
    for key, entry in entries.items():
        span = found.values.get((*path, key))
        if span is not None:
            yield (*span, entry)
            continue
        others = ("value", "unit", "std") if key == "source" else ("value", "unit")
        behind = max(found.values[*path, o][1] for o in others if (*path, o) in found.values)
        yield behind, behind, f", {key} = {entry}"


def _factor(si: str, unit: str) -> float:
    """SI value of a unit whose dimension has another unit of SI."""
    return next(units[unit] for units in UNITS.values() if next(iter(units)) == si and unit in units)


def _number(value: float, factor: float, std: float | None) -> str:
    """A number of SI in a unit: to a thousandth of its standard deviation, or the shortest that is read as the same."""
    number = value / factor
    if std:
        return repr(rounded(number, std / factor))
    tried = (float(f"{number:.{digits}g}") for digits in range(1, 18))
    return repr(next((n for n in tried if n * factor == value), number))


def _items(text: str, found: Places, path: Path, items: tuple[Any, ...]) -> tuple[int, int, str]:
    """New items of an array of tables, behind those that are there."""
    blocks = [
        "\n".join(
            [f"[[{'.'.join(map(str, path))}]]", *(f"{k} = {toml_value(v)}" for k, v in entries(i).items())]
        )
        for i in items
    ]
    return _block(text, found, path, blocks)


def _entries(text: str, found: Places, table: Path, lines: list[str]) -> tuple[int, int, str]:
    """New entries of a table, behind those that it has."""
    if table in found.tables:
        at = found.tables[table]
        start = "" if not at or text[at - 1] == "\n" else "\n"
        return at, at, start + "\n".join(lines) + "\n"
    return _block(text, found, table, ["\n".join([f"[{'.'.join(map(str, table))}]", *lines])])


def _block(text: str, found: Places, path: Path, blocks: list[str]) -> tuple[int, int, str]:
    """New tables behind the last one of the longest path that they share with others; at the end where they share none."""
    at = len(text)
    for length in range(len(path), 0, -1):
        same = [end for table, end in found.tables.items() if table[:length] == path[:length]]
        if same:
            at = max(same)
            break
    start = "\n" if not at or text[at - 1] == "\n" else "\n\n"
    return at, at, start + "\n\n".join(blocks) + "\n"


def _leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Path and value of every entry that a file states."""
    if isinstance(value, Strict) and not isinstance(value, Quantity):
        for name, field in type(value).model_fields.items():
            if name in value.model_fields_set:
                yield from _leaves(getattr(value, name), (*path, field.alias or name))
    elif isinstance(value, Mapping) and any(isinstance(v, Strict) for v in value.values()):
        for name, entry in value.items():
            yield from _leaves(entry, (*path, name))
    elif value is not None:
        yield path, value


def _at(value: Any, path: Path) -> Any:
    """Entry of a file or of a table at a path, None where there is none."""
    for key in path:
        name = "schema_" if key == "schema" else str(key)
        value = value.get(key) if isinstance(value, Mapping) else getattr(value, name, None)
    return value


def _same(one: AircraftFile, other: AircraftFile) -> bool:
    """Whether two files state the same, up to the rounding of `patched`."""
    paths = [path for file in (one, other) for path, _ in _leaves(file)]
    return all(_equal(_at(one, path), _at(other, path)) for path in paths)


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, Quantity) and isinstance(other, Quantity):
        rounding = 2.0 * SHARE * other.std
        return (
            math.isclose(one.value, other.value, rel_tol=_SAME, abs_tol=rounding)
            and math.isclose(one.std, other.std, rel_tol=0.01)
            and one.source == other.source
        )
    return bool(one == other)


__all__ = ["patched"]
