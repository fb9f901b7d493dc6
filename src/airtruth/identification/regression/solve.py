"""Estimate by a regression: solved once, or iterated with instruments; run by run, or jointly."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import (
    AircraftConstants,
    Observation,
    OneOrEach,
    each_batch,
    observe,
)
from airtruth.identification.estimates import JOINT, AnyScale, Estimates, Status, joined, mean_scale
from airtruth.identification.options import Options
from airtruth.identification.regression.covariance import (
    COVARIANCES,
    corrected_jointly,
    products,
    sandwich,
)
from airtruth.identification.regression.iterate import IterationOutcome, iterate, least_squares
from airtruth.identification.regression.lowpass import ls_problem
from airtruth.identification.regression.rows import Equations, Problem, Projected, project
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL, Motion

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Pose = Callable[[Observation, Options], Problem]

CHUNK_SAMPLES: Final = 32_000
"""Samples per channel of a chunk of runs: judgement: bounds the memory and keeps the arrays in the
processor's cache."""


def regress_batch(
    batch: Batch, constants: AircraftConstants, name: str, pose: Pose | None, options: Options
) -> Estimates:
    """Estimate the six derivatives of each run; nothing is checked.

    A result does not depend on the other runs of the batch.

    Parameters
    ----------
    batch, constants : as in `airtruth.identification.identify_batch`.
    name : name of the estimates.
    pose : (observation, options) -> the regression to iterate, from least squares; None is least squares.
    options : choices.
    """
    intercept = options.trim == "intercept"
    outcomes, covariances, scales = [], [], []
    for part in chunks(batch):
        observation = observe(part, constants, options)
        problem, outcome = _solve(observation, pose, options)
        outcomes.append(outcome)
        scales.append(observation.scale)
        covariances.append(_covariance(problem, outcome, observation.factors, intercept, options))
    return assembled(name, batch.run_ids, outcomes, covariances, joined(scales), options.covariance, options)


def regress_joint(
    parts: Sequence[Batch], constants: OneOrEach, name: str, pose: Pose | None, options: Options
) -> Estimates:
    """One estimate for all runs together: their normal equations are summed; nothing is checked.

    Trim, flight condition and filters stay each run's own. All runs are held in memory.

    Parameters
    ----------
    parts : batches; lengths and rates may differ.
    constants : of all batches, or one entry for each.
    name, pose, options : as in `regress_batch`.
    """
    intercept = options.trim == "intercept"
    observations = [
        observe(part, own, options) for batch, own in each_batch(parts, constants) for part in chunks(batch)
    ]
    factors = np.concatenate([o.factors for o in observations])
    starts = [ls_problem(o, options) for o in observations]
    joint = _together(starts)
    outcome = least_squares(joint, factors, intercept, joint=True)
    problems = starts
    if pose is not None:
        problems = [pose(o, options) for o in observations]
        outcome = _iterate(_together(problems), factors, outcome.theta, options, joint=True)
    covariance = np.full((1, 6, 6), np.nan)
    if options.covariance != "none" and np.isfinite(outcome.theta).all():
        covariance = _joint_covariance(problems, observations, outcome.theta, intercept, options)
    return assembled(
        name,
        (JOINT,),
        [outcome],
        [covariance],
        mean_scale([o.scale for o in observations]),
        options.covariance,
        options,
    )


def assembled(
    name: str,
    run_ids: tuple[str, ...],
    outcomes: Sequence[IterationOutcome],
    covariances: Sequence[Array],
    scale: AnyScale,
    covariance_name: str,
    options: Options,
    motion: Motion = LONGITUDINAL,
) -> Estimates:
    """Estimates of a method from the outcomes of its chunks.

    Parameters
    ----------
    name : of the method; run_ids : of all runs; scale : factors of all runs.
    outcomes, covariances : of each chunk, (runs, derivatives, derivatives) each.
    covariance_name : name of the covariance; options : of the identification; motion : whose derivatives they are.
    """
    return Estimates(
        method=name,
        run_ids=run_ids,
        theta=np.concatenate([o.theta for o in outcomes]),
        covariance=np.concatenate(covariances),
        covariance_name=covariance_name,
        status=np.concatenate([o.status for o in outcomes]),
        iterations=np.concatenate([o.iterations for o in outcomes]),
        scale=scale,
        confidence=options.confidence,
        motion=motion,
    )


def chunks(batch: Batch) -> Iterator[Batch]:
    """Pieces of a batch with at most `CHUNK_SAMPLES` samples per channel, or one run."""
    size = max(1, CHUNK_SAMPLES // batch.t_s.shape[1])
    for first in range(0, len(batch.run_ids), size):
        part = slice(first, first + size)
        yield replace(
            batch,
            run_ids=batch.run_ids[part],
            t_s=batch.t_s[part],
            channels={name: values[part] for name, values in batch.channels.items()},
            known_rates=None if batch.known_rates is None else batch.known_rates[:, part],
        )


def _solve(observation: Observation, pose: Pose | None, options: Options) -> tuple[Problem, IterationOutcome]:
    problem = ls_problem(observation, options)
    factors = observation.factors
    outcome = least_squares(problem, factors, options.trim == "intercept", joint=False)
    if pose is not None:
        problem = pose(observation, options)
        outcome = _iterate(problem, factors, outcome.theta, options, joint=False)
    return problem, outcome


def _iterate(
    problem: Equations, factors: Array, start: Array, options: Options, joint: bool
) -> IterationOutcome:
    return iterate(
        problem,
        factors,
        start,
        options.trim == "intercept",
        options.tolerance,
        options.maximum_iterations,
        joint,
    )


def _covariance(
    problem: Problem, outcome: IterationOutcome, factors: Array, intercept: bool, options: Options
) -> Array:
    covariance = np.full((factors.shape[0], 6, 6), np.nan)
    if options.covariance == "none":
        return covariance
    known = np.flatnonzero(np.isin(outcome.status, (Status.CONVERGED, Status.MAXIMUM_ITERATIONS)))
    known = known[problem.usable(outcome.theta[known], known)]
    theta = outcome.theta[known]
    projected = project(problem.rows(theta, known), theta, factors[known], intercept)
    parts = COVARIANCES[options.covariance](projected, factors[known], projected.e.shape[2])
    covariance[known] = sandwich(parts)
    return covariance


def _joint_covariance(
    problems: Sequence[Problem],
    observations: Sequence[Observation],
    theta: Array,
    intercept: bool,
    options: Options,
) -> Array:
    def projected() -> Iterator[tuple[Projected, Array]]:
        """Projection and factors of each observation, computed again for each pass: all of them together need too much memory."""
        for problem, observation in zip(problems, observations, strict=True):
            runs = observation.factors.shape[0]
            every = np.repeat(theta, runs, axis=0)
            rows = problem.rows(every, np.arange(runs))
            yield project(rows, every, observation.factors, intercept), observation.factors

    samples = sum(o.signals.shape[0] * o.signals.shape[2] for o in observations)
    bread, meat = np.zeros((1, 6, 6)), np.zeros((1, 6, 6))
    total = None
    if options.covariance == "corrected":
        total = np.sum([products(p, factors).sum(axis=0) for p, factors in projected()], axis=0)
    for p, factors in projected():
        if total is None:
            b, m = COVARIANCES[options.covariance](p, factors, samples)
        else:
            b, m = corrected_jointly(p, factors, total)
        bread += b.sum(axis=0)
        meat += m.sum(axis=0)
    return sandwich((bread, meat))


def _together(problems: Sequence[Problem]) -> Equations:
    """Equations of several observations as one; ``active`` is always all runs."""
    ends = np.cumsum([p.failed.size for p in problems])
    spans = [slice(end - p.failed.size, end) for p, end in zip(problems, ends, strict=True)]

    def moments(theta: Array, active: Ints) -> Array:
        return np.concatenate(
            [p.moments(theta[s], np.arange(p.failed.size)) for p, s in zip(problems, spans, strict=True)]
        )

    def usable(theta: Array, active: Ints) -> Bools:
        return np.concatenate(
            [p.usable(theta[s], np.arange(p.failed.size)) for p, s in zip(problems, spans, strict=True)]
        )

    return Equations(moments, usable, np.concatenate([p.failed for p in problems]))
