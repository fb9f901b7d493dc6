"""From a batch of logs to the arrays of an identification: flight condition, signals, dynamic pressure.

Measured dynamic pressure. With v = V(t)/V0 and p = q_bar(t)/q_bar0 the ratios to the constant flight
condition of a record, eq. (4) of M. Brunot, "An Instrumental Variable Approach for Aircraft Identification",
holds at every sample with the whole lift, that of the trim included:

    alpha' - q - g/V = -lift0 (p/v) CL,   q' = moment0 p Cm,   az = -normal0 p CL,
    CL = CL0 + CLalpha alpha + (c/2V0) CLq q/v + CLde de, and Cm alike.

Divided by p/v, p and p, the equations have the form of constant pressure: the same factors, the regressors
alpha, q/v and de, and one free constant each. A left side x a' becomes (x a)' - x' a, so that a filter can
take the derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import BANK
from airtruth.identification.options import Options
from airtruth.identification.regression.rows import row_factors
from airtruth.identification.signals import ALPHA, AZ, COMMAND, Q
from airtruth.logs.flight_log import Batch
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.atmosphere import air_density
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import PitchConstants, Scale, scale_of
from airtruth.units import G0

Array = NDArray[np.float64]

_BLOCK_S: Final = 0.5
"""Length of the means that `pressure_range` and `across_path` compare [s] (judgement: 25 samples at 50 Hz, and short for a
phugoid)."""
_LEVEL: Final = 0.01
"""Range of the cosine of the path angle in a record up to which gravity across the path is constant [-] (judgement: 0.1 m/s2, a
path that turns by 8 deg; the noise of accelerometers)."""
NO_LEFT: Final = np.empty((0, 4, 0))
"""Left sides at constant pressure without lateral motion: the estimators form them from the signals."""


AircraftConstants = PitchConstants
"""Constants of the aircraft that an identification needs."""
OneOrEach = AircraftConstants | Sequence[AircraftConstants]
"""Constants of all batches, or one entry for each of them: fuel burn changes mass and inertia between records."""


def each_batch(parts: Sequence[Batch], constants: OneOrEach) -> list[tuple[Batch, AircraftConstants]]:
    """Batches, each with its constants."""
    own = constants if isinstance(constants, Sequence) else [constants] * len(parts)
    return list(zip(parts, own, strict=True))


@dataclass(frozen=True)
class Observation:
    """Signals of runs of one length, measured and low-passed.

    Attributes
    ----------
    dt_s : sample period [s].
    signals : (runs, 4, samples) alpha [rad], q [rad/s], az [g], elevator [rad].
    smooth : (runs, 4, samples) the same after the low-pass.
    left, left_smooth : (runs, 4, samples) left sides of lift and moment, from `divide`, at measured dynamic pressure and in
        records of both motions; q and az of ``signals`` are then divided too. Without runs otherwise.
    command : (runs, samples) elevator command [rad], or None.
    scale : factors of shape (runs,).
    factors : (runs, 4) from `airtruth.identification.regression.rows.row_factors`.
    window : samples at the start of the record whose mean is the trim; 0 for a free intercept, with signals
        relative to their first sample.
    servo_s : declared time constant of the elevator's servo [s]; 0 for none.
    """

    dt_s: float
    signals: Array
    smooth: Array
    left: Array
    left_smooth: Array
    command: Array | None
    scale: Scale
    factors: Array
    window: int
    servo_s: float


def flight_condition(
    batch: Batch, constants: AircraftConstants, options: Options, pitch_rate: Array
) -> Scale:
    """Factors (runs,) of a constant airspeed and density, by ``options.condition``.

    Parameters
    ----------
    batch, constants, options : runs, aircraft, choices.
    pitch_rate : (runs, samples) low-passed q [rad/s].
    """
    airspeed, density = batch.channels["airspeed_m_s"], air_density(batch.channels)
    if options.condition == "motion":
        weight = (pitch_rate - pitch_rate.mean(axis=1, keepdims=True)) ** 2
        total = weight.sum(axis=1, keepdims=True)
        # a record at rest has no motion to weigh by; the checks refuse it earlier
        weight = np.where(total > 0.0, weight / np.where(total > 0.0, total, 1.0), 1.0 / weight.shape[1])
        mean_airspeed = np.einsum("rn,rn->r", airspeed, weight)
        mean_density = np.einsum("rn,rn->r", density, weight)
    else:
        last = window_samples(options, batch.dt_s) if options.condition == "window" else airspeed.shape[1]
        mean_airspeed = airspeed[:, :last].mean(axis=1)
        mean_density = density[:, :last].mean(axis=1)
    if options.airspeed_m_s is not None:
        mean_airspeed = np.full_like(mean_airspeed, options.airspeed_m_s)
    return scale_of(constants, mean_airspeed, mean_density)


def window_samples(options: Options, dt_s: float) -> int:
    """Samples of the trim window, at least one."""
    return max(1, round(options.trim_window_s / dt_s))


def measured_unless_given(options: Options) -> Options:
    """The options with the pressure "method" resolved: measured, or constant if the airspeed is given."""
    if options.pressure != "method":
        return options
    return replace(options, pressure="measured" if options.airspeed_m_s is None else "constant")


def takes_constant(options: Options, has_default_constant: bool) -> bool:
    """Whether a method takes the dynamic pressure for constant over a record.

    Parameters
    ----------
    has_default_constant : whether it does where the option ``pressure`` leaves the choice to the method.
    """
    resolved = options if has_default_constant else measured_unless_given(options)
    return resolved.pressure != "measured"


def pressure_range(batch: Batch) -> Array:
    """Largest less smallest dynamic pressure of each run over its mean (runs,) [-], in means over `_BLOCK_S`."""
    pressure = air_density(batch.channels) * batch.channels["airspeed_m_s"] ** 2
    return np.asarray(_range(pressure, batch.dt_s) / pressure.mean(axis=1))


def across_path(batch: Batch) -> Array:
    """Gravity across the path over that in level flight, (runs, samples) [-]: the cosine of the path angle theta - alpha.

    With the bank phi it is cos(phi) cos(theta) cos(alpha) + sin(theta) sin(alpha). One where theta is not measured, and in runs
    whose cosine changes by at most `_LEVEL`, in means over `_BLOCK_S`.
    """
    alpha, theta = batch.channels[LONGITUDINAL.vane], batch.channels.get("theta_rad")
    if theta is None:
        return np.ones_like(alpha)
    bank = batch.channels.get(BANK, np.zeros_like(alpha))
    cosine = np.cos(theta - alpha) - (1.0 - np.cos(bank)) * np.cos(theta) * np.cos(alpha)
    return np.where(_range(cosine, batch.dt_s)[:, None] > _LEVEL, cosine, 1.0)


def _range(x: Array, dt_s: float) -> Array:
    """Largest less smallest mean over `_BLOCK_S` of each row of (runs, samples)."""
    samples = x.shape[1]
    block = min(max(1, round(_BLOCK_S / dt_s)), samples)
    whole = samples // block * block
    return np.asarray(np.ptp(x[:, :whole].reshape(len(x), -1, block).mean(axis=2), axis=1))


def ratios_of(batch: Batch, constants: AircraftConstants, condition: Scale) -> tuple[Array, Array]:
    """Measured airspeed v and dynamic pressure p over those of the flight condition, (runs, samples) [-]."""
    airspeed = batch.channels["airspeed_m_s"]
    return ratios(airspeed, air_density(batch.channels), constants.wing_area_m2, constants.mass_kg, condition)


def ratios(
    airspeed_m_s: Array, density_kg_m3: Array, wing_area_m2: float, mass_kg: float, scale: Scale
) -> tuple[Array, Array]:
    """Airspeed and dynamic pressure over those of the flight condition.

    Parameters
    ----------
    airspeed_m_s, density_kg_m3 : (runs, samples) measured.
    wing_area_m2, mass_kg : S and m.
    scale : constant flight condition, factors (runs,).

    Returns
    -------
    v, p : (runs, samples) [-].
    """
    force = 0.5 * density_kg_m3 * airspeed_m_s**2 * (wing_area_m2 / mass_kg)
    return airspeed_m_s / scale.airspeed_m_s[:, None], force / scale.normal[:, None]


def divide(signals: Array, v: Array, p: Array, airspeed_m_s: Array, dt_s: float, across: Array) -> Array:
    """Divide q and az of ``signals`` by v and p, in place, and return the left sides.

    Parameters
    ----------
    signals : (runs, 4, samples) alpha [rad], q [rad/s], az [g], elevator [rad].
    v, p : (runs, samples) from `ratios`.
    airspeed_m_s : (runs,) V0.
    dt_s : sample period [s].
    across : (runs, samples) from `across_path`.

    Returns
    -------
    (runs, 4, samples)
        The first two are to be differentiated, the last two to be added, to give the left sides of lift and
        moment: x alpha [rad], q/p [rad/s], -x' alpha - x q - g cos(gamma)/(V0 p) [rad/s], -(1/p)' q [rad/s2], with
        x = v/p and alpha relative to its mean.
    """
    alpha_factor, q_factor = v / p, 1.0 / p
    alpha = signals[:, ALPHA] - signals[:, ALPHA].mean(axis=1, keepdims=True)
    q = signals[:, Q].copy()
    signals[:, Q] /= v
    signals[:, AZ] /= p
    alpha_slope, q_slope = (np.gradient(x, dt_s, axis=1) for x in (alpha_factor, q_factor))
    added = -alpha_slope * alpha - alpha_factor * q - G0 / airspeed_m_s[:, None] * across * q_factor
    return np.stack([alpha_factor * alpha, q_factor * q, added, -q_slope * q], axis=1)


def observe(batch: Batch, constants: AircraftConstants, options: Options) -> Observation:
    """Return the signals that the estimators read, az in g; nothing is checked."""
    channels = batch.channels
    signals = np.stack([channels[name] for name in LONGITUDINAL.channels], axis=1)
    signals[:, AZ] /= G0
    sos = butterworth(options.cutoff_of(batch.dt_s), options.order, batch.dt_s)
    smooth = zero_phase(signals, sos)
    condition = flight_condition(batch, constants, options, smooth[:, Q])
    left = left_smooth = NO_LEFT
    measured, known = options.pressure == "measured", batch.known_rates
    if measured or known is not None:
        across = across_path(batch)
        if known is None or measured:
            v, p = ratios_of(batch, constants, condition)
        else:
            v = p = np.ones_like(across)
            across = np.where(np.asarray(known.any(axis=(0, 2)))[:, None], across, 1.0)
        left = divide(signals, v, p, condition.airspeed_m_s, batch.dt_s, across)
        if known is not None:
            left[:, 2] -= v / p * known[0]
            left[:, 3] -= known[1] / p
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
        servo_s=batch.servo_s,
    )


def relative(left: Array, window: int) -> Array:
    """Left sides (runs, 4, samples) of an observation as deviations, by `origin_of`; unchanged if empty."""
    return left - origin_of(left, window)[:, :, None] if left.shape[0] > 0 else left


def origin_of(signals: Array, window: int) -> Array:
    """Reference value along the last axis: the first sample, or the mean over ``window`` samples if > 0."""
    if window > 0:
        return np.asarray(signals[..., :window].mean(axis=-1))
    return signals[..., 0].copy()
