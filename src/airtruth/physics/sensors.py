"""Sensor equations: from the motion of the centre of gravity to the reading of an instrument.

Body axes x forward, y right, z down, origin at the centre of gravity; p right wing down, q nose-up, r nose right positive.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.sensor_errors import SensorErrors

Array = NDArray[np.float64]

ACCELEROMETERS: Final = ("ax_m_s2", LATERAL.outputs[-1].channel, LONGITUDINAL.outputs[-1].channel)
"""Channels of specific force along x, y, z."""


def measure(errors: SensorErrors, truth: Array, dt_s: float, normals: Array) -> Array:
    """Reading of an instrument: lag, delay, scale, bias, noise, hold, quantisation, limits, in this order.

    The record starts in equilibrium: before it, the truth is its first sample. The position of the instrument is
    the matter of `at_instrument`.

    Parameters
    ----------
    errors : errors of the instrument.
    truth : (runs, samples) noise-free channel at the sensor.
    dt_s : sample period [s].
    normals : (runs, samples) independent standard normals.

    Returns
    -------
    (runs, samples), a new array; ``truth`` stays as it is.
    """
    y = truth
    if errors.lag_s > 0.0:
        y = lag(y, dt_s, errors.lag_s)
    if errors.delay_s > 0.0:
        y = delay(y, dt_s, errors.delay_s)
    y = y * errors.scale if errors.scale != 1.0 else y.copy()
    if errors.bias != 0.0:
        y += errors.bias
    if errors.noise_std > 0.0:
        y += errors.noise_std * normals
    if errors.hold_s > dt_s:
        y = hold(y, dt_s, errors.hold_s)
    if errors.quantum > 0.0:
        y = np.round(y / errors.quantum) * errors.quantum
    if errors.minimum > -np.inf or errors.maximum < np.inf:
        np.clip(y, errors.minimum, errors.maximum, out=y)
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
    x : (..., samples); before the record it is constant at its first sample.
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


def vane_equation(alpha_rad: Array, q_rad_s: Array, x_m: float, airspeed_m_s: Array) -> Array:
    """Angle of attack at a vane x forward of the centre of gravity, alpha - q x/V [rad].

    The vane moves up with q x (nose up), which lowers the flow angle there; to first order in q x/V. It is arithmetic alone,
    which the tracer's filter compiles for single numbers.
    """
    return alpha_rad - q_rad_s * x_m / airspeed_m_s


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


def side_vane_equation(
    beta_rad: Array, p_rad_s: Array, r_rad_s: Array, x_m: float, z_m: float, airspeed_m_s: Array
) -> Array:
    """Sideslip at a vane (x, z) from the centre of gravity, beta + x r/V - z p/V [rad], to first order in the rates.

    The vane moves to the right with r x - p z, the y component of omega x r. It is arithmetic alone, as `vane_equation`.
    """
    return beta_rad + (x_m * r_rad_s - z_m * p_rad_s) / airspeed_m_s


def rotation_acceleration(
    rates_rad_s: ArrayLike, rates_dot_rad_s2: ArrayLike, arm_m: tuple[float, float, float]
) -> Array:
    """Acceleration of a point that is fixed to a rotating body, against its origin: omega_dot x r + omega x (omega x r).

    Parameters
    ----------
    rates_rad_s, rates_dot_rad_s2 : (3, ...) p, q, r [rad/s] and their derivatives [rad/s2].
    arm_m : x, y, z of the point [m].

    Returns
    -------
    (3, ...) components along x, y, z [m/s2].
    """
    p, q, r = np.asarray(rates_rad_s, dtype=np.float64)
    p_dot, q_dot, r_dot = np.asarray(rates_dot_rad_s2, dtype=np.float64)
    x, y, z = arm_m
    return np.stack(
        [
            q_dot * z - r_dot * y + p * q * y + p * r * z - (q * q + r * r) * x,
            r_dot * x - p_dot * z + p * q * x + q * r * z - (p * p + r * r) * y,
            p_dot * y - q_dot * x + p * r * x + q * r * y - (p * p + q * q) * z,
        ]
    )


def at_instrument(channel: str, truth: Mapping[str, Array], errors: SensorErrors) -> Array:
    """True value of a channel where its instrument is: the arms of vanes and accelerometers and the position error applied.

    Parameters
    ----------
    channel : column of a log.
    truth : channel -> values of one shape at the centre of gravity [SI]; alpha_rad needs q_rad_s and airspeed_m_s,
        the accelerometers need q_rad_s and q_dot_rad_s2; airspeed_m_s with a position error needs alpha_rad. In a flight
        that rolls and yaws they need p_rad_s, r_rad_s, p_dot_rad_s2 and r_dot_rad_s2 as well.
    errors : position of the instrument.

    Returns
    -------
    Values of that shape [unit of the channel]; those of ``truth`` itself where the position does not matter.
    """
    x, y, z = arm = errors.x_m, errors.y_m, errors.z_m
    if channel == "airspeed_m_s" and errors.alpha_slope_per_rad != 0.0:
        return truth[channel] * errors.slope(truth[LONGITUDINAL.vane])
    if arm == (0.0, 0.0, 0.0):
        return truth[channel]
    (pitching,), (rolling, yawing) = LONGITUDINAL.gyros, LATERAL.gyros
    rolls = rolling in truth
    if channel == LONGITUDINAL.vane:
        alpha = vane_equation(truth[channel], truth[pitching], x, truth["airspeed_m_s"])
        return alpha + truth[rolling] * y / truth["airspeed_m_s"] if rolls and y != 0.0 else alpha
    if channel == LATERAL.vane:
        rates = truth[rolling], truth[yawing]
        return side_vane_equation(truth[channel], *rates, x, z, truth["airspeed_m_s"])
    if channel in ACCELEROMETERS and rolls:
        turning, changes = ([truth[f"{axis}_{unit}"] for axis in "pqr"] for unit in ("rad_s", "dot_rad_s2"))
        moved: Array = rotation_acceleration(turning, changes, arm)[ACCELEROMETERS.index(channel)]
        return truth[channel] + moved
    if channel == ACCELEROMETERS[2]:
        return accelerometer_az(truth[channel], truth["q_dot_rad_s2"], x, truth[pitching], z)
    if channel == ACCELEROMETERS[0]:
        return accelerometer_ax(truth[channel], truth[pitching], truth["q_dot_rad_s2"], x, z)
    return truth[channel]


__all__ = [
    "ACCELEROMETERS",
    "accelerometer_ax",
    "accelerometer_az",
    "at_instrument",
    "delay",
    "hold",
    "lag",
    "measure",
    "rotation_acceleration",
    "side_vane_equation",
    "vane_equation",
]
