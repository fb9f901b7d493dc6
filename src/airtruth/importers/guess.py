"""A first mapping, from the names and sizes of a file's columns, for a person to correct."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import REQUIRED, SIGNALS
from airtruth.checks.gate import inspect
from airtruth.errors import AirtruthError
from airtruth.foreign.source import further_name
from airtruth.importers.convert import convert
from airtruth.importers.derived import PRESSURE
from airtruth.importers.dictionary import NAMES, SHORT, TIME, Unit, Words, plain_name
from airtruth.importers.layout import guess_layout
from airtruth.importers.mapping import DERIVED, TIME_UNITS, MappingFile, SourceSection
from airtruth.importers.sources import Source, open_source
from airtruth.importers.uniform import even_times
from airtruth.logs.validate import JITTER, single_precision_s, validate
from airtruth.physics.reconstruction import NEEDED
from airtruth.units import UNITS

Array = NDArray[np.float64]

_LOWEST_HZ: Final = 0.1
"""Least rate that a guess takes from a clock [Hz] (judgement: slower logs do not show a short period)."""
_HIGHEST_HZ: Final = 1e5
"""Highest rate that a guess takes from a clock [Hz] (judgement: above that of any recorder)."""
_USUAL_HZ: Final = 50.0
"""Rate of a guess without a plausible clock [Hz] (judgement)."""
_SHOWN: Final = 200
"""Columns that the comment at the end lists [-] (judgement)."""
_STEADY: Final = frozenset({"density_kg_m3", "altitude_m", "airspeed_m_s", "throttle"})
"""Channels that may be constant in a record."""
_CLOCK_STEP_S: Final = (1e-4, 2.0)
"""Steps of an unnamed column that may be the time [s] (judgement: 0.5 Hz to 10 kHz)."""


@dataclass(frozen=True)
class _Column:
    """A column of a file with its plain name, and its unit where the file states one."""

    key: str | int
    variable: str | None
    name: str
    unit: Unit | None
    values: Array

    @property
    def group(self) -> str:
        """Matrix, or path without the last part: columns of one group share their rows."""
        if self.variable:
            return self.variable
        return str(self.key).rsplit(".", 1)[0] if "." in str(self.key) else ""


def guess_mapping(
    path: Path | str, section: SourceSection | None = None, *, words: Words | None = None
) -> str:
    """A mapping as TOML, with what was not found, and what physics says of the guess, as comments.

    Parameters
    ----------
    path : file of any supported format.
    section : how it is read; None guesses delimiter and decimal sign of text.
    words : names and units of the user's own (`airtruth.importers.dictionary.read_dictionary`).

    Raises
    ------
    StoreError, ConfigurationError
        If the file cannot be read.
    """
    section = section or guess_layout(path)
    source = open_source(path, section)
    words = words or Words()
    with np.errstate(invalid="ignore", over="ignore"):  # a signalling NaN
        columns = list(_columns(source, words))
    chosen, zero = _chosen(columns, words)
    body = "\n".join(_body(source, section, chosen, columns))
    lines = [f"# A guess from {source.path.name}: check every unit and sign before use."]
    lines += [f"# {name}: column {key!r} is zero throughout and is not mapped" for name, key in zero]
    lines += [f"# {text}" for text in _judgement(source, body, chosen)]
    lines += ["", body, "", "# Columns of the file, first and last value, smallest and largest:"]
    for c in columns[:_SHOWN]:
        finite = c.values[np.isfinite(c.values)]
        if len(finite):
            where = f"{c.variable} column {c.key}" if c.variable else repr(c.key)
            label = f" ({c.name})" if isinstance(c.key, int) and c.name and not c.name.isdigit() else ""
            lines.append(
                f"#   {where}{label}: {finite[0]:.6g}, {finite[-1]:.6g}; {finite.min():.6g}, {finite.max():.6g}"
            )
    return "\n".join(lines) + "\n"


def _columns(source: Source, words: Words) -> Iterator[_Column]:
    numbered = source.ordered and list(source.arrays) == [str(i) for i in range(1, len(source.arrays) + 1)]
    repeated = {
        further_name(name, n) if n > numbers[0] else name: (name, n)
        for name, numbers in source.repeated.items()
        for n in numbers
    }
    for name, values in source.arrays.items():
        if values.dtype.kind not in "biuf" or len(values) < 2:
            continue
        if values.ndim == 2:
            labels = source.labels.get(name, ("",) * values.shape[1])
            for i, label in enumerate(labels):
                plain, unit = _split(label, words)
                yield _Column(i + 1, name, plain, unit, values[:, i].astype(np.float64))
        else:
            own, number = repeated.get(name, (name, name))
            plain, unit = _split(own.rsplit(".", 1)[-1], words)
            stated = words.unit(source.units[name]) if name in source.units else None
            key: str | int = int(name) if numbered else number
            yield _Column(key, None, plain, unit or stated, values.astype(np.float64))


def _split(label: str, words: Words) -> tuple[str, Unit | None]:
    """ "alpha [deg]", "* STAB POS (deg TEU)", "alpha_deg" as plain name and unit."""
    text = label.strip("* ")
    bracket = re.search(r"[\[(]([^\])]*)[\])]", text)
    if bracket:
        return plain_name(text[: bracket.start()]), words.unit(bracket[1])
    plain = plain_name(text)
    if plain in words.names:
        return plain, None
    parts = plain.split("_")
    for count in (2, 1):
        unit = words.unit("_".join(parts[-count:])) if len(parts) > count else None
        if unit:
            return "_".join(parts[:-count]), unit
    return plain, None


def _chosen(
    columns: Sequence[_Column], words: Words
) -> tuple[dict[str, _Column], list[tuple[str, str | int]]]:
    """Channel -> column, and the channels whose only column is zero throughout."""
    chosen: dict[str, _Column] = {}
    zero: list[tuple[str, str | int]] = []
    for channel in NAMES:
        fitting = _fitting(channel, columns, words)
        used = [c for c in fitting if _peak(c) > 0.0]
        if fitting and not used:
            zero.append((channel, fitting[0].key))
        found = _best(channel, used)
        if found is not None:
            chosen[channel] = found
    if "airspeed_m_s" in chosen:
        chosen.pop(PRESSURE, None)
    if TIME not in chosen:
        clock = _unnamed_time(columns)
        if clock is not None:
            chosen[TIME] = clock
    return chosen, zero


def _peak(column: _Column) -> float:
    return float(np.abs(column.values[np.isfinite(column.values)]).max(initial=0.0))


def _fitting(channel: str, columns: Sequence[_Column], words: Words) -> list[_Column]:
    """Columns whose name fits; those of the user's own names alone where there are any, numbered ones last."""
    units = _units_of(channel)
    if channel == TIME:  # "ms" is a speed elsewhere
        columns = [replace(c, unit=Unit("ms")) if c.unit == Unit("m_s") else c for c in columns]
    fits = [c for c in columns if c.unit is None or c.unit.name in units]
    own = [c for c in fits if words.names.get(c.name) == channel]
    if own:
        return own
    rest = [c for c in fits if c.name not in words.names]
    exact = [c for c in rest if re.fullmatch(NAMES[channel], c.name)]
    short = [
        _Column(c.key, c.variable, c.name, Unit(SHORT[ending]), c.values)
        for c in rest
        if c.unit is None
        for ending in [c.name.rpartition("_")[2]]
        if SHORT.get(ending) in units and re.fullmatch(NAMES[channel], c.name.rpartition("_")[0])
    ]
    numbered = [c for c in rest if re.fullmatch(NAMES[channel], re.sub(r"_?\d+$", "", c.name) or "-")]
    return [*exact, *short, *(c for c in numbered if c not in exact)]


def _units_of(channel: str) -> dict[str, float]:
    return dict(TIME_UNITS) if channel == TIME else UNITS[_dimension(channel)]


def _dimension(channel: str) -> str:
    if channel == TIME:
        return "time"
    return SIGNALS[channel].dimension if channel in SIGNALS else DERIVED[channel]


def _best(channel: str, fitting: Sequence[_Column]) -> _Column | None:
    """Of several columns one that moves, then one with a unit, then the first."""
    moving = [c for c in fitting if float(np.nanmax(c.values)) > float(np.nanmin(c.values))]
    with_unit = [c for c in moving if c.unit is not None]
    steady = list(fitting) if channel in _STEADY else []
    return next(iter(with_unit or moving or steady), None)


def _unnamed_time(columns: Sequence[_Column]) -> _Column | None:
    """The first column without a name whose values increase evenly, and not by one: that is a counter."""
    for c in columns:
        if c.name and not c.name.isdigit():
            continue
        t = c.values
        if not np.isfinite(t).all():
            continue
        steps = np.diff(t)
        step = float(np.median(steps))
        rounding = single_precision_s(t)
        even = even_times(t, rounding) if (steps > 0.0).all() else t
        regular = len(t) > 2 and (steps > 0.0).all() and np.ptp(np.diff(even)) <= JITTER * step
        if regular and _CLOCK_STEP_S[0] <= step <= _CLOCK_STEP_S[1] and not (steps == 1.0).all():
            return _Column(c.key, c.variable, c.name, Unit("s"), c.values)
    return None


def _unit(channel: str, column: _Column, chosen: dict[str, _Column]) -> tuple[str, str]:
    """Unit and why."""
    if column.unit is not None:
        return column.unit.name, "from its name"
    values = column.values[np.isfinite(column.values)]
    peak, middle = (
        (float(np.abs(values).max()), float(np.abs(np.median(values)))) if len(values) else (0.0, 0.0)
    )
    dimension = _dimension(channel)
    if dimension == "angle":
        return ("deg" if peak > 1.6 else "rad"), "by its size"
    if dimension == "angular_rate":
        return ("deg_s" if peak > 2.0 else "rad_s"), "by its size"
    if channel == "az_m_s2":
        return ("g" if middle < 3.0 else "ft_s2" if middle > 22.0 else "m_s2"), "by its size"
    if channel == "ax_m_s2":
        if "az_m_s2" in chosen:
            return _unit("az_m_s2", chosen["az_m_s2"], {})[0], "as az"
        return ("g" if peak < 1.0 else "m_s2"), "by its size"
    if channel == "density_kg_m3":
        return ("slug_ft3" if middle < 0.004 else "kg_m3"), "by its size"
    if dimension == "time":
        step = float(np.median(np.diff(values))) if len(values) > 1 else 1.0
        return ("us" if step > 500.0 else "ms" if step >= 1.0 else "s"), "by its step"
    return next(iter(UNITS[dimension])), "assumed"


def _clock_of(column: _Column, base: _Column | None, columns: Sequence[_Column]) -> _Column | None:
    """Time column of the group of a column, where it is not that of [time]."""
    if base is None or column.group == base.group or not column.group:
        return None
    near = [
        c
        for c in columns
        if c.group == column.group
        and re.fullmatch(NAMES[TIME], c.name)
        and len(c.values) == len(column.values)
        and (c.unit is None or c.unit.name in TIME_UNITS)
    ]
    return near[0] if near else None


def _source_table(section: SourceSection) -> Iterator[str]:
    """[source] where the file is not read by the defaults of its suffix."""
    stated = {name: value for name, value in section if value != type(section).model_fields[name].default}
    if stated:
        yield "\n[source]"
    for name, value in stated.items():
        yield f"{name} = {json.dumps(value)}"


def _body(
    source: Source, section: SourceSection, chosen: dict[str, _Column], columns: Sequence[_Column]
) -> Iterator[str]:
    yield "schema = 1"
    yield f"# run_id = {json.dumps(source.path.stem)} # the name of the file, unless stated"
    yield from _source_table(section)
    time = None if source.clocks else chosen.get(TIME)
    yield "\n[time]"
    if source.clocks:
        yield "# each topic has its own times"
    elif time is not None:
        yield _entry(time)
        unnamed = not time.name or time.name.isdigit()
        reason = " # a column without a name that increases evenly" if unnamed else ""
        yield f'unit = "{_unit(TIME, time, chosen)[0]}"{reason}'
    else:
        yield '# no time was found: state column and unit, or the sample rate\n# column = "..."\n# rate_hz = ...'
    channels = [name for name in (*SIGNALS, *DERIVED) if name in chosen]
    clocks = {name: _clock_of(chosen[name], time, columns) for name in channels}
    if source.clocks or any(clocks.values()):
        rate = _rate_hz(source, chosen, clocks)
        yield f'\n[resample] # linear, cubic or previous\nrate_hz = {rate:.6g}\nmethod = "linear"'
    for name in channels:
        unit, reason = _unit(name, chosen[name], chosen)
        text = SIGNALS[name].description if name in SIGNALS else "instead of airspeed_m_s"
        yield f'\n[channels.{name}] # {text}\n{_entry(chosen[name])}\nunit = "{unit}" # {reason}'
        clock = clocks[name]
        if clock is not None:
            key, clock_unit = json.dumps(clock.key), _unit(TIME, clock, chosen)[0]
            matrix = f", variable = {json.dumps(clock.variable)}" if clock.variable else ""
            yield f'clock = {{ column = {key}{matrix}, unit = "{clock_unit}" }}'
        if name == "az_m_s2" and np.nanmedian(chosen[name].values) > 0.0:
            yield "sign = -1 # body z points down: level flight has about -1 g"
        elif chosen[name].unit == Unit(unit, -1):
            yield "sign = -1 # trailing edge up, from its name"
    yield from _missing(chosen)


def _missing(chosen: dict[str, _Column]) -> Iterator[str]:
    """What the log needs and the guess does not have."""
    for name in REQUIRED:
        if name in chosen or (name == "airspeed_m_s" and PRESSURE in chosen):
            continue
        yield f"\n# [channels.{name}] # needed, not found: {SIGNALS[name].description}"
        yield '# column = "..."\n# unit = "..."'
        speed = "airspeed_m_s" in chosen or PRESSURE in chosen
        if name == "alpha_rad" and speed and set(NEEDED) - {"airspeed_m_s"} <= chosen.keys():
            yield "# or, without a vane:\n# [reconstruct]\n# alpha = true"
    if not {"density_kg_m3", "altitude_m"} & chosen.keys():
        yield "\n# [channels.density_kg_m3] # needed, or altitude_m: a column, or a number"
        yield '# value = 1.225\n# unit = "kg_m3"'


def _rate_hz(source: Source, chosen: dict[str, _Column], clocks: dict[str, _Column | None]) -> float:
    """Rate of q, or of the first channel whose rate is plausible; the usual one if none is [Hz]."""
    for name in ("q_rad_s", *clocks):
        if name not in chosen:
            continue
        one, clock = chosen[name], clocks.get(name)
        own = source.clocks.get(str(one.key))
        if own is None:
            column = clock or chosen.get(TIME)
            if column is None:
                continue
            own = column.values * TIME_UNITS[_unit(TIME, column, chosen)[0]]
        steps = np.diff(own)
        step = float(np.median(steps)) if len(steps) else 0.0
        if 1.0 / _HIGHEST_HZ <= step <= 1.0 / _LOWEST_HZ:
            return float(f"{1.0 / step:.3g}")
    return _USUAL_HZ


def _entry(column: _Column) -> str:
    entry = f"column = {json.dumps(column.key)}"
    return entry + (f"\nvariable = {json.dumps(column.variable)}" if column.variable else "")


def _judgement(source: Source, body: str, chosen: dict[str, _Column]) -> list[str]:
    """What physics says of the guess."""
    import tomllib

    missing = [name for name in REQUIRED if name not in chosen]
    if PRESSURE in chosen and "airspeed_m_s" in missing:
        missing.remove("airspeed_m_s")
    if missing:
        return [f"Not found: {', '.join(missing)}."]
    try:
        log = convert(source, MappingFile.model_validate(tomllib.loads(body)))
        validate(log)
        faults = inspect(log)
    except AirtruthError as error:
        return str(error).splitlines()[:1]
    return [fault.sentence for fault in faults] or ["Gravity and kinematics do not contradict it."]


__all__ = ["guess_mapping"]
