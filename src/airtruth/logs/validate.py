"""Structural validation of a flight log: every breach of the log contract, named with run, row and cure.

Physical plausibility is the business of `airtruth.checks.gate`, which calls this first.
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS
from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL, MOTIONS

Index = NDArray[np.int64]

MINIMUM_SAMPLES: Final = 20
"""Shortest run that is accepted [samples] (judgement: zero-phase filters and six parameters need more than ten)."""
JITTER: Final = 0.01
"""Largest deviation of a time step from the run's mean step, and of a rate from the stated one [-] (judgement:
clocks that round to 0.1 ms at 100 Hz pass)."""

LARGEST: Final = 1e9
"""Largest magnitude of a value [SI], of a time and of its inverse step [s, 1/s], and of the inverse of a positive channel
(judgement: no flight comes near it, and its powers do not overflow)."""

_SHOWN: Final = 3
"""Number of runs that a sentence names."""
_GAP: Final = 1.5
"""Least length of a gap [steps]."""
_MISSPELT: Final = 0.75
"""Similarity from which a column counts as a misspelt channel [-] (judgement: alfa_rad has 0.82 of alpha_rad)."""
_POSITIVE: Final = ("airspeed_m_s", "density_kg_m3")
"""Channels whose values must be positive."""
_NO_VANE: Final = ", or without a vane state [reconstruct] alpha = true,"
"""Cure of a missing angle of attack: further keys of a mapping."""
_SERVO: Final = (
    ", a servo output with calibration = [[output, deflection], [output, deflection]] as measured at two outputs, and elevons "
    "with columns and weights,"
)
"""Cure of a missing control surface: further keys of a mapping."""


def validate(log: FlightLog, *, minimum_samples: int = MINIMUM_SAMPLES, source: str = "flight log") -> None:
    """Raise one error that lists every breach of the log contract.

    A breach is a missing channel, a run in two parts, too few samples, times that are not finite, increasing
    and uniform, a gap, a rate other than that of the metadata, a value that is not finite, or an airspeed or
    density that is not positive. Columns outside the vocabulary are not checked.

    Parameters
    ----------
    log : flight log.
    minimum_samples : length of the shortest run that is accepted [samples].
    source : name of the log in the message, usually its file.

    Raises
    ------
    LogError
        One sentence per breach.
    """
    problems = list(_structure(log))
    if not problems:
        parted = list(_parted(log))  # the length and the times of such a part tell nothing
        extent = parted or [*_short(log, minimum_samples), *_time(log)]
        problems = [*_missing(log), *extent, *_values(log)]
    if problems:
        count = f"{len(problems)} problems" if len(problems) > 1 else "1 problem"
        raise LogError("\n  - ".join([f"{source}: {count}", *problems]))


def _structure(log: FlightLog) -> Iterator[str]:
    if _divides(log):
        if not log.run_ids:
            yield "the log holds no run; fly or import it again"
        elif "" in log.run_ids:
            yield "run_id: empty; name every run"
    yield from row_problems(log)


def _divides(log: FlightLog) -> bool:
    """Whether the offsets divide the rows into the runs."""
    offsets = log.offsets
    ends = len(offsets) == len(log.run_ids) + 1 and offsets[0] == 0 and offsets[-1] == len(log.t_s)
    return bool(ends and (np.diff(offsets) >= 0).all())


def row_problems(log: FlightLog) -> Iterator[str]:
    """Rows that belong to no run, and channels of another number of rows, in words."""
    rows = len(log.t_s)
    if not _divides(log):
        yield (
            f"offsets do not divide {rows} rows into {len(log.run_ids)} runs; "
            "they are the first row of each run, and the number of rows"
        )
    for name, values in log.channels.items():
        if values.shape != (rows,):
            yield f"{name}: shape {values.shape} where t_s has {rows} rows; give one value per row"


def _missing(log: FlightLog) -> Iterator[str]:
    """Channels that the log lacks of the motion that it covers best, the pitch plane if it covers both alike.

    In a log of the lateral motion, a channel of the pitch plane counts as missing where a column has nearly its name.
    """
    motion = min(MOTIONS.values(), key=lambda m: len({*m.required} - {*log.channels}))
    present = [name for name in log.channels if name not in SIGNALS]
    for name in dict.fromkeys((*motion.required, *LONGITUDINAL.required)):
        if name not in log.channels:
            needed = name in motion.required
            near = difflib.get_close_matches(name, present, n=1, cutoff=0.5 if needed else _MISSPELT)
            if not needed and not near:
                continue
            step = f"the nearest column is {near[0]!r}: map it" if near else "map a column to it"
            if not near:
                controls = [one.channel for one in motion.controls]
                step += _NO_VANE if name == LONGITUDINAL.vane else _SERVO if name in controls else ""
            yield f"{name}: required channel is missing ({SIGNALS[name].description}); {step} on import"
    if "density_kg_m3" not in log.channels and "altitude_m" not in log.channels:
        yield "density_kg_m3 or altitude_m: one of the two is required, both are missing; map one on import"


def _parted(log: FlightLog) -> Iterator[str]:
    counts = Counter(log.run_ids)
    if len(counts) < len(log.run_ids):
        names = _listed([repr(name) for name, count in counts.items() if count > 1], "run")
        yield f"run_id: {names} in more than one part; sort by run_id and t_s, or rename the runs"


def _short(log: FlightLog, minimum_samples: int) -> Iterator[str]:
    lengths = np.diff(log.offsets)
    short = np.flatnonzero(lengths < minimum_samples)
    if len(short):
        which = [f"{log.run_ids[run]!r} ({lengths[run]})" for run in short]
        yield f"too few samples, below {minimum_samples}, in {_listed(which, 'run')}; leave them out"


def _time(log: FlightLog) -> Iterator[str]:
    lengths = np.diff(log.offsets)
    if not np.isfinite(log.t_s).all():
        bad = np.flatnonzero(~np.isfinite(log.t_s))
        where = _where(log, bad, with_time=False)
        yield f"t_s: {_not_finite(bad)}, {where}; repair them or cut the run there"
        return
    steps = np.diff(log.t_s)
    if np.abs(log.t_s).max(initial=0.0) > LARGEST or (np.abs(steps[steps != 0.0]) < 1.0 / LARGEST).any():
        yield (
            f"t_s: times beyond {LARGEST:g} s or steps below {1.0 / LARGEST:g} s; write seconds from the start of the run"
        )
        return
    timed = np.flatnonzero(lengths >= 2)
    first, last = log.offsets[timed], log.offsets[timed + 1] - 1
    period = (log.t_s[last] - log.t_s[first]) / (lengths[timed] - 1)
    if len(log.t_s) > 1:
        steps = np.diff(log.t_s)
        nominal = np.zeros(len(log.run_ids))
        nominal[timed] = period
        nominal = np.repeat(nominal, lengths)[:-1]
        wrong = ~((steps > 0.0) & (np.abs(steps - nominal) <= JITTER * nominal))
        ends = log.offsets[1:-1]
        wrong[ends[(ends > 0) & (ends < len(log.t_s))] - 1] = False  # from run to run
        if wrong.any():
            runs = np.unique(np.searchsorted(log.offsets, np.flatnonzero(wrong), side="right") - 1)
            yield from _irregular(log, runs)
            regular = ~np.isin(timed, runs)
            timed, period = timed[regular], period[regular]
    yield from _rate(log, timed, period)


def _irregular(log: FlightLog, runs: Index) -> Iterator[str]:
    """Sort the runs with unequal steps into those whose time goes back, has gaps, or jitters."""
    back: list[int] = []
    gaps: list[int] = []
    uneven: list[int] = []
    for run in runs:
        rows = log.rows(run)
        steps = np.diff(log.t_s[rows])
        step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
        late = rows.start + 1  # the row at which a step ends
        back.extend(late + np.flatnonzero(steps <= 0))
        gaps.extend(late + np.flatnonzero(steps > _GAP * step))
        uneven.extend(
            late
            + np.flatnonzero((steps > 0) & (steps <= _GAP * step) & (np.abs(steps - step) > JITTER * step))
        )
    if back:
        yield f"t_s: does not increase {_where(log, np.array(back))}; sort by t_s and drop repeated samples"
    if gaps:
        longest = max(float(log.t_s[row] - log.t_s[row - 1]) for row in gaps)
        yield (
            f"t_s: {len(gaps)} gap{'s' * (len(gaps) > 1)}, the longest {longest:.3g} s, "
            f"{_where(log, np.array(gaps))}; "
            "split the run there into two runs, or resample it on import"
        )
    rounding = single_precision_s(log.t_s)
    if uneven and rounding > 0.0:
        yield (
            f"t_s: single precision (float32), which resolves {1e3 * rounding:.2g} ms at {np.abs(log.t_s).max():.6g} s, "
            f"so that steps differ by more than {JITTER:.0%} {_where(log, np.array(uneven))}; write t_s as float64, "
            "or start every run at zero"
        )
    elif uneven:
        yield (
            f"t_s: steps differ by more than {JITTER:.0%} {_where(log, np.array(uneven))}; "
            "resample to a uniform rate on import"
        )


def single_precision_s(t: NDArray[np.float64]) -> float:
    """Resolution of times that are float32 numbers, in their unit; 0 if they are not or it does not matter.

    It matters where it exceeds `JITTER` of the mean step.
    """
    with np.errstate(over="ignore"):
        single = t.astype(np.float32)
    if len(t) < 2 or not (single == t).all():
        return 0.0
    resolution = float(np.spacing(np.abs(single).max()))
    return resolution if resolution > JITTER * float(np.median(np.abs(np.diff(t)))) else 0.0


def _rate(log: FlightLog, runs: Index, period: NDArray[np.float64]) -> Iterator[str]:
    if "sample_rate_hz" not in log.metadata:
        return
    stated = log.metadata["sample_rate_hz"]
    if isinstance(stated, bool) or not isinstance(stated, int | float) or not stated > 0:
        yield f"metadata: sample_rate_hz is {stated!r}, not a positive number; correct it or leave it out"
        return
    off = np.abs(period * stated - 1.0) > JITTER
    if off.any():
        which = [
            f"{log.run_ids[run]!r} ({1 / step:.6g} Hz)"
            for run, step in zip(runs[off], period[off], strict=True)
        ]
        yield f"t_s: not the {stated:g} Hz of the metadata (sample_rate_hz) in {_listed(which, 'run')}; correct either"


def _values(log: FlightLog) -> Iterator[str]:
    for name, values in log.channels.items():
        if name not in SIGNALS or not len(values):
            continue
        finite = np.isfinite(values)
        if not finite.all():
            bad = np.flatnonzero(~finite)
            yield (
                f"{name}: {_not_finite(bad)}, {_where(log, bad)}; "
                "cut the run there, or leave the channel out if it is optional"
            )
        below = finite & (values <= 0.0)
        if name in _POSITIVE and below.any():
            yield f"{name}: not positive {_where(log, np.flatnonzero(below))}; cut the run there"
        with np.errstate(invalid="ignore"):
            size = np.abs(values)
            beyond = (finite & (size > LARGEST)) | (
                (size < 1.0 / LARGEST) & (values > 0.0) if name in _POSITIVE else False
            )
        if beyond.any():
            rows = np.flatnonzero(beyond)
            yield (
                f"{name}: {values[rows[0]]:.3g} is not a plausible measurement, {_where(log, rows)}; "
                "correct its unit, or cut the "
                "run there"
            )


def _not_finite(rows: Index) -> str:
    return f"{len(rows)} values are NaN or infinite" if len(rows) > 1 else "one value is NaN or infinite"


def _where(log: FlightLog, rows: Index, *, with_time: bool = True) -> str:
    """Runs that hold the rows, with the first row in each, counted from the start of the run."""
    run_of = np.searchsorted(log.offsets, rows, side="right") - 1
    runs, first = np.unique(run_of, return_index=True)
    places = []
    for run, index in zip(runs[:_SHOWN], first[:_SHOWN], strict=True):
        row = int(rows[index])
        time = f", t {log.t_s[row]:.6g} s" if with_time else ""
        places.append(f"{log.run_ids[run]!r} (row {row - int(log.offsets[run])}{time})")
    return f"in {_listed(places, 'run', len(runs))}"


def _listed(items: list[str], noun: str, count: int | None = None) -> str:
    count = len(items) if count is None else count
    more = f" and {count - _SHOWN} more" if count > _SHOWN else ""
    return f"{count} {noun}{'s' if count > 1 else ''}: {', '.join(items[:_SHOWN])}{more}"


__all__ = ["JITTER", "MINIMUM_SAMPLES", "row_problems", "single_precision_s", "validate"]
