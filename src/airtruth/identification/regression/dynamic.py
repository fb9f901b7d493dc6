"""Regressions filtered by the aircraft's own dynamics: IV(f1) and IV(f2).

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (7), (8) and
(11), figure 3.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import Observation, origin_of, relative
from airtruth.identification.options import Options
from airtruth.identification.regression import rows as layout
from airtruth.identification.regression.auxiliary import bounded
from airtruth.identification.regression.dynamic_kernel import (
    DynamicModel,
    DynamicRecords,
    filtered_moments,
    filtered_rows,
)
from airtruth.identification.regression.rows import NO_INSTRUMENTS, Problem, made_by
from airtruth.identification.signals import ELEVATOR
from airtruth.numerics.intersample import decay_of, servo_bend
from airtruth.physics.short_period import CL_ALPHA, CL_DE, CM_ALPHA, CM_DE

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def f1_numerator(theta: Array, factors: Array) -> Array:
    """F(p) = 1/Delta(p), eq. (7): rows (n0, n1) of (n0 + n1 p)/Delta."""
    numerator = np.zeros((theta.shape[0], 2))
    numerator[:, 0] = 1.0
    return numerator


def f2_numerator(theta: Array, factors: Array) -> Array:
    """F(p) = (p + 1/T_theta2)/Delta(p), eq. (8) without k_q, which is common to all rows and cancels.

    q/de of eq. (2) = (b1 p + a10 b0 - a00 b1)/Delta, so that 1/T_theta2 = a10 b0/b1 - a00.
    """
    lift = factors[:, layout.LIFT]
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = lift * (theta[:, CM_ALPHA] * theta[:, CL_DE] / theta[:, CM_DE] - theta[:, CL_ALPHA])
    return np.stack([corner, np.ones_like(corner)], axis=-1)


def dynamic_problem(
    observation: Observation, options: Options, numerator: Callable[[Array, Array], Array]
) -> Problem:
    """IV whose X, Z and y pass the filter F(p) = (n0 + n1 p)/Delta(p) of the last iteration.

    Filtered derivatives are F(p) p of the signals: no finite differences. The auxiliary model is driven
    by the measured elevator; filter and model commute (eq. 11).

    Start: filters start from zero; a derivative is that of the signal relative to its first sample.
    Then F p x = F x' holds exactly from the first sample on, whatever motion the record starts in, and
    the constant of each equation becomes the step response of F, which is the TRIM column.

    Between samples: a signal is taken as linear plus the constant that gives each cell the area of the
    cubic through the four nearest samples. Where the elevator shows a servo behind a held command,
    `airtruth.numerics.intersample.servo_bend` restores its corners; their effect on alpha_dot and q_dot,
    b F(p) bend with b of the last iteration, is moved into y.

    Parameters
    ----------
    observation, options : signals and choices.
    numerator : `f1_numerator` or `f2_numerator`.
    """
    signals, factors, dt_s = observation.signals, observation.factors, observation.dt_s
    origin = origin_of(signals, observation.window)
    records = DynamicRecords(
        signals=signals,
        bend=servo_bend(signals[:, ELEVATOR], declared_decay=decay_of(observation.servo_s, dt_s)),
        origin=origin,
        left=relative(observation.left, observation.window),
        factors=factors,
        dt_s=dt_s,
    )
    duration_s = dt_s * signals.shape[2]

    def model(theta: Array, active: Ints) -> DynamicModel:
        made = NO_INSTRUMENTS
        if options.auxiliary is not None:
            u = signals[active, ELEVATOR] - origin[active, ELEVATOR, None]
            made = made_by(options.auxiliary, theta, u, dt_s, observation.scale, active)
        return DynamicModel(np.ascontiguousarray(theta), numerator(theta, factors[active]), made, active)

    def moments(theta: Array, active: Ints) -> Array:
        result = np.empty((active.size, 4, 7))
        filtered_moments(records, model(theta, active), result)
        return result

    def rows(theta: Array, active: Ints) -> Array:
        result = np.empty((active.size, layout.COUNT, signals.shape[2]))
        filtered_rows(records, model(theta, active), result)
        return result

    def usable(theta: Array, active: Ints) -> Bools:
        chosen = factors[active]
        return bounded(theta, chosen, duration_s) & np.isfinite(numerator(theta, chosen)).all(axis=1)

    failed = np.zeros(signals.shape[0], dtype=np.bool_)
    return Problem(moments=moments, usable=usable, failed=failed, rows=rows)
