"""From noise-free channels of many runs to the readings of their sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.probe import Constants
from airtruth.channels import LATERAL, PITCH_PLANE
from airtruth.physics import sensors
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.readings import reading_increments
from airtruth.physics.sensor_errors import SensorErrors
from airtruth.physics.terms import ReadingTerm, StateTerm

Array = NDArray[np.float64]


def logged(lateral: bool) -> tuple[str, ...]:
    """Channels of the log of a flight, with the lateral ones where it rolls and yaws."""
    return (*PITCH_PLANE, *LATERAL) if lateral else PITCH_PLANE


@dataclass(frozen=True)
class Readings:
    """Readings of the sensors beyond their errors.

    Attributes
    ----------
    terms, states : increments of the readings, and the states that drive them.
    constants : geometry of the aircraft.
    """

    terms: tuple[ReadingTerm, ...] = ()
    states: tuple[StateTerm, ...] = ()
    constants: Constants | None = None

    def increments(self, truth: Mapping[str, Array], dt_s: float) -> dict[str, Array]:
        """Channel -> increment of its reading, see `airtruth.physics.readings.reading_increments`."""
        return reading_increments(self.terms, self.states, truth, self.constants, dt_s)


def readings_of(aircraft: Aircraft) -> Readings:
    """The increments of readings that an aircraft.toml declares."""
    dynamics = aircraft.file.dynamics
    if dynamics is None or not dynamics.readings:
        return Readings()
    return Readings(dynamics.readings, dynamics.states, aircraft.constants)


def needs_every_step(
    fitted: Mapping[str, SensorErrors], log_period_s: float, readings: Readings | None = None
) -> bool:
    """Whether a sensor needs the samples between those of the log: for a lag or a state, or for a delay or hold between
    samples.
    """
    if readings is not None and readings.terms and readings.states:
        return True

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
    readings: Readings | None = None,
) -> dict[str, Array]:
    """Readings of the sensors at the samples of the log.

    Parameters
    ----------
    truth : channel -> (runs, records) noise-free values at the CG, q_dot_rad_s2 among them, and with the lateral channels
        p_dot_rad_s2 and r_dot_rad_s2.
    fitted : channel -> errors of its instrument; a channel without an instrument is logged as it is.
    noise : channel -> (runs, records) standard normals for the channels with noise.
    dt_s : period of the records [s].
    every : records per log sample.
    readings : increments of the readings; None for none.

    Returns
    -------
    dict
        Channel of `logged` -> (runs, samples).
    """
    result = {}
    more = {} if readings is None else readings.increments(truth, dt_s)
    for name in logged(MOTION.vane in truth):
        values = truth[name]
        if name in fitted:
            values = sensors.at_instrument(name, truth, fitted[name]) + more.get(name, 0.0)
            values = sensors.measure(fitted[name], values, dt_s, noise.get(name, np.zeros_like(values)))
        elif name in more:
            values = values + more[name]
        result[name] = values[:, ::every]
    return result
