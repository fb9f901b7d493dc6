"""Whether the sensors' noise is white, or part of it slow, before anything is traced.

Slow noise (a Gauss-Markov process beside the white one) costs states and parameters, and most records have none: it
enters once the records show it. Nothing tells it from what the model lacks where nobody declares how large the noise
is, nor where it has to be as slow as a motion or all there is: there it does not enter.

Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948), 50 (the score test), one-sided for each sensor's share.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from airtruth.trace.fit import (
    NO_WHITENER,
    Fit,
    Point,
    Problem,
    at_bounds,
    begin,
    fit,
    parts,
    reduced,
    tangent,
)
from airtruth.trace.model import BOUNDS, COLOUR
from airtruth.trace.prepare import Case
from airtruth.trace.score import eliminated

Array = NDArray[np.float64]

LEVEL: Final = 1e-9
"""Of the scores together. Half of the variance correlated over 80 ms scores 8 to 17 standard deviations in four
records of some seconds; what an aircraft lacks scores too, and less noise than that does no harm as white noise.
"""
FIRST_SHARE: Final = 0.2
"""Where the search for a share begins: of none there is no correlation time."""
SHARES: Final = COLOUR[:3]


def begun(case: Case) -> tuple[Case, Point]:
    """The case with slow noise where its fitted records show some, and where its search begins."""
    problem, hypothesis = case.fitted, case.hypothesis
    start = begin(problem, hypothesis)
    null = fit(problem, hypothesis, start)
    if null is None:
        return case, start
    if not problem.settings.noise_is_declared:
        return case, null.point
    settings = replace(problem.settings, coloured=True)
    slow = replace(problem, settings=settings)
    z = scores(slow, null)
    if not (norm.sf(z) < LEVEL / len(SHARES)).any():
        return case, null.point
    shared = null.point.shared.copy()
    shared[list(SHARES)] = np.where(z > 0.0, FIRST_SHARE, 0.0)
    found = fit(slow, hypothesis, replace(null.point, shared=shared))
    if found is None or not found.converged or any(found.point.shared[i] == BOUNDS[i][1] for i in COLOUR):
        return case, null.point
    held = None if case.held is None else replace(case.held, settings=settings)
    return replace(case, fitted=slow, held=held), found.point


def scores(problem: Problem, null: Fit) -> Array:
    """(3,) signed roots of the score of each sensor's share, every parameter refitted but the other shares.

    Parameters
    ----------
    problem : with slow noise; null : a fit without.
    """
    slope, information = share_slopes(problem, null)
    return np.asarray(-slope / np.sqrt(np.diag(information)))


def share_slopes(problem: Problem, null: Fit) -> tuple[Array, Array]:
    """Slope (3,) of the cost in the shares and their information (3, 3), every other parameter refitted; arguments as
    of `scores`.
    """
    tangents = [tangent(problem, i, null.hypothesis, null.point) for i in range(len(problem.records))]
    if any(t is None for t in tangents):
        return np.zeros(len(SHARES)), np.eye(len(SHARES))
    pieces = [parts(t, NO_WHITENER, levels=True) for t in tangents if t is not None]
    held = tuple(i for i in at_bounds(null.point) if i not in SHARES)
    gradient, information, _ = reduced(
        problem, null.hypothesis, null.point, len(null.point.sizes), pieces, levels=True, held=held
    )
    return eliminated(gradient, information, SHARES)
