"""The least covariance of the six derivatives from one record, by the Cramer-Rao bound of filter error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft, Sensor
from airtruth.errors import ConfigurationError
from airtruth.identification.condition import AircraftConstants
from airtruth.identification.likelihood.cramer_rao import experiment_bound
from airtruth.identification.likelihood.fit import fit
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.logs.flight_log import Batch
from airtruth.physics.gust_figures import GustScales
from airtruth.physics.motion import LONGITUDINAL

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearExperiment:
    """Properties of a record of the linear short period besides its elevator.

    Attributes
    ----------
    aircraft : constants of the aircraft.
    noise : channel -> standard deviation of the noise of its sensor [SI], see `sensor_noise`.
    gusts : of the air.
    airspeed_m_s : at the trim [m/s].
    dt_s : time between two samples [s].
    start : how the gusts start, see `airtruth.identification.likelihood.cramer_rao.experiment_bound`.
    """

    aircraft: AircraftConstants
    noise: Mapping[str, float]
    gusts: GustScales
    airspeed_m_s: float
    dt_s: float
    start: str

    def least_covariance(self, flown: Mapping[str, Array], theta: Array) -> Array:
        """Least covariance (6, 6) of unbiased derivatives, with levels, biases and initial states unknown.

        Parameters
        ----------
        flown : channel -> (samples,) of a flight in calm air; the elevator counts, and the flight condition.
        theta : (6,) true derivatives [-].
        """
        batch, options = self._read(flown)
        least: Array = experiment_bound(batch, self.aircraft, theta, options, self.start)[0]
        return least

    def linear_error(self, flown: Mapping[str, Array], theta: Array) -> Array:
        """Error (6,) of the derivatives that filter error estimates from a flight without noise: that of the linear model.

        Parameters
        ----------
        flown : channel -> (samples,) of a flight in calm air.
        theta : (6,) true derivatives [-]; the fit starts there.
        """
        batch, options = self._read(flown)
        return np.asarray(fit(batch, self.aircraft, theta[None], options).theta[0] - theta)

    def _read(self, flown: Mapping[str, Array]) -> tuple[Batch, FilterOptions]:
        alpha, q, az = (self.noise[name] for name in LONGITUDINAL.output_channels)
        options = FilterOptions(
            alpha,
            q,
            az,
            **self.gusts._asdict(),
            airspeed_std_m_s=self.noise.get("airspeed_m_s"),
            airspeed_m_s=self.airspeed_m_s,
        )
        return batch_of(flown, self.dt_s), options


def batch_of(flown: Mapping[str, Array], dt_s: float) -> Batch:
    """A flight, channel -> (samples,), as a batch of one run."""
    channels = {name: np.ascontiguousarray(values[None]) for name, values in flown.items()}
    samples = next(iter(channels.values())).shape[1]
    return Batch(("plan",), dt_s, dt_s * np.arange(samples, dtype=np.float64)[None], channels)


def sensor_noise(
    sensors: Mapping[str, Sensor], aircraft: Aircraft, channels: Sequence[str]
) -> dict[str, float]:
    """Standard deviation of the noise of each sensor that the bound needs [SI].

    Parameters
    ----------
    sensors : channel -> sensor.
    aircraft : named in the message.
    channels : outputs of the filter.

    Raises
    ------
    ConfigurationError
        If a sensor has no noise.
    """
    noise = {c: sensors[c].noise_std.value if c in sensors else 0.0 for c in channels}
    lacking = [c for c, std in noise.items() if std <= 0.0]
    if lacking:
        raise ConfigurationError(
            f"plan: {aircraft.name} states no noise of {', '.join(lacking)}, without which the bound is 0; "
            f"state noise_std in [sensors.{lacking[0]}] of {aircraft.folder / 'aircraft.toml'}, "
            f"or in [sensors.channel.{lacking[0]}] of the campaign"
        )
    return noise


__all__ = ["LinearExperiment", "sensor_noise"]
