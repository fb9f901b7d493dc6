"""Statistics of estimators over runs that come in parts, in a memory that does not depend on the number of runs.

Sums are taken in two passes: those of the values, then those of powers of the deviations from the means. Medians are
exact and take further passes (`airtruth.numerics.order_statistics`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.order_statistics import medians
from airtruth.physics import short_period
from airtruth.reporting import statistics
from airtruth.reporting.statistics import MAD_TO_STD, Counts, MethodStatistics, Statistic

Array = NDArray[np.float64]

_SIX: Final = slice(0, len(short_period.PARAMETERS))
"""Columns of the six derivatives."""
_MODAL: Final = slice(len(short_period.PARAMETERS), None)
"""Columns of wn and zeta."""
_COLUMNS: Final = len(short_period.PARAMETERS) + len(short_period.MODAL)
"""Number of estimated parameters [-]."""


@dataclass(frozen=True)
class Sample:
    """Runs of one method.

    Attributes
    ----------
    truth : (runs, 8) six derivatives [-], wn [rad/s], zeta [-].
    flown : (runs,) whether the run has a log.
    values, lower, upper : (runs, 8) estimates and the bounds of their intervals.
    converged, iterations, status : (runs,) how the estimation of each run ended.
    """

    truth: Array
    flown: NDArray[np.bool_]
    values: Array
    lower: Array
    upper: Array
    converged: NDArray[np.bool_]
    iterations: Array
    status: tuple[str, ...]

    @property
    def finite(self) -> NDArray[np.bool_]:
        """(runs,) whether the run has finite derivatives, converged or not."""
        return np.asarray(self.flown & np.isfinite(self.values[:, _SIX]).all(axis=1))

    @property
    def used(self) -> NDArray[np.bool_]:
        """(runs,) whether the run enters means."""
        return self.finite & self.converged

    @property
    def entering(self) -> NDArray[np.bool_]:
        """(runs, 8) whether an estimate enters its mean: wn and zeta of oscillatory estimates alone."""
        oscillates = self.used & np.isfinite(self.values[:, _MODAL]).all(axis=1)
        columns = [self.used] * len(short_period.PARAMETERS) + [oscillates] * len(short_period.MODAL)
        return np.stack(columns, axis=1)


Parts = Callable[[], Iterable[Mapping[str, Sample]]]
"""Returns the same parts of a campaign at each call, each with the same runs of every method."""


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def method_statistics(parts: Parts) -> dict[str, MethodStatistics]:
    """Return the statistics of each method over the runs of a campaign.

    Parameters
    ----------
    parts : the runs, each in one part.
    """
    sums: dict[str, _Sums] = {}
    for part in parts():
        for method, sample in part.items():
            sums.setdefault(method, _Sums()).add(sample)
    powers = {method: _Powers(own) for method, own in sums.items()}
    products = np.zeros((len(sums), len(sums)))
    for part in parts():
        influences = np.stack([powers[method].add(sample) for method, sample in part.items()])
        products += influences @ influences.T
    median, mad = _robust(parts, list(sums))
    return {
        method: _statistics(
            sums[method],
            powers[method],
            (median[i], mad[i]),
            float(products[i, i]),
            dict(zip(sums, products[i].tolist(), strict=True)),
        )
        for i, method in enumerate(sums)
    }


def _zeros() -> Array:
    return np.zeros(_COLUMNS)


@dataclass
class _Sums:
    """First pass: numbers of runs and sums."""

    total: int = 0
    failed_to_fly: int = 0
    finite: int = 0
    flown: int = 0
    used: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    stated: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(_COLUMNS, dtype=np.bool_))
    n: Array = field(default_factory=_zeros)
    values: Array = field(default_factory=_zeros)
    truth: Array = field(default_factory=_zeros)
    errors: Array = field(default_factory=_zeros)
    squares: Array = field(default_factory=_zeros)
    hits: Array = field(default_factory=_zeros)
    iterations: float = 0.0

    def add(self, s: Sample) -> None:
        """Add a part."""
        used, entering = s.used, s.entering
        self.total += len(s.truth)
        self.failed_to_fly += int(np.sum(~s.flown))
        self.flown += int(np.sum(s.flown))
        self.finite += int(np.sum(s.finite))
        self.used += int(np.sum(used))
        self.reasons.update(s.status[run] for run in np.flatnonzero(s.flown & ~used))
        self.stated |= ~np.isnan(s.lower[used]).all(axis=0)
        errors = s.values - s.truth
        self.n += entering.sum(axis=0)
        self.values += _sum(s.values, entering)
        self.truth += _sum(s.truth, entering)
        self.errors += _sum(errors, entering)
        self.squares += _sum(errors**2, entering)
        self.hits += _sum(((s.lower <= s.truth) & (s.truth <= s.upper)).astype(np.float64), entering)
        self.iterations += float(np.sum(s.iterations[used]))

    @property
    def counts(self) -> Counts:
        """Number of runs by outcome."""
        return Counts(
            total=self.total,
            failed_to_fly=self.failed_to_fly,
            used=self.used,
            not_converged=self.finite - self.used,
            diverged=self.flown - self.finite,
            aperiodic=self.used - int(self.n[-1]),
            reasons=dict(self.reasons.most_common()),
        )


class _Powers:
    """Second pass: sums of powers of the deviations from the means."""

    def __init__(self, sums: _Sums) -> None:
        self._used = sums.used
        self._values, self._errors = sums.values / sums.n, sums.errors / sums.n
        self._truth, self._squares = sums.truth / sums.n, sums.squares / sums.n
        self._iterations = sums.iterations / max(sums.used, 1)
        self.second, self.fourth, self.errors, self.squares = _zeros(), _zeros(), _zeros(), _zeros()
        self.products = np.zeros((len(short_period.PARAMETERS),) * 2)
        self.iterations = 0.0

    def add(self, s: Sample) -> Array:
        """Add a part, and return the influence of each of its runs on RelErr; 0 for runs that are not used."""
        used, entering = s.used, s.entering
        errors, deviations = s.values - s.truth, s.values - self._values
        self.second += _sum(deviations**2, entering)
        self.fourth += _sum(deviations**4, entering)
        self.errors += _sum((errors - self._errors) ** 2, entering)
        self.squares += _sum((errors**2 - self._squares) ** 2, entering)
        self.products += deviations[used, _SIX].T @ deviations[used, _SIX]
        self.iterations += float(np.sum((s.iterations[used] - self._iterations) ** 2))
        influences = np.zeros(len(s.truth))
        influences[used] = statistics.influence(
            errors[used, _SIX], self._errors[_SIX], self._truth[_SIX], self._used
        )
        return influences


def _sum(x: Array, entering: NDArray[np.bool_]) -> Array:
    return np.asarray(np.sum(np.where(entering, x, 0.0), axis=0))


def _statistics(
    sums: _Sums, powers: _Powers, robust: tuple[Array, Array], own: float, products: Mapping[str, float]
) -> MethodStatistics:
    coverage = statistics.hit_rate_of(sums.n, sums.hits)
    bias, truth = sums.errors / sums.n, sums.truth / sums.n
    modal_bias = statistics.mean_of(sums.n[_MODAL], sums.errors[_MODAL], powers.errors[_MODAL])
    modal_truth = np.abs(truth[_MODAL])
    return MethodStatistics(
        counts=sums.counts,
        mean=statistics.mean_of(sums.n, sums.values, powers.second),
        std=statistics.standard_deviation_of(sums.n, powers.second, powers.fourth),
        rmse=statistics.root_of(statistics.mean_of(sums.n, sums.squares, powers.squares)),
        coverage=Statistic(
            np.where(sums.stated, coverage.value, np.nan), np.where(sums.stated, coverage.se, np.nan)
        ),
        median=robust[0],
        mad=robust[1],
        relerr=statistics.relative_error_of(
            sums.used, bias[_SIX], truth[_SIX], own, float(np.sum(powers.errors[_SIX]))
        ),
        relerr_modal=Statistic(np.abs(modal_bias.value) / modal_truth, modal_bias.se / modal_truth),
        iterations=statistics.mean_of(sums.used, np.asarray(sums.iterations), np.asarray(powers.iterations)),
        correlation=statistics.correlation_of(sums.used, powers.products),
        products=products,
    )


def _robust(parts: Parts, methods: list[str]) -> tuple[Array, Array]:
    """Median and scaled median absolute deviation of each column over its finite rows, (methods, 8) each."""

    def blocks() -> Iterator[Array]:
        for part in parts():
            yield np.concatenate(
                [np.where(part[m].finite[:, None], part[m].values, np.nan) for m in methods], axis=1
            )

    centre = medians(blocks)
    spread = medians(lambda: (np.abs(block - centre) for block in blocks()))
    shape = len(methods), _COLUMNS
    return centre.reshape(shape), (MAD_TO_STD * spread).reshape(shape)


__all__ = ["Parts", "Sample", "method_statistics"]
