"""Records of a kinematic check: runs worth judging, several of them side by side, thinning; and what a check knows of an axis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.checks.pitch_motions import smoothing
from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.numerics.prefilter import butterworth, edge_samples, zero_phase
from airtruth.physics.motion_parts import Reference
from airtruth.physics.sensor_errors import KINDS, Kind, error_name
from airtruth.units import UNITS, printed

Array = NDArray[np.float64]
V = TypeVar("V")

_KEPT: Final = 8
"""Number of values of one name that are kept [-] (judgement: a step of a fit moves up to four errors, one after the other)."""
RATE_HZ: Final = 25.0
"""Smallest sample rate after thinning [Hz]: judgement; the motion of an aircraft lies below 5 Hz."""
MOST_RECORDS: Final = 20
"""Records judged together [-]: judgement; more add little, and time grows with them."""
LONGEST_ARM_M: Final = 40.0
"""Largest arm where no reference length is known [m]: judgement, half the length of the largest aircraft."""
USUAL_ARM_M: Final = 10.0
"""Arm that is not unusual where no reference length is known [m]: judgement."""


@dataclass(frozen=True)
class Samples:
    """One run, channels of one length; or several runs of one length and period, channels (runs, samples).

    The fields of a kind of record behind these are its channels, None for one that the log lacks.

    Attributes
    ----------
    run_id : name of the run.
    dt_s : sample period [s].
    """

    run_id: str
    dt_s: float

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(f.name for f in fields(cls))[2:]

    def channel(self, name: str) -> Array | None:
        """(samples,) a channel by its field, None where the log has none."""
        values: Array | None = getattr(self, name)
        return values

    @property
    def length(self) -> int:
        """Number of samples."""
        return int(next(x.shape[-1] for n in self.names() if (x := self.channel(n)) is not None))

    @property
    def duration_s(self) -> float:
        """Length of the record [s]."""
        return float(self.dt_s * self.length)

    @cached_property
    def t(self) -> Array:
        """(samples,) time from the first sample [s]."""
        return np.asarray(np.arange(self.length) * self.dt_s)

    def kept(self, name: str, at: tuple[float, ...], make: Callable[[], V]) -> V:
        """A value that a fit needs again and again while other errors move.

        Parameters
        ----------
        name : of the value; at : what it depends on beside the record; make : makes it.
        """
        own = self._kept.setdefault(name, {})
        if at not in own:
            if len(own) >= _KEPT:
                del own[next(iter(own))]
            own[at] = make()
        value: V = own[at]
        return value

    @cached_property
    def _kept(self) -> dict[str, dict[tuple[float, ...], Any]]:
        return {}


R = TypeVar("R", bound=Samples)


def records_of(
    logs: Sequence[FlightLog],
    make: Callable[[str, float, Mapping[str, Array]], R | None],
    still: str,
    manoeuvre: str,
) -> tuple[list[R], list[str]]:
    """The first `MOST_RECORDS` runs worth judging, and a remark if there are more runs.

    Parameters
    ----------
    logs : flight logs.
    make : name, sample period [s] and the channels that all logs have -> thinned record; None where nothing moves.
    still : what does not move, and ``manoeuvre`` : what would help, in the message.

    Raises
    ------
    LogError
        If no run is long enough and moves.
    """
    shared = set.intersection(*(set(log.channels) for log in logs))
    runs = [(log, run) for log in logs for run in range(len(log.run_ids))]
    records: list[R] = []
    for log, run in runs:
        rows = log.rows(run)
        dt = float(np.mean(np.diff(log.t_s[rows])))
        if len(records) < MOST_RECORDS and rows.stop - rows.start >= 4 * edge_samples(smoothing(dt)):
            record = make(log.run_ids[run], dt, {n: log.channels[n][rows] for n in shared})
            records += [] if record is None else [record]
    if not records:
        raise LogError(
            f"no run can be assessed: {len(runs)} runs are shorter than about two seconds, or {still} move in them; "
            f"give a record with {manoeuvre}"
        )
    many = len(records) < len(runs)
    return records, [f"{len(records)} of {len(runs)} runs were assessed."] if many else []


def stacked(records: Sequence[R]) -> list[tuple[tuple[int, ...], R]]:
    """Records of one length, period and set of channels as one, each with the numbers of its runs."""
    alike: dict[tuple[object, ...], list[int]] = {}
    for i, r in enumerate(records):
        absent = tuple(r.channel(n) is None for n in r.names())
        alike.setdefault((r.dt_s, r.length, absent), []).append(i)
    result = []
    for numbers in alike.values():
        own = [records[i] for i in numbers]
        joined: dict[str, Any] = {
            n: None if own[0].channel(n) is None else np.stack([getattr(r, n) for r in own])
            for n in own[0].names()
        }
        result.append((tuple(numbers), replace(own[0], **joined)))
    return result


def thinned(record: R) -> R:
    """Record with every k-th sample, at least `RATE_HZ`, all channels through one low-pass without lag."""
    every = int(1.0 / (record.dt_s * RATE_HZ) + 1e-6)
    if every < 2:
        return record
    period = every * record.dt_s
    sos = butterworth(0.4 / period, 4, record.dt_s)

    def thin(x: Array | None) -> Array | None:
        return None if x is None else np.ascontiguousarray(zero_phase(x[None], sos)[0, ::every])

    channels: dict[str, Any] = {n: thin(record.channel(n)) for n in record.names()}
    return replace(record, dt_s=period, **channels)


@dataclass(frozen=True)
class InstrumentError:
    """An error that the kinematics can show.

    Attributes
    ----------
    channel, kind : of `airtruth.physics.sensor_errors`, which name it.
    usual : size that is not unusual, the standard deviation of its prior [SI; of an arm in chords].
    step : step of its derivative [SI].
    meaning : definition, for people.
    """

    channel: str
    kind: Kind
    usual: float
    step: float
    meaning: str

    @property
    def name(self) -> str:
        """Name that effects and results share."""
        return error_name(self.channel, self.kind)

    @property
    def unit(self) -> str:
        """Unit as it is printed, "-" for none."""
        return printed(next(iter(UNITS[KINDS[self.kind].dimension]))) or "-"

    @property
    def neutral(self) -> float:
        """Value without error."""
        return KINDS[self.kind].neutral

    @property
    def is_factor(self) -> bool:
        """Whether it multiplies the reading, and a declared error too."""
        return KINDS[self.kind].is_factor

    @property
    def is_arm(self) -> bool:
        """Whether it is a distance."""
        return KINDS[self.kind].dimension == "length"


@dataclass(frozen=True)
class Kinematics:
    """The part of a kinematic check that depends on the motion; everything else of the check is common to all.

    Attributes
    ----------
    errors : errors that the channels can show, by name.
    channels : equation -> channel that it predicts.
    fields : channel whose bias the equations show -> field of the record.
    compare : record, errors and equations -> difference of each equation, of the shape of the channels.
    motions : record -> (k, samples) motions that the control surfaces cause.
    controls : the control surfaces, in sentences.
    reference : reference length of the motion.
    longest : largest arm over that length [-].
    same : groups of errors that move the channels in the same way; no set has two of a group.
    telling : sizes that records have to show before the channels are called consistent [SI].
    most : largest number of errors in a set; a real record, which no kinematic model of few terms explains exactly, takes up any
        further error.
    trends : degree of the polynomial that is free in each equation and record.
    offsets : unknown errors that are free in each record and every set: name -> step of its derivative [SI].
    common : the records may share one noise, where they do not differ by it.
    moved_by : equation -> names of the errors and offsets that move its difference; one without an entry depends on all.
    """

    errors: Mapping[str, InstrumentError]
    channels: Mapping[str, str]
    fields: Mapping[str, str]
    compare: Callable[[Any, Mapping[str, float], Sequence[str]], dict[str, Array]]
    motions: Callable[[Any], Array]
    controls: str
    reference: Reference
    longest: float
    same: tuple[frozenset[str], ...] = ()
    telling: Mapping[str, float] = field(default_factory=dict)
    most: int = 3
    trends: int = 1
    offsets: Mapping[str, float] = field(default_factory=dict)
    common: bool = False
    moved_by: Mapping[str, frozenset[str]] = field(default_factory=dict)

    def longest_arm_m(self, length_m: float | None) -> float:
        """Largest arm of an aircraft of a reference length [m]; `LONGEST_ARM_M` where it is not known."""
        return LONGEST_ARM_M if length_m is None else self.longest * length_m


def declared_errors(aircraft: Aircraft, kinematics: Kinematics) -> dict[str, float]:
    """Errors of sensors that aircraft.toml declares: name -> value [SI]."""
    result = {}
    for error in kinematics.errors.values():
        sensor = aircraft.file.sensors.get(error.channel)
        value = error.neutral if sensor is None else sensor.errors().value(error.kind)
        if value != error.neutral:
            result[error.name] = value
    return result


def declared_biases(aircraft: Aircraft, kinematics: Kinematics) -> dict[str, float]:
    """Biases that aircraft.toml declares: channel -> value [SI]."""
    sensors = aircraft.file.sensors
    biases = {channel: sensors[channel].errors().bias for channel in kinematics.fields if channel in sensors}
    return {channel: bias for channel, bias in biases.items() if bias != 0.0}


__all__ = [
    "LONGEST_ARM_M",
    "MOST_RECORDS",
    "RATE_HZ",
    "USUAL_ARM_M",
    "InstrumentError",
    "Kinematics",
    "R",
    "Samples",
    "declared_biases",
    "declared_errors",
    "records_of",
    "stacked",
    "thinned",
]
