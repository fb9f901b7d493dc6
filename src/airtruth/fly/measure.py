"""From noise-free channels of many runs to what their sensors would have logged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Sensor
from airtruth.physics import sensors
from airtruth.physics.sensors import SensorModel

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


def model(sensor: Sensor) -> SensorModel:
    """The sensor's equations without its uncertainties and sources."""
    return SensorModel(
        noise_std=sensor.noise_std.value,
        bias=sensor.bias.value,
        scale=sensor.scale.value,
        lag_s=sensor.lag.value,
        delay_s=sensor.delay.value,
        hold_s=sensor.hold.value,
        quantum=sensor.quantum.value,
        minimum=-np.inf if sensor.minimum is None else sensor.minimum.value,
        maximum=np.inf if sensor.maximum is None else sensor.maximum.value,
    )


def needs_every_step(models: Mapping[str, SensorModel], log_period_s: float) -> bool:
    """Whether a sensor has dynamics that the log's own samples cannot give: a lag, or an odd delay or hold."""

    def odd(duration: float) -> bool:
        samples = duration / log_period_s
        return abs(samples - round(samples)) > 1e-9

    return any(m.lag_s > 0.0 or odd(m.delay_s) or odd(m.hold_s) for m in models.values())


def at_sensor(name: str, truth: Mapping[str, Array], sensor: Sensor | None) -> Array:
    """Noise-free value where the sensor sits: vane and accelerometer arms applied; (runs, samples)."""
    if sensor is None or (sensor.x.value == 0.0 and sensor.z.value == 0.0):
        return truth[name]
    x, z = sensor.x.value, sensor.z.value
    if name == "alpha_rad":
        return sensors.vane_alpha(truth["alpha_rad"], truth["q_rad_s"], x, truth["airspeed_m_s"])
    if name == "az_m_s2":
        return sensors.accelerometer_az(truth["az_m_s2"], truth["q_dot_rad_s2"], x, truth["q_rad_s"], z)
    if name == "ax_m_s2":
        return sensors.accelerometer_ax(truth["ax_m_s2"], truth["q_rad_s"], truth["q_dot_rad_s2"], x, z)
    return truth[name]


def log_channels(
    truth: Mapping[str, Array],
    fitted: Mapping[str, Sensor],
    noise: Mapping[str, Array],
    dt_s: float,
    every: int,
) -> dict[str, Array]:
    """What the sensors log.

    Parameters
    ----------
    truth : channel -> (runs, records) noise-free values at the CG, q_dot_rad_s2 among them.
    fitted : channel -> sensor; a channel without one is logged as it is.
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
        values = at_sensor(name, truth, fitted.get(name))
        if name in fitted:
            values = sensors.measure(
                model(fitted[name]), values, dt_s, noise.get(name, np.zeros_like(values))
            )
        result[name] = values[:, ::every]
    return result
