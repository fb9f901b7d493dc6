"""Integral, derivative, shift and lag of sampled signals, from polynomials through six neighbouring samples.

At a tenth of the sample rate, far above the motion of an aircraft in its logs, their relative errors are below 2e-4
(the trapezoidal rule: 3 %). The coefficients are those of Lagrange's interpolation (M. Abramowitz and I. A. Stegun,
*Handbook of Mathematical Functions*, 1964, sections 25.2 to 25.4).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

_INTEGRAL: Final = np.array([11.0, -93.0, 802.0, 802.0, -93.0, 11.0]) / 1440.0
"""Weights of the integral over the middle interval of six samples, in periods [-]."""
_DERIVATIVE: Final = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
"""Weights of the derivative at the middle of seven samples, in periods [-]."""
_SHIFT: Final = np.array([-120.0, 24.0, -12.0, 12.0, -24.0, 120.0])
"""Denominators of Lagrange's weights of six samples [-]."""


def integral(x: Array, dt_s: float) -> Array:
    """Integral from the first sample, (samples,); exact for polynomials of the third degree.

    Examples
    --------
    >>> integral(np.array([0.0, 1.0, 4.0, 9.0, 16.0]), 1.0).round(6).tolist()
    [0.0, 0.333333, 2.666667, 9.0, 21.333333]
    """
    steps = np.convolve(_extended(x, 2), _INTEGRAL, "valid")
    return np.concatenate([[0.0], dt_s * np.cumsum(steps)])


def derivative(x: Array, dt_s: float) -> Array:
    """Derivative at the samples, (samples,); exact for polynomials of the third degree."""
    return np.asarray(np.convolve(_extended(x, 3), _DERIVATIVE[::-1], "valid") / dt_s)


def earlier(x: Array, dt_s: float, delay_s: float) -> Array:
    """x(t + delay), the end values held outside; a negative delay takes the signal later."""
    if delay_s == 0.0:
        return x
    whole = math.floor(delay_s / dt_s)
    part = delay_s / dt_s - whole
    weights = _shift_weights(part)
    reach = abs(whole) + 3
    padded = np.concatenate([np.full(reach, x[0]), x, np.full(reach, x[-1])])
    first = reach + whole - 2
    return np.asarray(np.convolve(padded[first : first + len(x) + 5], weights[::-1], "valid"))


def _shift_weights(part: float) -> Array:
    """Lagrange's weights of six samples for a point between the third and the fourth."""
    a, b, c, d, e, f = (part - node for node in range(-2, 4))
    products = (b * c * d * e * f, a * c * d * e * f, a * b * d * e * f, a * b * c * e * f, a * b * c * d * f)
    return np.asarray(np.array([*products, a * b * c * d * e]) / _SHIFT)


def lagged(x: Array, dt_s: float, lag_s: float) -> Array:
    """First-order lag, lag_s y' = x - y, from equilibrium.

    The signal is a cubic on each interval, with the derivatives of its neighbours. There p = x - lag x' + lag^2 x"
    - lag^3 x"' solves the equation, and y - p decays with exp(-dt/lag). A signal that is linear between samples
    (`airtruth.physics.sensors.lag`) loses more of a motion at a tenth of the sample rate than a lag of a third of a
    period takes away.
    """
    if lag_s <= 0.0:
        return x
    slope = derivative(x, dt_s)
    rise = np.diff(x) / dt_s
    left, right = slope[:-1], slope[1:]
    cubic = 6.0 * (left + right - 2.0 * rise) / dt_s**2
    curve = 2.0 * (3.0 * rise - 2.0 * left - right) / dt_s
    at_left = x[:-1] - lag_s * (left - lag_s * (curve - lag_s * cubic))
    at_right = x[1:] - lag_s * (right - lag_s * (curve + cubic * dt_s - lag_s * cubic))
    decay = math.exp(-dt_s / lag_s)
    y, _ = lfilter([1.0], [1.0, -decay], at_right - decay * at_left, zi=np.array([decay * x[0]]))
    return np.concatenate([x[:1], y])


def _extended(x: Array, count: int) -> Array:
    """Add samples at both ends by the cubics through the first and the last four samples."""
    if len(x) < 4:
        return np.concatenate([np.full(count, x[0]), x, np.full(count, x[-1])])
    before, after = x[:4], x[-4:][::-1]
    for _ in range(count):
        before = np.concatenate([[4.0 * before[0] - 6.0 * before[1] + 4.0 * before[2] - before[3]], before])
        after = np.concatenate([[4.0 * after[0] - 6.0 * after[1] + 4.0 * after[2] - after[3]], after])
    return np.concatenate([before[:count], x, after[:count][::-1]])


__all__ = ["derivative", "earlier", "integral", "lagged"]
