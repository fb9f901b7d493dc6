"""Records as instruments without the declared errors, at the centre of gravity, would have made them.

aircraft.toml declares scale, lag, delay and position of each instrument (`airtruth.physics.sensor_errors`). They are taken
out of the channels that the estimators read, in the reverse of the order in which a reading has them: scale, delay, lag,
position, slope over alpha. Biases remain: a free constant of each equation takes those of alpha, q, az and elevator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import LogError
from airtruth.identification.condition import AircraftConstants
from airtruth.identification.options import CUTOFF_SHARE
from airtruth.logs.flight_log import Batch
from airtruth.numerics.prefilter import butterworth, edge_samples, zero_phase
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.reconstruction import is_reconstructed
from airtruth.physics.sensor_errors import SensorErrors

Array = NDArray[np.float64]
Taken = Mapping[str, Mapping[str, float]]
"""Errors that are taken out: channel -> field of `SensorErrors` -> value [SI]."""

CHANNELS: Final[Mapping[str, tuple[str, ...]]] = {
    motion.name: ("airspeed_m_s", *motion.channels) for motion in (LONGITUDINAL, LATERAL)
}
"""Channels that the estimators of a motion read and an instrument measures."""
CUTOFF_HZ: Final = 12.5
"""Cutoff of the low-pass before a rate is taken, or the share `CUTOFF_SHARE` of a lower sample rate [Hz] (judgement: with
an accelerometer 0.3 m ahead in the GTM, CLde of filter-error errs by 10 % with 5 Hz, which takes the steps of the elevator
out of q', by 2 % with 12.5 Hz, and its scatter grows with 18 Hz)."""
ORDER: Final = 4
"""Order of one pass of that low-pass [-]; that of the estimators."""
_WORDS: Final = {
    "scale": "scale {0:.6g}",
    "lag_s": "lag {0:.6g} s",
    "delay_s": "delay {0:.6g} s",
    "x_m": "{0:.6g} m ahead of the CG",
    "z_m": "{0:.6g} m below the CG",
    "alpha_slope_per_rad": "{0:.6g} per rad of alpha",
}
"""Errors that are taken out, by the field of `SensorErrors`, in words."""
_PLACED: Final = {
    y.channel: ("x_m", "z_m") if y.channel != LONGITUDINAL.vane else ("x_m",)
    for y in (*LONGITUDINAL.outputs, *LATERAL.outputs)
    if y.instrument in ("vane", "accelerometer")
}
"""Channels that depend on the position of their instrument, and on which part of it."""
_WHOLE: Final = 1e-6
"""Part of a sample by which a delay may differ from whole samples [-] (rounding of decimal figures)."""


def taken_out(constants: AircraftConstants, motion: Motion = LONGITUDINAL) -> dict[str, dict[str, float]]:
    """Errors that are taken out: channel -> field of `SensorErrors` -> value [SI]; {} for an object without sensors."""
    if not isinstance(constants, Aircraft):
        return {}
    sensors = constants.file.sensors
    stated = {name: sensors[name] for name in CHANNELS[motion.name] if name in sensors}
    found = {name: _effective(name, sensor.errors()) for name, sensor in stated.items()}
    return {name: errors for name, errors in found.items() if errors}


def declared_words(taken: Taken) -> list[str]:
    """One sentence on the errors that are taken out of records; none where there are none."""
    parts = [
        f"{name} ({', '.join(_WORDS[key].format(value) for key, value in errors.items())})"
        for name, errors in taken.items()
    ]
    if not parts:
        return []
    return [f"errors that the aircraft declares for its instruments are taken out of {', '.join(parts)}"]


def as_ideal(batch: Batch, taken: Taken) -> Batch:
    """Return the runs without the declared errors of their instruments, up to the longest delay shorter.

    Delays are undone between samples by a cubic that keeps their order. Lags and the arm of the accelerometer need a rate,
    that of the channel behind a low-pass. A reconstructed alpha had no vane, and stays.

    Parameters
    ----------
    batch : runs (runs, samples) as measured.
    taken : errors from `taken_out`; without any the runs are returned as they are.

    Raises
    ------
    LogError
        If a delay is longer than the record.
    """
    errors = {name: SensorErrors(**own) for name, own in taken.items() if name in batch.channels}
    if is_reconstructed(batch.channels):
        errors.pop(LONGITUDINAL.vane, None)
    if not errors:
        return batch
    samples = batch.t_s.shape[1]
    kept = samples - max(_steps(own, batch.dt_s) for own in errors.values())
    sos = butterworth(min(CUTOFF_HZ, CUTOFF_SHARE / batch.dt_s), ORDER, batch.dt_s)
    if kept <= edge_samples(sos):
        longest = max(errors, key=lambda name: errors[name].delay_s)
        raise LogError(
            f"{longest}: the aircraft declares a delay of {errors[longest].delay_s:g} s, and the records last "
            f"{(samples - 1) * batch.dt_s:.3g} s; correct [sensors.{longest}] delay"
        )
    channels = dict(batch.channels)
    for name, own in errors.items():
        advanced = _advanced(own.unscaled(channels[name]), own.delay_s / batch.dt_s)[:, :kept]
        if own.lag_s > 0.0:
            advanced = advanced + own.lag_s * _rate(advanced, sos, batch.dt_s)
        channels[name] = advanced
    channels = {name: np.ascontiguousarray(values[:, :kept]) for name, values in channels.items()}
    for name, own in errors.items():
        if name in _PLACED:
            rate = partial(_rate, sos=sos, dt_s=batch.dt_s)
            channels[name] = channels[name] + moved_to_cg(name, own, channels, rate)
    if "airspeed_m_s" in errors and LONGITUDINAL.vane in channels:
        factor = errors["airspeed_m_s"].slope(channels[LONGITUDINAL.vane])
        channels["airspeed_m_s"] = channels["airspeed_m_s"] / factor
    return replace(batch, t_s=batch.t_s[:, :kept], channels=channels)


def _effective(name: str, own: SensorErrors) -> dict[str, float]:
    """The errors of a channel that are taken out, where they have an effect."""
    neutral = SensorErrors()
    return {
        key: getattr(own, key)
        for key in _WORDS
        if getattr(own, key) != getattr(neutral, key) and (key[1:] != "_m" or key in _PLACED.get(name, ()))
    }


def _steps(own: SensorErrors, dt_s: float) -> int:
    """Samples at the end of a record that a delay leaves without a value."""
    return math.ceil(own.delay_s / dt_s - _WHOLE)


def _advanced(x: Array, samples: float) -> Array:
    """(runs, samples) series so many samples earlier; the end, which no sample shows, holds the last value."""
    if samples == 0.0:
        return x
    from scipy.interpolate import PchipInterpolator

    at = np.arange(x.shape[1], dtype=np.float64)
    return np.asarray(PchipInterpolator(at, x, axis=1)(np.minimum(at + samples, at[-1])))


def _rate(x: Array, sos: Array, dt_s: float) -> Array:
    """(runs, samples) rate of a low-passed series: that of the cubic through its samples [unit/s]."""
    from scipy.interpolate import CubicSpline

    at = dt_s * np.arange(x.shape[1])
    return np.asarray(CubicSpline(at, zero_phase(x, sos), axis=1)(at, 1))


def moved_to_cg(
    name: str, own: SensorErrors, channels: Mapping[str, Array], rate: Callable[[Array], Array]
) -> Array:
    """Value at the CG less the reading, the inverse of `airtruth.physics.sensors.at_instrument`.

    Sideslip and side force: beta_vane = beta + x r/V - z p/V, ay = ay_cg + x r' - z p'; the products of rates with pitch
    rate and bank, a hundredth of these, are left out.

    Parameters
    ----------
    name : column of a vane or an accelerometer; own : its position.
    channels : column -> (runs, samples) of one length.
    rate : derivative of a measured rate [rad/s2].
    """
    x, y, z, speed = own.x_m, own.y_m, own.z_m, channels["airspeed_m_s"]
    if name in LATERAL.output_channels:
        p, r = (channels[gyro] for gyro in LATERAL.gyros)
        return np.asarray((z * p - x * r) / speed if name == LATERAL.vane else z * rate(p) - x * rate(r))
    q = channels[LONGITUDINAL.gyros[0]]
    if name == LONGITUDINAL.vane:
        moved = q * x / speed
        return np.asarray(moved - channels[LATERAL.gyros[0]] * y / speed if y else moved)
    return np.asarray(x * rate(q) + z * np.square(q))


__all__ = ["CHANNELS", "Taken", "as_ideal", "declared_words", "moved_to_cg", "taken_out"]
