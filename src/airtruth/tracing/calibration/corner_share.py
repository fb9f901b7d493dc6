"""The share of the uncertainty of unseen corners of the surface that the records show.

The variance of a corner is that of a step anywhere between two samples (`airtruth.tracing.model.records`). Where the steps of
all records lie alike, or the surface moves in ramps, the interpolation errs by less, and the filter would take every delay
of the surface, which moves the uncertainty to a later sample, for an improvement.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.prepare import Case

SHARES: Final = tuple(0.5**k for k in range(11))
"""Shares of the variance that are tried [-], down to a thousandth (judgement: 3 % of a step)."""


def with_corner_share(case: Case, start: Parameters) -> Case:
    """The case with the variance of its corners times the most likely share, if its records have corners.

    Parameters
    ----------
    start : the fit of the declared aircraft.
    """
    if not any(r.signals.corner_rad2.size for r in case.fitted.records):
        return case
    share = corner_share(case.fitted, case.hypothesis, start)
    held = None if case.held is None else _scaled(case.held, share)
    return replace(case, fitted=_scaled(case.fitted, share), held=held)


def corner_share(problem: TraceProblem, hypothesis: Hypothesis, start: Parameters) -> float:
    """The share of the variance with the largest likelihood, everything else as it is; 1 where an effect is missing.

    Parameters
    ----------
    start : the fit of the hypothesis.
    """
    best, least = 1.0, np.inf
    for share in SHARES:
        own = fit(_scaled(problem, share), hypothesis, start, iterations=0)
        if own is None or own.cost >= least:
            break
        best, least = share, own.cost
    return best


def _scaled(problem: TraceProblem, share: float) -> TraceProblem:
    records = tuple(
        replace(r, signals=replace(r.signals, corner_rad2=share * r.signals.corner_rad2))
        for r in problem.records
    )
    return replace(problem, records=records)


__all__ = ["SHARES", "corner_share", "with_corner_share"]
