"""What the estimators share: the measured signals of a batch, and the regression they pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identify.options import AuxiliaryModel
from airtruth.physics.short_period import Scale

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

COMMAND: Final = "elevator_command_rad"

NOT_MADE = np.empty((0, 3, 0))
"""Instruments that a kernel makes itself, by the linear auxiliary model."""


@dataclass(frozen=True)
class Observation:
    """Signals of runs of one length, and what the low-pass makes of them.

    Attributes
    ----------
    dt_s : sample period [s].
    signals : (runs, 4, samples) alpha [rad], q [rad/s], az [g], elevator [rad].
    smooth : (runs, 4, samples) the same after the low-pass.
    left, left_smooth : (runs, 4, samples) left sides of lift and moment where the dynamic pressure is the
        measured one, from `airtruth.identify.pressure.divide`, q and az of ``signals`` then being divided
        too; without runs where it is constant.
    command : (runs, samples) elevator command [rad], or None.
    scale : factors of shape (runs,).
    factors : (runs, 4) from `airtruth.identify.rows.row_factors`.
    window : samples at the start of the record whose mean is the trim; 0 for a free intercept, the
        signals are then taken relative to their first sample.
    """

    dt_s: float
    signals: Array
    smooth: Array
    left: Array
    left_smooth: Array
    command: Array | None
    scale: Scale
    factors: Array
    window: int


@dataclass(frozen=True)
class Equations:
    """What the iteration asks of a regression y = X theta + nu with instruments Z made by theta.

    Attributes
    ----------
    moments : (theta (active, 6), active) -> (active, 4, 7) sums of products, [Z | TRIM] against
        [X | Y | TRIM], with the instruments and filters that theta makes.
    usable : theta (active, 6), active -> (active,) whether theta makes instruments at all.
    failed : (runs,) runs that cannot be estimated: no actuator was found.
    """

    moments: Callable[[Array, Ints], Array]
    usable: Callable[[Array, Ints], Bools]
    failed: Bools


@dataclass(frozen=True)
class Problem(Equations):
    """Equations of runs of one length, which can be had before summation too.

    Attributes
    ----------
    rows : (theta (active, 6), active) -> (active, 10, samples), see `airtruth.identify.rows`.
    """

    rows: Callable[[Array, Ints], Array]


def made_by(
    auxiliary: AuxiliaryModel, theta: Array, u: Array, dt_s: float, scale: Scale, active: Ints
) -> Array:
    """Instruments alpha, q, elevator (active, 3, samples) of a model passed in.

    Parameters
    ----------
    auxiliary : the model.
    theta : (active, 6) derivatives [-].
    u : (active, samples) input, deviation from trim [rad].
    dt_s, scale, active : sample period [s], factors of all runs, runs to make.
    """
    made = auxiliary(theta, u, dt_s, take(scale, active))
    return np.stack(made if len(made) == 3 else (*made, u), axis=1)


def take(scale: Scale, index: Ints) -> Scale:
    """The factors of some of the runs."""
    return Scale(
        airspeed_m_s=scale.airspeed_m_s[index],
        lift=scale.lift[index],
        moment=scale.moment[index],
        normal=scale.normal[index],
        half_chord_time=scale.half_chord_time[index],
    )


def relative(left: Array, window: int) -> Array:
    """Left sides (runs, 4, samples) of an observation as deviations, by `origin_of`; none stay none."""
    return left - origin_of(left, window)[:, :, None] if left.shape[0] > 0 else left


def origin_of(signals: Array, window: int) -> Array:
    """What the last axis is relative to: its first sample, or its mean over ``window`` samples if > 0."""
    if window > 0:
        return np.asarray(signals[..., :window].mean(axis=-1))
    return signals[..., 0].copy()
