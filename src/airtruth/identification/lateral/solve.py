"""Estimates of the lateral-directional derivatives by a regression: once, or iterated with instruments."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.estimates import JOINT, Estimates, Status, joined, mean_scale
from airtruth.identification.lateral.covariance import bread_of, meat, sandwich
from airtruth.identification.lateral.kernels import solve
from airtruth.identification.lateral.observation import Each, LateralObservation, observe
from airtruth.identification.lateral.problems import (
    LateralProblem,
    SmoothRows,
    f1_problem,
    lowpass_problem,
    ls_problem,
    smoothed,
)
from airtruth.identification.options import Options
from airtruth.identification.regression.iterate import IterationOutcome, repeat
from airtruth.identification.regression.solve import assembled, chunks
from airtruth.logs.flight_log import Batch
from airtruth.physics.lateral import LateralConstants
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Pose = Callable[[LateralObservation, Options, SmoothRows], LateralProblem]

_COUNT: Final = len(LATERAL.parameters)
"""Number of derivatives."""
_SINGULAR: Final = 1e12
"""Condition number, in the Frobenius norm, of the normal equations with rows of unit length from which they count as singular
[-]; judgement."""


def solution(moments: Array) -> Array:
    """theta (runs, 15) of normal equations: sums Z X' and Z Y' (runs, 5, 8); NaN where singular."""
    width = len(LATERAL.signals)
    theta = np.empty((len(moments), width, len(LATERAL.coefficients)))
    matrix, right = (np.ascontiguousarray(part) for part in (moments[..., :width], moments[..., width:]))
    solve(matrix, right, _SINGULAR, theta)
    theta[~np.isfinite(theta).all(axis=(1, 2))] = np.nan
    return np.swapaxes(theta, 1, 2).reshape(-1, _COUNT)


@dataclass(frozen=True)
class _Several:
    """Problems of several observations as one."""

    problems: Sequence[LateralProblem]

    def parts(self, theta: Array) -> Iterator[tuple[LateralProblem, Array, Ints]]:
        """Each problem with the theta of its runs."""
        first = 0
        for problem in self.problems:
            yield problem, theta[first : first + problem.runs], np.arange(problem.runs)
            first += problem.runs

    def step(self, theta: Array, active: Ints, iteration: int) -> Array:
        """Theta (1, 15) of the summed normal equations."""
        sums = [problem.moments(own, runs).sum(axis=0) for problem, own, runs in self.parts(theta)]
        return solution(np.sum(sums, axis=0)[None])

    def usable(self, theta: Array, active: Ints) -> Bools:
        """Whether theta makes instruments of each run."""
        return np.concatenate([problem.usable(own, runs) for problem, own, runs in self.parts(theta)])


def _once(theta: Array) -> IterationOutcome:
    status = np.where(np.isfinite(theta).all(axis=1), Status.CONVERGED, Status.SINGULAR).astype(np.int8)
    return IterationOutcome(theta, status, np.zeros(len(theta), dtype=np.int32))


def _iterated(
    step: Callable[[Array, Ints, int], Array],
    usable: Callable[[Array, Ints], Bools],
    runs: int,
    start: Array,
    options: Options,
    joint: bool,
) -> IterationOutcome:
    failed = np.zeros(runs, dtype=np.bool_)
    with np.errstate(over="ignore", invalid="ignore"):
        return repeat(step, usable, failed, start, runs, options.tolerance, options.maximum_iterations, joint)


def regress_batch(
    batch: Batch, constants: LateralConstants, name: str, pose: Pose | None, options: Options
) -> Estimates:
    """Estimate the derivatives of each run; nothing is checked, and a result does not depend on the other runs.

    Parameters
    ----------
    batch, constants : runs and aircraft.
    name : of the estimates.
    pose : (observation, options, rows of least squares) -> the regression to iterate, from least squares; None is least squares.
    options : choices.
    """
    outcomes, covariances, scales = [], [], []
    for part in chunks(batch):
        o = observe(part, constants, options)
        smooth = smoothed(o, options)
        problem = ls_problem(o, options, smooth)
        every = np.arange(problem.runs)
        nothing = np.full((problem.runs, _COUNT), np.nan)
        outcome = _once(solution(problem.moments(nothing, every)))
        if pose is not None:
            problem = pose(o, options, smooth)

            def step(theta: Array, active: Ints, iteration: int, own: LateralProblem = problem) -> Array:
                return solution(own.moments(theta, active))

            outcome = _iterated(step, problem.usable, problem.runs, outcome.theta, options, False)
        outcomes.append(outcome)
        scales.append(o.scale)
        covariances.append(_covariance(problem, outcome, options))
    scale = joined(scales)
    return assembled(name, batch.run_ids, outcomes, covariances, scale, options.covariance, options, LATERAL)


def _covariance(problem: LateralProblem, outcome: IterationOutcome, options: Options) -> Array:
    covariance = np.full((problem.runs, _COUNT, _COUNT), np.nan)
    if options.covariance == "none":
        return covariance
    known = np.flatnonzero(np.isin(outcome.status, (Status.CONVERGED, Status.MAXIMUM_ITERATIONS)))
    known = known[problem.usable(outcome.theta[known], known)]
    if not known.size:
        return covariance
    theta = outcome.theta[known]
    rows = problem.rows(theta, known)
    bread = bread_of(rows)
    zz = np.matmul(rows.z, np.swapaxes(rows.z, 1, 2))
    middle = meat(rows, theta, options.covariance, bread, rows.z.shape[2])
    covariance[known] = sandwich(bread, middle, options.covariance, zz)
    return covariance


def regress_joint(
    parts: Sequence[Batch], constants: Each, name: str, pose: Pose | None, options: Options
) -> Estimates:
    """One estimate for all runs together: their normal equations are summed; nothing is checked.

    Trim, flight condition and filters stay each run's own.

    Parameters
    ----------
    parts : batches; lengths and rates may differ.
    constants : of all batches, or one entry for each.
    name, pose, options : as in `regress_batch`.
    """
    own = constants if isinstance(constants, Sequence) else [constants] * len(parts)
    observations = [
        observe(part, c, options) for batch, c in zip(parts, own, strict=True) for part in chunks(batch)
    ]
    smooth = [smoothed(o, options) for o in observations]
    posed = list(zip(observations, smooth, strict=True))
    several = _Several([ls_problem(o, options, rows) for o, rows in posed])
    runs = sum(problem.runs for problem in several.problems)
    outcome = _once(several.step(np.full((runs, _COUNT), np.nan), np.arange(runs), 0))
    if pose is not None:
        several = _Several([pose(o, options, rows) for o, rows in posed])
        outcome = _iterated(several.step, several.usable, runs, outcome.theta, options, True)
    covariance = np.full((1, _COUNT, _COUNT), np.nan)
    if options.covariance != "none" and np.isfinite(outcome.theta).all():
        covariance = _joint_covariance(several, np.repeat(outcome.theta, runs, axis=0), options)
    scale = mean_scale([o.scale for o in observations])
    return assembled(name, (JOINT,), [outcome], [covariance], scale, options.covariance, options, LATERAL)


def _joint_covariance(several: _Several, theta: Array, options: Options) -> Array:
    width = len(LATERAL.signals)
    bread, information = np.zeros((1, width, width)), np.zeros((1, width, width))
    samples = 0
    for problem, own, runs in several.parts(theta):
        rows = problem.rows(own, runs)
        bread += bread_of(rows).sum(axis=0)
        information += np.matmul(rows.z, np.swapaxes(rows.z, 1, 2)).sum(axis=0)
        samples += rows.z.shape[0] * rows.z.shape[2]
    middle = np.zeros((1, _COUNT, _COUNT))
    for problem, own, runs in several.parts(theta):
        rows = problem.rows(own, runs)
        middle += meat(rows, own, options.covariance, bread, samples).sum(axis=0)
    return sandwich(bread, middle, options.covariance, information)


POSES: Final[dict[str, Pose | None]] = {"ls": None, "iv-lowpass": lowpass_problem, "iv-f1": f1_problem}
"""Regressions by the name of the method."""

__all__ = ["POSES", "regress_batch", "regress_joint", "solution"]
