"""A flight log in memory: columns of many runs, one after another."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import RUN_ID, SIGNALS, TIME
from airtruth.errors import LogError, choices, counted, reason

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class FlightLog:
    """Runs of a flight test, columnar.

    ``len(log)`` is the number of runs.

    Attributes
    ----------
    metadata : file-level facts (aircraft, sample_rate_hz, ...); never anything of the truth.
    run_ids : one name per run, all different.
    offsets : (runs + 1,) first row of each run, and the number of rows.
    t_s : (rows,) time from the start of each run [s].
    channels : column name -> (rows,) values in SI, names of `airtruth.channels`.
    """

    metadata: Mapping[str, object]
    run_ids: tuple[str, ...]
    offsets: NDArray[np.int64]
    t_s: Array
    channels: Mapping[str, Array]

    def __post_init__(self) -> None:
        """Turn lists, columns of frames and arrays of other types into arrays.

        Raises
        ------
        LogError
            Naming the first that does not hold numbers.
        """
        own = {name: _floats(name, values) for name, values in self.channels.items()}
        object.__setattr__(self, "channels", own)
        object.__setattr__(self, "t_s", _floats(TIME, self.t_s))
        object.__setattr__(self, "offsets", np.asarray(self.offsets, dtype=np.int64))

    def rows(self, run: int) -> slice:
        """Rows of one run, by its index."""
        return slice(int(self.offsets[run]), int(self.offsets[run + 1]))

    def select(
        self,
        run_ids: str | Collection[str] | None = None,
        channels: str | Collection[str] | None = None,
        t_s: tuple[float, float] | None = None,
    ) -> FlightLog:
        """Return part of the log; every choice that is None keeps all.

        Parameters
        ----------
        run_ids : runs to keep; they stay in the order of the log.
        channels : channels to keep, in this order.
        t_s : first and last time to keep of every run [s], both included. The times of the result
            count from the first sample that is kept.

        Raises
        ------
        LogError
            If a run or channel does not exist, the times are not two numbers, or a run has no sample between them.

        Examples
        --------
        >>> log = at.read_log("out/light")
        >>> log
        FlightLog(6 runs of 5 s at 50 Hz, 11 channels: airspeed_m_s, alpha_rad, theta_rad, q_rad_s, ...)
        >>> log.select(channels=["alpha_rad", "q_rad_s"], t_s=(1.0, 3.0))
        FlightLog(6 runs of 2 s at 50 Hz, 2 channels: alpha_rad, q_rad_s)
        """
        runs = _indices(self.run_ids, run_ids)
        names = _names(self.channels, channels)
        between = None if t_s is None else _two_times(t_s)
        pieces = [_between(self, run, between) for run in runs]
        rows = np.concatenate([np.arange(0), *(np.arange(piece.start, piece.stop) for piece in pieces)])
        lengths = [piece.stop - piece.start for piece in pieces]
        starts = np.array([0.0 if t_s is None else self.t_s[piece.start] for piece in pieces])
        return FlightLog(
            metadata=self.metadata,
            run_ids=tuple(self.run_ids[run] for run in runs),
            offsets=np.cumsum([0, *lengths]).astype(np.int64),
            t_s=self.t_s[rows] - np.repeat(starts, lengths),
            channels={name: self.channels[name][rows] for name in names},
        )

    @classmethod
    def concat(cls, logs: Sequence[FlightLog]) -> FlightLog:
        """Join the runs of several logs in the order given.

        The metadata of the result are the entries on which all logs agree; ``record_constants``, which
        belong to runs, are all kept.

        Parameters
        ----------
        logs : logs with the same channels and different runs.

        Raises
        ------
        LogError
            If there is no log, a run occurs twice, or the channels differ.

        Examples
        --------
        >>> log = at.read_log("out/light")
        >>> first, last = log.select(log.run_ids[0]), log.select(log.run_ids[-1])
        >>> len(at.FlightLog.concat([first, last]))
        2
        """
        if not logs:
            raise LogError("concat: no log is given; give at least one")
        _check_joinable(logs)
        lengths = np.concatenate([np.diff(log.offsets) for log in logs])
        return cls(
            metadata=_common_metadata(logs),
            run_ids=tuple(run_id for log in logs for run_id in log.run_ids),
            offsets=np.append(0, np.cumsum(lengths)).astype(np.int64),
            t_s=np.concatenate([log.t_s for log in logs]),
            channels={
                name: np.concatenate([log.channels[name] for log in logs]) for name in logs[0].channels
            },
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row per sample: run_id, t_s and the channels, as in the file.

        Examples
        --------
        >>> at.read_log("out/light").to_frame().shape  # 6 runs of 251 samples, 11 channels
        (1506, 13)
        """
        import pandas as pd

        names = np.repeat(np.array(self.run_ids, dtype=object), np.diff(self.offsets))
        return pd.DataFrame({RUN_ID: names, TIME: self.t_s, **self.channels})

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.run_ids)

    def __repr__(self) -> str:
        """Return number, duration and sample rate of the runs, and the first channels."""
        names = list(self.channels)
        shown = ", ".join([*names[:SHOWN_CHANNELS], *["..."][: len(names) > SHOWN_CHANNELS]])
        return f"FlightLog({_extent(self)}, {counted(len(names), 'channel')}: {shown})"

    def _repr_html_(self) -> str:
        """Return a table of the channels with unit, extremes and mean."""
        import pandas as pd

        rows = [
            {
                "channel": name,
                "unit": SIGNALS[name].unit if name in SIGNALS else "",
                "minimum": values.min() if len(values) else np.nan,
                "mean": values.mean() if len(values) else np.nan,
                "maximum": values.max() if len(values) else np.nan,
            }
            for name, values in self.channels.items()
        ]
        table: str = pd.DataFrame(rows).to_html(index=False, float_format="{:.4g}".format, border=0)
        return f"<p>Flight log: {_extent(self)}</p>\n{table}"


SHOWN_CHANNELS = 4
"""Channels that the repr of a log names (judgement: one line of a terminal)."""


def _floats(name: str, values: object) -> Array:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise LogError(
            f"{name}: {type(values).__name__} does not hold numbers alone ({reason(error)}); give one number per row, NaN "
            "for a missing one"
        ) from error


def _extent(log: FlightLog) -> str:
    """Number, duration and sample rate of the runs; a range where they differ."""
    runs = [log.t_s[rows] for rows in map(log.rows, range(len(log))) if rows.stop - rows.start > 1]
    text = counted(len(log), "run")
    if not runs:
        return text
    durations = [float(t[-1] - t[0]) for t in runs]
    rates = [(len(t) - 1) / d for t, d in zip(runs, durations, strict=True) if d > 0.0]
    text += f" of {_range(durations)} s"
    return f"{text} at {_range(rates)} Hz" if rates else text


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def unknown_runs(missing: Collection[str], run_ids: Sequence[str]) -> str:
    """Return the sentence for runs that do not exist, with the nearest name and the extent of the log."""
    names = sorted(missing)
    near = difflib.get_close_matches(names[0], run_ids, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    extent = f"the log holds {counted(len(run_ids), 'run')}"
    span = f", {run_ids[0]!r} to {run_ids[-1]!r}" if run_ids else ""
    return f"no run {', '.join(map(repr, names[:5]))}; {hint}{extent}{span}"


def _indices(run_ids: Sequence[str], wanted: str | Collection[str] | None) -> list[int]:
    if wanted is None:
        return list(range(len(run_ids)))
    names = {wanted} if isinstance(wanted, str) else set(wanted)
    missing = names - set(run_ids)
    if missing:
        raise LogError(unknown_runs(missing, run_ids))
    return [index for index, name in enumerate(run_ids) if name in names]


def _names(channels: Mapping[str, Array], wanted: str | Collection[str] | None) -> list[str]:
    if wanted is None:
        return list(channels)
    names = [wanted] if isinstance(wanted, str) else list(dict.fromkeys(wanted))
    for name in names:
        if name not in channels:
            raise LogError(f"no channel {name!r}; {choices(name, channels)}")
    return names


def _two_times(t_s: tuple[float, float]) -> tuple[float, float]:
    try:
        first, last = map(float, t_s)
    except (TypeError, ValueError):
        raise LogError(
            f"t_s = {t_s!r}: must be the first and the last time to keep [s], such as (1.0, 3.0)"
        ) from None
    return first, last


def _between(log: FlightLog, run: int, t_s: tuple[float, float] | None) -> slice:
    """Rows of a run between two times; a rounding error of the time stamps does not exclude a sample."""
    rows = log.rows(run)
    if t_s is None:
        return rows
    t = log.t_s[rows]
    small = 1e-9 * max(1.0, abs(t_s[0]), abs(t_s[1]))
    start, stop = np.searchsorted(t, [t_s[0] - small, t_s[1] + small])
    if start >= stop:
        extent = f"it runs from {t[0]:g} to {t[-1]:g} s" if len(t) else "it has no samples"
        raise LogError(f"run {log.run_ids[run]!r} has no sample from {t_s[0]:g} to {t_s[1]:g} s; {extent}")
    return slice(rows.start + int(start), rows.start + int(stop))


def _check_joinable(logs: Sequence[FlightLog]) -> None:
    seen: set[str] = set()
    for log in logs:
        twice = seen & set(log.run_ids)
        if twice:
            raise LogError(f"run {min(twice)!r} is in two of the logs; rename it in one of them")
        seen |= set(log.run_ids)
        differing = set(log.channels) ^ set(logs[0].channels)
        if differing:
            raise LogError(
                f"channel {min(differing)!r} is not in all of the logs; select(channels=...) those that are"
            )


def _common_metadata(logs: Sequence[FlightLog]) -> dict[str, object]:
    first, *others = (log.metadata for log in logs)
    common = {key: value for key, value in first.items() if all(key in m and m[key] == value for m in others)}
    constants: dict[str, object] = {}
    for log in logs:
        own = log.metadata.get(RECORD_CONSTANTS)
        constants |= own if isinstance(own, Mapping) else {}
    return common | ({RECORD_CONSTANTS: constants} if constants else {})


RESAMPLED = "resampled"
"""Key of the metadata with the rate to which an import resampled a log, the method, and the lower rates of its channels."""
PRESCRIBED = "surface_prescribed"
"""Key of the metadata of a flown log whose surface followed its command without an actuator."""
RECORD_CONSTANTS = "record_constants"
"""Metadata entry with the mass, inertia and reference lengths of single runs: run -> name -> value in SI."""


@dataclass(frozen=True)
class Batch:
    """Runs of one length and one sample period, stacked.

    Attributes
    ----------
    run_ids : names of the runs.
    dt_s : sample period [s].
    t_s : (runs, samples) time [s].
    channels : column name -> (runs, samples) values in SI, C-contiguous.
    servo_s : time constant of the elevator's servo, where the aircraft declares it [s]; 0 for none.
    known_rates : (2, runs, samples) parts of alpha' [rad/s] and q' [rad/s2] that another motion causes; None for none.
    """

    run_ids: tuple[str, ...]
    dt_s: float
    t_s: Array
    channels: Mapping[str, Array]
    servo_s: float = 0.0
    known_rates: Array | None = None


def batches(log: FlightLog) -> Iterator[Batch]:
    """Group the runs of a validated log by length and sample period, in order of first appearance."""
    groups: dict[tuple[int, float], list[int]] = {}
    for run in range(len(log.run_ids)):
        rows = log.rows(run)
        n = rows.stop - rows.start
        dt = (log.t_s[rows.stop - 1] - log.t_s[rows.start]) / (n - 1)
        groups.setdefault((n, round(float(dt), 9)), []).append(run)
    for (n, dt), runs in groups.items():
        index = (log.offsets[runs][:, None] + np.arange(n)[None, :]).astype(np.int64)
        yield Batch(
            run_ids=tuple(log.run_ids[r] for r in runs),
            dt_s=dt,
            t_s=log.t_s[index],
            channels={name: np.ascontiguousarray(values[index]) for name, values in log.channels.items()},
        )
