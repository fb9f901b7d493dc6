"""Sensor equations: where a sensor sits, and what it makes of the truth.

Body axes x forward, z down, origin at the centre of gravity; q nose-up positive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SensorModel:
    """One channel of an instrument; the defaults do nothing. Applied in the order of `measure`.

    Attributes
    ----------
    noise_std : standard deviation of white noise per sample [unit of the channel].
    bias : constant added [unit of the channel].
    scale : factor on the truth [-].
    lag_s : time constant of a first-order lag [s].
    delay_s : transport delay [s], at least 0.
    quantum : size of a quantisation step, rounding to nearest [unit of the channel]; 0 for none.
    minimum, maximum : ends of the range [unit of the channel].
    hold_s : update period of a slower instrument, which holds its value between [s]; 0 for none.
    """

    noise_std: float = 0.0
    bias: float = 0.0
    scale: float = 1.0
    lag_s: float = 0.0
    delay_s: float = 0.0
    quantum: float = 0.0
    minimum: float = -np.inf
    maximum: float = np.inf
    hold_s: float = 0.0


def measure(model: SensorModel, truth: Array, dt_s: float, normals: Array) -> Array:
    """Reading of a sensor: lag, delay, scale, bias, noise, hold, quantisation, saturation, in this order.

    The record starts in equilibrium: what lag and delay need of the time before is the first sample.

    Parameters
    ----------
    model : the sensor.
    truth : (runs, samples) noise-free channel at the sensor.
    dt_s : sample period [s].
    normals : (runs, samples) independent standard normals.

    Returns
    -------
    (runs, samples), a new array; ``truth`` stays as it is.
    """
    y = truth
    if model.lag_s > 0.0:
        y = lag(y, dt_s, model.lag_s)
    if model.delay_s > 0.0:
        y = delay(y, dt_s, model.delay_s)
    y = y * model.scale if model.scale != 1.0 else y.copy()
    if model.bias != 0.0:
        y += model.bias
    if model.noise_std > 0.0:
        y += model.noise_std * normals
    if model.hold_s > dt_s:
        y = hold(y, dt_s, model.hold_s)
    if model.quantum > 0.0:
        y = np.round(y / model.quantum) * model.quantum
    if model.minimum > -np.inf or model.maximum < np.inf:
        np.clip(y, model.minimum, model.maximum, out=y)
    return y


def lag(x: Array, dt_s: float, lag_s: float) -> Array:
    """First-order lag, lag_s y' = x - y, of a signal that is linear between samples; exact at the samples.

    With r = dt/lag and e = exp(-r): y[i] = e y[i-1] + ((1 - e)/r - e) x[i-1] + (1 - (1 - e)/r) x[i],
    and y[0] = x[0].

    Parameters
    ----------
    x : (..., samples).
    dt_s, lag_s : sample period and time constant [s].
    """
    from scipy.signal import lfilter  # slow to import, and few sensors lag

    r = dt_s / lag_s
    e = np.exp(-r)
    mean = -np.expm1(-r) / r  # (1 - e)/r
    start = x[..., :1] * mean  # the filter's state in equilibrium at x[0]
    y, _ = lfilter([1.0 - mean, mean - e], [1.0, -e], x, axis=-1, zi=start)
    return np.asarray(y)


def delay(x: Array, dt_s: float, delay_s: float) -> Array:
    """Transport delay by linear interpolation between samples; exact for whole samples.

    The error for a part of a sample is at most dt^2/8 times the largest second derivative.

    Parameters
    ----------
    x : (..., samples); before the record it is held at the first sample.
    dt_s, delay_s : sample period and delay [s].
    """
    samples = x.shape[-1]
    # a delay of whole samples in decimal figures need not be whole in binary
    steps = round(delay_s / dt_s, 9)
    whole = int(steps)
    part = steps - whole
    index = np.arange(samples) - whole
    y: Array = np.take(x, np.maximum(index, 0), axis=-1)
    if part > 0.0:
        y += part * (np.take(x, np.maximum(index - 1, 0), axis=-1) - y)
    return y


def hold(x: Array, dt_s: float, hold_s: float) -> Array:
    """Zero-order hold of an instrument that updates at the times 0, hold_s, 2 hold_s, ...

    At each update it takes the last sample at or before that time.

    Parameters
    ----------
    x : (..., samples).
    dt_s, hold_s : sample period and update period [s].
    """
    ratio = hold_s / dt_s
    sample = np.arange(x.shape[-1])
    update = np.floor(np.round(sample / ratio, 9))
    taken = np.floor(np.round(update * ratio, 9)).astype(np.int64)
    return np.take(x, taken, axis=-1)


def vane_alpha(alpha_rad: ArrayLike, q_rad_s: ArrayLike, x_m: float, airspeed_m_s: ArrayLike) -> Array:
    """Angle of attack at a vane x forward of the centre of gravity, alpha - q x/V [rad].

    The vane moves up with q x (nose up), which lowers the flow angle there; to first order in q x/V.
    """
    q = np.asarray(q_rad_s, dtype=np.float64)
    return np.asarray(alpha_rad, dtype=np.float64) - q * x_m / np.asarray(airspeed_m_s, dtype=np.float64)


def accelerometer_ax(
    ax_m_s2: ArrayLike, q_rad_s: ArrayLike, q_dot_rad_s2: ArrayLike, x_m: float, z_m: float
) -> Array:
    """Specific force along x at (x, z) from the centre of gravity, ax + q_dot z - q^2 x [m/s2].

    The x component of a + omega_dot x r + omega x (omega x r) with omega = (0, q, 0), r = (x, 0, z).
    """
    q = np.asarray(q_rad_s, dtype=np.float64)
    q_dot = np.asarray(q_dot_rad_s2, dtype=np.float64)
    return np.asarray(ax_m_s2, dtype=np.float64) + q_dot * z_m - np.square(q) * x_m


def accelerometer_az(
    az_m_s2: ArrayLike, q_dot_rad_s2: ArrayLike, x_m: float, q_rad_s: ArrayLike = 0.0, z_m: float = 0.0
) -> Array:
    """Specific force along z at (x, z) from the centre of gravity, az - q_dot x - q^2 z [m/s2].

    The z component of the same sum as `accelerometer_ax`.
    """
    q = np.asarray(q_rad_s, dtype=np.float64)
    q_dot = np.asarray(q_dot_rad_s2, dtype=np.float64)
    return np.asarray(az_m_s2, dtype=np.float64) - q_dot * x_m - np.square(q) * z_m


__all__ = [
    "SensorModel",
    "accelerometer_ax",
    "accelerometer_az",
    "delay",
    "hold",
    "lag",
    "measure",
    "vane_alpha",
]
