"""Channels of a foreign file in SI, each with the times of its samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS
from airtruth.errors import ConfigurationError, LogError
from airtruth.importers.mapping import DERIVED, Channel, MappingFile, Place, unit_factor
from airtruth.importers.sources import Source, numbers
from airtruth.logs.validate import JITTER, single_precision_s

Array = NDArray[np.float64]


_EDGE: Final = 0.1
"""Part of a step by which a sample may lie outside the stated times [-] (judgement: rounding of what was stated)."""


@dataclass(frozen=True)
class Series:
    """A channel in SI with the times of its samples.

    Attributes
    ----------
    t_s : times on the file's clock [s]; of a constant without a clock minus and plus infinity.
    values : (samples,) [SI].
    rounding_s : resolution of times in single precision, where it matters [s]; otherwise 0.
    """

    t_s: Array
    values: Array
    rounding_s: float = 0.0

    @property
    def constant(self) -> bool:
        """Whether it is a number that the mapping states."""
        return bool(np.isinf(self.t_s).any())

    def between(self, start_s: float, end_s: float, rows: NDArray[np.bool_] | None = None) -> Series:
        """Samples between two times, or of some rows."""
        if self.constant:
            return self
        # a time is stated with ten digits, and on a clock since 1970 these are longer than a sample
        stated = 1e-9 * max(1.0, float(np.nanmax(np.abs(self.t_s), initial=0.0)))
        steps = np.abs(np.diff(self.t_s[np.isfinite(self.t_s)]))
        small = min(stated, _EDGE * float(np.median(steps))) if len(steps) else stated
        # a time that is no number stays, to be refused by name
        keep = rows if rows is not None else ~((self.t_s < start_s - small) | (self.t_s > end_s + small))
        return replace(self, t_s=self.t_s[keep], values=self.values[keep])


def read_series(source: Source, mapping: MappingFile) -> dict[str, Series]:
    """Every channel of a mapping.

    Raises
    ------
    LogError, ConfigurationError
        If a column is missing or not numeric, or a channel has no times or those of another number of rows.
    """
    clock = base_clock(source, mapping)
    series = {name: _series(source, mapping, name, one, clock) for name, one in mapping.channels.items()}
    if not series:
        raise ConfigurationError(
            f"{source.path}: the mapping names no channel; state [channels.alpha_rad] ..."
        )
    return series


def base_clock(source: Source, mapping: MappingFile) -> Series | None:
    """Times of [time] (values are empty); None if every channel brings its own."""
    time = mapping.time
    empty = np.empty(0)
    if time.column is not None:
        place = Place(column=time.column, variable=time.variable)
        _check_date(source, place, time.unit, "[time]")
        values, _ = numbers(source, place, mapping.source.variable)
        if mapping.resample is None:
            _check_precision(f"{source.path}: time column {time.column!r}", values, time.unit)
        return Series(_seconds(values, time.unit), empty, _rounding(values, time.unit))
    if time.rate_hz is not None:
        first = next((p for c in mapping.channels.values() for p in c.places), None)
        if first is None:
            raise ConfigurationError(f"{source.path}: no channel reads a column of the file")
        count = len(numbers(source, first, mapping.source.variable)[0])
        return Series(np.arange(count) / time.rate_hz, empty)
    if source.clocks or all(c.clock is not None or c.value is not None for c in mapping.channels.values()):
        return None
    raise ConfigurationError(f"{source.path}: no times; state [time] column (and unit), or rate_hz")


def _series(source: Source, mapping: MappingFile, name: str, one: Channel, clock: Series | None) -> Series:
    dimension = SIGNALS[name].dimension if name in SIGNALS else DERIVED[name]
    factor = one.sign * unit_factor(dimension, one.unit)
    variable = mapping.source.variable
    if one.value is not None:
        always = clock.t_s if clock is not None else np.array([-np.inf, np.inf])
        return Series(always, np.full(len(always), factor * (one.scale * one.value + one.offset)))
    own = None
    if one.clock is not None:
        _check_date(source, one.clock, one.clock.unit, f"channels.{name}.clock")
        raw, _ = numbers(source, one.clock, variable)
        with np.errstate(invalid="ignore", over="ignore"):
            shifted = _seconds(raw, one.clock.unit) + one.clock.offset_s
        own = Series(shifted, np.empty(0), _rounding(raw, one.clock.unit))
    read = [numbers(source, place, variable) for place in one.places]
    recorded = Series(read[0][1], np.empty(0)) if read[0][1] is not None else None
    times = next((x for x in (own, clock, recorded) if x is not None), None)
    if times is None:
        raise ConfigurationError(
            f"{source.path}: {name} has no times; state [time] column, or channels.{name}.clock"
        )
    for values, _ in read:
        if len(values) != len(times.t_s):
            raise LogError(
                f"{source.path}: {name} has {len(values)} values and its clock {len(times.t_s)}; "
                f"state channels.{name}.clock, or another column"
            )
    with np.errstate(invalid="ignore", over="ignore"):  # the gate names what is not finite
        mean = np.stack([values for values, _ in read]).mean(axis=0)
        return replace(times, values=factor * (one.scale * mean + one.offset))


def _seconds(values: Array, unit: str) -> Array:
    with np.errstate(invalid="ignore", over="ignore"):  # the check of the times names what is not finite
        return values * unit_factor("time", unit)


def _rounding(values: Array, unit: str) -> float:
    return single_precision_s(values[np.isfinite(values)]) * unit_factor("time", unit)


def _check_date(source: Source, place: Place, unit: str, where: str) -> None:
    """Refuse a unit of dates or durations: they are read as seconds, whatever the unit of the file's integers."""
    if place.column in source.dates and unit != "s":
        raise ConfigurationError(
            f"{source.path}: {where} unit = {unit!r}, but column {place.column!r} holds dates or durations, which are read "
            'as seconds; state unit = "s", or leave it out'
        )


def _check_precision(where: str, t: Array, unit: str) -> None:
    """Refuse times in single precision that do not determine which sample they belong to."""
    finite = t[np.isfinite(t)]
    rounding = single_precision_s(finite)
    steps = np.diff(finite)
    if rounding == 0.0 or not len(steps) or np.ptp(steps) <= JITTER * float(np.median(steps)):
        return
    if rounding > 0.5 * float(np.mean(np.abs(steps))):
        raise LogError(
            f"{where} is in single precision (float32), which resolves {rounding:.2g} {unit} at "
            f"{np.abs(finite).max():.6g} {unit}, more than half a step: samples cannot be counted by it; export it as "
            "float64, subtract the start before the export, or state [resample] rate_hz and method"
        )


__all__ = ["Series", "base_clock", "read_series"]
