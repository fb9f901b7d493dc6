"""Origin of each number of the updated aircraft: standard deviation, records and date."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from datetime import date
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft.origin import Term, number_of, rounded, with_number
from airtruth.physics.terms import AeroTerm, Change

Array = NDArray[np.float64]

_STEP: Final = 0.01
"""Step of a derivative over a size, in its standard deviations [-] (judgement: as of the intervals of a trace)."""
_MOST_NAMES: Final = 6
"""Number of records that are named one by one [-] (judgement: they fit one line)."""
_SIZED: Final = ("surface", "states", "aero", "declared", "sensors", "readings")
"""Fields of a `Change` whose terms have a number of their own."""


def source_text(run_ids: Sequence[str]) -> str:
    """Method, date and records of a trace.

    Parameters
    ----------
    run_ids : the fitted records.
    """
    shown = ", ".join(run_ids)
    if len(run_ids) > _MOST_NAMES:
        shown = f"{run_ids[0]} to {run_ids[-1]} ({len(run_ids)} in all)"
    return f"airtruth trace of {date.today().isoformat()}, records {shown}"


def with_spread(
    change_at: Callable[[Array], Change], sizes: Array, covariance: Array
) -> tuple[Change, dict[Term, float]]:
    """The change at estimated sizes, and the standard deviations of its numbers, to first order.

    A number is rounded to a thousandth of its standard deviation; bends, whose slopes cancel, are not.

    Parameters
    ----------
    change_at : sizes (n,) -> change.
    sizes, covariance : (n,) estimates and their covariance (n, n).
    """
    change = change_at(sizes)
    terms = list(_terms(change))
    slopes = np.zeros((len(terms), len(sizes)))
    for i, std in enumerate(np.sqrt(np.diag(covariance))):
        step = np.zeros(len(sizes))
        step[i] = _STEP * std
        above, below = (
            np.array([number_of(t) for t in _terms(change_at(x))]) for x in (sizes + step, sizes - step)
        )
        if 0.0 < std < np.inf and len(above) == len(below) == len(terms):
            slopes[:, i] = (above - below) / (2.0 * step[i])
    variance = np.einsum("ti,ij,tj->t", slopes, covariance, slopes)
    stated: dict[Term, float] = {}
    shorter: dict[Term, Term] = {}
    for term, own in zip(terms, variance, strict=True):
        std = float(np.sqrt(max(own, 0.0)))
        bends = isinstance(term, AeroTerm) and term.curve is not None
        shorter[term] = term if bends else with_number(term, rounded(number_of(term), std))
        if 0.0 < std < np.inf:
            stated[shorter[term]] = std
    parts: dict[str, Any] = {name: tuple(shorter[t] for t in getattr(change, name)) for name in _SIZED}
    return replace(change, **parts), stated


def _terms(change: Change) -> Iterator[Term]:
    for field in fields(change):
        if field.name in _SIZED:
            yield from getattr(change, field.name)


__all__ = ["source_text", "with_spread"]
