"""Filter error and output error of the lateral-directional motion.

Levels (gust, noise of the outputs, noise of p' and r') are estimated about declared values, as those of the short period
(`airtruth.identification.likelihood.method`). Output biases and initial states are each record's own.

Source: R. E. Maine and K. W. Iliff, "Identification of Dynamic Systems", NASA RP-1138 (1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import AircraftConstants
from airtruth.identification.estimates import JOINT, AnyScale, Estimates, concatenated, mean_scale
from airtruth.identification.lateral.predictor import PROCESS, factor_names, levels, outputs_of, records_of
from airtruth.identification.lateral.solve import regress_batch, regress_joint
from airtruth.identification.likelihood.fit import joint_maximum, maximum_of_each, memory_of
from airtruth.identification.likelihood.method import (
    GUST_LENGTH_M,
    GUST_M_S,
    GUST_PRIOR,
    NOISE_PRIOR,
    RESIDUAL_PRIOR,
    STEPS,
    sensor_noise,
)
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.identification.likelihood.scoring import Maxima, Search
from airtruth.identification.options import Options
from airtruth.identification.record_constants import LateralValues
from airtruth.identification.regression.solve import chunks
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]

PROCESS_NOISE: Final = 0.02
"""Declared noise of p' and r' [rad/s per root second]; judgement: tables of an aircraft cause .01 to .05."""
_COUNT: Final = len(LATERAL.parameters)
"""Number of derivatives."""


def search_of(noise: Array, options: Options, *, gusts: bool) -> Search:
    """Search of the derivatives and levels of groups whose outputs have a declared noise (groups, outputs)."""
    groups, outputs = noise.shape
    declared = np.log(noise)
    prior = np.full(outputs, NOISE_PRIOR if gusts else RESIDUAL_PRIOR)
    if gusts:
        gust, process = np.full((groups, 1), np.log(GUST_M_S)), np.full((groups, 2), np.log(PROCESS_NOISE))
        declared = np.concatenate([gust, declared, process], axis=1)
        prior = np.concatenate([[GUST_PRIOR], prior, np.full(len(PROCESS), GUST_PRIOR)])
    count = _COUNT + len(factor_names(options.terms))
    return Search(
        declared=np.concatenate([np.zeros((groups, count)), declared], axis=1),
        free=np.arange(count + prior.size),
        weight=np.concatenate([np.zeros(count), prior**-2.0]),
        level=slice(count, count + prior.size),
        tolerance=FilterOptions.tolerance,
        maximum_iterations=STEPS * options.maximum_iterations,
        to_prior=True,
    )


def _with_factors(theta: Array, options: Options) -> Array:
    """Start of a search from derivatives (rows, 15): the factors of nonlinear terms, which follow them, start from zero."""
    return np.concatenate([theta, np.zeros((len(theta), len(factor_names(options.terms))))], axis=1)


def _noise(batch: Batch, constants: AircraftConstants) -> Array:
    channels = {output.name: output.channel for output in LATERAL.outputs}
    return sensor_noise(batch, constants, [channels[name] for name in outputs_of(batch)])


def estimate(
    batch: Batch, values: LateralValues, constants: AircraftConstants, options: Options, *, gusts: bool
) -> Estimates:
    """Filter error, or output error without gusts, of each run, started from least squares; nothing is checked.

    Parameters
    ----------
    batch, options : runs, choices.
    values, constants : the aircraft, for its inertias and for its declared noise.
    gusts : whether the air moves.
    """
    parts = []
    for part in chunks(batch):
        start = regress_batch(part, values, "ls", None, replace(options, covariance="none"))
        data = records_of(part, values, options, GUST_LENGTH_M, gusts=gusts)
        search = search_of(_noise(part, constants), options, gusts=gusts)
        maxima = maximum_of_each(data, _with_factors(start.theta, options), search)
        made = _estimates(maxima, part.run_ids, data.scale, options, gusts=gusts)
        parts.append(replace(made, memory=memory_of(data, maxima.z)))
    return concatenated(parts, batch.run_ids)


def estimate_joint(
    parts: Sequence[Batch],
    values: Sequence[LateralValues],
    constants: Sequence[AircraftConstants],
    options: Options,
    *,
    gusts: bool,
) -> Estimates:
    """One estimate for all runs; they share the levels too. See `estimate`."""
    start = regress_joint(parts, values, "ls", None, replace(options, covariance="none"))
    noise = np.concatenate([_noise(part, own) for part, own in zip(parts, constants, strict=True)])
    data = [
        records_of(part, own, options, GUST_LENGTH_M, gusts=gusts)
        for batch, own in zip(parts, values, strict=True)
        for part in chunks(batch)
    ]
    search = search_of(np.median(noise, axis=0, keepdims=True), options, gusts=gusts)
    maxima = joint_maximum(data, _with_factors(start.theta, options)[0], search)
    made = _estimates(maxima, (JOINT,), mean_scale([d.scale for d in data]), options, gusts=gusts)
    each = [memory_of(d, np.repeat(maxima.z, d.signals.y.shape[0], axis=0)) for d in data]
    return replace(made, memory=np.concatenate(each).mean(keepdims=True))


def _estimates(
    maxima: Maxima, run_ids: tuple[str, ...], scale: AnyScale, options: Options, *, gusts: bool
) -> Estimates:
    covariance = maxima.covariance[:, :_COUNT, :_COUNT]
    none = options.covariance == "none"
    return Estimates(
        method="filter-error" if gusts else "output-error",
        run_ids=run_ids,
        theta=maxima.z[:, :_COUNT],
        covariance=np.full_like(covariance, np.nan) if none else covariance,
        covariance_name="none" if none else "fisher",
        status=maxima.status,
        iterations=maxima.iterations,
        scale=scale,
        confidence=options.confidence,
        motion=LATERAL,
    )


__all__ = ["estimate", "estimate_joint", "levels", "search_of"]
