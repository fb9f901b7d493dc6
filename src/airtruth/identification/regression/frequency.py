"""Equation error in the frequency domain, in a band that the data choose.

Sources: E. A. Morelli and K. Cunningham, "Aircraft Dynamic Modeling in Turbulence", AIAA 2012-4650; V. Klein
and E. A. Morelli, "Aircraft System Identification: Theory and Practice", 2006, section 7.2. Moment and normal
force of M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eq. (4), transformed:

    j w Q + [q]_0^T = moment Cm(w),   AZ = -normal CL(w),   X(w) = int_0^T x(t) exp(-j w t) dt, w = 2 pi k/T

At these frequencies the transform of a constant is zero. An error at the ends of the record is a constant over
w, and a linear trend is j/w: two free columns in each equation. The equation of alpha_dot is left out, as in
`airtruth.identification.regression.refined`, because it depends on the gust alone.

The moment equation is weighted by 1/|j w + moment |Cmq| c/2V|, which makes the gyro's noise white. A corner
frequency, chosen by restricted likelihood per run and equation, accounts for noise that rises towards low
frequencies (that of the other sensors through the pole, the u gust).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from airtruth.errors import ConfigurationError
from airtruth.identification.condition import (
    AircraftConstants,
    OneOrEach,
    each_batch,
    measured_unless_given,
    observe,
    origin_of,
)
from airtruth.identification.estimates import JOINT, Estimates, Status, joined, mean_scale
from airtruth.identification.options import Options
from airtruth.identification.regression.covariance import sandwich
from airtruth.identification.regression.frequency_kernel import FREE, sums_of
from airtruth.identification.regression.rows import HALF_CHORD, LIFT, MOMENT, solve
from airtruth.identification.regression.solve import chunks, regress_batch, regress_joint
from airtruth.identification.signals import ALPHA, AZ, ELEVATOR, Q
from airtruth.logs.flight_log import Batch
from airtruth.numerics.intersample import decay_of, servo_bend
from airtruth.physics.short_period import CL_ALPHA, CL_Q, CM_ALPHA, CM_Q, Scale

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Ints = NDArray[np.int64]

NAME: Final = "frequency"
"""Name of the method."""

LOWEST: Final = 0.15
"""Lower end of the band over the short period's frequency [-]; judgement: below it gusts and drift dominate."""
SURE: Final = 2.5
"""Multiple of the short period's frequency up to which the band extends without a test [-]; judgement."""
HIGHEST: Final = 6.0
"""Largest multiple of the short period's frequency in the band [-]; judgement."""
CLEAR: Final = 10.0
"""Power of alpha over its noise floor, mean of three neighbours, up to which the band continues [-]; judgement."""
FLOOR_FROM: Final = 0.6
"""Share of half the sample rate above which the mean power is the noise floor [-]; judgement."""
PASSES: Final = 2
"""Solutions [-]: the first has the weights of least squares, the last those of the first."""
TOP: Final = 2.0 / 3.0
"""Share of half the sample rate that the band may use [-]; judgement: above it the interpolation between samples
is uncertain."""


@dataclass(frozen=True)
class Spectra:
    """Transforms of runs of one length, see `airtruth.identification.regression.frequency_kernel.sums_of`.

    ``elevator`` is the deviation from its value at the trim, (runs, samples) [rad].
    """

    normal: Complex
    moment: Complex
    omega: Array
    alpha_floor: Array
    rate_hz: float
    factors: Array
    scale: Scale
    elevator: Array


def transform(x: Array, dt_s: float) -> Complex:
    """Fourier integrals over the record by the trapezoidal rule, frequencies k/T, T = (samples - 1) dt.

    Parameters
    ----------
    x : (..., samples); dt_s : sample period [s].

    Returns
    -------
    (..., frequencies), unit of x times s, from frequency 0 on.
    """
    folded = x[..., :-1].copy()
    folded[..., 0] = 0.5 * (x[..., 0] + x[..., -1])
    return np.asarray(rfft(folded) * dt_s)


def spectra(batch: Batch, constants: AircraftConstants, options: Options) -> Spectra:
    """Transforms of both equations; nothing is checked."""
    observation = observe(batch, constants, options)
    signals, dt_s = observation.signals, observation.dt_s
    signals = signals - signals.mean(axis=2, keepdims=True)
    rate, added = signals[:, Q], np.zeros_like(signals[:, Q])
    if observation.left.shape[0] > 0:
        rate, added = observation.left[:, 1], observation.left[:, 3]
    samples = signals.shape[2]
    whole = transform(signals, dt_s)
    omega = 2.0 * np.pi * np.arange(whole.shape[2]) / ((samples - 1) * dt_s)
    # alpha_dot and q_dot have the corners of the elevator, so that its integral must be exact;
    # the normal force follows sample by sample
    bend = servo_bend(observation.signals[:, ELEVATOR], declared_decay=decay_of(batch.servo_s, dt_s))
    bend[:, 0] = 2.0 * bend[:, -1]  # a cell belongs to the sample at its end, and the record is folded
    elevator = whole[:, ELEVATOR] + transform(bend, dt_s) * np.exp(0.5j * omega * dt_s)
    slope = 1j * omega * transform(rate, dt_s) + (rate[:, -1] - rate[:, 0])[:, None]
    left = slope + transform(added, dt_s)
    floor = np.abs(whole[:, ALPHA, int(FLOOR_FROM * whole.shape[2]) :]) ** 2
    return Spectra(
        normal=np.stack([whole[:, ALPHA], whole[:, Q], whole[:, ELEVATOR], whole[:, AZ]], axis=1),
        moment=np.stack([whole[:, ALPHA], whole[:, Q], elevator, left], axis=1),
        omega=omega,
        alpha_floor=floor.mean(axis=1),
        rate_hz=1.0 / dt_s,
        factors=observation.factors,
        scale=observation.scale,
        elevator=observation.signals[:, ELEVATOR]
        - origin_of(observation.signals, observation.window)[:, ELEVATOR, None],
    )


def band_of(data: Spectra, theta: Array, options: Options) -> Ints:
    """Indices of the first frequency of each run's band and of the one after its last, (runs, 2).

    The band extends from `LOWEST` times the short period's frequency (of theta, by least squares) to the
    frequency at which alpha comes within `CLEAR` of its noise floor, at least `SURE` and at most `HIGHEST`
    times the short period's frequency; or it is ``options.band_hz``. The constant and the upper third of the
    spectrum are left out, and a band has at least as many frequencies as parameters.

    Parameters
    ----------
    data : transforms; theta : (runs, 6); options : choices.
    """
    hz = data.omega / (2.0 * np.pi)
    runs, last = theta.shape[0], int(TOP * data.omega.size + 1e-9)
    least = 3 + FREE
    if options.band_hz is not None:
        first = max(1, int(np.searchsorted(hz, options.band_hz[0] * (1.0 - 1e-9))))
        end = min(last, int(np.searchsorted(hz, options.band_hz[1] * (1.0 + 1e-9))))
        return np.tile([first, max(end, first)], (runs, 1)).astype(np.int64)
    f = data.factors
    lift, moment, half = f[:, LIFT], f[:, MOMENT], f[:, HALF_CHORD]
    det = lift * theta[:, CL_ALPHA] * moment * half * theta[:, CM_Q]
    det -= (1.0 + lift * half * theta[:, CL_Q]) * moment * theta[:, CM_ALPHA]
    own_hz = np.sqrt(np.abs(det)) / (2.0 * np.pi)
    power = np.abs(data.normal[:, ALPHA]) ** 2
    mean = power.copy()
    mean[:, 1:-1] = (power[:, :-2] + power[:, 1:-1] + power[:, 2:]) / 3.0
    band = np.empty((runs, 2), dtype=np.int64)
    for r in range(runs):
        # a poor least-squares start must not leave the record without a band
        own = min(max(float(np.nan_to_num(own_hz[r])), 2.0 * hz[1]), hz[last] / SURE)
        low, sure, high = np.searchsorted(hz, [LOWEST * own, SURE * own, HIGHEST * own])
        band[r, 0] = max(1, low)
        end = max(int(sure), int(band[r, 0]) + least)
        while end < min(high, last) and mean[r, end] > CLEAR * data.alpha_floor[r]:
            end += 1
        band[r, 1] = min(end, last)
    return band


def estimate(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Estimate the six derivatives of each run; nothing is checked.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identification.identify_batch`. Cutoff and order affect the start
        alone, trim has no effect, and any covariance but "none" is the method's own.

    Raises
    ------
    ConfigurationError
        If ``options.band_hz`` holds too few frequencies of a record.
    """
    options = measured_unless_given(options)
    thetas, covariances, scales = [], [], []
    for part in chunks(batch):
        data, theta, covariance = solved_part(part, constants, options)
        thetas.append(theta)
        covariances.append(covariance)
        scales.append(data.scale)
    return _estimates(
        np.concatenate(thetas), np.concatenate(covariances), batch.run_ids, joined(scales), options
    )


def estimate_joint(parts: Sequence[Batch], constants: OneOrEach, options: Options) -> Estimates:
    """One estimate for all runs: normal equations summed, each over its own noise variance.

    Parameters
    ----------
    parts : batches; lengths and rates may differ.
    constants, options : as in `estimate`.

    Raises
    ------
    ConfigurationError
        As `estimate`.
    """
    options = measured_unless_given(options)
    data, theta, covariance = solved_together(parts, constants, options)
    return _estimates(theta, covariance, (JOINT,), mean_scale([d.scale for d in data]), options)


def checked_band(data: Spectra, theta: Array, options: Options) -> Ints:
    """`band_of`, refused where it holds too few frequencies.

    Raises
    ------
    ConfigurationError
        If ``options.band_hz`` holds too few frequencies of a record.
    """
    band = band_of(data, theta, options)
    count = int((band[:, 1] - band[:, 0]).min())
    if options.band_hz is not None and count < 3 + FREE:
        record_s = 2.0 * np.pi / data.omega[1]
        raise ConfigurationError(
            f"option band_hz = {options.band_hz}: a record of {record_s:.3g} s at {data.rate_hz:.4g} Hz has "
            f"{count} frequencies in it, a multiple of {1.0 / record_s:.3g} Hz each, and {3 + FREE} are "
            "needed; widen the band"
        )
    return band


def solved_part(part: Batch, constants: AircraftConstants, options: Options) -> tuple[Spectra, Array, Array]:
    """Transforms of a chunk, theta (runs, 6) of each run and its covariance (runs, 6, 6); see `estimate`."""
    data = spectra(part, constants, options)
    start = regress_batch(part, constants, "ls", None, replace(options, covariance="none")).theta
    return data, *_solved([data], [checked_band(data, start, options)], start, joint=False)


def solved_together(
    parts: Sequence[Batch], constants: OneOrEach, options: Options
) -> tuple[list[Spectra], Array, Array]:
    """Transforms of all chunks, theta (1, 6) of all runs and its covariance (1, 6, 6); see `estimate_joint`."""
    data = [
        spectra(part, own, options) for batch, own in each_batch(parts, constants) for part in chunks(batch)
    ]
    start = regress_joint(parts, constants, "ls", None, replace(options, covariance="none")).theta
    bands = [checked_band(d, np.repeat(start, d.factors.shape[0], axis=0), options) for d in data]
    return data, *_solved(data, bands, start, joint=True)


def _solved(data: Sequence[Spectra], bands: Sequence[Ints], theta: Array, joint: bool) -> tuple[Array, Array]:
    """Weighted least squares of both equations: theta (runs, 6) and its covariance (runs, 6, 6).

    Parameters
    ----------
    data : transforms; bands : of each, from `band_of`; theta : (runs, 6), or (1, 6) if joint, start.
    joint : whether all runs share one theta.
    """
    for _ in range(PASSES):
        parts = []
        first = 0
        for d, band in zip(data, bands, strict=True):
            runs = d.factors.shape[0]
            own = np.repeat(theta, runs, axis=0) if joint else theta[first : first + runs]
            sums = np.empty((runs, 2, 3, 4))
            sums_of(d.normal, d.moment, d.factors, np.nan_to_num(own), band, d.omega, sums)
            parts.append(sums)
            first += runs
        whole = np.concatenate(parts)
        if joint:
            whole = whole.sum(axis=0, keepdims=True)
        theta = solve(whole[..., :3], whole[..., 3])
    information = np.zeros((theta.shape[0], 6, 6))
    information[:, :3, :3], information[:, 3:, 3:] = whole[:, 0, :, :3], whole[:, 1, :, :3]
    return theta, sandwich((information, information))


def _estimates(
    theta: Array, covariance: Array, run_ids: tuple[str, ...], scale: Scale, options: Options
) -> Estimates:
    known = np.asarray(np.isfinite(theta).all(axis=1))
    none = options.covariance == "none"
    return Estimates(
        method=NAME,
        run_ids=run_ids,
        theta=np.where(known[:, None], theta, np.nan),
        covariance=np.full_like(covariance, np.nan) if none else covariance,
        covariance_name="none" if none else "complex least squares",
        status=np.where(known, Status.CONVERGED, Status.SINGULAR).astype(np.int8),
        iterations=np.full(theta.shape[0], PASSES, dtype=np.int32),
        scale=scale,
        confidence=options.confidence,
    )
