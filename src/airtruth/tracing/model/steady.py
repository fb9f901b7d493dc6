"""The steady filter of a record: its linearisation at the record's mean, its gain, and the innovations that it expects.

Source: R. E. Maine and K. W. Iliff, NASA RP-1138 (1985), for the filter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.corners import Corners, input_column, spread_of
from airtruth.tracing.model.equations import settle_effects
from airtruth.tracing.model.kernel_input import FilterModel, KernelInput
from airtruth.tracing.model.linearise import (
    FirstUpdate,
    discrete,
    gain_of,
    linearise,
    process_intensity,
)
from airtruth.tracing.model.parameters import AZ, OUTPUTS

Array = NDArray[np.float64]


class SteadyFilter(NamedTuple):
    """Gain of the filter at the record's mean, and the innovations that it expects.

    Attributes
    ----------
    k_gain : (states, outputs) of the update; first : the part of it that alpha and q have alone.
    white, covariance : (outputs, outputs) whitener W with W S W' = I, and S; logdet : log|S|.
    corners : recursion where the surface is uncertain.
    direct : (states,) slope of az at the CG's accelerometer before its lag and delay.
    shown : share of a change of az since the last sample that its reading shows [-].
    """

    k_gain: Array
    first: FirstUpdate
    white: Array
    covariance: Array
    logdet: float
    corners: Corners
    direct: Array
    shown: float


def steady_filter(given: KernelInput) -> SteadyFilter | None:
    """The steady filter of a record; None where its innovations have no covariance.

    It depends on neither the initial state, nor the biases, nor the trim.
    """
    model = given.model
    n = model.states.size
    a, c = np.empty((n, n)), np.empty((OUTPUTS, n))
    direct = linearise_at_reference(given, a, c)
    process = process_intensity(given.reference.airspeed_m_s, model)
    phi, noise = discrete(a, process, given.dt_s)
    k_gain, white, covariance, logdet, p, first = gain_of(phi, c, noise, model.sensors.variance)
    if not math.isfinite(logdet):
        return None
    corners = _certain(model)
    if given.corner_rad2.size > 0:
        spread = spread_of(a, input_column(_reference_state(given), given.reference, model), given.dt_s)
        root = np.asarray(np.linalg.inv(white))
        corners = Corners(phi, noise, spread, p, c, model.sensors.variance, covariance, root, logdet)
    shown = _shown(float(model.sensors.lag_s[AZ]), float(model.sensors.delay_s[AZ]), given.dt_s)
    return SteadyFilter(k_gain, first, white, covariance, logdet, corners, direct, shown)


def _shown(lag_s: float, delay_s: float, dt_s: float) -> float:
    """Share of a ramp over one sample period that a lag and a delay show at its end [-]."""
    ratio = lag_s / dt_s
    behind = ratio * -math.expm1(-1.0 / ratio) if ratio > 0.0 else 0.0
    return (1.0 - behind) * max(0.0, 1.0 - delay_s / dt_s)


def _certain(model: FilterModel) -> Corners:
    """The recursion of a surface that is known everywhere."""
    none = np.zeros((0, 0))
    return Corners(none, none, none, none, none, model.sensors.variance, none, none, 0.0)


def without_update(model: FilterModel) -> SteadyFilter:
    """The filter of a free run, whose state no measurement corrects."""
    n, square = model.states.size, np.eye(OUTPUTS)
    first = FirstUpdate(np.zeros((n, 2)), np.zeros(2))
    return SteadyFilter(np.zeros((n, OUTPUTS)), first, square, square, 0.0, _certain(model), np.zeros(n), 1.0)


def _reference_state(given: KernelInput) -> Array:
    """The record's mean, effects' states in equilibrium with it."""
    x = np.zeros(given.model.states.size)
    x[0] = given.reference_alpha_rad
    settle_effects(x, x[0], given.reference.elevator_rad, given.model)
    return x


def linearise_at_reference(given: KernelInput, a: Array, c: Array) -> Array:
    """`linearise` at the record's mean, effects' states in equilibrium with it."""
    return linearise(_reference_state(given), given.reference, given.model, a, c)


__all__ = ["SteadyFilter", "linearise_at_reference", "steady_filter", "without_update"]
