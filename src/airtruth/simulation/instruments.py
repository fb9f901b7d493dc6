"""From noise-free channels of many runs to the readings of their sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics import sensors
from airtruth.physics.sensor_errors import SensorErrors

Array = NDArray[np.float64]

LOGGED: Final = (
    "airspeed_m_s",
    "alpha_rad",
    "theta_rad",
    "q_rad_s",
    "ax_m_s2",
    "az_m_s2",
    "elevator_rad",
    "elevator_command_rad",
    "throttle",
    "altitude_m",
    "density_kg_m3",
)
"""Channels of a log, in the order of its columns."""


def needs_every_step(fitted: Mapping[str, SensorErrors], log_period_s: float) -> bool:
    """Whether a sensor needs the samples between those of the log: for a lag, or for a delay or hold between samples."""

    def odd(duration: float) -> bool:
        samples = duration / log_period_s
        return abs(samples - round(samples)) > 1e-9

    return any(m.lag_s > 0.0 or odd(m.delay_s) or odd(m.hold_s) for m in fitted.values())


def log_channels(
    truth: Mapping[str, Array],
    fitted: Mapping[str, SensorErrors],
    noise: Mapping[str, Array],
    dt_s: float,
    every: int,
) -> dict[str, Array]:
    """Readings of the sensors at the samples of the log.

    Parameters
    ----------
    truth : channel -> (runs, records) noise-free values at the CG, q_dot_rad_s2 among them.
    fitted : channel -> errors of its instrument; a channel without an instrument is logged as it is.
    noise : channel -> (runs, records) standard normals for the channels with noise.
    dt_s : period of the records [s].
    every : records per log sample.

    Returns
    -------
    dict
        Channel of `LOGGED` -> (runs, samples).
    """
    result = {}
    for name in LOGGED:
        values = truth[name]
        if name in fitted:
            values = sensors.at_instrument(name, truth, fitted[name])
            values = sensors.measure(fitted[name], values, dt_s, noise.get(name, np.zeros_like(values)))
        result[name] = values[:, ::every]
    return result
