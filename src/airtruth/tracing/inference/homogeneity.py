"""Whether single records have the derivatives and sizes of all records together.

With the slope x_i and the information H_i of record i at the common optimum, the records' own estimates lie at -H_i^-1 x_i, and

    Q = sum x_i' H_i^-1 x_i - (sum x_i)' (sum H_i)^-1 (sum x_i)

is the weighted sum of squares of their distances from the common one: chi-square if the records agree. Slopes of serially
dependent samples have a larger variance; Q is divided by the largest ratio of robust to plain variance.

Source: W. G. Cochran, Biometrics 10 (1954) 101-129, section 3, for several parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from airtruth.numerics.normal_equations import scaled_inverse
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.posterior import PosteriorFit, TraceProblem
from airtruth.tracing.inference.robust import MarginalSlope, inflation, marginal_slopes

Array = NDArray[np.float64]

_LEAST: Final = 1e-6
"""Information of a direction over that of the best-known one, scaled to unit diagonal, below which a record does not show it
[-] (judgement: above rounding)."""
_SEVERAL: Final = 3
"""Least number of records of which one can be told apart [-]: of two that differ, either may be wrong."""


DIFFERENCES: Final = "the differences between the records"
"""Deviation that the test of their agreement names."""


@dataclass(frozen=True)
class Homogeneity(HypothesisTest):
    """Test of the agreement of records.

    Attributes
    ----------
    outlier : number of the record without which the statistic falls most; None for fewer than three records.
    rest_p_value : the p-value of the other records among themselves; 1 without an outlier.
    """

    outlier: int | None
    rest_p_value: float


def homogeneity(problem: TraceProblem, fitted: PosteriorFit) -> Homogeneity:
    """Test whether the derivatives and the sizes of effects are those of each record.

    Parameters
    ----------
    problem, fitted : records, and a fit of them at its optimum.
    """
    common = problem.layout.common
    sizes = common.size + np.setdiff1d(np.arange(len(fitted.point.sizes)), fitted.hypothesis.fixed)
    kept = np.concatenate([np.arange(common.size)[common.derivatives], sizes])
    of_records = marginal_slopes(problem, fitted)
    x = np.array([own.slope[kept] for own in of_records])
    h = np.array([own.information[np.ix_(kept, kept)] for own in of_records])
    excess = float(inflation(problem, _at_own(fitted, of_records, kept, x, h))[kept].max()) ** 2
    everyone = np.arange(len(x))
    statistic, degrees = spread(x, h)
    p_value = float(chdtrc(max(degrees, 1), statistic / excess))
    if len(x) < _SEVERAL:
        return Homogeneity(DIFFERENCES, statistic / excess, degrees, p_value, None, 1.0)
    without = [spread(x[everyone != i], h[everyone != i]) for i in everyone]
    outlier = int(np.argmin([value for value, _ in without]))
    rest, own_degrees = without[outlier]
    rest_p_value = float(chdtrc(max(own_degrees, 1), rest / excess))
    return Homogeneity(DIFFERENCES, statistic / excess, degrees, p_value, outlier, rest_p_value)


def _at_own(
    fitted: PosteriorFit, of_records: Sequence[MarginalSlope], kept: NDArray[np.int64], x: Array, h: Array
) -> PosteriorFit:
    """The fit with the innovations that each record has at its own estimates, to first order.

    What differs between records is no serial dependence of the noise.
    """
    marginal, own_part = fitted.layout.marginal, fitted.layout.per_record
    moved = []
    for at, own, slope, information in zip(fitted.sensitivities, of_records, x, h, strict=True):
        step = np.zeros(marginal.stop)
        step[kept] = -scaled_inverse(information, _LEAST) @ slope
        followed = own.own @ step
        r = at.r + np.einsum("p,pki->ki", step, at.t[marginal])
        r += np.einsum("p,pki->ki", followed, at.t[own_part][: len(followed)])
        moved.append(replace(at, r=r))
    return replace(fitted, sensitivities=tuple(moved))


def spread(slopes: Array, information: Array) -> tuple[float, int]:
    """Weighted sum of squares of the records' estimates about the common one, and its degrees of freedom.

    Parameters
    ----------
    slopes : (records, parameters) of the negative log-likelihood; information : (records, parameters, parameters).

    Examples
    --------
    >>> slopes = np.array([[-1.0], [1.0]])  # estimates of 1 and -1 with unit standard errors
    >>> spread(slopes, np.ones((2, 1, 1)))
    (2.0, 1)
    """
    parts = [_energy(x, h) for x, h in zip(slopes, information, strict=True)]
    common, rank = _energy(slopes.sum(axis=0), information.sum(axis=0))
    return float(sum(value for value, _ in parts) - common), sum(n for _, n in parts) - rank


def _energy(x: Array, h: Array) -> tuple[float, int]:
    """x' h^-1 x over the directions that h shows, and their number."""
    size = np.sqrt(np.maximum(np.diagonal(h), 1e-300))
    values, vectors = np.linalg.eigh(h / np.outer(size, size))
    shown = values > _LEAST * values[-1]
    along = vectors[:, shown].T @ (x / size)
    return float(np.sum(along**2 / values[shown])), int(shown.sum())


__all__ = ["DIFFERENCES", "Homogeneity", "homogeneity", "spread"]
