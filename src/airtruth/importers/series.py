"""Channels of a foreign file in SI, each with the times of its samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import ATTITUDE
from airtruth.errors import ConfigurationError, LogError
from airtruth.importers.attitude import LEAST_NORM, air_angles, continuous, euler_angles
from airtruth.importers.channel_table import Points
from airtruth.importers.mapping import (
    AIRSPEEDS,
    MAPPED,
    AttitudeTable,
    BodyVelocity,
    Channel,
    Clock,
    MappingFile,
    Place,
    unit_factor,
)
from airtruth.importers.mirrored import are_mirrored
from airtruth.importers.sources import Source, numbers
from airtruth.logs.validate import JITTER, single_precision_s
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.units import ZEROS

Array = NDArray[np.float64]


_EDGE: Final = 0.1
"""Part of a step by which a sample may lie outside the stated times [-] (judgement: rounding of what was stated)."""


_TURNING: Final[dict[str, Callable[[Array], Array]]] = {
    name: continuous if name == "theta_rad" else np.unwrap for name in ATTITUDE
}
"""Angles that recorders let jump by a turn, and what takes the jumps out: roll and heading count from their first value."""


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
    if mapping.attitude is not None:
        series |= _attitude(source, mapping, mapping.attitude, clock)
    if mapping.body_velocity is not None:
        made = _body_velocity(source, mapping, mapping.body_velocity, clock)
        if any(name in series for name in AIRSPEEDS):
            del made["airspeed_m_s"]
        series = made | series
    _check_mirrored(source, mapping, series, clock)
    if not series:
        raise ConfigurationError(
            f"{source.path}: the mapping names no channel; state [channels.alpha_rad] ..."
        )
    return series


def _check_mirrored(
    source: Source, mapping: MappingFile, series: dict[str, Series], clock: Series | None
) -> None:
    """Refuse a mean of two surfaces that cancels the elevator; weights state that a mean is meant."""
    (control,) = LONGITUDINAL.controls
    for name in (control.channel, control.command):
        one, q = mapping.channels.get(name), series.get(control.damped)
        if one is None or q is None or q.constant or len(one.places) != 2 or one.weights:
            continue
        times, read = _calibrated_columns(source, mapping, name, one, clock)
        if are_mirrored(times.t_s, read, q.t_s, q.values):
            first, second = map(repr, one.columns)
            raise LogError(
                f"{source.path}: {name}: the pitch acceleration follows the difference of {first} and {second}, not their mean: "
                f"the servos are mirrored; state weights = [0.5, -0.5] under [channels.{name}] and the offset of the difference "
                f"(of elevons the roll then has [-0.5, -0.5] if {first} is the left one), or weights = [0.5, 0.5] if the mean "
                "is right"
            )


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
        first = next(iter(_places(mapping)), None)
        if first is None:
            raise ConfigurationError(f"{source.path}: no channel reads a column of the file")
        count = len(numbers(source, first, mapping.source.variable)[0])
        return Series(np.arange(count) / time.rate_hz, empty)
    tables = [one for one in (mapping.attitude, mapping.body_velocity) if one is not None]
    own = [c.clock is not None or c.value is not None for c in mapping.channels.values()]
    if source.clocks or all([*own, *(table.clock is not None for table in tables)]):
        return None
    raise ConfigurationError(f"{source.path}: no times; state [time] column (and unit), or rate_hz")


def _places(mapping: MappingFile) -> list[Place]:
    """Columns that a mapping reads as channels."""
    places = [place for channel in mapping.channels.values() for place in channel.places]
    attitude, velocity = mapping.attitude, mapping.body_velocity
    if attitude is not None:
        places += [Place(column=key, variable=attitude.variable) for key in attitude.quaternion]
    if velocity is not None:
        places += [Place(column=key, variable=velocity.variable) for key in (velocity.u, velocity.w)]
    return places


def _series(source: Source, mapping: MappingFile, name: str, one: Channel, clock: Series | None) -> Series:
    factor = one.sign * unit_factor(MAPPED[name], one.unit)
    zero = one.offset + ZEROS.get(one.unit, 0.0)
    above = one.reference_m or 0.0
    if one.value is not None:
        always = clock.t_s if clock is not None else np.array([-np.inf, np.inf])
        return Series(always, np.full(len(always), factor * (one.scale * one.value + zero) + above))
    times, read = _calibrated_columns(source, mapping, name, one, clock)
    with np.errstate(invalid="ignore", over="ignore"):  # the gate names what is not finite
        combined = np.array(one.weights) @ read if one.weights else read.mean(axis=0)
        values = factor * (one.scale * combined + zero) + above
    without_jumps = _TURNING.get(name)
    return replace(times, values=_unwrapped(values, without_jumps) if without_jumps else values)


def _calibrated_columns(
    source: Source, mapping: MappingFile, name: str, one: Channel, clock: Series | None
) -> tuple[Series, Array]:
    """Times (values are empty) of a channel and (columns, samples) values of its columns, each by its calibration."""
    times, read = _read(source, mapping, one.places, f"channels.{name}", one.clock, clock)
    if not one.calibrations:
        return times, read
    with np.errstate(invalid="ignore", over="ignore"):
        return times, np.stack([calibrated(*pair) for pair in zip(read, one.calibrations, strict=True)])


def _attitude(
    source: Source, mapping: MappingFile, one: AttitudeTable, clock: Series | None
) -> dict[str, Series]:
    """theta_rad, phi_rad and psi_rad of a quaternion; phi and psi do not jump by a turn."""
    places = [Place(column=key, variable=one.variable) for key in one.quaternion]
    times, read = _read(source, mapping, places, "attitude", one.clock, clock)
    with np.errstate(invalid="ignore", over="ignore"):
        norm = np.sqrt((read**2).sum(axis=0))
    short = np.flatnonzero(norm < LEAST_NORM)
    if len(short):
        raise LogError(
            f"{source.path}: [attitude] quaternion has a norm of {norm[short[0]]:.3g} in row {int(short[0]) + 1}, where an "
            "attitude has 1; name its four columns in their order"
        )
    scalar_first = read if one.order == "wxyz" else read[[3, 0, 1, 2]]
    phi, theta, psi = euler_angles(scalar_first, frame=one.frame, rotates=one.rotates)
    angles = (theta, _unwrapped(phi), _unwrapped(psi))
    return {name: replace(times, values=angle) for name, angle in zip(ATTITUDE, angles, strict=True)}


def _unwrapped(angle_rad: Array, without_jumps: Callable[[Array], Array] = np.unwrap) -> Array:
    """An angle without jumps of a turn, which interpolation would fill; what is not finite stays."""
    result = angle_rad.copy()
    known = np.isfinite(result)
    result[known] = without_jumps(result[known])
    return result


def _body_velocity(
    source: Source, mapping: MappingFile, one: BodyVelocity, clock: Series | None
) -> dict[str, Series]:
    """airspeed_m_s, alpha_rad, and beta_rad where v is known."""
    places = [Place(column=key, variable=one.variable) for key in (one.u, one.v, one.w) if key is not None]
    times, read = _read(source, mapping, places, "body_velocity", one.clock, clock)
    read = read * unit_factor("speed", one.unit)
    v = read[1] if one.v is not None else np.zeros(len(times.t_s))
    speed, alpha, beta = air_angles(read[0], v, read[-1])
    values = {"airspeed_m_s": speed, LONGITUDINAL.vane: alpha} | (
        {LATERAL.vane: beta} if one.v is not None else {}
    )
    return {name: replace(times, values=value) for name, value in values.items()}


def _read(
    source: Source,
    mapping: MappingFile,
    places: Sequence[Place],
    table: str,
    stated: Clock | None,
    clock: Series | None,
) -> tuple[Series, Array]:
    """Times (values are empty) and raw values (columns, samples) of the columns of one table of a mapping."""
    variable = mapping.source.variable
    own = None
    if stated is not None:
        _check_date(source, stated, stated.unit, f"{table}.clock")
        raw, _ = numbers(source, stated, variable)
        with np.errstate(invalid="ignore", over="ignore"):
            shifted = _seconds(raw, stated.unit) + stated.offset_s
        own = Series(shifted, np.empty(0), _rounding(raw, stated.unit))
    read = [numbers(source, place, variable) for place in places]
    recorded = Series(read[0][1], np.empty(0)) if read[0][1] is not None else None
    times = next((x for x in (own, clock, recorded) if x is not None), None)
    if times is None:
        raise ConfigurationError(
            f"{source.path}: {table} has no times; state [time] column, or {table}.clock"
        )
    for place, (values, t) in zip(places, read, strict=True):
        if len(values) != len(times.t_s):
            raise LogError(
                f"{source.path}: {table} has {len(values)} values and its clock {len(times.t_s)}; "
                f"state {table}.clock, or another column"
            )
        if times is recorded and t is not None and not np.array_equal(t, times.t_s):
            raise LogError(
                f"{source.path}: {table}: columns {places[0].column!r} and {place.column!r} are recorded at other times; "
                "combine columns of one message or topic"
            )
    return times, np.stack([values for values, _ in read])


def calibrated(raw: Array, points: Points) -> Array:
    """Piecewise linear through points (raw, value), which continues beyond the first and the last one.

    Parameters
    ----------
    raw : (samples,)
    points : two or more, by increasing raw value.
    """
    x, y = np.array(points).T
    left = np.clip(np.searchsorted(x, raw, side="right") - 1, 0, len(x) - 2)
    return np.asarray(y[left] + (raw - x[left]) * (np.diff(y) / np.diff(x))[left])


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


__all__ = ["Series", "base_clock", "calibrated", "read_series"]
