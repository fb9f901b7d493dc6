"""Channels with times of their own, brought to one uniform rate without aliasing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.importers.mapping import Resample
from airtruth.importers.series import Series
from airtruth.logs.validate import JITTER

Array = NDArray[np.float64]

MOST_SAMPLES: Final = 2e7
"""Samples of a resampled run [-] (judgement: five hours at 1 kHz)."""
FASTER: Final = 1.05
"""Ratio of a channel's own rate to the new one above which it is low-passed first [-] (judgement: clocks that differ by
less than 5 % alias only a band that no estimator reads)."""
PASS: Final = 0.4
"""Highest frequency that the low-pass leaves unchanged, as a share of the new rate [-]; it ends at one half."""
RIPPLE_DB: Final = 80.0
"""Attenuation beyond half the new rate, and ripple below `PASS` [dB] (judgement: 0.01 % of a channel)."""
GAP: Final = (10.0, 0.5)
"""Usual steps and time [s] that a pause must both exceed to be a gap (judgement: jitter and single lost samples do not)."""
LOST_S: Final = 0.5
"""Time at either end of a record from which the loss is stated [s] (judgement: recorders start within half a second)."""
SLOWER: Final = 0.8
"""Share of the common rate below which the rate of a channel's own samples counts as lower [-] (judgement)."""
SNAP: Final = 0.75
"""Largest distance of a time in single precision from an even grid [resolutions]: a half is rounding, the rest the error
of the fitted grid."""


def uniform(
    where: str, series: Mapping[str, Series], resample: Resample | None
) -> tuple[Array, dict[str, Array]]:
    """Times from zero and channels at one uniform rate.

    Without ``resample`` the channels must share their times. With it each channel is interpolated; one whose own
    rate is higher is first low-passed without lag.

    Raises
    ------
    LogError
        Naming the channel whose times or values cannot be used.
    """
    moving = {name: one for name, one in series.items() if not one.constant}
    if not moving:
        raise LogError(f"{where}: every channel is a constant; map columns of the file")
    for name, one in moving.items():
        _check_times(where, name, one.t_s)
    if resample is None:
        t = _shared(where, moving)
        return t, {n: s.values if n in moving else np.full(len(t), s.values[0]) for n, s in series.items()}
    full = {
        name: Series(even_times(o.t_s, o.rounding_s)[ok], o.values[ok])
        for name, o in moving.items()
        if (ok := np.isfinite(o.values)).sum() > 3
    }
    for name in moving:
        if name not in full:
            raise LogError(
                f"{where}: {name} holds {len(moving[name].values)} rows and at most three values; map another"
            )
    start, end = max(o.t_s[0] for o in full.values()), min(o.t_s[-1] for o in full.values())
    start = _phase(full, start, end, resample.rate_hz)
    samples = np.floor((end - start) * resample.rate_hz + 1e-6) + 1.0
    if samples > MOST_SAMPLES:
        raise LogError(
            f"{where}: {end - start:g} s at {resample.rate_hz:g} Hz are {samples:g} samples, and a run may have "
            f"{MOST_SAMPLES:g}; correct the unit of [time], cut a [[manoeuvre]], or lower [resample] rate_hz"
        )
    count = int(samples)
    if count < 2:
        raise LogError(
            f"{where}: the channels share no time: the last starts at {start:g} s, the first ends at {end:g} s"
        )
    for name, one in full.items():
        if resample.method != "previous":
            _check_gaps(where, name, one, start, end)
    t = np.arange(count) / resample.rate_hz
    values = {n: resampled(one, start + t, resample) for n, one in full.items()}
    return t, {n: values[n] if n in values else np.full(count, s.values[0]) for n, s in series.items()}


def shortened(series: Mapping[str, Series]) -> list[str]:
    """Time that a record loses at its ends because one channel has no value there while others have, in words.

    Parameters
    ----------
    series : channels of a run, with times of their own.
    """
    spans = {
        name: (float(one.t_s[ok][0]), float(one.t_s[ok][-1]))
        for name, one in series.items()
        if not one.constant and (ok := np.isfinite(one.values)).any()
    }
    if not spans:
        return []
    last = max(spans, key=lambda name: spans[name][0])
    first = min(spans, key=lambda name: spans[name][1])
    head = spans[last][0] - min(start for start, _ in spans.values())
    tail = max(end for _, end in spans.values()) - spans[first][1]
    sentences = [f"its first {head:.3g} s are left out, where {last} has no value"] if head > LOST_S else []
    return sentences + (
        [f"its last {tail:.3g} s are left out, where {first} has no value"] if tail > LOST_S else []
    )


def beyond(series: Mapping[str, Series], start_s: float, end_s: float) -> list[str]:
    """Time that a run lacks of the times that the mapping states for it, in words.

    Parameters
    ----------
    series : channels of the run; start_s, end_s : stated times on their clock [s], infinite where none are stated.
    """
    times = [one.t_s[np.isfinite(one.t_s)] for one in series.values() if not one.constant]
    known = [t for t in times if len(t)]
    if not known:
        return []
    low, high = min(t.min() for t in known), max(t.max() for t in known)
    early = np.isfinite(start_s) and low - start_s > LOST_S
    late = np.isfinite(end_s) and end_s - high > LOST_S
    sentences = (
        [f"[[manoeuvre]] start_s is {start_s:g}, but the first sample is at {low:g} s"] if early else []
    )
    return sentences + (
        [f"[[manoeuvre]] end_s is {end_s:g}, but the last sample is at {high:g} s"] if late else []
    )


def slower(series: Mapping[str, Series], rate_hz: float) -> dict[str, float]:
    """Channel -> rate of its own samples [Hz], of those whose rate is less than `SLOWER` of the common one."""
    own: dict[str, float] = {}
    for name, one in series.items():
        t = one.t_s[np.isfinite(one.values)] if not one.constant else np.empty(0)
        if len(t) > 1 and t[-1] > t[0] and (hz := (len(t) - 1) / float(t[-1] - t[0])) < SLOWER * rate_hz:
            own[name] = float(f"{hz:.4g}")
    return own


def jitter_of(one: Series) -> float:
    """Largest departure of a step from the usual one, as a share of it, without pauses and lost samples [-]."""
    steps = _steps(one)
    if not len(steps):
        return 0.0
    usual = float(np.median(steps))
    apart = np.abs(steps - usual)[steps < 1.5 * usual] / usual
    rounding = one.rounding_s / usual
    largest = float(apart.max(initial=0.0))
    return largest if largest > 2.0 * rounding else 0.0


def lost_of(one: Series) -> tuple[int, float]:
    """Number of samples that are missing between others, and the longest time between two samples [s]; 0 and 0 for none."""
    steps = _steps(one)
    if not len(steps):
        return 0, 0.0
    usual = float(np.median(steps))
    long = steps[steps >= 1.5 * usual]
    return int((np.round(long / usual) - 1.0).sum()), float(long.max(initial=0.0))


def _steps(one: Series) -> Array:
    """Steps of the times of a channel [s]; none of a constant, and where they do not increase."""
    steps = np.diff(one.t_s[np.isfinite(one.t_s)]) if not one.constant else np.empty(0)
    return steps if len(steps) > 1 and (steps > 0.0).all() else np.empty(0)


def _phase(full: Mapping[str, Series], start: float, end: float, rate_hz: float) -> float:
    """Start of the new times: a sample of a channel that has the new rate already, which is then not interpolated."""
    for one in full.values():
        after = one.t_s[np.searchsorted(one.t_s, start) :]
        own = even_times(after)
        if len(own) > 1 and abs((own[-1] - own[0]) * rate_hz - (len(own) - 1)) < JITTER and own[0] < end:
            return float(own[0])
    return start


def _shared(where: str, moving: Mapping[str, Series]) -> Array:
    """Common times from zero; refuses channels that have others, or empty cells."""
    first_name, first = next(iter(moving.items()))
    for name, one in moving.items():
        if len(one.t_s) != len(first.t_s) or not np.array_equal(one.t_s, first.t_s):
            raise LogError(
                f"{where}: {first_name} ({_rate(first)}) and {name} ({_rate(one)}) are sampled at other times; "
                "state [resample] rate_hz and method"
            )
        empty = ~np.isfinite(one.values)
        if empty.any():
            raise LogError(
                f"{where}: {name} is empty, NaN or infinite in {int(empty.sum())} of {len(one.values)} rows, the first at "
                f"{one.t_s[empty][0]:g} s; state [resample] to interpolate, or cut a [[manoeuvre]]"
            )
    t = even_times(first.t_s, first.rounding_s)
    return np.asarray(t - t[0])


def even_times(t_s: Array, rounding_s: float = 0.0) -> Array:
    """The even grid behind rounded times; the times themselves where rounding does not explain them.

    Steps and times have to be on the grid: steps that differ by little can add up, as those of a clock that drifts.

    Parameters
    ----------
    t_s : increasing times [s].
    rounding_s : resolution of times in single precision [s]; 0 for others, which may differ by `JITTER` of a step.
    """
    if len(t_s) < 2:
        return t_s
    index = np.arange(len(t_s))
    period = (t_s[-1] - t_s[0]) / (len(t_s) - 1)
    even = t_s[0] + index * period
    if max(np.abs(np.diff(t_s) - period).max(), np.abs(t_s - even).max()) <= JITTER * period:
        return np.asarray(even, dtype=np.float64)
    if 0.0 < rounding_s <= 0.5 * period:
        slope, origin = np.polyfit(index - index.mean(), t_s, 1)
        even = origin + slope * (index - index.mean())
        if np.abs(t_s - even).max() <= SNAP * rounding_s:
            return np.asarray(even, dtype=np.float64)
    return t_s


def resampled(one: Series, t_s: Array, resample: Resample) -> Array:
    """A channel at other times, low-passed first where its own rate is higher than the new one."""
    from scipy.interpolate import CubicSpline

    if resample.method == "previous":
        index = np.searchsorted(one.t_s, t_s + 1e-9 * (one.t_s[1] - one.t_s[0]), side="right") - 1
        return np.asarray(one.values[np.maximum(index, 0)])
    if np.ptp(one.values) == 0.0:
        return np.full(len(t_s), one.values[0])
    own_hz = 1.0 / float(np.median(np.diff(one.t_s)))
    if own_hz > FASTER * resample.rate_hz:
        count = int(np.floor((one.t_s[-1] - one.t_s[0]) * own_hz + 1e-6)) + 1
        grid = one.t_s[0] + np.arange(count) / own_hz
        if len(grid) == len(one.t_s) and np.abs(grid - one.t_s).max() <= JITTER / own_hz:
            values = one.values
        else:
            values = _interpolated(one, grid, resample.method)
        filtered = low_passed(values, own_hz, resample.rate_hz)
        return np.asarray(CubicSpline(grid, filtered)(np.clip(t_s, grid[0], grid[-1])))
    return _interpolated(one, t_s, resample.method)


def low_passed(values: Array, own_hz: float, rate_hz: float) -> Array:
    """Values without what a lower rate would alias, without lag.

    A symmetric FIR filter with a Kaiser window (A. V. Oppenheim and R. W. Schafer, *Discrete-Time Signal Processing*,
    3rd ed., 2010, 7.6.1). Each end is continued by the record mirrored through its end point.

    Parameters
    ----------
    values : (samples,) at a uniform rate.
    own_hz, rate_hz : their rate and the lower one [Hz].
    """
    from scipy.signal import firwin, kaiserord, oaconvolve

    taps, beta = kaiserord(RIPPLE_DB, (0.5 - PASS) * rate_hz / (0.5 * own_hz))
    half = int(taps) // 2
    weights = firwin(2 * half + 1, 0.5 * (0.5 + PASS) * rate_hz, window=("kaiser", beta), fs=own_hz)
    extent = min(half, len(values) - 1)
    before = 2.0 * values[0] - values[extent:0:-1]
    after = 2.0 * values[-1] - values[-2 : -extent - 2 : -1]
    missing = half - extent
    extended = np.pad(np.concatenate([before, values, after]), missing, mode="edge")
    return np.asarray(oaconvolve(extended, weights, mode="valid"))


def _interpolated(one: Series, t_s: Array, method: str) -> Array:
    if method == "linear":
        return np.asarray(np.interp(t_s, one.t_s, one.values))
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(one.t_s, one.values)(t_s))


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
            f"{t[row + 1]:.9g} s; if rows are out of order, sort the file by the time; if the recorder started again there, name "
            "each run's rows by [time] run, or split the file"
        )


def gaps(t_s: Array) -> list[tuple[float, float]]:
    """Start and end of pauses between samples (samples,) that are far longer than the usual step, `GAP` [s]."""
    steps = np.diff(t_s)
    if not len(steps):
        return []
    long = np.flatnonzero(steps > max(GAP[0] * float(np.median(steps)), GAP[1]))
    return [(float(t_s[i]), float(t_s[i + 1])) for i in long]


def _check_gaps(where: str, name: str, one: Series, start: float, end: float) -> None:
    """Refuse to invent samples where a recorder paused."""
    inside = [(low, high) for low, high in gaps(one.t_s) if high > start and low < end]
    if inside:
        low, high = max(inside, key=lambda g: g[1] - g[0])
        raise LogError(
            f"{where}: {name} has {len(inside)} gap{'s' * (len(inside) > 1)}, the longest of {high - low:.3g} s from "
            f"{low:.6g} to {high:.6g} s, which interpolation would invent; cut a [[manoeuvre]] beside it, use "
            '`airtruth import --find-manoeuvres`, or hold the last value with method = "previous"'
        )


def _rate(one: Series) -> str:
    return f"{(len(one.t_s) - 1) / (one.t_s[-1] - one.t_s[0]):.4g} Hz"


__all__ = [
    "MOST_SAMPLES",
    "beyond",
    "even_times",
    "gaps",
    "jitter_of",
    "lost_of",
    "low_passed",
    "resampled",
    "shortened",
    "slower",
    "uniform",
]
