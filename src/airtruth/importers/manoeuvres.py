"""Manoeuvres in a long record: where the elevator moves deliberately, from a trimmed state, and the aircraft responds.

The elevator's deviation from its running median marks the inputs. A background level, below which three quarters of a
flight usually lie, and the largest inputs set the threshold, so that neither units nor the size of the aircraft matter.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.means import LIMITS, MEANS
from airtruth.checks.pitch_motions import smoothing
from airtruth.documents import read_plain
from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.importers.free_response import free_spans
from airtruth.importers.manoeuvre_result import FREE, INPUT, CandidateManoeuvre, ManoeuvreResult
from airtruth.importers.mapping import ManoeuvreSpan, Resample
from airtruth.importers.series import Series
from airtruth.importers.uniform import gaps, resampled
from airtruth.numerics.prefilter import edge_samples
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

RATE_HZ: Final = 20.0
"""Rate of the search [Hz] (judgement: pilots and test inputs have no content above 5 Hz)."""
TREND_S: Final = 20.0
"""Length of the running median that is the trimmed elevator [s] (judgement: twice the longest 3-2-1-1)."""
REACH_S: Final = 1.0
"""Time over which the largest deviation counts [s] (judgement: the dwell within a doublet is shorter)."""
BACKGROUND: Final = (25.0, 4.0)
"""Percentile of the deviation that is the background, and its multiple that an input exceeds [%, -] (judgement)."""
SHARE: Final = (99.5, 0.1)
"""Percentile of the deviation that is a large input, and its share that an input exceeds [%, -] (judgement)."""
LEAST_RAD: Final = 0.1 * DEG
"""Deviation of the elevator below which nothing is an input [rad] (judgement: play and noise)."""
GAP_S: Final = 2.5
"""Pause within a manoeuvre [s] (judgement: the longest step of a 3-2-1-1 of 0.8 s)."""
TRIM_S: Final = 2.0
"""Time before the input that belongs to the manoeuvre [s] (judgement: the trim of a record is estimated from it)."""
SETTLE_S: Final = (3.0, 8.0)
"""Shortest and longest time after the input that belongs to the manoeuvre [s] (judgement: one to four short periods)."""
QUIET: Final = 2.0
"""Multiple of the background of q at which the response has ended [-] (judgement)."""
LONGEST_S: Final = 60.0
"""Input beyond which it is piloting and no manoeuvre [s] (judgement: a slow frequency sweep)."""
EXCITED: Final = 3.0
"""Least ratio of the response of q to its background [-] (judgement: 10 dB)."""
TRIMMED: Final = 0.3
"""Largest share of the elevator's range that lies in the time before the input [-] (judgement)."""
SPEED_CHANGE: Final = 0.15
"""Largest relative change of airspeed [-] (judgement: the dynamic pressure changes by a third)."""
TURNING: Final = 1.15
"""Mean load factor above which the aircraft turns [-]: a bank of 30 deg."""


FLYING_M_S: Final = MEANS["airspeed_m_s"][0]
"""Mean airspeed below which an aircraft is on the ground [m/s]: no log of a flight has less."""
_SURFACE, _RATE = LONGITUDINAL.controls[0].channel, LONGITUDINAL.controls[0].damped
_NORMAL = LONGITUDINAL.outputs[-1].channel
DEFLECTED_RAD: Final = LIMITS[_SURFACE][1]
"""Deflection beyond which a column holds no elevator [rad]: no log of a flight has more."""
LENGTHS: Final = 4
"""Least length of a record over the extension of the low-pass of `airtruth check`, the longest of all commands [-], as `check`
and `identify` demand it."""


def find(where: str, series: Mapping[str, Series], rate_hz: float | None = None) -> ManoeuvreResult:
    """Search a flight for manoeuvres.

    A manoeuvre is an input of the elevator, or a free response with the elevator at rest. It is accepted if it was flown, its
    surface is possible, and it is long enough for every command.

    Parameters
    ----------
    where : name of the file in messages.
    series : elevator_rad and q_rad_s, and airspeed_m_s and az_m_s2 where they are measured.
    rate_hz : rate to which the import resamples [Hz]; None for that of q_rad_s.

    Raises
    ------
    LogError
        If elevator or q is missing, or the record is shorter than a manoeuvre.
    """
    needed = (_SURFACE, _RATE)
    missing = [n for n in needed if n not in series or series[n].constant]
    if missing:
        raise LogError(f"{where}: the search for manoeuvres needs {', '.join(missing)}; map a column")
    used = {n: _clean(series[n]) for n in (*needed, "airspeed_m_s", _NORMAL) if n in series}
    used = {n: one for n, one in used.items() if len(one.t_s) > 3}
    start, end = max(one.t_s[0] for one in used.values()), min(one.t_s[-1] for one in used.values())
    count = int((end - start) * RATE_HZ) + 1
    if not set(needed) <= used.keys() or count < (TRIM_S + SETTLE_S[0]) * RATE_HZ:
        raise LogError(f"{where}: lasts {max(end - start, 0.0):.3g} s, which is shorter than a manoeuvre")
    t = start + np.arange(count) / RATE_HZ
    how = Resample(rate_hz=RATE_HZ, method="linear")
    c = {name: resampled(one, t, how) for name, one in used.items()}
    deviation, threshold = _deviation(c[_SURFACE])
    background = _background(c[_RATE])
    spans = [(first, last, INPUT) for first, last in _spans(deviation, threshold)]
    spans += _free(c[_RATE], spans, background)
    spans.sort()
    least_s = shortest_s(rate_hz or 1.0 / float(np.median(np.diff(used[_RATE].t_s))))
    candidates = []
    for number, (first, last, kind) in enumerate(spans):
        before = spans[number - 1][1] if number else 0
        after = spans[number + 1][0] if number + 1 < len(spans) else count - 1
        low = max(first - round(TRIM_S * RATE_HZ), before)
        high = _settled(c[_RATE], last, min(after, count - 1), background)
        high = min(max(high, low + math.ceil(least_s * RATE_HZ) + 1), after, count - 1)
        at = (low, first, last, high)
        one = _candidate(f"m{number + 1:02d}", kind, c, deviation, at, background, t, least_s)
        candidates.append(_without_gaps(one, used))
    return ManoeuvreResult(tuple(candidates), t, c[_SURFACE], c[_RATE], threshold)


def shortest_s(rate_hz: float) -> float:
    """Length of the shortest record that `check` and `identify` accept at a sample rate [s].

    Parameters
    ----------
    rate_hz : sample rate [Hz].
    """
    return LENGTHS * edge_samples(smoothing(1.0 / rate_hz)) / rate_hz


def _without_gaps(candidate: CandidateManoeuvre, used: Mapping[str, Series]) -> CandidateManoeuvre:
    """The candidate, not accepted where a recorder paused within it."""
    for name, one in used.items():
        for low, high in gaps(one.t_s):
            if high > candidate.start_s and low < candidate.end_s:
                reason = f"{name} has a gap of {high - low:.3g} s"
                text = f"{candidate.reason}; {reason}" if candidate.reason else reason
                return replace(candidate, accept="no", reason=text)
    return candidate


def _clean(one: Series) -> Series:
    if one.constant:
        return Series(np.empty(0), np.empty(0))
    ok = np.isfinite(one.t_s) & np.isfinite(one.values)
    keep = np.concatenate([[True], np.diff(one.t_s[ok]) > 0.0]) if ok.any() else np.zeros(0, dtype=np.bool_)
    return Series(one.t_s[ok][keep], one.values[ok][keep])


def _deviation(elevator: Array) -> tuple[Array, float]:
    """Deviation of the elevator from its running median, and the threshold of an input [rad]."""
    from scipy.ndimage import maximum_filter1d, median_filter

    size = min(2 * round(0.5 * TREND_S * RATE_HZ) + 1, 2 * (len(elevator) // 2) - 1)
    deviation = elevator - median_filter(elevator, size, mode="nearest")
    reach = maximum_filter1d(np.abs(deviation), max(1, round(REACH_S * RATE_HZ)))
    quiet, large = np.percentile(reach, [BACKGROUND[0], SHARE[0]])
    return np.asarray(deviation), float(max(BACKGROUND[1] * quiet, SHARE[1] * large, LEAST_RAD))


def _background(q: Array) -> float:
    """Root mean square of q, without its slow part, in the quiet quarter of windows of one second."""
    size = round(RATE_HZ)
    windows = q[: len(q) // size * size].reshape(-1, size)
    return float(np.percentile(windows.std(axis=1), BACKGROUND[0]))


def _spans(deviation: Array, threshold: float) -> list[tuple[int, int]]:
    """First and last sample of each input; inputs with a short pause between are one."""
    over = np.flatnonzero(np.abs(deviation) > threshold)
    if not len(over):
        return []
    cuts = np.flatnonzero(np.diff(over) > GAP_S * RATE_HZ)
    firsts = over[np.concatenate([[0], cuts + 1])]
    lasts = over[np.concatenate([cuts, [len(over) - 1]])]
    return [(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True)]


def _free(q: Array, spans: Sequence[tuple[int, int, str]], background: float) -> list[tuple[int, int, str]]:
    """Free responses outside the inputs, and the responses to them."""
    from scipy.ndimage import median_filter

    busy = np.zeros(len(q), dtype=np.bool_)
    for first, last, _ in spans:
        busy[first : last + round(SETTLE_S[1] * RATE_HZ)] = True
    size = min(2 * round(0.5 * TREND_S * RATE_HZ) + 1, 2 * (len(q) // 2) - 1)
    quick = q - median_filter(q, size, mode="nearest")
    found = free_spans(quick, busy, EXCITED * background, round(REACH_S * RATE_HZ), 1.0 / RATE_HZ)
    return [(first, last, FREE) for first, last in found]


def _settled(q: Array, last: int, limit: int, background: float) -> int:
    """Sample at which the response has ended, between the shortest and the longest time after the input."""
    least, most = (last + round(s * RATE_HZ) for s in SETTLE_S)
    size = round(RATE_HZ)
    for at in range(least, min(most, limit)):
        if q[max(at - size, last) : at].std() < QUIET * background:
            return min(at, limit)
    return min(most, limit)


def _candidate(
    run_id: str,
    kind: str,
    c: Mapping[str, Array],
    deviation: Array,
    at: tuple[int, int, int, int],
    background: float,
    t: Array,
    least_s: float,
) -> CandidateManoeuvre:
    """Measures of one candidate: start, first and last sample of the input, and end."""
    low, first, last, high = at
    part = slice(low, high + 1)
    elevator = c[_SURFACE]
    size = float(np.ptp(elevator[first : last + 1])) or float(np.ptp(elevator[part]))
    quiet = elevator[low : max(first - round(0.2 * RATE_HZ), low + 1)]
    trim = float(np.ptp(quiet)) / size if size > 0.0 else np.inf
    response = float(c[_RATE][first : high + 1].std()) / max(background, 1e-9)
    speed = c["airspeed_m_s"][part] if "airspeed_m_s" in c else np.array([np.nan])
    change = (
        float(np.ptp(speed)) / max(abs(float(speed.mean())), 1e-9) if np.isfinite(speed).all() else np.nan
    )
    load = float(np.median(c[_NORMAL][part])) / -G0 if _NORMAL in c else np.nan
    reasons = []
    if speed.mean() < FLYING_M_S:
        reasons.append(f"on the ground: airspeed of {speed.mean():.1f} m/s")
    deflected = float(np.abs(elevator[part]).max())
    if deflected > DEFLECTED_RAD:
        reasons.append(
            f"elevator of {deflected / DEG:.0f} deg, beyond {DEFLECTED_RAD / DEG:.0f} deg: another unit or column"
        )
    if (high - low) / RATE_HZ < least_s:
        reasons.append(
            f"lasts {(high - low) / RATE_HZ:.1f} s, check and identify need {least_s:.1f} s at this rate"
        )
    if kind == INPUT and (last - first) / RATE_HZ > LONGEST_S:
        reasons.append(f"input of {(last - first) / RATE_HZ:.0f} s, longer than a manoeuvre")
    if response < EXCITED:
        reasons.append(f"q moves {response:.1f} times its background")
    if kind == INPUT and first - low < 0.5 * TRIM_S * RATE_HZ:
        reasons.append("no trim before the input")
    elif kind == INPUT and trim > TRIMMED:
        reasons.append(f"the elevator moves by {100 * trim:.0f} % of the input before it")
    if change > SPEED_CHANGE:
        reasons.append(f"airspeed changes by {100 * change:.0f} %")
    if load > TURNING:
        reasons.append(f"mean load factor of {load:.2f}: a turn or a pull-up")
    energy = float((deviation[first : last + 1] ** 2).sum()) / RATE_HZ / DEG**2
    return CandidateManoeuvre(
        run_id=run_id,
        accept="no" if reasons else "yes",
        start_s=float(t[low]),
        end_s=float(t[high]),
        input_deg=size / DEG,
        energy_deg2_s=energy,
        excitation=response,
        trim_range=trim,
        airspeed_m_s=float(speed.mean()),
        airspeed_change=change,
        load_factor=load,
        reason="; ".join(reasons),
        kind=kind,
    )


def read_table(path: Path | str) -> tuple[ManoeuvreSpan, ...]:
    """Accepted manoeuvres of a table, as written by `ManoeuvreResult.table` or by hand.

    Columns start_s and end_s are needed; run_id is numbered where it is missing, and rows with accept = no are left out.

    Raises
    ------
    StoreError
        If the file cannot be read.
    ConfigurationError
        Naming the line, if a time is no number, an end is not after its start, or no row is accepted.
    """
    path = Path(path)
    rows = list(
        csv.DictReader(
            io.StringIO(read_plain(path, StoreError, "`airtruth import --find-manoeuvres` writes one"))
        )
    )
    if not rows or not {"start_s", "end_s"} <= set(rows[0]):
        raise ConfigurationError(f"{path}: needs the columns start_s and end_s and a row for each manoeuvre")
    result: list[ManoeuvreSpan] = []
    for line, row in enumerate(rows, start=2):
        accept = (row.get("accept") or "yes").strip().lower()
        if accept not in ("yes", "no"):
            raise ConfigurationError(f"{path}, line {line}: accept is {accept!r}; write yes or no")
        if accept == "no":
            continue
        try:
            start, end = float(row["start_s"] or ""), float(row["end_s"] or "")
        except ValueError:
            raise ConfigurationError(
                f"{path}, line {line}: start_s {row['start_s']!r} and end_s {row['end_s']!r} must be numbers [s]"
            ) from None
        if not (math.isfinite(start) and math.isfinite(end)):
            raise ConfigurationError(
                f"{path}, line {line}: start_s {start:g} and end_s {end:g} must be finite [s]"
            )
        if not end > start:
            raise ConfigurationError(f"{path}, line {line}: end_s {end:g} is not after start_s {start:g}")
        name = (row.get("run_id") or "").strip() or f"m{line - 1:02d}"
        result.append(ManoeuvreSpan(run_id=name, start_s=start, end_s=end))
    if not result:
        raise ConfigurationError(f"{path}: accepts no manoeuvre; write yes under accept in a row")
    names = [one.run_id for one in result]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise ConfigurationError(f"{path}: run_id {', '.join(map(repr, twice))} is given twice; rename one")
    return tuple(result)


__all__ = ["find", "read_table", "shortest_s"]
