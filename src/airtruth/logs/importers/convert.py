"""From a foreign file and its mapping to a flight log that holds the contract."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.importers.mapping import (
    CONSTANTS,
    Channel,
    Clock,
    MappingFile,
    Place,
    Resample,
    read_mapping,
    unit_factor,
)
from airtruth.logs.importers.plausible import Problem, problems
from airtruth.logs.importers.sources import Source, column, numbers, open_source
from airtruth.logs.validate import JITTER, validate
from airtruth.signals import SIGNALS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Imported:
    """An imported log, and what about it looks wrong without being certain.

    Attributes
    ----------
    log : holds the contract.
    problems : findings of `airtruth.logs.importers.plausible`; with ``force`` the certain ones too.
    """

    log: FlightLog
    problems: tuple[Problem, ...]


@dataclass(frozen=True)
class _Series:
    """A channel in SI with the times of its samples on the file's clock [s]."""

    t_s: Array
    values: Array


def import_log(path: Path | str, mapping: MappingFile | Path | str, *, force: bool = False) -> Imported:
    """Read a foreign file through a mapping, and hold the result against physics.

    Parameters
    ----------
    path : CSV, whitespace table, .mat, Parquet or .ulg.
    mapping : mapping, or its file.
    force : keep a log whose mapping contradicts physics; the contract itself is never waived.

    Raises
    ------
    StoreError
        If the file cannot be read.
    ConfigurationError
        If the mapping cannot be used as written.
    LogError
        If a column is missing or not numeric, times do not increase, the mapping contradicts physics,
        or the result breaks the contract; the message says which and what to do.
    """
    if not isinstance(mapping, MappingFile):
        mapping = read_mapping(mapping)
    source = open_source(path, mapping.source)
    log = convert(source, mapping)
    found = problems(log)
    certain = [p.sentence for p in found if p.certain]
    if certain and not force:
        heading = f"{path}: the mapping contradicts physics; correct it, or keep it with --force"
        raise LogError("\n  - ".join([heading, *certain]))
    validate(log, source=str(path))
    return Imported(log, tuple(found))


def convert(source: Source, mapping: MappingFile) -> FlightLog:
    """Channels in SI and float64, runs, uniform times; nothing is judged by physics here.

    Raises
    ------
    LogError, ConfigurationError
        As `import_log`.
    """
    clock = _base_clock(source, mapping)
    series = {name: _series(source, mapping, name, one, clock) for name, one in mapping.channels.items()}
    if not series:
        raise ConfigurationError(
            f"{source.path}: the mapping names no channel; state [channels.alpha_rad] ..."
        )
    parts = _runs(source, mapping, series, clock)
    ids, times, blocks, facts = [], [], [], {}
    for run_id, start, end, rows in parts:
        where = f"{source.path}, run {run_id!r}"
        cut = {name: _cut(one, start, end, rows) for name, one in series.items()}
        t, values = _uniform(where, cut, mapping.resample)
        ids.append(run_id)
        times.append(t)
        blocks.append(values)
        stated = _constants(source, mapping, clock, start, end, rows)
        if stated:
            facts[run_id] = stated
    metadata: dict[str, object] = {"source": source.path.name}
    if mapping.aircraft:
        metadata["aircraft"] = mapping.aircraft
    if mapping.resample:
        metadata["resampled"] = {"rate_hz": mapping.resample.rate_hz, "method": mapping.resample.method}
    rates = {round((len(t) - 1) / (t[-1] - t[0]), 6) for t in times if len(t) > 1}
    if len(rates) == 1:
        metadata["sample_rate_hz"] = rates.pop()
    if facts:
        metadata["record_constants"] = facts
    return FlightLog(
        metadata=metadata,
        run_ids=tuple(ids),
        offsets=np.cumsum([0, *(len(t) for t in times)]).astype(np.int64),
        t_s=np.concatenate(times),
        channels={name: np.concatenate([b[name] for b in blocks]) for name in series},
    )


def record_constants(log: FlightLog, run_id: str) -> Mapping[str, float]:
    """Mass, inertia and reference lengths that the mapping stated for a run, in SI; {} if none."""
    facts = log.metadata.get("record_constants", {})
    return dict(facts.get(run_id, {})) if isinstance(facts, Mapping) else {}


def _base_clock(source: Source, mapping: MappingFile) -> Array | None:
    time = mapping.time
    if time.column is not None:
        place = Place(column=time.column, variable=time.variable)
        values, _ = numbers(source, place, mapping.source.variable)
        return values * unit_factor("time", time.unit)
    if time.rate_hz is not None:
        first = next((p for c in mapping.channels.values() for p in c.places), None)
        if first is None:
            raise ConfigurationError(f"{source.path}: no channel reads a column of the file")
        return np.arange(len(numbers(source, first, mapping.source.variable)[0])) / time.rate_hz
    if source.clocks:
        return None
    raise ConfigurationError(f"{source.path}: no times; state [time] column (and unit), or rate_hz")


def _series(source: Source, mapping: MappingFile, name: str, one: Channel, clock: Array | None) -> _Series:
    factor = one.sign * unit_factor(SIGNALS[name].dimension, one.unit)
    own = _own_clock(source, mapping, one.clock) if one.clock else None
    read = [numbers(source, place, mapping.source.variable) for place in one.places]
    if one.value is not None:
        always = clock if clock is not None else np.array([-np.inf, np.inf])
        return _Series(always, np.full(len(always), factor * (one.scale * one.value + one.offset)))
    t: Array | None = next((x for x in (own, clock, read[0][1]) if x is not None), None)
    if t is None:
        raise ConfigurationError(
            f"{source.path}: {name} has no times; state [time] column, or channels.{name}.clock"
        )
    for values, _ in read:
        if len(values) != len(t):
            raise LogError(
                f"{source.path}: {name} has {len(values)} values and its clock {len(t)}; "
                f"state channels.{name}.clock, or another column"
            )
    raw = np.stack([values for values, _ in read]).mean(axis=0)
    return _Series(t, factor * (one.scale * raw + one.offset))


def _own_clock(source: Source, mapping: MappingFile, clock: Clock) -> Array:
    values, _ = numbers(source, clock, mapping.source.variable)
    return values * unit_factor("time", clock.unit)


def _runs(
    source: Source, mapping: MappingFile, series: Mapping[str, _Series], clock: Array | None
) -> list[tuple[str, float, float, NDArray[np.bool_] | None]]:
    """Name, start and end on the file's clock, and rows (where a column names them) of each run."""
    if mapping.time.run is not None:
        place = Place(column=mapping.time.run, variable=mapping.time.variable)
        names = np.array([str(x) for x in column(source, place, mapping.source.variable)[0]])
        return [(str(n), -np.inf, np.inf, names == n) for n in dict.fromkeys(names.tolist())]
    finite = [one.t_s[np.isfinite(one.t_s)] for one in series.values()]
    edges = [(t.min(), t.max()) for t in finite if len(t)]
    if not edges:
        raise LogError(f"{source.path}: no time is finite; state [time] column and unit")
    low, high = min(e[0] for e in edges), max(e[1] for e in edges)
    if not mapping.manoeuvre:
        return [(mapping.run_id or source.path.stem, -np.inf, np.inf, None)]
    for one in mapping.manoeuvre:
        if one.end_s <= low or one.start_s >= high:
            raise LogError(
                f"{source.path}: manoeuvre {one.run_id!r} from {one.start_s:g} to {one.end_s:g} s lies outside "
                f"the file, whose clock runs from {low:g} to {high:g} s"
            )
    return [(one.run_id, one.start_s, one.end_s, None) for one in mapping.manoeuvre]


def _cut(one: _Series, start: float, end: float, rows: NDArray[np.bool_] | None) -> _Series:
    if np.isinf(one.t_s).any():
        return one
    small = 1e-9 * max(1.0, float(np.nanmax(np.abs(one.t_s))))
    # a time that is no number stays, to be refused by name
    keep = rows if rows is not None else ~((one.t_s < start - small) | (one.t_s > end + small))
    return _Series(one.t_s[keep], one.values[keep])


def _uniform(
    where: str, series: Mapping[str, _Series], resample: Resample | None
) -> tuple[Array, dict[str, Array]]:
    """Times from zero and channels at one uniform rate."""
    moving = {name: one for name, one in series.items() if not np.isinf(one.t_s).any()}
    if not moving:
        raise LogError(f"{where}: every channel is a constant; map columns of the file")
    for name, one in moving.items():
        _check_times(where, name, one.t_s)
    if resample is None:
        first_name, first = next(iter(moving.items()))
        for name, one in moving.items():
            if len(one.t_s) != len(first.t_s) or not np.array_equal(one.t_s, first.t_s):
                raise LogError(
                    f"{where}: {first_name} ({_rate(first)}) and {name} ({_rate(one)}) are sampled at other times; "
                    "state [resample] rate_hz and method"
                )
            gaps = int(np.isnan(one.values).sum())
            if gaps:
                raise LogError(
                    f"{where}: {name} is empty or NaN in {gaps} of {len(one.values)} rows, the first at "
                    f"{one.t_s[np.isnan(one.values)][0]:g} s; state [resample] to interpolate, or cut a [[manoeuvre]]"
                )
        t = first.t_s - first.t_s[0]
        if len(t) > 1:
            period = t[-1] / (len(t) - 1)
            even = np.arange(len(t)) * period
            if np.abs(np.diff(t) - period).max() <= JITTER * period:
                t = even  # rounded time stamps
        return t, {n: s.values if n in moving else np.full(len(t), s.values[0]) for n, s in series.items()}
    full = {
        name: _Series(o.t_s[ok], o.values[ok])
        for name, o in moving.items()
        if (ok := ~np.isnan(o.values)).sum() > 3
    }
    for name in moving:
        if name not in full:
            raise LogError(
                f"{where}: {name} holds {len(moving[name].values)} rows and at most three values; map another"
            )
    start, end = max(o.t_s[0] for o in full.values()), min(o.t_s[-1] for o in full.values())
    count = int(np.floor((end - start) * resample.rate_hz + 1e-6)) + 1
    if count < 2:
        raise LogError(
            f"{where}: the channels share no time: the last starts at {start:g} s, the first ends at {end:g} s"
        )
    t = np.arange(count) / resample.rate_hz
    values = {n: _interpolated(full[n], start + t, resample.method) for n in full}
    return t, {n: values[n] if n in values else np.full(count, s.values[0]) for n, s in series.items()}


def _check_times(where: str, name: str, t: Array) -> None:
    if len(t) < 2:
        raise LogError(f"{where}: {name} has {len(t)} rows; a run needs a manoeuvre of a second or more")
    if not np.isfinite(t).all():
        row = int(np.flatnonzero(~np.isfinite(t))[0])
        raise LogError(f"{where}: the time of {name} in row {row + 1} is empty or NaN; delete the row")
    back = np.flatnonzero(np.diff(t) <= 0.0)
    if len(back):
        row = int(back[0])
        raise LogError(
            f"{where}: time does not increase in {len(back)} rows, the first is row {row + 2}: {t[row]:.9g} s, then "
            f"{t[row + 1]:.9g} s; sort the file and drop repeated rows, or name each run's rows by [time] run"
        )


def _rate(one: _Series) -> str:
    return f"{(len(one.t_s) - 1) / (one.t_s[-1] - one.t_s[0]):.4g} Hz"


def _interpolated(one: _Series, t: Array, method: str) -> Array:
    if method == "linear":
        return np.asarray(np.interp(t, one.t_s, one.values))
    if method == "previous":
        index = np.searchsorted(one.t_s, t + 1e-9 * (one.t_s[1] - one.t_s[0]), side="right") - 1
        return np.asarray(one.values[np.maximum(index, 0)])
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(one.t_s, one.values)(t))


def _constants(
    source: Source,
    mapping: MappingFile,
    clock: Array | None,
    start: float,
    end: float,
    rows: NDArray[np.bool_] | None,
) -> dict[str, float]:
    result = {}
    for name, one in mapping.constants.items():
        factor = unit_factor(CONSTANTS[name], one.unit)
        if one.column is None:
            assert one.value is not None
            result[name] = factor * one.value
            continue
        values, own = numbers(
            source, Place(column=one.column, variable=one.variable), mapping.source.variable
        )
        t = clock if clock is not None else own
        if len(values) > 1 and t is not None and len(t) == len(values):
            values = _cut(_Series(t, values), start, end, rows).values
        mean = float(np.nanmean(values)) * factor
        if not np.isfinite(mean) or mean <= 0.0:
            raise LogError(
                f"{source.path}: {name} comes out as {mean:g}; map another column, or state a value"
            )
        result[name] = mean
    return result


__all__ = ["Imported", "convert", "import_log", "record_constants"]
