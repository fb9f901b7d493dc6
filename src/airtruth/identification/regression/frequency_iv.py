"""Instrumental variables in the frequency domain: the regression of `frequency` with noise-free instruments.

Sources: R. Larsson and M. Enqvist, "Sequential Aerodynamic Model Parameter Identification", IFAC SYSID 2012, for
instruments in the frequency domain; M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eq. (9)
and III.B, for the instruments: the auxiliary model that the last estimate makes, driven by the measured elevator.

    theta_i = (sum_w Re[Z(w)^H W X(w)])^-1 sum_w Re[Z(w)^H W Y(w)]

Band, weights and nuisance columns are those of `airtruth.identification.regression.frequency`; the colour of the noise
is that of the residual at the last estimate. Larsson and Enqvist update the sums with each sample; here a record is
transformed as a whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import AircraftConstants, OneOrEach, measured_unless_given
from airtruth.identification.estimates import JOINT, Estimates, Status, joined, mean_scale
from airtruth.identification.options import Options
from airtruth.identification.regression.auxiliary import bounded, linear_auxiliary
from airtruth.identification.regression.covariance import sandwich
from airtruth.identification.regression.frequency import (
    Spectra,
    checked_band,
    solved_part,
    solved_together,
    transform,
)
from airtruth.identification.regression.frequency_kernel import instrumented_sums
from airtruth.identification.regression.iterate import IterationOutcome, repeat
from airtruth.identification.regression.rows import made_by, solve
from airtruth.identification.regression.solve import assembled, chunks
from airtruth.logs.flight_log import Batch
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NAME: Final = "iv-frequency"
"""Name of the method."""


class _Regression:
    """Sums of one set of transforms with the instruments that theta makes."""

    def __init__(self, data: Spectra, start: Array, options: Options) -> None:
        self.data = data
        self.options = options
        runs = data.factors.shape[0]
        self.start = np.repeat(start, runs, axis=0) if start.shape[0] != runs else start
        self.band = checked_band(data, self.start, options)

    @property
    def duration_s(self) -> float:
        """Length of the records [s]."""
        return float(self.data.elevator.shape[1] / self.data.rate_hz)

    def sums(self, theta: Array, active: Ints) -> Array:
        """(active, 2, 3, 7), see `airtruth.identification.regression.frequency_kernel.instrumented_sums`."""
        data, dt_s = self.data, 1.0 / self.data.rate_hz
        u = np.ascontiguousarray(data.elevator[active])
        if self.options.auxiliary is None:
            scale = Scale(*(getattr(data.scale, name)[active] for name in Scale.__dataclass_fields__))
            alpha, q = linear_auxiliary(np.ascontiguousarray(theta), u, dt_s, scale)
        else:
            made = made_by(self.options.auxiliary, theta, u, dt_s, data.scale, active)
            alpha, q = made[:, 0], made[:, 1]
        motion = np.stack([alpha, q], axis=1)
        instruments = transform(motion - motion.mean(axis=2, keepdims=True), dt_s)
        sums = np.empty((active.size, 2, 3, 7))
        instrumented_sums(
            instruments,
            data.normal[active],
            data.moment[active],
            data.factors[active],
            np.ascontiguousarray(theta),
            self.band[active],
            data.omega,
            sums,
        )
        return sums

    def usable(self, theta: Array, active: Ints) -> Bools:
        """Whether the auxiliary model of each active run stays bounded over the record."""
        return bounded(theta, self.data.factors[active], self.duration_s)


def estimate(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Estimate the six derivatives of each run from the estimates of `frequency`; nothing is checked.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identification.identify_batch`. Cutoff and order affect the start
        alone, and any covariance but "none" is the method's own.

    Raises
    ------
    ConfigurationError
        If ``options.band_hz`` holds too few frequencies of a record.
    """
    options = measured_unless_given(options)
    outcomes, covariances, scales = [], [], []
    for part in chunks(batch):
        data, start, _ = solved_part(part, constants, options)
        regression = _Regression(data, start, options)
        outcome = _iterated([regression], start, options, joint=False)
        outcomes.append(outcome)
        scales.append(data.scale)
        covariances.append(_covariance([regression], outcome, options, joint=False))
    return assembled(
        NAME, batch.run_ids, outcomes, covariances, joined(scales), _covariance_name(options), options
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
    data, start, _ = solved_together(parts, constants, options)
    regressions = [_Regression(d, start, options) for d in data]
    outcome = _iterated(regressions, start, options, joint=True)
    return assembled(
        NAME,
        (JOINT,),
        [outcome],
        [_covariance(regressions, outcome, options, joint=True)],
        mean_scale([d.scale for d in data]),
        _covariance_name(options),
        options,
    )


def _covariance_name(options: Options) -> str:
    return "none" if options.covariance == "none" else "complex instrumental variables"


def _all_sums(regressions: Sequence[_Regression], theta: Array, members: Ints, joint: bool) -> Array:
    if not joint:
        return regressions[0].sums(theta, members)
    parts, first = [], 0
    for r in regressions:
        runs = r.data.factors.shape[0]
        parts.append(r.sums(theta[first : first + runs], np.arange(runs)))
        first += runs
    return np.asarray(np.concatenate(parts).sum(axis=0, keepdims=True))


def _iterated(
    regressions: Sequence[_Regression], start: Array, options: Options, joint: bool
) -> IterationOutcome:
    counts = [r.data.factors.shape[0] for r in regressions]

    def step(theta: Array, members: Ints, iteration: int) -> Array:
        sums = _all_sums(regressions, theta, members, joint)
        return solve(sums[..., :3], sums[..., 3])

    def usable(theta: Array, members: Ints) -> Bools:
        if not joint:
            return regressions[0].usable(theta, members)
        spans = np.split(theta, np.cumsum(counts)[:-1])
        return np.concatenate(
            [r.usable(t, np.arange(n)) for r, t, n in zip(regressions, spans, counts, strict=True)]
        )

    return repeat(
        step,
        usable,
        np.zeros(sum(counts), dtype=np.bool_),
        start,
        sum(counts),
        options.tolerance,
        options.maximum_iterations,
        joint,
    )


def _covariance(
    regressions: Sequence[_Regression], outcome: IterationOutcome, options: Options, joint: bool
) -> Array:
    covariance = np.full((outcome.theta.shape[0], 6, 6), np.nan)
    known = np.flatnonzero(np.isin(outcome.status, (Status.CONVERGED, Status.MAXIMUM_ITERATIONS)))
    if options.covariance == "none" or known.size == 0:
        return covariance
    theta = outcome.theta[known]
    if joint:
        theta = np.repeat(theta, sum(r.data.factors.shape[0] for r in regressions), axis=0)
    sums = _all_sums(regressions, theta, known, joint)
    bread, meat = np.zeros((sums.shape[0], 6, 6)), np.zeros((sums.shape[0], 6, 6))
    for i, span in enumerate((slice(0, 3), slice(3, 6))):
        bread[:, span, span], meat[:, span, span] = sums[:, i, :, :3], sums[:, i, :, 4:]
    covariance[known] = sandwich((bread, meat))
    return covariance


__all__ = ["NAME", "estimate", "estimate_joint"]
