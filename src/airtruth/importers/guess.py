"""A first mapping: the assignment of columns to channels that names, units and physics agree on, for a person to check."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from airtruth.checks.gate import inspect
from airtruth.errors import AirtruthError, LogError
from airtruth.importers.convert import convert
from airtruth.importers.dictionary import Lexicon, Words, compact, lexicon
from airtruth.importers.guessing.assignment import CERTAIN, AssignmentSearch, Decision
from airtruth.importers.guessing.candidates import (
    CommonTimes,
    candidates,
    pauses_of,
    rising,
    times_of,
    without_pauses,
)
from airtruth.importers.guessing.columns import Column, GroupClock, clocks_of, columns_of, split
from airtruth.importers.guessing.lateral import LATERAL_RELATIONS
from airtruth.importers.guessing.proposal import Proposal, Writer
from airtruth.importers.guessing.readings import Candidates, Reading
from airtruth.importers.guessing.slots import LATERAL_SLOTS
from airtruth.importers.guessing.times import Times, column_list, run_column
from airtruth.importers.layout import guess_layout
from airtruth.importers.mapping import MappingFile, Place, SourceSection
from airtruth.importers.sources import Source, numbers, open_source, records
from airtruth.logs.validate import validate

_SHOWN: Final = 200
"""Columns that the comment at the end lists [-] (judgement)."""
_RECORDS: Final = (4, 0.8)
"""Fewest fields of a struct that is a record, and least share of the file's arrays that such structs hold [-] (judgement:
topics and instances of a sensor are structs of equal fields too, and hold less)."""
_EMPTY: Final = "some of its cells are empty; map it with [resample], which fills them"
"""Why a column of the lateral motion is left out."""
_GRID: Final = (5.0, 25.0, 60_000)
"""Least and largest rate on which readings are compared [Hz], and most samples [-] (judgement: 40 minutes of short periods)."""


def guess_mapping(
    path: Path | str, section: SourceSection | None = None, *, words: Words | None = None
) -> str:
    """A mapping as TOML; each line states what it rests on, and what is in doubt is a comment.

    Parameters
    ----------
    path : file of any supported format.
    section : how it is read; None guesses delimiter and decimal sign of text.
    words : knowledge of the user's own (`airtruth.importers.dictionary.read_dictionary`).

    Raises
    ------
    StoreError, ConfigurationError
        If the file cannot be read.
    """
    section = section or guess_layout(path)
    whole = open_source(path, section)
    if not section.structs:
        section = section.model_copy(update={"structs": alike(whole)})
    source = records(whole, section)[0][1]
    known = lexicon(_names(source), words)
    columns = list(columns_of(source, known))
    clocks = clocks_of(columns, known)
    grid = _grid(columns, clocks)
    found = candidates(columns, known, grid, clocks)
    decisions = AssignmentSearch(found.readings, grid.dt_s).decisions()
    times = Times(clocks, decisions, bool(source.clocks), run_column(source, clocks))
    beside = _lateral(found, decisions, grid.dt_s)
    proposal = Writer({**decisions, **beside}, found, times, grid).proposal()
    name = "the name of the file" if not section.structs else "the names of the structs"
    head = ["schema = 1", f"# run_id = {json.dumps(source.path.stem)} # {name}, unless stated"]
    body = "\n".join([*head, *_source_table(section), *proposal.lines])
    lines = [f"# A guess from {source.path.name}: check every unit and sign before use."]
    lines += [f"# {name}: column {c.key!r} is zero throughout and is not mapped" for name, c in found.zero]
    lines += [f"# Not read: {text}" for text in _unread(source, known)]
    lines += [f"# {c.full!r} is not {channel}: {why}" for c, why, channel in found.refused if channel]
    lines += [f"# {text}" for text in _judgement(whole, body, proposal)]
    lines += [f"# Not mapped: {text}." for text in proposal.optional]
    lines += ["", body, "", "# Columns of the file, first and last value, smallest and largest:"]
    return "\n".join([*lines, *column_list(columns, _SHOWN)]) + "\n"


def _lateral(found: Candidates, decisions: Mapping[str, Decision], dt_s: float) -> dict[str, Decision]:
    """Decisions on the lateral-directional motion, which change nothing of the others.

    A quaternion that gives theta gives phi and psi too, and a velocity that gives alpha gives beta; otherwise neither does.
    A column with empty cells is refused, because it would stop the import.
    """
    kind = {"phi": "attitude", "psi": "attitude", "beta": "velocity"}
    source = {"phi": "theta", "psi": "theta", "beta": "alpha"}
    readings: dict[str, list[Reading]] = {}
    for slot in LATERAL_SLOTS:
        own = decisions.get(source.get(slot, ""))
        whole = own.reading.columns if own is not None and own.reading.kind == kind.get(slot) else None
        for r in found.readings.get(slot, ()):
            if r.columns != whole if whole is not None else r.kind in ("attitude", "velocity"):
                continue
            if all(np.isfinite(column.values).all() for column in r.columns):
                readings.setdefault(slot, []).append(r)
            elif (r.column, _EMPTY, r.channel) not in found.refused:
                found.refused.append((r.column, _EMPTY, r.channel))
    given = {slot: one.reading for slot, one in decisions.items() if one.lead >= CERTAIN}
    return AssignmentSearch(readings, dt_s, LATERAL_SLOTS, LATERAL_RELATIONS, given).decisions()


def alike(source: Source) -> tuple[str, ...]:
    """Structs that are records of one layout: siblings with the same fields, which hold nearly all of the file."""
    if source.ordered or source.clocks:
        return ()
    groups: dict[tuple[str, frozenset[str]], list[str]] = {}
    for struct in source.structs:
        fields = frozenset(source.within(struct).arrays)
        parent = struct.rpartition(".")[0]
        groups.setdefault((parent, fields), []).append(struct)
    least, share = _RECORDS
    for (_, fields), structs in groups.items():
        if (
            len(structs) > 1
            and len(fields) >= least
            and len(structs) * len(fields) >= share * len(source.arrays)
        ):
            return tuple(structs)
    return ()


def _unread(source: Source, known: Lexicon) -> Iterator[str]:
    """Why a column with the name of a channel or of the time is no series: text among its numbers, or times that go back."""
    for name in source.names:
        meant = known.meanings(compact(split(name.rpartition(".")[2], known)[0]))
        if not meant or source.arrays[name].ndim > 1:
            continue
        try:
            values, _ = numbers(source, Place(column=name))
        except LogError as error:
            yield str(error)
            continue
        if "t_s" in meant and len(values) > 1 and not (np.diff(values) > 0.0).any():
            yield f"column {name!r} has the name of the time and never increases; reverse or sort the rows of the file"


def _names(source: Source) -> Iterator[str]:
    yield from source.arrays
    for labels in source.labels.values():
        yield from (label.strip("* ") for label in labels)


def _grid(columns: Sequence[Column], clocks: Mapping[str, GroupClock]) -> CommonTimes:
    """Times common to the columns: those of the clocks' longest part, at the rate of the fastest within limits."""
    least, most, samples = _GRID
    times = {
        id(t): (r := rising(t))[np.isfinite(r)] for c in columns if (t := times_of(c, clocks)) is not None
    }
    usable = [t for t in times.values() if len(t) > 3 and 0.0 < np.ptp(t) < 1e7]
    if not usable:
        rows = max((len(c.values) for c in columns), default=4)
        return CommonTimes(np.arange(float(rows)), 0.0)
    pauses = pauses_of(np.unique(np.concatenate(usable)))
    usable = [without_pauses(t, pauses) for t in usable]
    start, end = float(np.median([t.min() for t in usable])), float(np.median([t.max() for t in usable]))
    fastest = max(len(t) / float(np.ptp(t)) for t in usable)
    rate = float(np.clip(fastest, least, most))
    if (end - start) * rate > samples:
        middle = 0.5 * (start + end)
        start, end = middle - 0.5 * samples / rate, middle + 0.5 * samples / rate
    count = max(8, int((end - start) * rate))
    return CommonTimes(start + np.arange(count) / rate, 1.0 / rate, pauses)


def _source_table(section: SourceSection) -> Iterator[str]:
    """[source] where the file is not read by the defaults of its suffix."""
    stated = {name: value for name, value in section if value != type(section).model_fields[name].default}
    if stated:
        yield "\n[source]"
    for name, value in stated.items():
        yield f"{name} = {json.dumps(value)}" + (" # each a run" if name == "structs" else "")


def _judgement(source: Source, body: str, proposal: Proposal) -> list[str]:
    """The missing or doubtful channels, or the verdict of physics on the guess."""
    if proposal.doubts:
        return [f"Not mapped: {text}." for text in proposal.doubts]
    try:
        log = convert(source, MappingFile.model_validate(tomllib.loads(body)))
        validate(log)
        faults = inspect(log)
    except AirtruthError as error:
        return str(error).splitlines()[:1]
    return [fault.sentence for fault in faults] or ["Gravity and kinematics do not contradict it."]


__all__ = ["guess_mapping"]
