"""From a batch of logs to the arrays of an identification: flight condition, signals, trim window."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify.options import Options
from airtruth.identify.prefilter import butterworth, zero_phase
from airtruth.identify.pressure import NO_LEFT, divide, ratios
from airtruth.identify.problem import COMMAND, Observation
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


def density_of(batch: Batch) -> Array:
    """Air density (runs, samples) [kg/m3]: measured, or from altitude_m through the standard atmosphere."""
    channels = batch.channels
    if "density_kg_m3" in channels:
        return channels["density_kg_m3"]
    return np.asarray(density_kg_m3(channels["altitude_m"]))


def flight_condition(
    batch: Batch, constants: AircraftConstants, options: Options, pitch_rate: Array
) -> Scale:
    """Factors (runs,) of a constant airspeed and density, by ``options.condition``.

    Parameters
    ----------
    batch, constants, options : runs, aircraft, choices.
    pitch_rate : (runs, samples) low-passed q [rad/s].
    """
    airspeed, density = batch.channels["airspeed_m_s"], density_of(batch)
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


def ratios_of(batch: Batch, constants: AircraftConstants, condition: Scale) -> tuple[Array, Array]:
    """Measured airspeed and dynamic pressure over those of the flight condition, (runs, samples) each."""
    airspeed = batch.channels["airspeed_m_s"]
    return ratios(airspeed, density_of(batch), constants.wing_area_m2, constants.mass_kg, condition)


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
    sos = butterworth(options.cutoff_hz, options.order, batch.dt_s)
    smooth = zero_phase(signals, sos)
    condition = flight_condition(batch, constants, options, smooth[:, 1])
    left = left_smooth = NO_LEFT
    if options.pressure == "measured":
        v, p = ratios_of(batch, constants, condition)
        left = divide(signals, v, p, condition.airspeed_m_s, batch.dt_s)
        smooth, left_smooth = zero_phase(signals, sos), zero_phase(left, sos)
    return Observation(
        dt_s=batch.dt_s,
        signals=signals,
        smooth=smooth,
        left=left,
        left_smooth=left_smooth,
        command=channels.get(COMMAND),
        scale=condition,
        factors=row_factors(condition),
        window=window_samples(options, batch.dt_s) if options.trim == "mean" else 0,
    )
