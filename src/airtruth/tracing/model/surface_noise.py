"""The noise of the measured surfaces, which the filter takes for a motion of the controls.

A sample of the surface with an error e changes the pitch rate of the model's aircraft by M_de e dt, and not that of the real one.
Where that is small against the noise of the gyro, the surface is exact. Elsewhere the error is noise of the process.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.settings import Settings

_NEGLIGIBLE: Final = 0.1
"""Change of an angular rate in a sample, by the surface's noise, over the noise of the gyro, up to which the surface is exact [-]
(judgement: the gyro then averages over ten samples before the changes have the size of its error)."""


def with_surface_noise(record: TraceRecord, settings: Settings) -> TraceRecord:
    """The record, without the variance of its surfaces' noise where that is negligible."""
    signals, plant = record.signals, record.plant
    if not signals.surface_noise_rad2.any():
        return record
    motion, constants = signals.motion, plant.aircraft.constants
    qbar_pa = 0.5 * float(signals.density_kg_m3.mean()) * float(np.mean(signals.airspeed_m_s**2))
    gyros = [i for i, output in enumerate(motion.outputs) if output.instrument == "gyro"]
    moments = [c for c in motion.coefficients if c.length is not None]
    for coefficient, gyro in zip(moments, gyros, strict=True):
        inertia = next(d.entry for d in motion.declared if coefficient.name in d.divides)
        length_m = getattr(constants, f"{coefficient.length}_m")
        moment = qbar_pa * constants.wing_area_m2 * length_m / getattr(constants, f"{inertia}_kg_m2")
        for control, noise_rad2 in zip(motion.controls, signals.surface_noise_rad2, strict=True):
            turning = moment * abs(float(plant.derivatives[motion.at(coefficient.name, control.name)]))
            change = turning * float(np.sqrt(noise_rad2.max())) * signals.dt_s
            if change > _NEGLIGIBLE * float(settings.noise[gyro]):
                return record
    return replace(record, signals=replace(signals, surface_noise_rad2=signals.surface_noise_rad2[:, :0]))


__all__ = ["with_surface_noise"]
