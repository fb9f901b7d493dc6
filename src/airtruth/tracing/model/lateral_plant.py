"""Forces of the declared aircraft over the signals of the lateral-directional motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.simulation.trim import Trim

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LateralPlant:
    """The declared aircraft about one trim, as the filter needs it; the tables add up, one for each signal of the motion.

    Attributes
    ----------
    alpha_rad : (alpha,) axis of the tables [rad].
    points : (signals, points) axis of each signal: beta, p b/(2V), r b/(2V), aileron, rudder [rad, -].
    values : (signals, alpha, points, 3) Y [m2], L and N [m3] of the air over the dynamic pressure; the part at the trim's beta,
        no rates and the trim's surfaces is in the table of beta alone.
    constant : (alpha, 3) Y [N], L and N [N m] at no dynamic pressure.
    trim_alpha_rad : angle of attack of the trim [rad].
    trim_signals : (signals,) origin of the increments of the derivatives [rad, -].
    neutral_rad : (controls,) deflections that an effectiveness leaves alone [rad]: zero, for the linear model its trim.
    derivatives, derivative_cov : (15,) declared values and (15, 15) covariance, mass, inertias and CG included.
    trim : of the JSBSim aircraft, None for a linear one.
    alpha_shift_rad : 0, because the tables are over the measured angle of attack; of `airtruth.tracing.model.plant.Plant`, the
        angle from which the linear model counts.
    """

    aircraft: Aircraft
    alpha_rad: Array
    points: Array
    values: Array
    constant: Array
    trim_alpha_rad: float
    trim_signals: Array
    neutral_rad: Array
    derivatives: Array
    derivative_cov: Array
    trim: Trim | None
    alpha_shift_rad: float = 0.0


__all__ = ["LateralPlant"]
