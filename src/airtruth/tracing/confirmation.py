"""Are the held-out records no worse after than before? A test of innovations and of free runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.inference.assess import Assessment
from airtruth.tracing.inference.robust import MEMORY_S, long_run
from airtruth.tracing.stages import Stages

Array = NDArray[np.float64]

_ERRORS: Final = 2.0
"""Standard errors by which the held-out records may seem worse [-] (convention; two unrelated models of equal error are
denied in one of ten cases, measured in tests/tracing/test_confirmation.py)."""


def confirmation(stages: Stages, first: str = "before", second: str = "after") -> bool | None:
    """Whether a stage is no worse than an earlier one on held-out records; None without either of them.

    Two sums over the samples of all held-out records are tested against their long-run variance: the difference of the
    log-likelihoods of the innovations, and that of the squared residuals of the free runs over the noise floor.
    """
    if stages.case.held is None or second not in stages.models:
        return None
    before, after = stages.held[first], stages.held[second]
    lags = [round(MEMORY_S / r.signals.dt_s) for r in stages.case.held.records]
    free = _free_run_gains(before, after, stages.case.held.settings.measured)
    return not (_worse(_likelihood_gains(before, after), lags) or _worse(free, lags))


def _likelihood_gains(before: Sequence[Assessment], after: Sequence[Assessment]) -> Iterator[Array]:
    """(samples,) gains in log-likelihood of each record."""
    for old, new in zip(before, after, strict=True):
        yield _densities(new) - _densities(old)


def _densities(assessed: Assessment) -> Array:
    """(samples,) log-density of the innovations."""
    squares = 0.5 * (assessed.whitened**2).sum(axis=1)
    return np.asarray(-squares - (assessed.likelihood - squares.sum()) / len(squares))


def _free_run_gains(
    before: Sequence[Assessment], after: Sequence[Assessment], measured: NDArray[np.bool_]
) -> Iterator[Array]:
    """(samples,) gains in the squared residual of each record, measured channels weighted by the smaller of their errors."""
    for old, new in zip(before, after, strict=True):
        weight = np.minimum(old.free_run, new.free_run)
        gains = ((old.residual / weight) ** 2) - ((new.residual / weight) ** 2)
        yield gains[:, measured].sum(axis=1)


def _worse(gains: Iterator[Array], lags: Sequence[int]) -> bool:
    """Whether the sum of the gains is negative by more than `_ERRORS` of its standard errors."""
    total, variance = 0.0, 0.0
    for own, most in zip(gains, lags, strict=True):
        if not np.isfinite(own).all():
            return not np.isfinite(own[own > 0.0]).all()
        total += float(own.sum())
        variance += max(float(long_run((own - own.mean())[:, None], most)[0, 0]), 0.0)
    return total < -_ERRORS * float(np.sqrt(variance))


__all__ = ["confirmation"]
