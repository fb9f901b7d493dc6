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
from airtruth.identification.lateral.model_error import (
    random_terms,
    with_random_terms,
    with_repeated_noise,
    with_uncertain_attack,
)
from airtruth.identification.lateral.observation import steady_flight
from airtruth.identification.lateral.predictor import (
    PROCESS,
    factor_names,
    levels,
    outputs_of,
    records_by_terms,
    records_of,
)
from airtruth.identification.lateral.solve import regress_batch, regress_joint
from airtruth.identification.likelihood.fit import (
    Records,
    correlation_of,
    estimates_of,
    joint_maximum,
    maximum_of_each,
    memory_of,
    scored_each,
)
from airtruth.identification.likelihood.kalman import score
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
from airtruth.identification.options import TERMS, Options
from airtruth.identification.record_constants import LateralValues
from airtruth.identification.regression.solve import chunks
from airtruth.logs.flight_log import Batch
from airtruth.physics.lateral import LateralScale
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]

PROCESS_NOISE: Final = 0.02
"""Declared noise of p' and r' [rad/s per root second]; judgement: tables of an aircraft cause .01 to .05."""
_START: Final = 0.2
"""Share of its declared size from which the search of that noise starts [-]; judgement: a linear aircraft in gusts has .03 to .1
of it, tables .1 to .7, and a search from the whole takes up to a fifth more steps."""
_NEAR: Final = 2.0
"""Decrease of the cost of a step that hardly changes the information of a run [-]; judgement: two standard deviations."""
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
        near=_NEAR if gusts else 0.0,
    )


def _start(theta: Array, search: Search, *, gusts: bool) -> Array:
    """Start of a search from derivatives (rows, 15): factors of nonlinear terms from zero, levels as declared."""
    start = np.concatenate([theta, search.declared[:, _COUNT:]], axis=1)
    if gusts:
        start[:, -len(PROCESS) :] += np.log(_START)
    return start


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
        choices = (options.terms, TERMS) if gusts else (options.terms,)
        data, *others = records_by_terms(part, values, options, GUST_LENGTH_M, choices, gusts=gusts)
        search = search_of(_noise(part, constants), options, gusts=gusts)
        maxima = maximum_of_each(data, _start(start.theta, search, gusts=gusts), search)
        known = np.flatnonzero(np.isfinite(maxima.z).all(axis=1))
        if not gusts or not known.size:
            memory = memory_of(data, maxima.z)
        else:
            more = others[0]
            random = random_terms(options, search.weight.size)
            z = random.point(maxima.z[known])
            made = score(more.layout, known, z, np.arange(z.shape[1]), more.signals, more.dt_s)
            # the random factors are zero here, so that the innovations are those of the fit
            memory = np.full(len(maxima.z), np.nan)
            memory[known] = correlation_of(made.innovations)
            moved = with_uncertain_attack(
                with_random_terms(
                    maxima.of(known), (made.cost, made.gradient, made.information), search.weight, random
                ),
                steady_flight(part, options).variance[known],
            )
            maxima.z[known], maxima.covariance[known] = moved.z, moved.covariance
        answer = _estimates(maxima, part.run_ids, data.scale, options, gusts=gusts)
        parts.append(replace(answer, memory=memory))
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
    steady = [steady_flight(part, options) for part in parts]
    attack, variance = (np.concatenate(column) for column in zip(*steady, strict=True))

    def read(chosen: Options) -> list[Records[LateralScale]]:
        return [
            records_of(part, own, chosen, GUST_LENGTH_M, gusts=gusts, attack=float(attack.mean()))
            for batch, own in zip(parts, values, strict=True)
            for part in chunks(batch)
        ]

    data = read(options)
    search = search_of(np.median(noise, axis=0, keepdims=True), options, gusts=gusts)
    maxima = joint_maximum(data, _start(start.theta, search, gusts=gusts)[0], search)
    each = [memory_of(d, np.repeat(maxima.z, d.signals.y.shape[0], axis=0)) for d in data]
    if gusts and np.isfinite(maxima.z).all():
        more = read(replace(options, terms=TERMS))
        maxima = _with_model_error(maxima, data, more, variance.mean() / variance.size, options, search)
    made = _estimates(maxima, (JOINT,), mean_scale([d.scale for d in data]), options, gusts=gusts)
    return replace(made, memory=np.concatenate(each).mean(keepdims=True))


def _with_model_error(
    maxima: Maxima,
    data: Sequence[Records[LateralScale]],
    more: Sequence[Records[LateralScale]],
    variance: float,
    options: Options,
    search: Search,
) -> Maxima:
    """The maximum of all runs with random terms and with noise of the moments that repeats (`lateral.model_error`).

    Parameters
    ----------
    data, more : records of the fit, and those in which every nonlinear term is free.
    variance : of the angle of attack at which the derivatives hold [rad2].
    """
    z = maxima.z
    _, _, each = scored_each(data, z, search.free)
    silent = z.copy()
    silent[:, -len(PROCESS) :] = -np.inf
    others = search.free[: -len(PROCESS)]
    quiet = scored_each(data, silent, others)[2].sum(axis=0) + np.diag(search.weight[: others.size])
    random = random_terms(options, search.weight.size)
    at = random.point(z)
    cost, gradient, information = (
        part.sum(axis=0)[None] for part in scored_each(more, at, np.arange(at.shape[1]))
    )
    moved = with_random_terms(maxima, (cost, gradient, information), search.weight, random)
    repeated = with_repeated_noise(moved.maxima, maxima.covariance[0], each, quiet)
    return with_uncertain_attack(moved._replace(maxima=repeated), np.array([variance]))


def _estimates(
    maxima: Maxima, run_ids: tuple[str, ...], scale: AnyScale, options: Options, *, gusts: bool
) -> Estimates:
    made = estimates_of(maxima, run_ids, scale, LATERAL, options.confidence, gusts)
    if options.covariance != "none":
        return made
    return replace(made, covariance=np.full_like(made.covariance, np.nan), covariance_name="none")


__all__ = ["estimate", "estimate_joint", "levels", "search_of"]
