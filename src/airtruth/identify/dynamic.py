"""Regressions filtered by the aircraft's own dynamics: IV(f1) and IV(f2).

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (7), (8) and
(11), figure 3.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify import rows as layout
from airtruth.identify.auxiliary import bounded, respond, state_matrices
from airtruth.identify.dynamic_kernel import (
    combine,
    denominator,
    linear_pair,
    rate,
    smooth_pair,
    step_and_bend,
    subtract,
)
from airtruth.identify.hold import first_order_hold
from airtruth.identify.intersample import servo_bend
from airtruth.identify.options import Options
from airtruth.identify.problem import NOT_MADE, Observation, Problem, made_by, origin_of, relative

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
    lift = factors[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = lift * (theta[:, 3] * theta[:, 2] / theta[:, 5] - theta[:, 0])
    return np.stack([corner, np.ones_like(corner)], axis=-1)


@njit(cache=True)
def _filter_run(
    signals: Array,
    bend: Array,
    origin: Array,
    left: Array,
    made: Array,
    theta: Array,
    factors: Array,
    numerator: Array,
    dt_s: float,
    work: Array,
    w: Array,
) -> None:
    """Fill the rows w (10, samples) of one run, see `dynamic_problem`; work (18, samples) is scratch."""
    a00, a01, a10, a11, b0, b1 = state_matrices(theta, factors)
    trace, det = denominator(a00, a01, a10, a11)
    e, g, h = first_order_hold(0.0, 1.0, -det, trace, 0.0, 1.0, dt_s)
    alpha, q, normal, elevator = signals[0], signals[1], signals[2], signals[3]
    if made.size == 0:
        respond((a00, a01, a10, a11, b0, b1), elevator, origin[3], dt_s, work[16], work[17])
    else:
        work[16:] = made[:2]
    smooth_pair(alpha, q, origin[0], origin[1], e, g, h, work[0:4])
    smooth_pair(normal, elevator, origin[2], origin[3], e, g, h, work[4:8])
    linear_pair(work[16], work[17], e, g, h, work[8:12])
    step_and_bend(bend, e, g[0] + h[0], g[1] + h[1], work[12:16])
    n0, n1 = numerator[0], numerator[1]
    for to, state in ((0, 8), (1, 10), (2, 6), (3, 12), (4, 0), (5, 2), (6, 6), (9, 4)):
        combine(n0, work[state], n1, work[state + 1], w[to])
    if made.size > 0:
        linear_pair(made[2], made[2], e, g, h, work[8:12])
        combine(n0, work[8], n1, work[9], w[2])
    combine(n0, work[14], n1, work[15], work[16])
    if left.shape[1] == 0:
        rate(alpha, alpha[0] - origin[0], work[0:2], work[12:14], n0, n1, trace, det, w[7])
        rate(q, q[0] - origin[1], work[2:4], work[12:14], n0, n1, trace, det, w[8])
        subtract(w[7], 1.0, w[5])
    else:
        x, y = left[0], left[1]
        smooth_pair(x, y, 0.0, 0.0, e, g, h, work[0:4])
        smooth_pair(left[2], left[3], 0.0, 0.0, e, g, h, work[4:8])
        rate(x, x[0], work[0:2], work[12:14], n0, n1, trace, det, w[7])
        rate(y, y[0], work[2:4], work[12:14], n0, n1, trace, det, w[8])
        combine(-n0, work[4], -n1, work[5], work[8])
        combine(-n0, work[6], -n1, work[7], work[9])
        subtract(w[7], 1.0, work[8])
        subtract(w[8], 1.0, work[9])
    subtract(w[7], b0, work[16])
    subtract(w[8], b1, work[16])


@njit(cache=True)
def _moments(
    signals: Array,
    bend: Array,
    origin: Array,
    left: Array,
    made: Array,
    theta: Array,
    factors: Array,
    numerator: Array,
    active: Ints,
    dt_s: float,
    moments: Array,
) -> None:
    w = np.empty((10, signals.shape[2]))
    work = np.empty((18, signals.shape[2]))
    nothing, no_left = np.empty((3, 0)), np.empty((4, 0))
    for i in range(active.size):
        r = active[i]
        external = made[i] if made.shape[0] > 0 else nothing
        own = left[r] if left.shape[0] > 0 else no_left
        _filter_run(
            signals[r],
            bend[r],
            origin[r],
            own,
            external,
            theta[i],
            factors[r],
            numerator[i],
            dt_s,
            work,
            w,
        )
        layout.products(w[:4], w[4:], moments[i])


@njit(cache=True)
def _rows(
    signals: Array,
    bend: Array,
    origin: Array,
    left: Array,
    made: Array,
    theta: Array,
    factors: Array,
    numerator: Array,
    active: Ints,
    dt_s: float,
    rows: Array,
) -> None:
    work = np.empty((18, signals.shape[2]))
    nothing, no_left = np.empty((3, 0)), np.empty((4, 0))
    for i in range(active.size):
        r = active[i]
        external = made[i] if made.shape[0] > 0 else nothing
        own = left[r] if left.shape[0] > 0 else no_left
        _filter_run(
            signals[r],
            bend[r],
            origin[r],
            own,
            external,
            theta[i],
            factors[r],
            numerator[i],
            dt_s,
            work,
            rows[i],
        )


def dynamic_problem(
    observation: Observation, options: Options, numerator: Callable[[Array, Array], Array]
) -> Problem:
    """IV whose X, Z and y pass the filter F(p) = (n0 + n1 p)/Delta(p) of the last iteration.

    Filtered derivatives are F(p) p of the signals: no finite differences. The auxiliary model is driven
    by the measured elevator; filter and model commute (eq. 11).

    Start: filters start from zero; a derivative is that of the signal relative to its first sample.
    Then F p x = F x' holds exactly from the first sample on, whatever motion the record starts in, and
    the constant of each equation becomes the step response of F, which is the TRIM column.

    Between samples: a signal is taken linear plus the constant that gives each cell the area of the
    cubic through the four nearest samples; where the elevator is seen to be a servo behind a held
    command, `airtruth.identify.intersample.servo_bend` rebuilds its corners, and what they add to
    alpha_dot and q_dot, b F(p) bend with b of the last iteration, is moved into y.

    Parameters
    ----------
    observation, options : signals and choices.
    numerator : `f1_numerator` or `f2_numerator`.
    """
    signals, factors, dt_s = observation.signals, observation.factors, observation.dt_s
    origin = origin_of(signals, observation.window)
    left = relative(observation.left, observation.window)
    bend = servo_bend(signals[:, 3])
    duration_s = dt_s * signals.shape[2]

    def instruments(theta: Array, active: Ints) -> Array:
        if options.auxiliary is None:
            return NOT_MADE
        u = signals[active, 3] - origin[active, 3, None]
        return made_by(options.auxiliary, theta, u, dt_s, observation.scale, active)

    def moments(theta: Array, active: Ints) -> Array:
        result = np.empty((active.size, 4, 7))
        made, top = instruments(theta, active), numerator(theta, factors[active])
        _moments(signals, bend, origin, left, made, theta, factors, top, active, dt_s, result)
        return result

    def rows(theta: Array, active: Ints) -> Array:
        result = np.empty((active.size, layout.COUNT, signals.shape[2]))
        made, top = instruments(theta, active), numerator(theta, factors[active])
        _rows(signals, bend, origin, left, made, theta, factors, top, active, dt_s, result)
        return result

    def usable(theta: Array, active: Ints) -> Bools:
        chosen = factors[active]
        return bounded(theta, chosen, duration_s) & np.isfinite(numerator(theta, chosen)).all(axis=1)

    failed = np.zeros(signals.shape[0], dtype=np.bool_)
    return Problem(moments=moments, usable=usable, failed=failed, rows=rows)
