"""The iteration of the instrumental variables, run by run or jointly over runs.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eq. (9) and III.D.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.estimates import Status
from airtruth.identification.regression.rows import Equations, normal_equations, solve

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LARGEST: Final = 1e6
"""Size of a derivative that counts as divergence [-]; judgement: the largest plausible one, CLq, is of order
100."""


@dataclass(frozen=True)
class IterationOutcome:
    """theta (runs, 6), status (runs,) and iterations (runs,); one row if joint."""

    theta: Array
    status: NDArray[np.int8]
    iterations: NDArray[np.int32]


def least_squares(problem: Equations, factors: Array, intercept: bool, joint: bool) -> IterationOutcome:
    """Solve once, with instruments that do not depend on theta (eq. 5).

    Parameters
    ----------
    problem : regression whose moments ignore theta.
    factors : (runs, 4) from `airtruth.identification.regression.rows.row_factors`.
    intercept : whether a constant is free in each equation of each run.
    joint : whether all runs share one theta.
    """
    runs = factors.shape[0]
    moments = problem.moments(np.full((runs, 6), np.nan), np.arange(runs))
    theta = _solution(moments, factors, intercept, joint)
    status = np.where(np.isfinite(theta).all(axis=1), Status.CONVERGED, Status.SINGULAR).astype(np.int8)
    return IterationOutcome(theta, status, np.zeros(theta.shape[0], dtype=np.int32))


def iterate(
    problem: Equations,
    factors: Array,
    start: Array,
    intercept: bool,
    tolerance: float,
    maximum_iterations: int,
    joint: bool,
) -> IterationOutcome:
    """Repeat eq. (9) until ||theta_i - theta_(i-1)|| <= tolerance ||theta_i|| (2-norm over the six).

    Each run ends by its own criterion, so that its result does not depend on the others.

    Parameters
    ----------
    problem, factors, intercept, joint : as in `least_squares`.
    start : (runs, 6), or (1, 6) if joint; runs whose start is not finite end as singular.
    tolerance, maximum_iterations : as in `airtruth.identification.options.Options`.
    """

    def step(theta: Array, members: Ints, iteration: int) -> Array:
        return _solution(problem.moments(theta, members), factors[members], intercept, joint)

    return repeat(
        step, problem.usable, problem.failed, start, factors.shape[0], tolerance, maximum_iterations, joint
    )


def repeat(
    step: Callable[[Array, Ints, int], Array],
    usable: Callable[[Array, Ints], Bools],
    failed: Bools,
    start: Array,
    runs: int,
    tolerance: float,
    maximum_iterations: int,
    joint: bool,
) -> IterationOutcome:
    """Iterate any step towards its fixed point, run by run or jointly.

    Parameters
    ----------
    step : (theta (active, derivatives), active, iteration from 0) -> the next theta, of one row if joint.
    usable, failed : as in `airtruth.identification.regression.rows.Equations`.
    start, tolerance, maximum_iterations : as in `iterate`.
    runs : number of runs.
    joint : whether all runs share one theta.
    """
    theta = start.copy()
    units = theta.shape[0]
    status = np.full(units, Status.MAXIMUM_ITERATIONS, dtype=np.int8)
    iterations = np.zeros(units, dtype=np.int32)
    status[~np.isfinite(theta).all(axis=1)] = Status.SINGULAR
    if joint:
        if failed.any():
            status[:] = Status.ACTUATOR
    else:
        status[failed] = Status.ACTUATOR
    active = np.flatnonzero(status == Status.MAXIMUM_ITERATIONS)
    for iteration in range(maximum_iterations):
        if active.size == 0:
            break
        members = np.arange(runs) if joint else active
        previous = np.broadcast_to(theta, (runs, theta.shape[1])) if joint else theta[active]
        simulable = usable(previous, members)
        if joint:
            simulable = np.array([bool(simulable.all())])
        status[active[~simulable]] = Status.UNSTABLE
        active = active[simulable]
        if active.size == 0:
            break
        if not joint:
            members, previous = active, theta[active]
        new = step(previous, members, iteration)
        change = _norms(new - theta[active])
        iterations[active] += 1
        theta[active] = new
        largest = np.abs(new).max(axis=1)  # a NaN counts as the largest
        sound = largest <= LARGEST
        converged = sound & (change <= tolerance * _norms(new))
        if not sound.all():
            status[active[~np.isfinite(largest)]] = Status.SINGULAR
            status[active[np.isfinite(largest) & ~sound]] = Status.DIVERGED
        status[active[converged]] = Status.CONVERGED
        active = active[sound & ~converged]
    lost = (status != Status.CONVERGED) & (status != Status.MAXIMUM_ITERATIONS)
    theta[lost] = np.nan
    return IterationOutcome(theta, status, iterations)


def _norms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("ri,ri->r", x, x)))


def _solution(moments: Array, factors: Array, intercept: bool, joint: bool) -> Array:
    matrix, right = normal_equations(moments, factors, intercept)
    if joint:
        matrix, right = matrix.sum(axis=0, keepdims=True), right.sum(axis=0, keepdims=True)
    return solve(matrix, right)
