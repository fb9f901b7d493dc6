"""From a batch of logs to the arrays of an identification: flight condition, signals, trim window."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify.methods import COMMAND
from airtruth.identify.options import Options
from airtruth.identify.prefilter import butterworth, zero_phase
from airtruth.identify.problem import Observation
from airtruth.identify.rows import row_factors
from airtruth.logs.flight_log import Batch
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.short_period import Scale, scale
from airtruth.units import G0

Array = NDArray[np.float64]


class AircraftConstants(Protocol):
    """What an identification must know of the aircraft."""

    @property
    def wing_area_m2(self) -> float:
        """Reference area S [m2]."""

    @property
    def chord_m(self) -> float:
        """Mean aerodynamic chord c [m]."""

    @property
    def mass_kg(self) -> float:
        """Mass m [kg]."""

    @property
    def inertia_yy_kg_m2(self) -> float:
        """Pitch inertia Iyy [kg m2]."""


def flight_condition(
    batch: Batch, constants: AircraftConstants, options: Options, pitch_rate: Array
) -> Scale:
    """Factors (runs,) of a constant airspeed and density, by ``options.condition``.

    Density comes from density_kg_m3, or from altitude_m through the standard atmosphere.

    Parameters
    ----------
    batch, constants, options : runs, aircraft, choices.
    pitch_rate : (runs, samples) low-passed q [rad/s].
    """
    channels = batch.channels
    airspeed = channels["airspeed_m_s"]
    density = (
        channels["density_kg_m3"] if "density_kg_m3" in channels else density_kg_m3(channels["altitude_m"])
    )
    if options.condition == "motion":
        weight = (pitch_rate - pitch_rate.mean(axis=1, keepdims=True)) ** 2
        total = weight.sum(axis=1, keepdims=True)
        # a record at rest has no motion to weigh by; checks refuse it before it gets this far
        weight = np.where(total > 0.0, weight / np.where(total > 0.0, total, 1.0), 1.0 / weight.shape[1])
        mean_airspeed = np.einsum("rn,rn->r", airspeed, weight)
        mean_density = np.einsum("rn,rn->r", density, weight)
    else:
        last = window_samples(options, batch.dt_s) if options.condition == "window" else airspeed.shape[1]
        mean_airspeed = airspeed[:, :last].mean(axis=1)
        mean_density = density[:, :last].mean(axis=1)
    if options.airspeed_m_s is not None:
        mean_airspeed = np.full_like(mean_airspeed, options.airspeed_m_s)
    return scale(
        constants.wing_area_m2,
        constants.chord_m,
        constants.mass_kg,
        constants.inertia_yy_kg_m2,
        mean_airspeed,
        mean_density,
    )


def window_samples(options: Options, dt_s: float) -> int:
    """Samples of the trim window, at least one."""
    return max(1, round(options.trim_window_s / dt_s))


@njit(cache=True)
def _stack(alpha: Array, q: Array, az: Array, elevator: Array, gravity: float, signals: Array) -> None:
    for r in range(alpha.shape[0]):
        for k in range(alpha.shape[1]):
            signals[r, 0, k] = alpha[r, k]
            signals[r, 1, k] = q[r, k]
            signals[r, 2, k] = az[r, k] / gravity
            signals[r, 3, k] = elevator[r, k]


def observe(batch: Batch, constants: AircraftConstants, options: Options) -> Observation:
    """The signals that the estimators read, az in g; nothing is checked here."""
    channels = batch.channels
    alpha = channels["alpha_rad"]
    signals = np.empty((alpha.shape[0], 4, alpha.shape[1]))
    _stack(alpha, channels["q_rad_s"], channels["az_m_s2"], channels["elevator_rad"], G0, signals)
    smooth = zero_phase(signals, butterworth(options.cutoff_hz, options.order, batch.dt_s))
    condition = flight_condition(batch, constants, options, smooth[:, 1])
    return Observation(
        dt_s=batch.dt_s,
        signals=signals,
        smooth=smooth,
        command=channels.get(COMMAND),
        scale=condition,
        factors=row_factors(condition),
        window=window_samples(options, batch.dt_s) if options.trim == "mean" else 0,
    )
