"""Test of nonlinear terms in the lateral-directional coefficients: dependence on alpha, then beta |beta|.

Least squares of a record with the terms beside the regressors, and Wald's statistic of the terms of each coefficient with the
covariance of coloured residuals. Its size is near chi-squared for long records.

Source: E. A. Morelli and V. Klein, Journal of Guidance, Control, and Dynamics 20(1), 1997, for the covariance.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from airtruth.identification.lateral.covariance import bread_of, meat, sandwich
from airtruth.identification.lateral.observation import (
    REGRESSORS,
    change_of_attack,
    nonlinear,
    observe,
    steady_flight,
)
from airtruth.identification.lateral.problems import smoothed
from airtruth.identification.options import TERMS, Options
from airtruth.logs.flight_log import Batch
from airtruth.physics.lateral import LateralConstants
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]

SIGNIFICANT: Final = 0.001
"""Probability below which a term is said to be there [-]; judgement: records have two terms in three coefficients."""


def p_values(batch: Batch, constants: LateralConstants, options: Options) -> Array:
    """(runs, terms, coefficients) probability of as large a term without it, in the order of `TERMS` and of the motion.

    NaN where the record does not determine the terms, such as without a change of alpha.

    Parameters
    ----------
    batch, constants, options : runs, aircraft, choices; ``options.terms`` has no effect.
    """
    plain = replace(options, terms=())
    o = observe(batch, constants, plain)
    change = change_of_attack(batch, steady_flight(batch, plain).attack)
    runs, first = len(batch.run_ids), len(REGRESSORS)
    result = np.full((runs, len(TERMS), len(LATERAL.coefficients)), np.nan)
    for number, name in enumerate(TERMS):
        terms = nonlinear(o.regressors, change, (name,))
        regressors = np.concatenate(
            [terms, o.regressors], axis=1
        )  # the surfaces stay last: they have corners
        rows = smoothed(replace(o, regressors=regressors), plain).rows
        bread, width = bread_of(rows), rows.x.shape[1]
        size = np.sqrt(np.einsum("rii->ri", bread))
        size = np.where(size > 0.0, size, 1.0)  # alpha does not change where the log lacks it
        sound = np.flatnonzero(np.linalg.cond(bread / (size[:, :, None] * size[:, None, :])) < _SINGULAR)
        if not sound.size:
            continue
        own = replace(rows, **{f: getattr(rows, f)[sound] for f in ("z", "x", "y", "free")})
        matrix = bread[sound]
        theta = np.swapaxes(np.linalg.solve(matrix, own.z @ np.swapaxes(own.y, 1, 2)), 1, 2).reshape(
            sound.size, -1
        )
        middle = meat(own, theta, "corrected", matrix, own.z.shape[2])
        covariance = sandwich(matrix, middle, "corrected", matrix)
        added = width - first
        for coefficient in range(result.shape[2]):
            at = slice(coefficient * width, coefficient * width + added)
            value = theta[:, at, None]
            wald = np.swapaxes(value, 1, 2) @ np.linalg.solve(covariance[:, at, at], value)
            result[sound, number, coefficient] = chdtrc(added, wald[:, 0, 0])
    return result


_SINGULAR: Final = 1e8
"""Condition number of the normal equations of unit-length columns from which terms are not tested [-]; judgement."""

__all__ = ["SIGNIFICANT", "p_values"]
