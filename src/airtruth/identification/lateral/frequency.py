"""Equation error of the lateral-directional motion in the frequency domain, in the band of its modes.

Transforms of the regression of `airtruth.identification.lateral.observation`,

    j w Y1 + [y1]_0^T + Y2 = Theta X,   X(w) = int_0^T x(t) exp(-j w t) dt,   w = 2 pi k/T,

in which a constant has no part. An error at the ends of the record is a constant over w and a linear trend is j/w: free
columns of each equation. The residuals are complex and independent from one frequency to the next, so that ordinary
covariances hold where their spectrum is flat over the band.

Source: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 7.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError
from airtruth.identification.estimates import JOINT, AnyScale, Estimates, Status, joined, mean_scale
from airtruth.identification.lateral.observation import CONTROLS, LateralObservation, observe
from airtruth.identification.lateral.solve import regress_batch, regress_joint, solution
from airtruth.identification.options import Options
from airtruth.identification.record_constants import LateralValues
from airtruth.identification.regression.frequency import transform
from airtruth.identification.regression.solve import chunks
from airtruth.logs.flight_log import Batch
from airtruth.physics.lateral import lateral_modal
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Bools = NDArray[np.bool_]

NAME: Final = "frequency"
"""Name of the method."""
LOWEST: Final = 0.15
"""Lower end of the band over the frequency of the Dutch roll [-]; judgement: below it gusts and drift dominate."""
HIGHEST: Final = 2.5
"""Upper end of the band over the frequency of the Dutch roll [-]; judgement: above it the surfaces still move and the
accelerations are within the noise of differences."""
_WN_RAD_S: Final = 2.0
"""Frequency in place of that of a Dutch roll which least squares does not find [rad/s]; judgement."""
_FREE: Final = 3
"""Free columns of each equation: a complex constant, and j/w."""
_COUNT: Final = len(LATERAL.parameters)
"""Number of derivatives."""


def spectra(o: LateralObservation) -> tuple[Complex, Complex, Complex, Array]:
    """Transforms (runs, ..., frequencies) of regressors, left sides and nonlinear terms; and w [rad/s]."""
    samples = o.regressors.shape[2]

    def centred(x: Array) -> Array:
        return np.asarray(x - x.mean(axis=2, keepdims=True))

    x = transform(centred(o.regressors), o.dt_s)
    omega = 2.0 * np.pi * np.arange(x.shape[2]) / ((samples - 1) * o.dt_s)
    bend = o.bend.copy()
    bend[..., 0] = 2.0 * bend[..., -1]  # a cell belongs to the sample at its end, and the record is folded
    x[:, -len(CONTROLS) :] += transform(bend, o.dt_s) * np.exp(0.5j * omega * o.dt_s)
    ends = o.slopes[..., -1:] - o.slopes[..., :1]
    y = 1j * omega * transform(o.slopes, o.dt_s) + ends + transform(centred(o.added), o.dt_s)
    return x, y, transform(centred(o.terms), o.dt_s), omega


def band_of(wn_rad_s: Array, omega: Array, options: Options) -> Bools:
    """(runs, frequencies) frequencies of the band of each run.

    Raises
    ------
    ConfigurationError
        If ``options.band_hz`` holds too few frequencies of a record.
    """
    wn = np.where(np.isfinite(wn_rad_s), wn_rad_s, _WN_RAD_S)
    low, high = LOWEST * wn, HIGHEST * wn
    if options.band_hz is not None:
        low, high = (np.full_like(wn, 2.0 * np.pi * hz) for hz in options.band_hz)
    band = (omega > 0.0) & (omega >= low[:, None]) & (omega <= high[:, None])
    needed = len(LATERAL.signals) + _FREE
    fewest = int(band.sum(axis=1).min())
    if options.band_hz is not None and fewest < needed:
        raise ConfigurationError(
            f"option band_hz = {options.band_hz}: a record of {2.0 * np.pi / omega[1]:.3g} s has {fewest} frequencies in it, and "
            f"{needed} are needed; widen the band"
        )
    return np.asarray(band)


def _products(
    x: Complex, y: Complex, terms: Complex, omega: Array, band: Bools
) -> tuple[Array, Array, Array]:
    """X'X (runs, 5, 5), X'Y (runs, 5, 3) and Y'Y (runs, 3, 3) without the free columns, real parts over the band."""
    runs, width, count = x.shape
    w = np.where(omega > 0.0, omega, 1.0)
    ends = np.stack([np.ones(count), 1j * np.ones(count), 1j / w * w[min(1, count - 1)]])
    both = (
        np.concatenate([x, y, terms, np.broadcast_to(ends, (runs, _FREE, count))], axis=1) * band[:, None, :]
    )
    rows = np.concatenate([both.real, both.imag], axis=2)
    left_sides = width + y.shape[1]
    basis = np.linalg.qr(np.swapaxes(rows[:, left_sides:], 1, 2))[0]
    rows = rows[:, :left_sides]
    rows = rows - np.matmul(np.matmul(rows, basis), np.swapaxes(basis, 1, 2))
    own, left = rows[:, :width], rows[:, width:]
    right = np.swapaxes(left, 1, 2)
    return np.matmul(own, np.swapaxes(own, 1, 2)), np.matmul(own, right), np.matmul(left, right)


def _solved(parts: Sequence[tuple[Array, Array, Array]], degrees: Array) -> tuple[Array, Array]:
    """theta (runs, 15) and covariance of sums of products with the residuals' degrees of freedom (runs,)."""
    matrix, right, square = parts[0]
    theta = solution(matrix, right)
    table = theta.reshape(len(theta), *LATERAL.shape)
    residual = square - table @ right
    covariance = np.full((len(theta), _COUNT, _COUNT), np.nan)
    known = np.flatnonzero(np.isfinite(theta).all(axis=1) & (degrees > 0))
    inverse = np.linalg.inv(matrix[known])
    spread = residual[known] / degrees[known, None, None]
    made = np.einsum("rij,rab->riajb", spread, inverse)
    covariance[known] = made.reshape(-1, _COUNT, _COUNT)
    return theta, covariance


def _degrees(band: Bools, terms: Complex) -> Array:
    return np.asarray(2.0 * band.sum(axis=1) - _FREE - terms.shape[1])


def estimate(batch: Batch, constants: LateralValues, options: Options) -> Estimates:
    """Estimate the derivatives of each run; nothing is checked.

    Raises
    ------
    ConfigurationError
        As `band_of`.
    """
    thetas, covariances, scales = [], [], []
    for part in chunks(batch):
        o = observe(part, constants, options)
        start = regress_batch(part, constants, "ls", None, _quick(options))
        x, y, terms, omega = spectra(o)
        band = band_of(lateral_modal(start.theta, o.scale)[:, 0], omega, options)
        degrees = _degrees(band, terms) - len(LATERAL.signals)
        theta, covariance = _solved([_products(x, y, terms, omega, band)], degrees)
        thetas.append(theta)
        covariances.append(covariance)
        scales.append(o.scale)
    return _estimates(
        np.concatenate(thetas), np.concatenate(covariances), batch.run_ids, joined(scales), options
    )


def estimate_joint(parts: Sequence[Batch], constants: Sequence[LateralValues], options: Options) -> Estimates:
    """One estimate for all runs: their normal equations are summed.

    Raises
    ------
    ConfigurationError
        As `band_of`.
    """
    start = regress_joint(parts, constants, "ls", None, _quick(options))
    wn = lateral_modal(start.theta, start.scale)[:, 0]  # type: ignore[arg-type]
    sums: list[list[Array]] = []
    scales, degrees = [], -float(len(LATERAL.signals))
    for batch, own in zip(parts, constants, strict=True):
        for part in chunks(batch):
            o = observe(part, own, options)
            x, y, terms, omega = spectra(o)
            band = band_of(np.repeat(wn, len(x)), omega, options)
            degrees += float(_degrees(band, terms).sum())
            sums.append([p.sum(axis=0) for p in _products(x, y, terms, omega, band)])
            scales.append(o.scale)
    matrix, right, square = (np.sum([s[k] for s in sums], axis=0)[None] for k in range(3))
    theta, covariance = _solved([(matrix, right, square)], np.array([degrees]))
    return _estimates(theta, covariance, (JOINT,), mean_scale(scales), options)


def _quick(options: Options) -> Options:
    return replace(options, covariance="none")


def _estimates(
    theta: Array, covariance: Array, run_ids: tuple[str, ...], scale: AnyScale, options: Options
) -> Estimates:
    known = np.isfinite(theta).all(axis=1)
    none = options.covariance == "none"
    return Estimates(
        method=NAME,
        run_ids=run_ids,
        theta=theta,
        covariance=np.full_like(covariance, np.nan) if none else covariance,
        covariance_name="none" if none else "complex least squares",
        status=np.where(known, Status.CONVERGED, Status.SINGULAR).astype(np.int8),
        iterations=np.ones(len(theta), dtype=np.int32),
        scale=scale,
        confidence=options.confidence,
        motion=LATERAL,
    )


__all__ = ["estimate", "estimate_joint"]
