"""What an identification answers: one frozen record per method, and its table."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from airtruth.identify.modal import modal_with_covariance
from airtruth.physics.short_period import MODAL, PARAMETERS, Scale

Array = NDArray[np.float64]


class Status(IntEnum):
    """How the identification of one run ended; `SENTENCES` says it in words."""

    CONVERGED = 0
    MAXIMUM_ITERATIONS = 1
    DIVERGED = 2
    UNSTABLE = 3
    SINGULAR = 4
    ACTUATOR = 5


JOINT: Final = "joint"
"""run_id of an estimate that all runs share."""

SENTENCES: Final[dict[Status, str]] = {
    Status.CONVERGED: "converged",
    Status.MAXIMUM_ITERATIONS: "maximum number of iterations reached before convergence",
    Status.DIVERGED: "diverged: an estimate left every plausible range",
    Status.UNSTABLE: "unstable auxiliary model: its simulation grows without bound over the record",
    Status.SINGULAR: "singular: the instruments do not separate the parameters",
    Status.ACTUATOR: "no stable first-order actuator found between command and surface",
}


@dataclass(frozen=True)
class Estimates:
    """Estimates of one method for a batch of runs, or for all of them jointly (one row).

    Attributes
    ----------
    method : name of the method.
    run_ids : names of the runs; of a joint estimate the single name "joint".
    theta : (runs, 6) in the order of PARAMETERS [-]; NaN where there is no estimate.
    covariance : (runs, 6, 6) by the rule ``covariance_name``.
    covariance_name : "printed", "white" or "coloured".
    status : (runs,) values of `Status`.
    iterations : (runs,) iterations of the instrumental variables; 0 for least squares.
    scale : factors (runs,) of the flight condition that theta refers to.
    confidence : probability of the intervals [-].
    """

    method: str
    run_ids: tuple[str, ...]
    theta: Array
    covariance: Array
    covariance_name: str
    status: NDArray[np.int8]
    iterations: NDArray[np.int32]
    scale: Scale
    confidence: float

    @property
    def converged(self) -> NDArray[np.bool_]:
        """(runs,) whether the estimate converged."""
        return np.asarray(self.status == Status.CONVERGED)


@dataclass(frozen=True)
class Quantities:
    """The six derivatives and the modal parameters with their uncertainty.

    Attributes
    ----------
    names : CLalpha ... Cmde [-], wn_rad_s [rad/s], zeta [-].
    value, std, lower, upper : (runs, 8); the interval is symmetric and normal.
    """

    names: tuple[str, ...]
    value: Array
    std: Array
    lower: Array
    upper: Array


def quantities(estimates: Estimates) -> Quantities:
    """Values, standard deviations and intervals of derivatives and modal parameters."""
    modal, modal_covariance = modal_with_covariance(estimates.theta, estimates.covariance, estimates.scale)
    value = np.concatenate([estimates.theta, modal], axis=-1)
    variance = np.concatenate(
        [
            np.diagonal(estimates.covariance, axis1=-2, axis2=-1),
            np.diagonal(modal_covariance, axis1=-2, axis2=-1),
        ],
        axis=-1,
    )
    std = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    half = float(norm.ppf(0.5 + 0.5 * estimates.confidence)) * std
    return Quantities(PARAMETERS + MODAL, value, std, value - half, value + half)


def estimates_table(estimates: Estimates) -> pd.DataFrame:
    """One row per run: run_id, method, converged, iterations, status, then NAME, NAME_std, ..._upper."""
    q = quantities(estimates)
    columns: dict[str, object] = {
        "run_id": list(estimates.run_ids),
        "method": [estimates.method] * len(estimates.run_ids),
        "converged": estimates.converged,
        "iterations": estimates.iterations,
        "status": [SENTENCES[Status(int(s))] for s in estimates.status],
    }
    for i, name in enumerate(q.names):
        columns[name] = q.value[:, i]
        columns[f"{name}_std"] = q.std[:, i]
        columns[f"{name}_lower"] = q.lower[:, i]
        columns[f"{name}_upper"] = q.upper[:, i]
    return pd.DataFrame(columns)
