"""The covariance of estimates as columns of a table: correlations beside the standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion import LONGITUDINAL

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


def correlation_names(names: Sequence[str] = LONGITUDINAL.parameters) -> tuple[str, ...]:
    """Columns of the correlations of derivatives, the upper triangle row by row.

    Examples
    --------
    >>> correlation_names(("CLalpha", "CLq", "CLde"))
    ('CLalpha_CLq_corr', 'CLalpha_CLde_corr', 'CLq_CLde_corr')
    """
    return tuple(f"{one}_{other}_corr" for one, other in combinations(names, 2))


def correlation_columns(
    covariance: Array, names: Sequence[str] = LONGITUDINAL.parameters
) -> dict[str, Array]:
    """Correlations [-] by the names of their columns; NaN where a variance is not positive.

    Parameters
    ----------
    covariance : (rows, n, n) in the order of ``names``.
    """
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    std = np.sqrt(np.where(variance > 0.0, variance, np.nan))
    correlation = covariance / (std[:, :, None] * std[:, None, :])
    upper = zip(*np.triu_indices(len(names), 1), strict=True)
    return {
        column: np.clip(correlation[:, i, j], -1.0, 1.0)
        for column, (i, j) in zip(correlation_names(names), upper, strict=True)
    }


def covariance_of(frame: pd.DataFrame, names: Sequence[str] = LONGITUDINAL.parameters) -> Array:
    """(rows, n, n) covariance of the derivatives of a table of estimates; NaN where the table does not hold it.

    Parameters
    ----------
    frame : columns NAME_std and those of `correlation_names`; files of older versions lack the latter.
    """
    n = len(names)
    covariance = np.full((len(frame), n, n), np.nan)
    wanted = [*(f"{name}_std" for name in names), *correlation_names(names)]
    if not set(wanted) <= set(frame.columns):
        return covariance
    values = frame[wanted].to_numpy(dtype=np.float64)
    std = values[:, :n]
    rows, columns = np.triu_indices(n, 1)
    covariance[:, range(n), range(n)] = std**2
    covariance[:, rows, columns] = values[:, n:] * std[:, rows] * std[:, columns]
    covariance[:, columns, rows] = covariance[:, rows, columns]
    return covariance


__all__ = ["correlation_columns", "correlation_names", "covariance_of"]
