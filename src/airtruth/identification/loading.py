"""A joint estimate of records with different centres of gravity.

Records of one centre of gravity are estimated together. The estimates of the groups are then combined by weighted least
squares, each transferred to the mean centre of gravity (minimum distance; T. S. Ferguson, *A Course in Large Sample
Theory*, 1996, ch. 23): as efficient as one joint fit where the groups are informative by themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError
from airtruth.identification.estimates import Estimates, Status, mean_scale
from airtruth.identification.record_constants import EqualRuns
from airtruth.physics.composition import cg_transfer

Array = NDArray[np.float64]


def mean_cg(groups: Mapping[float | None, Sequence[EqualRuns]]) -> float | None:
    """Mean centre of gravity over the runs [chords]; None if they state none."""
    runs = {cg: sum(len(p.batch.run_ids) for p in parts) for cg, parts in groups.items() if cg is not None}
    return sum(cg * n for cg, n in runs.items()) / sum(runs.values()) if runs else None


def at_one_cg(made: Mapping[float | None, Estimates], reference: float | None) -> Estimates:
    """One estimate from the joint estimates of several centres of gravity.

    Parameters
    ----------
    made : centre of gravity [chords] -> estimate of its runs, one row.
    reference : centre of gravity of the result [chords].

    Returns
    -------
    Estimates
        The single estimate if there is one. A group without a converged estimate makes the result not converged.

    Raises
    ------
    ConfigurationError
        If the estimates have no covariance, by which they are weighted.
    """
    parts = list(made.values())
    if len(parts) == 1 or reference is None:
        return parts[0]
    if parts[0].covariance_name == "none":
        raise ConfigurationError(
            "--joint: records with different centres of gravity are weighted by their covariance; "
            "state another --covariance than none"
        )
    bad = next((p for p in parts if not p.converged[0] or not np.isfinite(p.covariance).all()), None)
    scale = mean_scale([p.scale for p in parts])
    if bad is not None:
        status = bad.status if bad.status[0] != Status.CONVERGED else np.array([Status.SINGULAR], np.int8)
        nothing = np.full_like(bad.covariance, np.nan)
        return replace(
            bad, theta=np.full_like(bad.theta, np.nan), covariance=nothing, status=status, scale=scale
        )
    information, right = np.zeros_like(parts[0].covariance[0]), np.zeros_like(parts[0].theta[0])
    for cg, part in made.items():
        assert cg is not None
        to_own = cg_transfer(cg - reference)
        weight = np.linalg.inv(part.covariance[0])
        information += to_own.T @ weight @ to_own
        right += to_own.T @ weight @ part.theta[0]
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return replace(
        parts[0],
        theta=(covariance @ right)[None, :],
        covariance=covariance[None, :, :],
        iterations=np.max([p.iterations for p in parts], axis=0),
        scale=scale,
    )


__all__ = ["at_one_cg", "mean_cg"]
