"""Refined instrumental variables: whitened equations, instruments that know the gusts.

Two of the three equations of M. Brunot, "An Instrumental Variable Approach for Aircraft Identification",
eq. (4), are kept, each with a filter, instruments and a whitening of its own:

    moment   F (q' = moment p Cm), F = 1/(p + moment |Cmq| c/2V): instruments alpha as measured and q as
             alpha and elevator move it by this very equation
    normal   az/p = -normal CL, unfiltered: instruments low-passed alpha and the same q

The vane feels what the wing feels, gusts included, so that alpha instruments use the motion that gusts
cause; the vane's own noise is small. The equation of alpha_dot has the weight zero: where the others hold it
reads alpha_dot - q = (az + g)/V + w_dot/V, in which no parameter is left, and the gust's w_dot is correlated
with these instruments. Where the pressure is the measured one, the equations are
those of `airtruth.identify.pressure`.

Whitening: noise of vane and surface enters the moment equation and leaves through its pole, beside that of
the gyro; the share of the two is chosen by restricted likelihood. What colour is left, and that of the normal
force, is taken by an autoregressive model (`airtruth.identify.whiten`), per run and equation. Both are found
in each of the first `SETTLING` iterations and then kept, or a run between two orders would never converge.
The whitened equations are P. C. Young's refined instrumental variables ("Recursive Estimation and Time-Series
Analysis", 2011, ch. 7). Their covariance is B^-1 M B^-T with B = Z'X and M = Z'Z of the whitened columns over
the variance of the whitened residuals.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError
from airtruth.identify.condition import AircraftConstants, observe, ratios_of
from airtruth.identify.covariance import sandwich
from airtruth.identify.intersample import servo_bend
from airtruth.identify.iterate import Outcome, repeat
from airtruth.identify.normal import solve
from airtruth.identify.options import Options
from airtruth.identify.pressure import measured_unless_given
from airtruth.identify.problem import origin_of
from airtruth.identify.refined_kernel import whitened_sums
from airtruth.identify.regression import chunks, joined, mean_scale, regress_batch, regress_joint
from airtruth.identify.results import JOINT, Estimates, Status
from airtruth.identify.whiten import LARGEST_ORDER
from airtruth.logs.flight_log import Batch
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NAME: Final = "iv-refined"
SETTLING: Final = 8


@dataclass(frozen=True)
class Record:
    """Runs of one length as the kernel reads them, see `airtruth.identify.refined_kernel.whitened_sums`.

    The kernel writes the whitening of each run and equation, ``colour``.
    """

    signals: Array
    smooth: Array
    bend: Array
    v: Array
    p: Array
    factors: Array
    dt_s: float
    scale: Scale
    colour: Array


def records(batch: Batch, constants: AircraftConstants, options: Options) -> Record:
    """Signals as deviations, and the ratios of airspeed and pressure; nothing is checked."""
    observation = observe(batch, constants, replace(options, pressure="constant"))
    signals = observation.signals
    v = p = np.ones_like(signals[:, 0])
    if options.pressure == "measured":
        v, p = ratios_of(batch, constants, observation.scale)
    signals[:, 2] /= p
    smooth = observation.smooth[:, 0] - origin_of(observation.smooth[:, 0], observation.window)[:, None]
    return Record(
        signals=signals - origin_of(signals, observation.window)[:, :, None],
        smooth=smooth,
        bend=servo_bend(signals[:, 3]),
        v=v,
        p=p,
        factors=observation.factors,
        dt_s=batch.dt_s,
        scale=observation.scale,
        colour=np.zeros((signals.shape[0], 2, 2 + LARGEST_ORDER)),
    )


def estimate(batch: Batch, constants: AircraftConstants, options: Options) -> Estimates:
    """Estimate the six derivatives of each run; nothing is checked.

    Parameters
    ----------
    batch, constants, options : as in `airtruth.identify.identify_batch`. Of the options, cutoff and order
        serve the start and the instrument alpha alone, and any covariance but "none" is the method's own.

    Raises
    ------
    ConfigurationError
        If an auxiliary model is passed in, which would not be used.
    """
    options = _settled(options)
    outcomes, covariances, scales = [], [], []
    for part in chunks(batch):
        data = records(part, constants, options)
        start = regress_batch(part, constants, "ls", None, replace(options, covariance="none"))
        outcome = _solved([data], start.theta, options, joint=False)
        outcomes.append(outcome)
        scales.append(data.scale)
        covariances.append(_covariance([data], outcome, options, joint=False))
    return Estimates(
        method=NAME,
        run_ids=batch.run_ids,
        theta=np.concatenate([o.theta for o in outcomes]),
        covariance=np.concatenate(covariances),
        covariance_name=_covariance_name(options),
        status=np.concatenate([o.status for o in outcomes]),
        iterations=np.concatenate([o.iterations for o in outcomes]),
        scale=joined(scales),
        confidence=options.confidence,
    )


def estimate_joint(parts: Sequence[Batch], constants: AircraftConstants, options: Options) -> Estimates:
    """One estimate for all runs: whitened normal equations summed, each over its own noise variance.

    Parameters
    ----------
    parts : batches; lengths and rates may differ. Constants, starts and whitening stay each run's own.
    constants, options : as in `estimate`.

    Raises
    ------
    ConfigurationError
        As `estimate`.
    """
    options = _settled(options)
    data = [records(part, constants, options) for batch in parts for part in chunks(batch)]
    start = regress_joint(parts, constants, "ls", None, replace(options, covariance="none"))
    outcome = _solved(data, start.theta, options, joint=True)
    return Estimates(
        method=NAME,
        run_ids=(JOINT,),
        theta=outcome.theta,
        covariance=_covariance(data, outcome, options, joint=True),
        covariance_name=_covariance_name(options),
        status=outcome.status,
        iterations=outcome.iterations,
        scale=mean_scale([d.scale for d in data]),
        confidence=options.confidence,
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


def _sums(data: Sequence[Record], theta: Array, active: Ints, options: Options, settled: bool) -> Array:
    """(active, 2, 3, 7), see `whitened_sums`; all runs where there are several records."""
    result = []
    first = 0
    for d in data:
        last = first + d.factors.shape[0]
        mine = (active >= first) & (active < last)
        sums = np.empty((int(mine.sum()), 2, 3, 7))
        whitened_sums(
            d.signals,
            d.smooth,
            d.bend,
            d.v,
            d.p,
            d.factors,
            np.ascontiguousarray(theta[mine]),
            active[mine] - first,
            options.trim == "intercept",
            d.dt_s,
            settled,
            d.colour,
            sums,
        )
        result.append(sums)
        first = last
    return np.concatenate(result)


def _solved(data: Sequence[Record], start: Array, options: Options, joint: bool) -> Outcome:
    runs = sum(d.factors.shape[0] for d in data)
    iteration = itertools.count()

    def step(theta: Array, active: Ints) -> Array:
        sums = _sums(data, theta, active, options, settled=next(iteration) >= SETTLING)
        if joint:
            sums = sums.sum(axis=0, keepdims=True)
        return solve(np.ascontiguousarray(sums[:, :, :, :3]), np.ascontiguousarray(sums[:, :, :, 3]))

    def usable(theta: Array, active: Ints) -> Bools:
        return np.ones(active.size, dtype=np.bool_)

    none_failed = np.zeros(runs, dtype=np.bool_)
    return repeat(
        step, usable, none_failed, start, runs, options.tolerance, options.maximum_iterations, joint
    )


def _covariance(data: Sequence[Record], outcome: Outcome, options: Options, joint: bool) -> Array:
    covariance = np.full((outcome.theta.shape[0], 6, 6), np.nan)
    known = np.flatnonzero(np.isin(outcome.status, (Status.CONVERGED, Status.MAXIMUM_ITERATIONS)))
    if options.covariance == "none" or known.size == 0:
        return covariance
    active = np.arange(sum(d.factors.shape[0] for d in data)) if joint else known
    theta = np.broadcast_to(outcome.theta, (active.size, 6)) if joint else outcome.theta[known]
    sums = _sums(data, theta, active, options, settled=True)
    bread, meat = np.zeros((active.size, 6, 6)), np.zeros((active.size, 6, 6))
    for block in range(2):
        at = slice(3 * block, 3 * block + 3)
        bread[:, at, at], meat[:, at, at] = sums[:, block, :, :3], sums[:, block, :, 4:]
    if joint:
        bread, meat = bread.sum(axis=0, keepdims=True), meat.sum(axis=0, keepdims=True)
    covariance[known] = sandwich((bread, meat))
    return covariance
