"""Maximum of a likelihood by Fisher scoring with Levenberg-Marquardt damping, many groups of runs at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import lambertw

from airtruth.identification.estimates import Status
from airtruth.numerics import levenberg_marquardt as solver
from airtruth.numerics import normal_equations
from airtruth.numerics.levenberg_marquardt_options import Damping, SolverOptions, Stopping

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Scored = tuple[Array, Array, Array]
"""Negative log-likelihood (active,), its gradient (active, free), information (active, free, free)."""
Evaluate = Callable[[Array, Ints, bool], Scored]

DAMPING: Final = Damping(initial=1e-3, least=1e-3, most=0.9e9)
"""Damping relative to the information; judgement: from nearly undamped to steps of rounding size."""
RIDGE: Final = 1e-14
"""Added to the unit diagonal of the scaled information [-]; judgement: keeps a factorisation from an exact zero, far
below rounding of the information."""
LEAST_CURVED: Final = 0.05
"""Least curvature along a step that a secant shows, over that before [-]; judgement: below, the step is too long for it."""
LARGEST: Final = 1e6
"""Size of a derivative that counts as divergence [-]; judgement: the largest plausible one, CLq, is of order 100."""


@dataclass(frozen=True)
class Search:
    """Parameters of a likelihood, their prior, and how to search; derivatives come first, then the levels.

    Attributes
    ----------
    declared : (groups, parameters) centres of the prior: 0 for derivatives, logarithms of the levels.
    free : indices of the estimated parameters.
    weight : (free,) inverse variances of the prior; 0 for derivatives.
    level : positions of the levels among the free parameters.
    tolerance : length of the last step [standard errors].
    maximum_iterations : steps after which a fit is reported as not converged.
    to_prior : whether a step of a level that the record does not show goes to where likelihood and prior balance, and not as
        far as Newton's, which is at most 1/2.
    near : decrease of the cost [-] below which the point that a step leads to takes over the information of the point before
        it; the covariance is then of that point.
    """

    declared: Array
    free: Ints
    weight: Array
    level: slice
    tolerance: float
    maximum_iterations: int
    to_prior: bool = False
    near: float = 0.0


@dataclass(frozen=True)
class Maxima:
    """Maximum of the likelihood of each group of runs.

    Attributes
    ----------
    z : (groups, parameters) derivatives, then logarithms of the levels; NaN without a maximum.
    covariance : (groups, free, free) inverse of the information, prior of the levels included.
    status, iterations : (groups,).
    """

    z: Array
    covariance: Array
    status: NDArray[np.int8]
    iterations: NDArray[np.int32]

    def of(self, groups: Ints) -> Maxima:
        """Maxima of some groups."""
        return Maxima(self.z[groups], self.covariance[groups], self.status[groups], self.iterations[groups])


class _Point(NamedTuple):
    """Posterior at a point x: cost, gradient, information, and the curvature that a step uses."""

    cost: float
    x: Array
    gradient: Array
    information: Array
    curvature: Array


@dataclass(frozen=True)
class _Posterior:
    """The solver's problems: one for each group.

    Attributes
    ----------
    evaluate_likelihood : as in `maximise`.
    declared : (groups, parameters) centre of the prior.
    weight : (free,) inverse variances of the prior.
    free : indices of the estimated parameters; level : positions of the levels among them.
    to_prior, near : as in `Search`.
    """

    evaluate_likelihood: Evaluate
    declared: Array
    weight: Array
    free: Ints
    level: slice
    to_prior: bool
    near: float

    def evaluate(self, x: Array, index: Ints, near: Sequence[_Point] | None) -> list[_Point | None]:
        """Posterior at points x (rows, free); None where the cost is not finite."""
        points: list[_Point | None] = [None] * len(index)
        sound = np.asarray(np.isfinite(x).all(axis=1))
        short = sound & (np.zeros_like(sound) if near is None else self._short(x, near))
        for rows, informed in ((np.flatnonzero(sound & ~short), True), (np.flatnonzero(short), False)):
            if not rows.size:
                continue
            z = self.declared[index[rows]]
            z[:, self.free] = x[rows]
            off = x[rows] - self.declared[np.ix_(index[rows], self.free)]
            cost, slope, information = self.evaluate_likelihood(z, index[rows], informed)
            cost = cost + 0.5 * (self.weight * off**2).sum(axis=1)
            gradient = slope + self.weight * off
            if informed or near is None:
                curvature = self._curvature(slope, information, off)
                information = information + np.diag(self.weight)
            else:
                before = [near[row] for row in rows.tolist()]
                information = np.stack([p.information for p in before])
                curvature = secant(
                    np.stack([p.curvature for p in before]),
                    x[rows] - np.stack([p.x for p in before]),
                    gradient - np.stack([p.gradient for p in before]),
                )
            for made in zip(rows, cost, x[rows], gradient, information, curvature, strict=True):
                if np.isfinite(made[1]):
                    points[made[0]] = _Point(float(made[1]), *made[2:])
        return points

    def _short(self, x: Array, near: Sequence[_Point]) -> NDArray[np.bool_]:
        """Points x (rows, free) that the points near to them promise to be little better."""
        if self.near == 0.0:
            return np.zeros(len(near), dtype=np.bool_)
        gradient, curvature = np.stack([p.gradient for p in near]), np.stack([p.curvature for p in near])
        step = x - np.stack([p.x for p in near])
        bent = np.matmul(curvature, step[:, :, None])[:, :, 0]
        return np.asarray(-(step * (gradient + 0.5 * bent)).sum(axis=1) < self.near)

    def _curvature(self, gradient: Array, information: Array, off: Array) -> Array:
        """Curvature (rows, free, free) of the posterior for a step, from gradient and information of the likelihood.

        A level that the record does not show enters J by its square s^2 alone: information ~ s^4, while the curvature in log s
        is twice the gradient.

        Parameters
        ----------
        off : (rows, free) parameters less the centre of their prior.
        """
        hidden = np.zeros_like(gradient)
        own, known = self.level, np.diagonal(information, axis1=1, axis2=2)[:, self.level]
        hidden[:, own] = np.maximum(2.0 * gradient[:, own] - known, 0.0)
        if self.to_prior:
            balanced = to_balance(gradient[:, own], off[:, own], self.weight[own])
            faint = (hidden[:, own] > 0.0) & np.isfinite(balanced)
            least = np.maximum(balanced - known - self.weight[own], 0.0)
            hidden[:, own] = np.where(faint, least, hidden[:, own])
        return np.asarray(information + (hidden + self.weight)[:, :, None] * np.eye(self.free.size))

    def step(self, x: Array, at: Sequence[_Point], damping: Array, index: Ints) -> tuple[Array, Array]:
        """Steps (rows, free), and the decreases (rows,) of the cost that they promise; NaN where singular."""
        gradient = np.stack([point.gradient for point in at])
        curvature = np.stack([point.curvature for point in at])
        known = np.stack([np.diagonal(point.information) for point in at])
        regular = (known > 0.0).all(axis=1)
        step = np.full(gradient.shape, np.nan)
        step[regular] = normal_equations.scaled_step(
            gradient[regular], curvature[regular], damping[regular] + RIDGE
        )
        # a level changes by a factor of e at most at a time
        largest = np.abs(step[:, self.level]).max(axis=1, initial=0.0)
        step /= np.maximum(1.0, largest)[:, None]
        bent = np.einsum("gi,gij,gj->g", step, curvature, step)
        return step, -(gradient * step).sum(axis=1) - 0.5 * bent

    def move(self, x: Array, step: Array, index: Ints) -> Array:
        """Points after a step; the parameters have no bounds."""
        return x + step


def to_balance(gradient: Array, off: Array, weight: Array) -> Array:
    """Curvature whose Newton step leads to the least g/2 exp(2 d) + w/2 (off + d)^2 over the step d of a logarithm of a level.

    The first term is the cost of a level s that enters by s^2 alone, g its gradient; the second is the prior. Setting the slope
    to zero, y exp(y) = 2 g/w exp(-2 off) with y = -2 (off + d): Lambert's function.

    Parameters
    ----------
    gradient : (..., levels) g of the likelihood; off : (..., levels) level less the centre of its prior; weight : (levels,) w.

    Returns
    -------
    (..., levels); NaN without a balance, such as with a negative gradient.

    Examples
    --------
    >>> curvature = to_balance(np.array([3.0]), np.array([0.5]), np.array([2.0]))
    >>> step = -(3.0 + 2.0 * 0.5) / curvature
    >>> bool(abs(3.0 * np.exp(2.0 * step) + 2.0 * (0.5 + step))[0] < 1e-12)
    True
    """
    with np.errstate(all="ignore"):
        y = np.real(lambertw(2.0 * gradient / weight * np.exp(-2.0 * off)))
        step = -0.5 * y - off
        return np.asarray(-(gradient + weight * off) / step)


def secant(curvature: Array, step: Array, change: Array) -> Array:
    """Curvature (rows, n, n) that explains the change of the gradient (rows, n) over a step (rows, n).

    The update of Broyden, Fletcher, Goldfarb and Shanno (J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., 2006,
    eq. 6.19); where the change is not that of a curved cost, the curvature stays.
    """
    explained = np.matmul(curvature, step[:, :, None])[:, :, 0]
    before, after = (step * explained).sum(axis=1), (step * change).sum(axis=1)
    curved = after > LEAST_CURVED * before
    with np.errstate(divide="ignore", invalid="ignore"):
        more = change[:, :, None] * change[:, None, :] / after[:, None, None]
        less = explained[:, :, None] * explained[:, None, :] / before[:, None, None]
        return np.where(curved[:, None, None], curvature + more - less, curvature)


def maximise(evaluate: Evaluate, start: Array, search: Search) -> Maxima:
    """Maximise the likelihood of each group.

    Parameters
    ----------
    evaluate : (z (active, parameters), active, whether the information is wanted) -> `Scored` of those groups.
    start : (groups, derivatives), or levels too; levels that are not given start at the centre of their prior.
    search : parameters, prior, and how to search.
    """
    count, free, declared = search.level.start, search.free, search.declared
    problems = _Posterior(evaluate, declared, search.weight, free, search.level, search.to_prior, search.near)
    x = declared[:, free]
    x[:, : start.shape[1]] = start
    how = SolverOptions(
        iterations=search.maximum_iterations,
        damping=DAMPING,
        # the decrement of the last step: tolerance^2/2 for a step of `tolerance` standard errors
        stopping=Stopping(undamped=0.5 * search.tolerance**2),
        reuse=search.near > 0.0,
        renewed_end=False,
    )
    end = solver.minimise(problems, x, how)
    z = declared.copy()
    z[:, free] = end.x
    status = np.array([_STATUS[s] for s in end.status], dtype=np.int8)
    ended = np.isin(status, (Status.CONVERGED, Status.MAXIMUM_ITERATIONS))
    status[ended & ~(np.abs(z[:, :count]) < LARGEST).all(axis=1)] = Status.DIVERGED
    covariance = np.full((len(z), free.size, free.size), np.nan)
    for group in range(len(z)):
        point = end.at[group]
        if status[group] in (Status.CONVERGED, Status.MAXIMUM_ITERATIONS) and point is not None:
            covariance[group] = normal_equations.scaled_inverse(point.information, RIDGE)
        else:
            z[group] = np.nan
    return Maxima(z, covariance, status, np.array(end.iterations, dtype=np.int32))


_STATUS: Final = {
    solver.SolverStatus.CONVERGED: Status.CONVERGED,
    solver.SolverStatus.ITERATIONS: Status.MAXIMUM_ITERATIONS,
    solver.SolverStatus.STALLED: Status.MAXIMUM_ITERATIONS,
    solver.SolverStatus.SINGULAR: Status.SINGULAR,
    solver.SolverStatus.FAILED: Status.DIVERGED,
}
"""Status of an estimate for the end of its search."""
