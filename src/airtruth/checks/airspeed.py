"""Airspeed as an input of a model, without the noise of its sensor; and the speed over ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK
from airtruth.numerics.local_level import smoothed, walk_to_noise
from airtruth.numerics.prefilter import butterworth, edge_samples, zero_phase
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.sensors import ACCELEROMETERS
from airtruth.units import G0

Array = NDArray[np.float64]

_CUTOFF_HZ: Final = 5.0
"""Least cutoff of the low-pass of airspeed and density [Hz] (judgement): above the phugoid, below the noise of the
sensors."""
_NEGLIGIBLE: Final = 3e-3
"""Standard deviation of the noise that a low-pass leaves in the airspeed, over the airspeed, up to which it is no disturbance [-]
(judgement: 0.006 of the lift, 0.06 m/s2 in level flight, as the noise of accelerometers; and in strong gusts the estimate of the
noise scatters by up to 0.0025 in the records of 6 s of data/undeclared)."""
_GROUND_SLOPE_M_S2: Final = 0.3
"""Largest error of the acceleration along the path that a longitudinal accelerometer leaves [m/s2] (judgement: a bias of
0.02 g and an error in attitude of half a degree). A steeper trend of the airspeed is one of the wind."""


def low_passed(x: Array, dt_s: float, cutoff_hz: float = _CUTOFF_HZ) -> Array:
    """Samples without what is above a cutoff [Hz], without lag; as they are where the log is too slow or short for it."""
    x = np.asarray(x, dtype=np.float64)
    if 0.45 / dt_s <= cutoff_hz or len(x) < 40:
        return x
    sos = butterworth(cutoff_hz, 2, dt_s)
    return zero_phase(x[None], sos)[0] if len(x) > edge_samples(sos) else x


def gust_cutoff_hz(airspeed_m_s: Array, dt_s: float) -> float:
    """Frequency at which white noise of the airspeed exceeds its gusts [Hz], `_CUTOFF_HZ` at least; infinite without noise.

    In short times a gust along the path is a random walk. Differences of a walk of variance q per sample in white noise of
    variance r have the variance q + 2 r and the covariance -r from one to the next. The spectra q/(w dt)^2 and r meet at
    w = sqrt(q/r)/dt, the corner of the optimal smoother.

    Parameters
    ----------
    airspeed_m_s : (samples,); dt_s : sample period [s].

    Source: J. F. Muth, J. Amer. Statist. Assoc. 55 (1960) 299-306, for the random walk in noise.
    """
    return float(_cutoff_hz(*_variances(airspeed_m_s), dt_s))


def _cutoff_hz(noise: Array, walk: Array, dt_s: float) -> Array:
    """`gust_cutoff_hz` (...,) from the variances."""
    ratio = np.divide(walk, noise, out=np.full(np.shape(noise), np.inf), where=noise > 0.0)
    return np.asarray(np.maximum(_CUTOFF_HZ, np.sqrt(ratio) / (2.0 * np.pi * dt_s)))


def _variances(airspeed_m_s: Array) -> tuple[Array, Array]:
    """Variances of the noise and of the steps of the walk [m2/s2] (...,), by moments; zero noise where none shows."""
    change = np.diff(np.asarray(airspeed_m_s, dtype=np.float64))
    if change.shape[-1] < 2:
        return np.zeros(change.shape[:-1]), np.zeros(change.shape[:-1])
    count = change.shape[-1]
    total = change.sum(axis=-1)
    mean, ends = total / count, change[..., 0] + change[..., -1]
    follows = np.einsum("...i,...i->...", change[..., 1:], change[..., :-1])
    covariance = (follows - mean * (2.0 * total - ends)) / (count - 1) + mean**2
    noise = np.maximum(-covariance, 0.0)
    variance = np.einsum("...i,...i->...", change, change) / count - mean**2
    return noise, np.maximum(variance - 2.0 * noise, 0.0)


def is_noisy(airspeed_m_s: Array, dt_s: float, negligible: float = _NEGLIGIBLE) -> NDArray[np.bool_]:
    """Whether a low-pass at `gust_cutoff_hz` leaves noise of more than a share of the mean.

    Parameters
    ----------
    airspeed_m_s : (..., samples); dt_s : sample period [s].
    negligible : the share [-].
    """
    airspeed = np.asarray(airspeed_m_s, dtype=np.float64)
    noise, walk = _variances(airspeed)
    share = np.minimum(1.0, 2.0 * dt_s * _cutoff_hz(noise, walk, dt_s))
    return np.asarray(np.sqrt(noise * share) > negligible * airspeed.mean(axis=-1))


class WalkInNoise(NamedTuple):
    """Statistics of an airspeed that is the most probable random walk beside the speed over ground.

    noise_m2_s2 : variance of the noise of the sensor [m2/s2]; ratio : variance of a step of the walk over it [-].
    """

    noise_m2_s2: float
    ratio: float


class QuietAirspeed(NamedTuple):
    """Airspeed without the noise of its sensor (samples,) [m/s]; the walk that it was taken for, None behind a low-pass."""

    speed_m_s: Array
    walk: WalkInNoise | None


def without_noise(
    airspeed_m_s: Array,
    ground_m_s: Array,
    dt_s: float,
    ground_walk_m2_s2: float = 0.0,
    negligible: float = _NEGLIGIBLE,
) -> QuietAirspeed:
    """Airspeed without the noise of its sensor.

    A low-pass at `gust_cutoff_hz` is enough for most sensors. If it leaves more than a negligible share, which changes the forces
    as a gust does, the result is the speed over ground and the most probable random walk of what the airspeed has beside it.

    Parameters
    ----------
    airspeed_m_s, ground_m_s : (samples,), the second as of `ground_speed`.
    dt_s : sample period [s].
    ground_walk_m2_s2 : variance that the error of the speed over ground gains from one sample to the next, as of `ground_walk`;
        the walk has at least that of it.
    negligible : as of `is_noisy`.
    """
    airspeed = np.asarray(airspeed_m_s, dtype=np.float64)
    if not is_noisy(airspeed, dt_s, negligible):
        return QuietAirspeed(low_passed(airspeed, dt_s, gust_cutoff_hz(airspeed, dt_s)), None)
    noise = float(_variances(airspeed)[0])
    gust = airspeed - ground_m_s
    ratio = max(walk_to_noise(gust), ground_walk_m2_s2 / noise)
    return QuietAirspeed(np.asarray(ground_m_s + smoothed(gust, ratio)), WalkInNoise(noise, ratio))


def ground_speed(channels: Mapping[str, Array], theta: Array, dt_s: float, *, banked: bool = False) -> Array:
    """Speed without gusts (samples,) [m/s]: the integral of the acceleration along the path, and a line.

    The line, which fits the airspeed, takes up the accelerometer's bias and the steady wind; without ax, thrust less drag too.
    With ax its slope is limited to what the sensors err by, so that a wind that grows along the path does not accelerate the
    aircraft.
    """
    v = np.asarray(channels["airspeed_m_s"], dtype=np.float64)
    along = (_banked_acceleration if banked else _path_acceleration)(channels, theta)
    speed = np.concatenate([[0.0], np.cumsum(0.5 * dt_s * (along[1:] + along[:-1]))])
    time = dt_s * (np.arange(len(v)) - 0.5 * (len(v) - 1))
    slope = float(time @ (v - speed) / (time @ time))
    if "ax_m_s2" in channels:
        slope = min(max(slope, -_GROUND_SLOPE_M_S2), _GROUND_SLOPE_M_S2)
    return np.asarray(speed + float((v - speed).mean()) + slope * time)


def attitude(channels: Mapping[str, Array], dt_s: float) -> Array:
    """Pitch attitude (samples,) [rad]: measured, or the integral of the pitch rate from alpha at the start, level flight."""
    theta = channels.get("theta_rad")
    if theta is not None:
        return np.asarray(theta)
    q = channels[LONGITUDINAL.gyros[0]]
    return np.asarray(
        channels[LONGITUDINAL.vane][0] + np.concatenate([[0.0], np.cumsum(0.5 * dt_s * (q[1:] + q[:-1]))])
    )


class Speeds(NamedTuple):
    """Speeds of a run: pitch attitude and speed over ground that give them (samples,) [rad], [m/s], and the airspeed."""

    theta_rad: Array
    ground_m_s: Array
    quiet: QuietAirspeed


def speeds(channels: Mapping[str, Array], dt_s: float, *, banked: bool = False) -> Speeds:
    """Airspeed of a run without the noise of its sensor, and what it follows from.

    Parameters
    ----------
    channels : (samples,) each; dt_s : sample period [s].
    banked : whether sideslip and bank count; otherwise the flight is in the pitch plane. No noise is negligible there: gyros show
        the moments in calm air, and a turning aircraft averages them over seconds.
    """
    theta, negligible = attitude(channels, dt_s), 0.0 if banked else _NEGLIGIBLE
    ground = ground_speed(channels, theta, dt_s, banked=banked)
    walk = ground_walk(channels, theta, dt_s, banked=banked)
    return Speeds(theta, ground, without_noise(channels["airspeed_m_s"], ground, dt_s, walk, negligible))


def ground_walk(channels: Mapping[str, Array], theta: Array, dt_s: float, *, banked: bool = False) -> float:
    """Variance that the error of `ground_speed` gains from one sample to the next, from the noise of its sensors [m2/s2]."""
    noise, _ = _variances((_banked_acceleration if banked else _path_acceleration)(channels, theta))
    return float(noise) * dt_s**2


def _path_acceleration(channels: Mapping[str, Array], theta: Array) -> Array:
    """Acceleration along the path (samples,) [m/s2], without ax that of gravity."""
    alpha = channels[LONGITUDINAL.vane]
    along = -G0 * np.sin(theta - alpha)
    if "ax_m_s2" in channels:
        along = along + channels["ax_m_s2"] * np.cos(alpha) + channels[ACCELEROMETERS[2]] * np.sin(alpha)
    return np.asarray(along)


def _banked_acceleration(channels: Mapping[str, Array], theta: Array) -> Array:
    """As `_path_acceleration` with sideslip and bank; the specific force of axes that are not recorded is left out.

    Source: B. L. Stevens and F. L. Lewis, Aircraft Control and Simulation, 2nd ed., 2003, table 2.5-1 (V').
    """
    alpha, beta, phi = channels[LONGITUDINAL.vane], channels[LATERAL.vane], channels[BANK]
    along = np.stack([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    gravity = np.stack([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    total = G0 * (along * gravity).sum(axis=0)
    if "ax_m_s2" in channels:
        for part, name in zip(along, ACCELEROMETERS, strict=True):
            total = total + part * channels.get(name, 0.0)
    return np.asarray(total)


__all__ = [
    "QuietAirspeed",
    "Speeds",
    "WalkInNoise",
    "attitude",
    "ground_speed",
    "ground_walk",
    "gust_cutoff_hz",
    "is_noisy",
    "low_passed",
    "speeds",
    "without_noise",
]
