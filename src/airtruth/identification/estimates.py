"""Estimates of one method as arrays, the quantities derived from them, and their rows of contract 2."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from airtruth.identification.covariance_columns import correlation_columns
from airtruth.identification.record_constants import RecordConstants
from airtruth.physics.lateral import LateralScale, lateral_modal, lateral_modes
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.short_period import Scale, modal, system

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
AnyScale = Scale | LateralScale
"""Factors of a flight condition, those of the motion."""
S = TypeVar("S", bound=Scale | LateralScale)


class Status(IntEnum):
    """How the identification of one run ended; `SENTENCES` has the words."""

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
    Status.ACTUATOR: "no stable first-order actuator fits command and surface",
}
"""Sentence for each status."""


@dataclass(frozen=True)
class Estimates:
    """Estimates of one method for a batch of runs, or for all of them jointly (one row).

    Attributes
    ----------
    method : name of the method.
    run_ids : names of the runs; of a joint estimate the single name "joint".
    theta : (runs, derivatives) in the order of ``motion.parameters`` [-]; NaN where there is no estimate.
    covariance : (runs, derivatives, derivatives) by the rule ``covariance_name``.
    covariance_name : name of the covariance: of `COVARIANCES`, or the method's own.
    status : (runs,) values of `Status`.
    iterations : (runs,) iterations of the instrumental variables; 0 for least squares.
    scale : factors (runs,) of the flight condition that theta refers to.
    confidence : probability of the intervals [-].
    motion : whose derivatives they are.
    memory : (runs,) largest correlation of neighbouring innovations of an output [-]; None where the method makes none.
    """

    method: str
    run_ids: tuple[str, ...]
    theta: Array
    covariance: Array
    covariance_name: str
    status: NDArray[np.int8]
    iterations: NDArray[np.int32]
    scale: AnyScale
    confidence: float
    motion: Motion = LONGITUDINAL
    memory: Array | None = None

    @property
    def converged(self) -> NDArray[np.bool_]:
        """(runs,) whether the estimate converged."""
        return np.asarray(self.status == Status.CONVERGED)

    @property
    def params(self) -> pd.DataFrame:
        """`airtruth.identification.frames.params`."""
        from airtruth.identification import frames

        return frames.params(self)

    @property
    def bse(self) -> pd.DataFrame:
        """`airtruth.identification.frames.bse`."""
        from airtruth.identification import frames

        return frames.bse(self)

    def conf_int(self, alpha: float = 0.05) -> pd.DataFrame:
        """`airtruth.identification.frames.conf_int`."""
        from airtruth.identification import frames

        return frames.conf_int(self, alpha)

    def cov_params(self, run_id: str | None = None) -> pd.DataFrame:
        """`airtruth.identification.frames.cov_params`."""
        from airtruth.identification import frames

        return frames.cov_params(self, run_id)

    def __repr__(self) -> str:
        """Return method, runs and convergence in a line."""
        return f"Estimates({self.method}, {int(self.converged.sum())} of {len(self.run_ids)} runs converged)"

    def rows(self, first: int, end: int) -> Estimates:
        """Estimates of the runs from number ``first`` to before number ``end``."""
        part = slice(first, end)
        return replace(
            self,
            run_ids=self.run_ids[part],
            theta=self.theta[part],
            covariance=self.covariance[part],
            status=self.status[part],
            iterations=self.iterations[part],
            scale=chosen(self.scale, part),
            memory=None if self.memory is None else self.memory[part],
        )


Parts = Callable[[], Iterable[Sequence[Estimates]]]
"""Returns the same parts at each call, each run in one of them; a part has one entry for each method, of the same runs."""


@dataclass(frozen=True)
class Quantities:
    """The derivatives and the modal parameters with their uncertainty.

    Attributes
    ----------
    names : those of the motion, derivatives first: CLalpha ... Cmde [-], wn_rad_s [rad/s], zeta [-].
    value, std, lower, upper : (runs, quantities); the interval is symmetric and normal.
    """

    names: tuple[str, ...]
    value: Array
    std: Array
    lower: Array
    upper: Array


def concatenated(parts: Sequence[Estimates], run_ids: Sequence[str]) -> Estimates:
    """Estimates of one method from several batches as one, in the order of ``run_ids``.

    Parameters
    ----------
    parts : estimates of one method with the same options; each run in one of them.
    run_ids : names of all their runs.
    """
    scale = joined([part.scale for part in parts])
    given = [run_id for part in parts for run_id in part.run_ids]
    if given == list(run_ids):
        order: slice | NDArray[np.int64] = slice(None)
    else:
        index = {run_id: i for i, run_id in enumerate(given)}
        order = np.array([index[run_id] for run_id in run_ids], dtype=np.int64)
    return replace(
        parts[0],
        run_ids=tuple(run_ids),
        theta=np.concatenate([part.theta for part in parts])[order],
        covariance=np.concatenate([part.covariance for part in parts])[order],
        status=np.concatenate([part.status for part in parts])[order],
        iterations=np.concatenate([part.iterations for part in parts])[order],
        scale=chosen(scale, order),
        memory=_joined_memory([part.memory for part in parts], order),
    )


def _joined_memory(parts: Sequence[Array | None], order: slice | NDArray[np.int64]) -> Array | None:
    known = [part for part in parts if part is not None]
    return np.concatenate(known)[order] if len(known) == len(parts) else None


def chosen(scale: S, runs: slice | NDArray[np.int64]) -> S:
    """Factors of some runs."""
    return type(scale)(*(np.asarray(getattr(scale, f))[runs] for f in scale.__dataclass_fields__))


def joined(scales: Sequence[S]) -> S:
    """Factors (runs,) of several batches, one after another."""
    first = scales[0]
    return type(first)(*(np.concatenate([getattr(s, f) for s in scales]) for f in first.__dataclass_fields__))


def mean_scale(scales: Sequence[S]) -> S:
    """Factors (1,): their means over the runs of several batches."""
    scale = joined(scales)
    return type(scale)(*(getattr(scale, f).mean(keepdims=True) for f in scale.__dataclass_fields__))


def modal_jacobian(theta: Array, s: Scale) -> Array:
    """d(wn, zeta)/d theta, (..., 2, 6): wn^2 = det A and 2 zeta wn = -tr A of eq. (2).

    Source of A: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eq. (2).
    The elevator derivatives do not enter. NaN where det A is not positive.
    """
    a, _ = system(theta, s)
    wn, zeta = modal(theta, s)
    h = s.half_chord_time
    zero = np.zeros_like(wn)
    # dA/dtheta: each of the four derivatives enters one element of A
    trace = np.stack([-s.lift + zero, zero, zero, zero, s.moment * h + zero, zero], axis=-1)
    det = np.stack(
        [
            -s.lift * a[..., 1, 1],
            s.lift * h * a[..., 1, 0],
            zero,
            -a[..., 0, 1] * s.moment,
            a[..., 0, 0] * s.moment * h,
            zero,
        ],
        axis=-1,
    )
    d_wn = det / (2.0 * wn)[..., None]
    d_zeta = -trace / (2.0 * wn)[..., None] - (zeta / wn)[..., None] * d_wn
    return np.stack([d_wn, d_zeta], axis=-2)


def modal_values(theta: Array, s: AnyScale) -> Array:
    """Modal parameters (..., modes) in the order of the motion's ``modal``."""
    return lateral_modal(theta, s) if isinstance(s, LateralScale) else np.stack(modal(theta, s), axis=-1)


def modal_with_covariance(theta: Array, covariance: Array, s: AnyScale) -> tuple[Array, Array]:
    """Modal parameters (..., modes) and their covariance (..., modes, modes), by the delta method."""
    if isinstance(s, LateralScale):
        values, jacobian = lateral_modes(theta, s)
    else:
        values, jacobian = np.stack(modal(theta, s), axis=-1), modal_jacobian(theta, s)
    return values, jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)


def quantities(estimates: Estimates) -> Quantities:
    """Values, standard deviations and intervals of derivatives and modal parameters."""
    modes, modal_covariance = modal_with_covariance(estimates.theta, estimates.covariance, estimates.scale)
    value = np.concatenate([estimates.theta, modes], axis=-1)
    variance = np.concatenate(
        [
            np.diagonal(estimates.covariance, axis1=-2, axis2=-1),
            np.diagonal(modal_covariance, axis1=-2, axis2=-1),
        ],
        axis=-1,
    )
    std = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    half = half_width(estimates.confidence) * std
    motion = estimates.motion
    return Quantities(motion.parameters + motion.modal, value, std, value - half, value + half)


def point_values(estimates: Estimates) -> Array:
    """(runs, quantities) derivatives and modal parameters: those of `quantities`, without their uncertainty."""
    return np.concatenate([estimates.theta, modal_values(estimates.theta, estimates.scale)], axis=-1)


def deviations(estimates: Estimates) -> Array:
    """(runs, derivatives) standard deviations of the derivatives [-]: those of `quantities`; NaN for a negative variance."""
    variance = np.diagonal(estimates.covariance, axis1=-2, axis2=-1)
    return np.asarray(np.sqrt(np.where(variance >= 0.0, variance, np.nan)))


def half_width(confidence: float) -> float:
    """Half the width of an interval of a normal variable [standard deviations]."""
    return float(ndtri(0.5 + 0.5 * confidence))


def estimates_table(estimates: Estimates, constants: RecordConstants | None = None) -> pd.DataFrame:
    """One row per run: run_id, method, converged, iterations, then NAME, NAME_std, ..._upper, then status.

    Behind them, correlations of the derivatives (`correlation_columns`) and, with the constants, the flight condition:
    airspeed_m_s, density_kg_m3, of the lateral motion alpha_rad and theta_rad
    (for the mass of the constants, also of a run that states another mass).

    Parameters
    ----------
    constants : of the aircraft; None leaves the flight condition out.
    """
    import pandas as pd

    q = quantities(estimates)
    columns: dict[str, object] = {
        "run_id": list(estimates.run_ids),
        "method": [estimates.method] * len(estimates.run_ids),
        "converged": estimates.converged,
        "iterations": estimates.iterations,
    }
    for i, name in enumerate(q.names):
        columns[name] = q.value[:, i]
        columns[f"{name}_std"] = q.std[:, i]
        columns[f"{name}_lower"] = q.lower[:, i]
        columns[f"{name}_upper"] = q.upper[:, i]
    columns["status"] = np.array(list(SENTENCES.values()), dtype=object)[estimates.status].tolist()
    columns |= correlation_columns(estimates.covariance, estimates.motion.parameters)
    if constants is not None:
        scale = estimates.scale
        airspeed = np.broadcast_to(scale.airspeed_m_s, len(estimates.run_ids))
        per_mass = scale.force if isinstance(scale, LateralScale) else scale.normal
        pressure = per_mass * constants.mass_kg / constants.wing_area_m2
        columns["airspeed_m_s"] = airspeed
        columns["density_kg_m3"] = 2.0 * pressure / airspeed**2
        for name in estimates.motion.known:
            if name not in columns and hasattr(scale, name):
                columns[name] = np.broadcast_to(getattr(scale, name), len(estimates.run_ids))
    return pd.DataFrame(columns)
