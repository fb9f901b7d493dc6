"""Offset between the clocks of two recorders, from a channel that both hold.

The offset is the maximum of the normalised cross-correlation over all lags that leave an overlap, refined by least
squares on the time shift (W. J. Emery and R. E. Thomson, *Data Analysis Methods in Physical Oceanography*, 3rd ed.,
2014, 5.5). In long records the shift is estimated in windows too, whose slope is the drift of one clock against the
other. Both recorders are taken to sense the channel without delay: a delay of one of them is part of the offset.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.importers.series import Series
from airtruth.importers.uniform import low_passed
from airtruth.physics.motion import LONGITUDINAL

Array = NDArray[np.float64]

PREFERRED: Final = (
    *LONGITUDINAL.gyros,
    LONGITUDINAL.outputs[-1].channel,
    *LONGITUDINAL.surfaces,
    *LONGITUDINAL.commands,
    "theta_rad",
    LONGITUDINAL.vane,
    "ax_m_s2",
    "airspeed_m_s",
    "altitude_m",
)
"""Channels that may align two files, the one with the sharpest changes first."""
FASTEST_HZ: Final = 100.0
"""Highest rate at which records are compared [Hz] (judgement: the motion of an aircraft ends far below half of it)."""
TREND_S: Final = 1.5
"""Standard deviation of the Gaussian mean that is subtracted, so that slow changes do not decide [s] (judgement: a quarter
of a slow short period)."""
CROPPED: Final = (2.0, 0.2)
"""Ends that are left out because this mean reaches beyond them: multiples of `TREND_S`, and most share of the record [-]."""
LEAST_OVERLAP_S: Final = 5.0
"""Shortest overlap that is considered [s] (judgement: a manoeuvre)."""
OVERLAP: Final = 0.5
"""The same as a share of the shorter record [-] (judgement)."""
LEAST_CORRELATION: Final = 0.6
"""Correlation below which two channels are not the same signal [-] (judgement)."""
CLEAR: Final = 12.0
"""Twice the log-likelihood ratio by which the best lag must exceed every other [-]: likelihood ratio of 400."""
WINDOW_S: Final = 60.0
"""Length of the windows for the drift [s] (judgement)."""
FEWEST_WINDOWS: Final = 3
"""Windows with motion below which no drift is estimated [-]."""
MOVING: Final = 0.1
"""Share of the median window's variance below which a window is still [-] (judgement)."""
SIGNIFICANT: Final = 3.0
"""Standard deviations from zero at which a drift is applied [-]."""
STEPS: Final = 12
"""Most steps of the refinement [-]; three suffice within half a period."""


@dataclass(frozen=True)
class Alignment:
    """Clock of a file against that of the first one: t_first = t + offset_s + drift (t - at_s).

    Attributes
    ----------
    offset_s, std_s : offset at ``at_s`` and its standard deviation [s].
    drift, drift_std : relative rate of the clocks and its standard deviation [s/s]; 0 and nan if not estimated.
    at_s : time on the file's own clock at which the offset holds [s].
    channel : channel that both files hold, "" if the offset is declared.
    correlation : of the aligned channel [-]; nan if declared.
    """

    offset_s: float
    std_s: float
    drift: float = 0.0
    drift_std: float = math.nan
    at_s: float = 0.0
    channel: str = ""
    correlation: float = math.nan

    def applied(self, t_s: Array) -> Array:
        """Times on the clock of the first file [s]."""
        return np.asarray(t_s + self.offset_s + self.drift * (t_s - self.at_s))

    def sentence(self, file: str) -> str:
        """The offset with its uncertainty, and its origin."""
        text = f"{file}: its clock is moved by {self.offset_s:+.4f} +- {self.std_s:.4f} s"
        if not self.channel:
            return f"{text} (declared)"
        text += f", from {self.channel} (correlation {self.correlation:.3f})"
        if math.isnan(self.drift_std):
            return text
        used = "applied" if self.drift else "not applied"
        return f"{text}; drift {1e6 * self.drift:+.1f} +- {1e6 * self.drift_std:.1f} ppm, {used}"


def aligned(
    where: str, first: Mapping[str, Series], other: Mapping[str, Series], channel: str | None = None
) -> Alignment:
    """Offset of a file's clock from a channel that it shares with the first file.

    Parameters
    ----------
    where : name of the file in messages.
    first, other : channels of both files.
    channel : the common channel; None takes the first of `PREFERRED` that both hold.

    Raises
    ------
    LogError
        If they share no channel, do not overlap, or the best lag is not clearly the best.
    """
    common = [
        n for n in PREFERRED if n in first and n in other and not (first[n].constant or other[n].constant)
    ]
    if channel is not None:
        if channel not in common:
            raise LogError(
                f"{where}: [align] channel {channel!r} is not in both files; "
                f"common to both: {', '.join(common) or 'none'}"
            )
        common = [channel]
    if not common:
        raise LogError(
            f"{where}: shares no channel with the first file, from which its clock could be aligned; map one in both "
            "(q_rad_s is the best), or state [align] offset_s and std_s"
        )
    return offset_between(where, first[common[0]], other[common[0]], common[0])


def offset_between(where: str, first: Series, other: Series, name: str) -> Alignment:
    """Offset, drift and their standard deviations; raises as `aligned`."""
    rate = min(FASTEST_HZ, max(_rate(first), _rate(other)))
    band = min(_rate(first), _rate(other), FASTEST_HZ)
    (t_a, a), (t_b, b) = (_prepared(one, rate, band) for one in (first, other))
    least = max(LEAST_OVERLAP_S, OVERLAP * min(len(a), len(b)) / rate)
    if min(len(a), len(b)) / rate < LEAST_OVERLAP_S:
        raise LogError(
            f"{where}: {name} lasts {min(len(a), len(b)) / rate:.3g} s in one of the files, too short to align their "
            "clocks; state [align] offset_s and std_s"
        )
    lags, correlation = _correlations(a, b, round(least * rate))
    best = int(np.argmax(correlation))
    peak = float(correlation[best])
    if peak < LEAST_CORRELATION:
        raise LogError(
            f"{where}: {name} correlates with that of the first file by at most {peak:.2f}, so that it is not the same "
            "signal or not the same flight; state [align] channel, or offset_s and std_s"
        )
    start = t_a[0] - t_b[0] + lags[best] / rate
    shift, gain, residual = _refined(t_a, a, t_b, b, start)
    effective = len(residual) / _correlation_length(residual)
    rival = _rival(correlation, best)
    evidence = effective * math.log((1.0 - rival**2) / max(1.0 - peak**2, 1e-12))
    if evidence < CLEAR:
        raise LogError(
            f"{where}: {name} fits the first file at two offsets almost as well (correlations {peak:.3f} and {rival:.3f}), "
            "as in a periodic manoeuvre; state [align] offset_s and std_s"
        )
    inside = (t_b + shift >= t_a[0]) & (t_b + shift <= t_a[-1])
    std = _shift_std(t_a, a, t_b[inside], shift, gain, residual, rate)
    at = float(t_b[inside].mean())
    drift, drift_std, moved = _drift(t_a, a, t_b[inside], b[inside], shift, rate)
    if math.isfinite(drift_std) and abs(drift) > SIGNIFICANT * drift_std:
        return Alignment(moved[0], moved[1], drift, drift_std, at, name, peak)
    return Alignment(shift, std, 0.0, drift_std, at, name, peak)


def _rate(one: Series) -> float:
    return 1.0 / float(np.median(np.diff(one.t_s)))


def _prepared(one: Series, rate_hz: float, band_hz: float) -> tuple[Array, Array]:
    """Uniform times and values in a common band, without trend, scaled to unit variance."""
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import gaussian_filter1d

    ok = np.isfinite(one.t_s) & np.isfinite(one.values)
    t, x = one.t_s[ok], one.values[ok]
    own = 1.0 / float(np.median(np.diff(t)))
    grid = t[0] + np.arange(int((t[-1] - t[0]) * own) + 1) / own
    x = np.interp(grid, t, x)
    if own > band_hz:
        x = low_passed(x, own, band_hz)
    new = grid[0] + np.arange(int((grid[-1] - grid[0]) * rate_hz) + 1) / rate_hz
    y = CubicSpline(grid, x)(new)
    y = y - gaussian_filter1d(y, TREND_S * rate_hz, mode="nearest")
    end = round(min(CROPPED[0] * TREND_S * rate_hz, CROPPED[1] * len(y)))
    y = y[end : len(y) - end]
    return new[end : len(new) - end], np.asarray(y / max(float(y.std()), 1e-300))


def _correlations(a: Array, b: Array, least: int) -> tuple[NDArray[np.int64], Array]:
    """Correlation of a(t + lag) and b(t) over their overlap, for every lag with at least so many samples."""
    from scipy.signal import fftconvolve

    product = fftconvolve(a, b[::-1])
    lags = np.arange(-(len(b) - 1), len(a))
    first, last = np.maximum(lags, 0), np.minimum(lags + len(b), len(a))
    power_a = np.concatenate([[0.0], np.cumsum(a**2)])
    power_b = np.concatenate([[0.0], np.cumsum(b**2)])
    energy = (power_a[last] - power_a[first]) * (power_b[last - lags] - power_b[first - lags])
    enough = last - first >= least
    floor = 1e-3 * float(energy.max())
    value = np.where(enough & (energy > floor), product / np.sqrt(np.maximum(energy, floor)), -1.0)
    return lags, np.asarray(np.clip(value, -1.0, 1.0))


def _rival(correlation: Array, best: int) -> float:
    """Largest correlation outside the lobe of the best lag."""
    low = best
    while low > 0 and correlation[low - 1] > 0.0:
        low -= 1
    high = best
    while high < len(correlation) - 1 and correlation[high + 1] > 0.0:
        high += 1
    outside = np.concatenate([correlation[:low], correlation[high + 1 :]])
    return float(max(outside.max(initial=0.0), 0.0))


def _refined(t_a: Array, a: Array, t_b: Array, b: Array, start: float) -> tuple[float, float, Array]:
    """Shift, gain and residual of b(t) = gain a(t + shift) + constant, by Gauss-Newton."""
    from scipy.interpolate import CubicSpline

    curve = CubicSpline(t_a, a)
    slope = curve.derivative()
    shift, gain, residual = start, 1.0, b
    for _ in range(STEPS):
        inside = (t_b + shift >= t_a[0]) & (t_b + shift <= t_a[-1])
        t = t_b[inside] + shift
        model = np.column_stack([curve(t), np.ones(len(t)), slope(t)])
        (gain, constant, step), *_ = np.linalg.lstsq(model, b[inside], rcond=None)
        residual = b[inside] - model[:, :2] @ np.array([gain, constant])
        change = step / gain if gain else 0.0
        shift += float(np.clip(change, -0.2, 0.2))
        if abs(change) < 1e-7:
            break
    return shift, float(gain), residual


def _correlation_length(residual: Array) -> float:
    """Samples that count as one: the sum of the autocorrelation up to its first zero."""
    x = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
    own = np.fft.irfft(spectrum)[: len(x)]
    if own[0] <= 0.0:
        return 1.0
    own = own / own[0]
    end = int(np.argmax(own <= 0.0)) or len(own)
    return float(max(1.0, 1.0 + 2.0 * own[1:end].sum()))


def _shift_std(
    t_a: Array, a: Array, t_b: Array, shift: float, gain: float, residual: Array, rate: float
) -> float:
    """Standard deviation of a shift for residuals of any colour (Newey and West, *Econometrica* 55(3), 1987)."""
    from scipy.interpolate import CubicSpline

    slope = gain * CubicSpline(t_a, a).derivative()(t_b + shift)
    count = min(len(slope), len(residual))
    u = slope[:count] * residual[:count]
    u = u - u.mean()
    reach = min(count // 4, max(1, round(2.0 * _correlation_length(residual))))
    long_run = float(u @ u)
    for lag in range(1, reach + 1):
        long_run += 2.0 * (1.0 - lag / (reach + 1.0)) * float(u[lag:] @ u[:-lag])
    return math.sqrt(max(long_run, 0.0)) / float(slope @ slope) if slope.any() else math.inf


def _drift(
    t_a: Array, a: Array, t_b: Array, b: Array, shift: float, rate: float
) -> tuple[float, float, tuple[float, float]]:
    """Drift, its standard deviation, and offset with standard deviation at the middle; nan for short records."""
    none = 0.0, math.nan, (shift, math.nan)
    size = round(WINDOW_S * rate)
    starts = range(0, len(b) - size + 1, size)
    if len(starts) < FEWEST_WINDOWS:
        return none
    power = np.array([b[s : s + size].var() for s in starts])
    rows = []
    for s, p in zip(starts, power, strict=True):
        if p < MOVING * np.median(power):
            continue
        t, x = t_b[s : s + size], b[s : s + size]
        local, gain, residual = _refined(t_a, a, t, x, shift)
        std = _shift_std(t_a, a, t, local, gain, residual, rate)
        if abs(local - shift) < 0.5 and 0.0 < std < 0.1:
            rows.append((float(t.mean()), local, std))
    if len(rows) < FEWEST_WINDOWS:
        return none
    times, shifts, stds = (np.array(column) for column in zip(*rows, strict=True))
    weight = 1.0 / stds**2
    middle = float(t_b.mean())
    model = np.column_stack([np.ones(len(times)), times - middle])
    information = model.T @ (weight[:, None] * model)
    covariance = np.linalg.inv(information)
    offset, slope = covariance @ model.T @ (weight * shifts)
    rest = shifts - model @ np.array([offset, slope])
    birge = max(1.0, float(weight @ rest**2) / max(len(times) - 2, 1))
    stds_of = np.sqrt(birge * np.diag(covariance))
    return float(slope), float(stds_of[1]), (float(offset), float(stds_of[0]))


__all__ = ["PREFERRED", "Alignment", "aligned", "offset_between"]
