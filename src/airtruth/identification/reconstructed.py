"""Intervals that hold the uncertainty of a reconstructed angle of attack.

An imported log without an alpha vane has, beside its reconstructed alpha, the directions of the errors of one standard
deviation that the reconstruction leaves (`airtruth.physics.reconstruction`). Each is added to alpha in turn, and the
change of the estimate is its effect, linear for small errors. The errors are those of instruments and therefore common to
all runs of a joint estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from airtruth.identification.estimates import Estimates
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import COLUMNS, is_reconstructed


def with_reconstruction(
    estimate: Callable[[Sequence[Batch], Options], Estimates], parts: Sequence[Batch], options: Options
) -> Estimates:
    """Estimate, and add to the covariance what the errors of a reconstructed alpha contribute.

    Where an estimate from a disturbed alpha does not exist the covariance is NaN: it cannot be stated.

    Parameters
    ----------
    estimate : (batches, options) -> estimates.
    parts : batches; those without the columns of a reconstruction are estimated as they are.
    options : choices.
    """
    made = estimate(parts, options)
    if options.covariance == "none" or not any(is_reconstructed(p.channels) for p in parts):
        return made
    covariance = made.covariance.copy()
    for name in COLUMNS:
        moved = estimate([_disturbed(part, name) for part in parts], replace(options, covariance="none"))
        change = moved.theta - made.theta
        covariance += change[:, :, None] * change[:, None, :]
    return replace(made, covariance=covariance)


def _disturbed(batch: Batch, name: str) -> Batch:
    if name not in batch.channels:
        return batch
    vane = LONGITUDINAL.vane
    angle = np.ascontiguousarray(batch.channels[vane] + batch.channels[name])
    return replace(batch, channels={**batch.channels, vane: angle})


__all__ = ["with_reconstruction"]
