"""Surface actuators: a first-order servo with rate limit, stops and transport delay."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


def respond(
    command_rad: Array,
    dt_s: float,
    bandwidth_hz: float,
    rate_limit_rad_s: float = np.inf,
    minimum_rad: float = -np.inf,
    maximum_rad: float = np.inf,
    delay_s: float = 0.0,
) -> Array:
    """Surface positions for commands that are linear between samples.

    The servo obeys y' = clip(w (c(t - delay) - y), -rate_limit, rate_limit) with w = 2 pi bandwidth, and
    stays between its stops (a limited integrator: it leaves a stop as soon as the command lies inside).
    Each stretch of time, in the linear range, at the rate limit and at a stop, is solved in closed form
    with its switching instants, so samples are exact; only a stop that is reached and left again between
    two samples is not resolved. The delay is exact for any part of a sample. Before the record the
    command is its first sample and the servo is at rest there.

    Parameters
    ----------
    command_rad : (runs, samples) command [rad].
    dt_s : sample period [s].
    bandwidth_hz : servo bandwidth, -3 dB frequency in the linear range [Hz].
    rate_limit_rad_s : largest rate [rad/s]; infinite for none.
    minimum_rad, maximum_rad : stops [rad]; infinite for none.
    delay_s : transport delay, before or after the servo alike [s].

    Returns
    -------
    (runs, samples) surface position [rad].
    """
    steps = round(delay_s / dt_s, 9)  # whole samples stay whole in spite of binary fractions
    whole = int(steps)
    result = np.empty(command_rad.shape)
    _servo(
        np.ascontiguousarray(command_rad, dtype=np.float64),
        float(dt_s),
        2.0 * math.pi * bandwidth_hz,
        float(rate_limit_rad_s),
        float(minimum_rad),
        float(maximum_rad),
        whole,
        (1.0 - (steps - whole)) * dt_s,
        result,
    )
    return result


@njit(cache=True)
def _servo(
    command: Array,
    dt: float,
    bandwidth: float,
    rate: float,
    low: float,
    high: float,
    whole: int,
    part: float,
    result: Array,
) -> None:
    """``part`` is the time into a sample interval at which the delayed output is read, dt for none."""
    runs, samples = command.shape
    for r in range(runs):
        y = min(max(command[r, 0], low), high)
        for i in range(min(whole + 1, samples)):
            result[r, i] = y
        for i in range(samples - 1 - whole):
            slope = (command[r, i + 1] - command[r, i]) / dt
            y = _advance(y, command[r, i], slope, part, bandwidth, rate, low, high)
            result[r, i + 1 + whole] = y
            if part < dt:
                y = _advance(y, command[r, i] + slope * part, slope, dt - part, bandwidth, rate, low, high)


@njit(cache=True)
def _advance(
    y: float, command: float, slope: float, duration: float, w: float, rate: float, low: float, high: float
) -> float:
    """Servo position after ``duration`` of a command ramp, in terms of the error e = c - y."""
    if (y >= high and command > high) or (y <= low and command < low):
        # at a stop until the command comes back inside
        stop = high if y >= high else low
        wait = (stop - command) / slope if slope != 0.0 else np.inf
        if wait < 0.0 or wait >= duration:
            return stop
        command = stop
        duration -= wait
        y = stop
    end = command + slope * duration
    band = rate / w  # error at which the rate limit starts
    e = command - y
    left = duration
    while left > 0.0:
        if e > band or e < -band or (e == band and slope > rate) or (e == -band and slope < -rate):
            # at the rate limit: e' = slope - rate, until e is back at the edge of the band
            side = 1.0 if e > 0.0 else -1.0
            closing = rate - side * slope
            needed = (side * e - band) / closing if closing > 0.0 else np.inf
            if needed >= left:
                e += (slope - side * rate) * left
                left = 0.0
            else:
                e = side * band
                left -= needed
        else:
            # linear: e tends to slope/w; it leaves the band only on the side of that value
            final = slope / w
            needed = np.inf
            if final > band:
                needed = math.log((final - e) / (final - band)) / w
            elif final < -band:
                needed = math.log((final - e) / (final + band)) / w
            if needed >= left:
                e = final + (e - final) * math.exp(-w * left)
                left = 0.0
            else:
                e = band if final > band else -band
                left -= needed
    return min(max(end - e, low), high)


__all__ = ["respond"]
