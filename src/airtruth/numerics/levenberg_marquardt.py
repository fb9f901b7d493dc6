"""Minimise cost functions by damped Gauss-Newton or Fisher-scoring steps: one Levenberg-Marquardt solver.

The solver knows nothing of a model. A caller describes its problems by three functions (`Problems`): evaluate a
point, propose a step at a given damping, and apply a step within bounds. The solver chooses the damping, accepts or
rejects the steps and ends the search. It works on several problems of one shape side by side, each with a damping, a
status and an iteration count of its own. Every call of the caller's functions gets all problems that still run, so
that a caller can evaluate them in one vectorised or parallel pass.

The tracer's posterior is one problem whose step eliminates the parameters of each record, and reuses derivatives
(`Options.reuse`). A batch of runs is many problems: ``evaluate`` gets the rows of those that still run, and ``step``
stacks their gradients and curvatures for one call of `airtruth.numerics.normal_equations.scaled_step`.

Sources: D. W. Marquardt, J. Soc. Indust. Appl. Math. 11 (1963) 431-441 (steps damped on the scaled diagonal, factor
10); K. Madsen, H. B. Nielsen and O. Tingleff, Methods for Non-Linear Least Squares Problems, 2nd ed. (2004), section
3.2 (the gain ratio governs the damping); R. E. Maine and K. W. Iliff, NASA RP-1138 (1985), section 5 (Gauss-Newton
steps for maximum likelihood).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.levenberg_marquardt_options import Options

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_TINY: Final = 1e-300
"""Least promised decrease by which a decrease is divided [unit of the cost]; prevents a division by zero."""


class Status(IntEnum):
    """Why a search ended."""

    RUNNING = 0
    CONVERGED = 1
    ITERATIONS = 2
    """The iterations were used up."""
    STALLED = 3
    """The damping reached its largest value: no step lowers the cost."""
    SHORT = 4
    """Damped steps promise nothing more, but an undamped one does; or the derivatives could not be renewed."""
    OUTRUN = 5
    """The cost can no longer reach that of a rival."""
    SINGULAR = 6
    """No step could be computed."""
    FAILED = 7
    """The start cannot be evaluated."""


class Evaluation(Protocol):
    """Value of a caller at a point: the cost, and whatever its own ``step`` needs."""

    @property
    def cost(self) -> float:
        """Cost at the point; finite."""


E = TypeVar("E", bound=Evaluation)


class Problems(Protocol[E]):
    """Several minimisation problems with the same number of parameters.

    Every method takes rows: ``index`` holds the numbers of the problems that the rows of the other arguments belong
    to.
    """

    def evaluate(self, x: Array, index: Ints, near: Sequence[E] | None) -> list[E | None]:
        """Evaluate points.

        Parameters
        ----------
        x : (rows, parameters).
        near : evaluations at nearby points whose derivatives may be reused; None where they must be renewed.

        Returns
        -------
        One evaluation per row; None where the cost is not finite.
        """

    def step(self, x: Array, at: Sequence[E], damping: Array, index: Ints) -> tuple[Array, Array]:
        """Propose steps (rows, parameters) at dampings (rows,), and the decreases (rows,) of the cost they promise."""

    def move(self, x: Array, step: Array, index: Ints) -> Array:
        """Apply steps to points, both (rows, parameters), within whatever bounds the parameters have."""


@dataclass(frozen=True)
class Solution(Generic[E]):
    """Where the searches ended.

    Attributes
    ----------
    x : (problems, parameters); of a problem whose start cannot be evaluated, that start.
    at : the last evaluation: at ``x``, or before the undamped step that ended the search; None where there is none.
    status, iterations : of each problem.
    """

    x: Array
    at: tuple[E | None, ...]
    status: tuple[Status, ...]
    iterations: tuple[int, ...]


@dataclass
class _Search(Generic[E]):
    """State of one search."""

    number: int
    x: Array
    at: E | None
    damping: float
    fresh: bool = True
    status: Status = Status.RUNNING
    iterations: int = 0


@dataclass
class _Trial(Generic[E]):
    """A proposed step of one search: where it leads, and what it promised."""

    search: _Search[E]
    promised: float
    x: Array
    at: E | None


def minimise(
    problems: Problems[E],
    start: Array,
    options: Options,
    rival: float = np.inf,
    near: Sequence[E] | None = None,
    at_near: bool = False,
) -> Solution[E]:
    """Minimise the cost of each problem.

    Parameters
    ----------
    problems : the problems.
    start : (problems, parameters).
    options : how to search.
    rival : cost of a competitor; a search that cannot reach it ends early.
    near : evaluations near the start, one per problem, whose derivatives the first steps use.
    at_near : whether they are those of the start itself, so that the derivatives are as new.
    """
    index = np.arange(len(start))
    first = problems.evaluate(start, index, near)
    fresh = near is None or at_near
    searches = [_Search(i, start[i], at, options.damping.initial, fresh) for i, at in enumerate(first)]
    for search in searches:
        if search.at is None:
            search.status = Status.FAILED
    for _ in range(options.iterations):
        running = [s for s in searches if s.status is Status.RUNNING]
        if not running:
            break
        _iterate(problems, running, options, rival)
    for search in searches:
        if search.status is Status.RUNNING:
            search.status = Status.ITERATIONS
    renewed = [s for s in searches if options.renewed_outrun or s.status is not Status.OUTRUN]
    _renew(problems, [s for s in renewed if options.renewed_end and not s.fresh])
    return Solution(
        np.array([s.x for s in searches]),
        tuple(s.at for s in searches),
        tuple(s.status for s in searches),
        tuple(s.iterations for s in searches),
    )


def _iterate(problems: Problems[E], searches: Sequence[_Search[E]], options: Options, rival: float) -> None:
    """One iteration of each search."""
    for search in searches:
        search.iterations += 1
    stopping = options.stopping
    if stopping.undamped is not None:
        searches = _end_undamped(problems, searches, stopping.undamped)
    trials = _propose(problems, searches)
    if stopping.promised is not None:
        for trial in trials:
            if trial.promised < stopping.promised and trial.search.fresh:
                sure = _promises_less(problems, trial.search, options, stopping.promised_confirm)
                trial.search.status = Status.CONVERGED if sure else Status.SHORT
        trials = [t for t in trials if t.search.status is Status.RUNNING]
    _evaluate(problems, trials, options.reuse)
    for trial in trials:
        _follow_chords(problems, trial, options.chords)
    stale = []
    for trial in trials:
        decrease = _accept_or_reject(problems, trial, options, rival)
        search = trial.search
        limit = max(options.stale, options.creeping * trial.promised)
        if search.status is Status.RUNNING and not search.fresh and decrease < limit:
            stale.append(search)
    for search in _renew(problems, stale):
        search.status = Status.SHORT
    for trial in trials:
        if trial.search.status is Status.RUNNING and trial.search.damping > options.damping.most:
            trial.search.status = Status.STALLED


def _end_undamped(problems: Problems[E], searches: Sequence[_Search[E]], limit: float) -> list[_Search[E]]:
    """Take the last, undamped step where it promises no more than a limit; the searches that go on."""
    steps, promised, x, index = _steps(problems, searches, np.zeros(len(searches)))
    ended = np.isfinite(promised) & np.less_equal(promised, limit)
    x[ended] = problems.move(x[ended], steps[ended], index[ended])
    going = []
    for search, end, moved in zip(searches, ended, x, strict=True):
        if end:
            search.x, search.status = moved, Status.CONVERGED
        else:
            going.append(search)
    return going


def _propose(problems: Problems[E], searches: Sequence[_Search[E]]) -> list[_Trial[E]]:
    """The damped step of each search."""
    if not searches:
        return []
    steps, promised, x, index = _steps(problems, searches, np.array([s.damping for s in searches]))
    sound: NDArray[np.bool_] = np.asarray(np.isfinite(steps).all(axis=1))
    moved = problems.move(x, np.where(sound[:, None], steps, 0.0), index)
    trials = []
    for search, good, promise, there in zip(searches, sound, promised, moved, strict=True):
        if good:
            trials.append(_Trial(search, float(promise), there, None))
        else:
            search.status = Status.SINGULAR
    return trials


def _steps(
    problems: Problems[E], searches: Sequence[_Search[E]], damping: Array
) -> tuple[Array, Array, Array, Ints]:
    at = [s.at for s in searches if s.at is not None]
    x, index = np.array([s.x for s in searches]), np.array([s.number for s in searches], dtype=np.int64)
    steps, promised = problems.step(x, at, damping, index)
    return steps, promised, x, index


def _evaluate(problems: Problems[E], trials: Sequence[_Trial[E]], reuse: bool) -> None:
    """Evaluate the trial points."""
    if not trials:
        return
    near = [t.search.at for t in trials if t.search.at is not None] if reuse else None
    index = np.array([t.search.number for t in trials], dtype=np.int64)
    for trial, at in zip(
        trials, problems.evaluate(np.array([t.x for t in trials]), index, near), strict=True
    ):
        trial.at = at


def _follow_chords(problems: Problems[E], trial: _Trial[E], most: int) -> None:
    """Take further steps from a poor trial point, with the derivatives that led to it, while they lower the cost."""
    search = trial.search
    for _ in range(most):
        if trial.at is None or search.at is None or search.at.cost - trial.at.cost > 0.5 * trial.promised:
            return
        beyond = _Search(search.number, trial.x, trial.at, search.damping)
        step, _, x, index = _steps(problems, [beyond], np.array([search.damping]))
        further = problems.move(x, step, index)
        again = problems.evaluate(further, index, [search.at])[0]
        if again is None or again.cost >= trial.at.cost:
            return
        trial.x, trial.at = further[0], again


def _accept_or_reject(problems: Problems[E], trial: _Trial[E], options: Options, rival: float) -> float:
    """Take a trial point or raise the damping; end the search where a rule says so. The decrease of the cost."""
    search, stopping = trial.search, options.stopping
    decrease = -np.inf
    if trial.at is not None and search.at is not None:
        decrease = search.at.cost - trial.at.cost
    if trial.at is not None and decrease > options.damping.slack:
        search.x, search.at = trial.x, trial.at
        search.damping = options.damping.after(search.damping, decrease / max(trial.promised, _TINY))
        behind = trial.at.cost - rival
        margin = min(options.outrun, options.outrun_renewed) if search.fresh else options.outrun
        small = stopping.decrease is not None and decrease < stopping.decrease and search.fresh
        if behind > margin and 4.0 * decrease < behind:
            search.status = Status.OUTRUN
        elif small and _promises_less(problems, search, options, stopping.decrease_confirm):
            search.status = Status.CONVERGED
        elif options.reuse:
            search.fresh = False
    elif (
        stopping.rejected is not None
        and search.fresh
        and _promises_less(problems, search, options, stopping.rejected)
    ):
        search.status = Status.CONVERGED
    else:
        search.damping = options.damping.after(search.damping, None)
    return float(decrease)


def _promises_less(problems: Problems[E], search: _Search[E], options: Options, limit: float | None) -> bool:
    """Whether a step at the least damping promises less than a limit; None is no limit."""
    if limit is None:
        return True
    _, promised, _, _ = _steps(problems, [search], np.array([options.damping.least]))
    return bool(promised[0] < limit)


def _renew(problems: Problems[E], searches: Sequence[_Search[E]]) -> list[_Search[E]]:
    """Make derivatives at the present points; the searches for which that fails."""
    if not searches:
        return []
    index = np.array([s.number for s in searches], dtype=np.int64)
    failed = []
    for search, at in zip(
        searches, problems.evaluate(np.array([s.x for s in searches]), index, None), strict=True
    ):
        if at is None:
            failed.append(search)
        else:
            search.at, search.fresh = at, True
    return failed


__all__ = ["Evaluation", "Problems", "Solution", "Status", "minimise"]
