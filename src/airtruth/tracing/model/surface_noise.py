"""The noise of the measured surfaces, which the filter takes for a motion of the controls.

The model's aircraft follows the errors of the measured surfaces, the real one does not. A lightly damped motion adds up the
errors of many samples. Where that is small against the noise of every sensor, the surface is exact. Elsewhere the error is
noise of the process.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.linear_model import Linear
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.increment_response import linear_motion, linear_scale
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.settings import Settings

_NEGLIGIBLE: Final = 0.2
"""Spectrum of an output that the surfaces' noise causes, over that of the sensor's noise, up to which the surface is exact [-]
(judgement: a chi-square statistic grows by less than that, at the frequencies of the motion alone)."""


def with_surface_noise(record: TraceRecord, settings: Settings) -> TraceRecord:
    """The record, without the variance of its surfaces' noise where that is negligible."""
    signals = record.signals
    if not signals.surface_noise_rad2.any() or caused_share(record, settings) > _NEGLIGIBLE:
        return record
    return replace(record, signals=replace(signals, surface_noise_rad2=signals.surface_noise_rad2[:, :0]))


def caused_share(record: TraceRecord, settings: Settings) -> float:
    """Largest spectrum of an output that the noise of moving surfaces causes, over that of the sensor's noise [-].

    Parameters
    ----------
    record : with the variance of its surfaces' noise; settings : noise of the sensors.
    """
    s = record.signals
    means = {
        "airspeed_m_s": s.airspeed_m_s,
        "density_kg_m3": s.density_kg_m3,
        LONGITUDINAL.vane: s.attack_rad,
        "theta_rad": s.theta_rad,
    }
    scale = linear_scale(
        s.motion, record.plant.aircraft.constants, {n: x.mean()[None, None] for n, x in means.items()}
    )
    model, _ = linear_motion(record.plant.derivatives[None], scale)
    largest_rad2 = s.surface_noise_rad2.max(axis=1)
    every = gains(Linear(*(part[0] for part in model)), 2.0 * np.pi / (s.dt_s * len(s.y)))
    shares = [
        (np.abs(gain) ** 2 @ largest_rad2 / settings.noise**2)[settings.measured].max() for gain in every
    ]
    return float(max(shares, default=0.0))


def gains(model: Linear, least_rad_s: float) -> list[NDArray[np.complex128]]:
    """Frequency responses (outputs, controls) at the natural frequencies of a linear model.

    Parameters
    ----------
    model : without leading axes; least_rad_s : slower motions are left out [rad/s].
    """
    natural = np.abs(np.linalg.eigvals(model.a))
    return [
        np.asarray(model.c @ np.linalg.solve(1j * omega * np.eye(len(model.a)) - model.a, model.b) + model.d)
        for omega in natural[natural >= least_rad_s]
    ]


__all__ = ["caused_share", "gains", "with_surface_noise"]
