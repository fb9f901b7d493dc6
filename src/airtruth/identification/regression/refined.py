"""Refined instrumental variables: whitened equations, instruments that include the motion in gusts.

Two of the three equations of M. Brunot, "An Instrumental Variable Approach for Aircraft Identification",
eq. (4), are used, each with a filter, instruments and a whitening of its own:

    moment   F (q' = moment p Cm), F = 1/(p + moment |Cmq| c/2V): instruments alpha as measured and q as
             alpha and elevator move it by this very equation
    normal   az/p = -normal CL, unfiltered: instruments low-passed alpha and the same q

The vane measures the gusts that act on the wing, so that alpha instruments use the motion that gusts cause;
the vane's own noise is small. The equation of alpha_dot has the weight zero: where the others hold it reads
alpha_dot - q = (az + g)/V + w_dot/V, which contains no parameter, and the gust's w_dot is correlated with
these instruments. At measured dynamic pressure the equations are those of
`airtruth.identification.condition`.

Whitening: noise of vane and surface enters the moment equation and leaves through its pole, together with the
gyro's own noise. Restricted likelihood chooses the ratio of the two. An autoregressive model
(`airtruth.identification.regression.refined_kernel`) whitens the remaining colour, and that of the normal force,
per run and equation. Both are chosen in each of the first `SETTLING` iterations and then kept, so that a run
between two orders converges. The whitened equations are P. C. Young's refined instrumental variables
("Recursive Estimation and Time-Series Analysis", 2011, ch. 7). Their covariance is B^-1 M B^-T with B = Z'X and
M = Z'Z of the whitened columns over the variance of the whitened residuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError
from airtruth.identification.condition import (
    AircraftConstants,
    OneOrEach,
    each_batch,
    measured_unless_given,
    observe,
    origin_of,
    ratios_of,
)
from airtruth.identification.estimates import JOINT, Estimates, Status, joined, mean_scale
from airtruth.identification.options import Options
from airtruth.identification.regression.covariance import sandwich
from airtruth.identification.regression.iterate import IterationOutcome, repeat
from airtruth.identification.regression.refined_kernel import WHITENING, RefinedRun, record_sums
from airtruth.identification.regression.rows import solve
from airtruth.identification.regression.solve import assembled, chunks, regress_batch, regress_joint
from airtruth.identification.signals import ALPHA, AZ, ELEVATOR, Q
from airtruth.logs.flight_log import Batch
from airtruth.numerics.intersample import decay_of, servo_bend
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NAME: Final = "iv-refined"
"""Name of the method."""
SETTLING: Final = 8
"""Iterations that choose the whitening again [-]; judgement, three times the usual number to convergence."""


@dataclass(frozen=True)
class RefinedRecords:
    """Runs as the kernel reads them, and the factors (runs,) of their flight conditions."""

    runs: tuple[RefinedRun, ...]
    scale: Scale


def records(batch: Batch, constants: AircraftConstants, options: Options) -> RefinedRecords:
    """Signals as deviations, and the ratios of airspeed and pressure; nothing is checked."""
    observation = observe(batch, constants, replace(options, pressure="constant"))
    signals = observation.signals
    v = p = np.ones_like(signals[:, Q])
    if options.pressure == "measured":
        v, p = ratios_of(batch, constants, observation.scale)
    signals[:, AZ] /= p
    smooth = (
        observation.smooth[:, ALPHA] - origin_of(observation.smooth[:, ALPHA], observation.window)[:, None]
    )
    bend = servo_bend(signals[:, ELEVATOR], declared_decay=decay_of(batch.servo_s, batch.dt_s))
    signals = signals - origin_of(signals, observation.window)[:, :, None]
    known = np.zeros_like(v) if batch.known_rates is None else batch.known_rates[1]
    runs = tuple(
        RefinedRun(signals[r], smooth[r], bend[r], v[r], p[r], observation.factors[r], batch.dt_s, known[r])
        for r in range(signals.shape[0])
    )
    return RefinedRecords(runs, observation.scale)


def estimate(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Estimate the six derivatives of each run; nothing is checked.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identification.identify_batch`. Cutoff and order affect the
        start and the instrument alpha alone, and any covariance but "none" is the method's own.

    Raises
    ------
    ConfigurationError
        If the options hold an auxiliary model, which would not be used.
    """
    options = _settled(options)
    outcomes, covariances, scales = [], [], []
    for part in chunks(batch):
        data = records(part, constants, options)
        start = regress_batch(part, constants, "ls", None, replace(options, covariance="none"))
        outcome, whitening = _solved(data.runs, start.theta, options, joint=False)
        outcomes.append(outcome)
        scales.append(data.scale)
        covariances.append(_covariance(data.runs, outcome, whitening, options, joint=False))
    return assembled(
        NAME, batch.run_ids, outcomes, covariances, joined(scales), _covariance_name(options), options
    )


def estimate_joint(parts: Sequence[Batch], constants: OneOrEach, options: Options) -> Estimates:
    """One estimate for all runs: whitened normal equations summed, each over its own noise variance.

    Parameters
    ----------
    parts : batches; lengths and rates may differ. Constants, starts and whitening remain each run's own.
    constants, options : as in `estimate`.

    Raises
    ------
    ConfigurationError
        As `estimate`.
    """
    options = _settled(options)
    data = [
        records(part, own, options) for batch, own in each_batch(parts, constants) for part in chunks(batch)
    ]
    runs = [run for d in data for run in d.runs]
    start = regress_joint(parts, constants, "ls", None, replace(options, covariance="none"))
    outcome, whitening = _solved(runs, start.theta, options, joint=True)
    return assembled(
        NAME,
        (JOINT,),
        [outcome],
        [_covariance(runs, outcome, whitening, options, joint=True)],
        mean_scale([d.scale for d in data]),
        _covariance_name(options),
        options,
    )


def _settled(options: Options) -> Options:
    if options.auxiliary is not None:
        raise ConfigurationError(
            f"method {NAME} makes its instruments from measured alpha and elevator and uses no auxiliary "
            "model: leave the option auxiliary out, or use iv-f1"
        )
    return measured_unless_given(options)


def _covariance_name(options: Options) -> str:
    return options.covariance if options.covariance == "none" else "whitened"


def _sums(
    runs: Sequence[RefinedRun], theta: Array, active: Ints, options: Options, settled: bool, whitening: Array
) -> Array:
    """Sums (active, 2, 3, 7) of the active runs, see `record_sums`; writes ``whitening`` unless settled."""
    sums = np.empty((active.size, 2, 3, 7))
    intercept = options.trim == "intercept"
    for i, run in enumerate(active):
        record_sums(runs[run], theta[i].copy(), intercept, settled, whitening[run], sums[i])
    return sums


def _solved(
    runs: Sequence[RefinedRun], start: Array, options: Options, joint: bool
) -> tuple[IterationOutcome, Array]:
    """Iterate to the fixed point; the outcome and the whitening (runs, 2, WHITENING) at its end."""
    whitening = np.zeros((len(runs), 2, WHITENING))

    def step(theta: Array, active: Ints, iteration: int) -> Array:
        sums = _sums(runs, theta, active, options, iteration >= SETTLING, whitening)
        if joint:
            sums = sums.sum(axis=0, keepdims=True)
        return solve(sums[:, :, :, :3], sums[:, :, :, 3])

    def usable(theta: Array, active: Ints) -> Bools:
        return np.ones(active.size, dtype=np.bool_)

    none_failed = np.zeros(len(runs), dtype=np.bool_)
    tolerance, limit = options.tolerance, options.maximum_iterations
    return repeat(step, usable, none_failed, start, len(runs), tolerance, limit, joint), whitening


def _covariance(
    runs: Sequence[RefinedRun], outcome: IterationOutcome, whitening: Array, options: Options, joint: bool
) -> Array:
    covariance = np.full((outcome.theta.shape[0], 6, 6), np.nan)
    known = np.flatnonzero(np.isin(outcome.status, (Status.CONVERGED, Status.MAXIMUM_ITERATIONS)))
    if options.covariance == "none" or known.size == 0:
        return covariance
    active = np.arange(len(runs)) if joint else known
    theta = np.broadcast_to(outcome.theta, (active.size, 6)) if joint else outcome.theta[known]
    sums = _sums(runs, theta, active, options, True, whitening)
    bread, meat = np.zeros((active.size, 6, 6)), np.zeros((active.size, 6, 6))
    for block in range(2):
        at = slice(3 * block, 3 * block + 3)
        bread[:, at, at], meat[:, at, at] = sums[:, block, :, :3], sums[:, block, :, 4:]
    if joint:
        bread, meat = bread.sum(axis=0, keepdims=True), meat.sum(axis=0, keepdims=True)
    covariance[known] = sandwich((bread, meat))
    return covariance
