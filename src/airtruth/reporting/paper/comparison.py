"""The paper's numbers for a method, with the Monte Carlo standard errors that it does not print."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.reporting.paper import published
from airtruth.reporting.paper.published import ESTIMATED, Printed, PublishedColumn
from airtruth.reporting.statistics import Array, MethodStatistics

_WORDS: Final[Mapping[int, str]] = {6: "six", 12: "twelve", 15: "fifteen"}
"""Number of derivatives -> word."""

RUNS: Final = ""
"""Name in place of a parameter for statistics of the runs."""


def together(motion: Motion) -> str:
    """Name in place of a parameter for statistics of all scored derivatives together: their number as a word."""
    return _WORDS[len(motion.scored)]


Key = tuple[str, str]
"""Parameter and statistic."""

Beside = Mapping[Key, tuple[Printed, float]]
"""Parameter and statistic -> published number and its Monte Carlo standard error."""


def published_figures(
    column: PublishedColumn, runs: int, ours: MethodStatistics
) -> dict[Key, tuple[Printed, float]]:
    """Return the published numbers of a column, and the RMSE that follows from them.

    The paper prints means and standard deviations s over n runs. Their standard errors are taken as
    s/sqrt(n) and s/sqrt(2(n - 1)), the latter exact to first order for normal estimates. That of
    RelErr follows from s by the delta method, with our correlation between the six estimates; that of
    the mean number of iterations from our spread of iterations over n runs. The RMSE is
    sqrt((mean - truth)^2 + s^2 (n - 1)/n).

    Parameters
    ----------
    column : column of the paper.
    runs : n, number of runs of the column.
    ours : statistics of the method to compare with.
    """
    truth = published.load().truth
    numbers: dict[Key, tuple[Printed, float]] = {}
    for name in ESTIMATED:
        mean, std = column.mean[name], column.std[name]
        bias, s2 = mean.value - truth[name].value, std.value**2
        rmse = math.sqrt(bias**2 + s2 * (runs - 1) / runs)
        numbers[name, "mean"] = mean, std.value / math.sqrt(runs)
        numbers[name, "std"] = std, std.value / math.sqrt(2.0 * (runs - 1))
        numbers[name, "rmse"] = (
            Printed(rmse, math.hypot(mean.unit * bias, std.unit * std.value) / rmse),
            math.sqrt((2.0 * s2**2 + 4.0 * bias**2 * s2) / runs) / (2.0 * rmse),
        )
    numbers[together(LONGITUDINAL), "relerr_pct"] = (
        column.relerr_pct,
        _relerr_se_pct(column, runs, ours.correlation),
    )
    for name, relerr in column.relerr_modal_pct.items():
        se = 100.0 * column.std[name].value / math.sqrt(runs) / truth[name].value
        numbers[name, "relerr_pct"] = relerr, se
    if column.iterations:
        se = float(ours.iterations.se) * math.sqrt(ours.counts.used / runs)
        numbers[RUNS, "iterations"] = column.iterations, se
    return numbers


def published_ratio(
    column: PublishedColumn,
    reference: PublishedColumn,
    runs: int,
    ours: MethodStatistics,
    our_reference: MethodStatistics,
    correlation: float,
) -> tuple[Printed, float]:
    """Return the ratio of two published RelErr and its standard error.

    The paper applies every method to the same runs but prints no correlation between methods. The correlation
    between our two RelErr replaces it, with the paper's own standard errors (delta method on the logarithm).

    Parameters
    ----------
    column, reference : numerator and denominator.
    runs : number of runs of the paper.
    ours, our_reference : statistics of the methods to compare with.
    correlation : between the errors of our two RelErr [-].
    """
    parts = [
        (c.relerr_pct.value, c.relerr_pct.unit, _relerr_se_pct(c, runs, s.correlation))
        for c, s in ((column, ours), (reference, our_reference))
    ]
    (a, unit_a, se_a), (b, unit_b, se_b) = parts
    variance = (se_a / a) ** 2 + (se_b / b) ** 2 - 2.0 * correlation * se_a * se_b / (a * b)
    ratio = a / b
    return Printed(ratio, ratio * math.hypot(unit_a / a, unit_b / b)), ratio * math.sqrt(max(variance, 0.0))


def _relerr_se_pct(column: PublishedColumn, runs: int, correlation: Array) -> float:
    names = LONGITUDINAL.parameters
    truth = published.load().truth
    target = np.array([truth[name].value for name in names])
    bias = np.array([column.mean[name].value for name in names]) - target
    std = np.array([column.std[name].value for name in names])
    weighted = bias / np.linalg.norm(bias) * std
    return 100.0 * math.sqrt(weighted @ correlation @ weighted / runs) / float(np.linalg.norm(target))
