"""Statistics of estimators over runs that come in parts, in a memory that does not depend on the number of runs.

Sums are taken in two passes: those of the values, then those of powers of the deviations from the means. Medians are
exact and take further passes (`airtruth.numerics.order_statistics`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.order_statistics import medians
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.reporting import statistics
from airtruth.reporting.statistics import MAD_TO_STD, Counts, MethodStatistics, Statistic

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sample:
    """Runs of one method.

    Attributes
    ----------
    truth : (runs, estimated) derivatives and modal parameters, as `Motion.estimated`.
    flown : (runs,) whether the run has a log.
    values, lower, upper : (runs, estimated) estimates and the bounds of their intervals.
    converged, iterations, status : (runs,) how the estimation of each run ended.
    motion : whose parameters they are.
    """

    truth: Array
    flown: NDArray[np.bool_]
    values: Array
    lower: Array
    upper: Array
    converged: NDArray[np.bool_]
    iterations: Array
    status: tuple[str, ...]
    motion: Motion = LONGITUDINAL

    @property
    def finite(self) -> NDArray[np.bool_]:
        """(runs,) whether the run has finite derivatives, converged or not."""
        return np.asarray(self.flown & np.isfinite(self.values[:, _derivatives(self.motion)]).all(axis=1))

    @property
    def used(self) -> NDArray[np.bool_]:
        """(runs,) whether the run enters means."""
        return self.finite & self.converged

    @property
    def entering(self) -> NDArray[np.bool_]:
        """(runs, estimated) whether an estimate enters its mean: modal parameters of estimates that have all of them alone."""
        oscillates = self.used & np.isfinite(self.values[:, _modal(self.motion)]).all(axis=1)
        columns = [self.used] * len(self.motion.parameters) + [oscillates] * len(self.motion.modal)
        return np.stack(columns, axis=1)


def _derivatives(motion: Motion) -> slice:
    """Columns of the derivatives."""
    return slice(len(motion.parameters))


def _modal(motion: Motion) -> slice:
    """Columns of the modal parameters."""
    return slice(len(motion.parameters), None)


def _scored(motion: Motion) -> NDArray[np.intp]:
    """Columns of the derivatives that RelErr counts."""
    return np.array([motion.index(name) for name in motion.scored])


Parts = Callable[[], Iterable[Mapping[str, Sample]]]
"""Returns the same parts of a campaign at each call, each with the same runs of every method."""


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def method_statistics(parts: Parts) -> dict[str, MethodStatistics]:
    """Return the statistics of each method over the runs of a campaign.

    Parameters
    ----------
    parts : the runs, each in one part.
    """
    sums: dict[str, _PartialSums] = {}
    for part in parts():
        for method, sample in part.items():
            sums.setdefault(method, _PartialSums(sample.motion)).add(sample)
    powers = {method: _Powers(own) for method, own in sums.items()}
    products = np.zeros((len(sums), len(sums)))
    for part in parts():
        influences = np.stack([powers[method].add(sample) for method, sample in part.items()])
        products += influences @ influences.T
    median, mad = _robust(parts, sums)
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


class _PartialSums:
    """First pass: numbers of runs and sums."""

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.total, self.failed_to_fly, self.finite, self.flown, self.used = 0, 0, 0, 0, 0
        self.reasons: Counter[str] = Counter()
        columns = len(motion.estimated)
        self.stated = np.zeros(columns, dtype=np.bool_)
        self.n, self.values, self.truth = (np.zeros(columns) for _ in range(3))
        self.errors, self.squares, self.hits = (np.zeros(columns) for _ in range(3))
        self.iterations = 0.0

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

    def __init__(self, sums: _PartialSums) -> None:
        self._used = sums.used
        self._values, self._errors = sums.values / sums.n, sums.errors / sums.n
        self._truth, self._squares = sums.truth / sums.n, sums.squares / sums.n
        self._iterations = sums.iterations / max(sums.used, 1)
        self.second, self.fourth, self.errors, self.squares = np.zeros((4, len(sums.n)))
        self.products = np.zeros((len(sums.motion.parameters),) * 2)
        self.iterations = 0.0

    def add(self, s: Sample) -> Array:
        """Add a part, and return the influence of each of its runs on RelErr; 0 for runs that are not used."""
        used, entering = s.used, s.entering
        errors, deviations = s.values - s.truth, s.values - self._values
        self.second += _sum(deviations**2, entering)
        self.fourth += _sum(deviations**4, entering)
        self.errors += _sum((errors - self._errors) ** 2, entering)
        self.squares += _sum((errors**2 - self._squares) ** 2, entering)
        own = deviations[used, _derivatives(s.motion)]
        self.products += own.T @ own
        self.iterations += float(np.sum((s.iterations[used] - self._iterations) ** 2))
        influences = np.zeros(len(s.truth))
        scored = _scored(s.motion)
        influences[used] = statistics.influence(
            errors[used][:, scored], self._errors[scored], self._truth[scored], self._used
        )
        return influences


def _sum(x: Array, entering: NDArray[np.bool_]) -> Array:
    return np.asarray(np.sum(np.where(entering, x, 0.0), axis=0))


def _statistics(
    sums: _PartialSums,
    powers: _Powers,
    robust: tuple[Array, Array],
    own: float,
    products: Mapping[str, float],
) -> MethodStatistics:
    coverage = statistics.hit_rate_of(sums.n, sums.hits)
    bias, truth = sums.errors / sums.n, sums.truth / sums.n
    scored, modal = _scored(sums.motion), _modal(sums.motion)
    modal_bias = statistics.mean_of(sums.n[modal], sums.errors[modal], powers.errors[modal])
    modal_truth = np.abs(truth[modal])
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
            sums.used, bias[scored], truth[scored], own, float(np.sum(powers.errors[scored]))
        ),
        relerr_modal=Statistic(np.abs(modal_bias.value) / modal_truth, modal_bias.se / modal_truth),
        iterations=statistics.mean_of(sums.used, np.asarray(sums.iterations), np.asarray(powers.iterations)),
        correlation=statistics.correlation_of(sums.used, powers.products),
        products=products,
    )


def _robust(parts: Parts, sums: Mapping[str, _PartialSums]) -> tuple[Array, Array]:
    """Median and scaled median absolute deviation of each column over its finite rows, (methods, estimated) each."""
    methods = list(sums)

    def blocks() -> Iterator[Array]:
        for part in parts():
            yield np.concatenate(
                [np.where(part[m].finite[:, None], part[m].values, np.nan) for m in methods], axis=1
            )

    centre = medians(blocks)
    spread = medians(lambda: (np.abs(block - centre) for block in blocks()))
    shape = len(methods), -1
    return centre.reshape(shape), (MAD_TO_STD * spread).reshape(shape)


__all__ = ["Parts", "Sample", "method_statistics"]
