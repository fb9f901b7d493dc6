"""Regressions of low-passed signals and their central differences: LS and the IV variants by input.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", III.D, figure 2, and
IV.B.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identify import rows as layout
from airtruth.identify.auxiliary import bounded, respond, state_matrices
from airtruth.identify.options import Options
from airtruth.identify.prefilter import butterworth, zero_phase
from airtruth.identify.problem import NOT_MADE, Observation, Problem, made_by, origin_of, relative

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@njit(cache=True)
def _fill(smooth: Array, origin: Array, left: Array, dt_s: float, rows: Array) -> None:
    last = smooth.shape[2] - 1
    half = 0.5 / dt_s
    for r in range(smooth.shape[0]):
        alpha, q, az, de = smooth[r, 0], smooth[r, 1], smooth[r, 2], smooth[r, 3]
        oa, oq, on, od = origin[r, 0], origin[r, 1], origin[r, 2], origin[r, 3]
        w = rows[r]
        for k in range(1, last):
            w[0, k - 1] = w[4, k - 1] = alpha[k] - oa
            w[1, k - 1] = w[5, k - 1] = q[k] - oq
            w[2, k - 1] = w[6, k - 1] = de[k] - od
            w[3, k - 1] = 1.0
            w[7, k - 1] = half * (alpha[k + 1] - alpha[k - 1]) - (q[k] - oq)
            w[8, k - 1] = half * (q[k + 1] - q[k - 1])
            w[9, k - 1] = az[k] - on
        if left.shape[0] > 0:
            x, y, to_lift, to_moment = left[r, 0], left[r, 1], left[r, 2], left[r, 3]
            for k in range(1, last):
                w[7, k - 1] = half * (x[k + 1] - x[k - 1]) + to_lift[k]
                w[8, k - 1] = half * (y[k + 1] - y[k - 1]) + to_moment[k]


def least_squares_rows(observation: Observation) -> Array:
    """Rows (runs, 10, samples - 2) of LS: Z = X.

    Derivatives are central differences, (x[k+1] - x[k-1])/(2 dt), of the low-passed signals; the first
    and the last sample have none. Their gain, sin(w dt)/(w dt), is a bias that falls as dt^2.
    """
    smooth = observation.smooth
    rows = np.empty((smooth.shape[0], layout.COUNT, smooth.shape[2] - 2))
    left = relative(observation.left_smooth, observation.window)
    _fill(smooth, origin_of(smooth, observation.window), left, observation.dt_s, rows)
    return rows


def ls_problem(observation: Observation, options: Options) -> Problem:
    """Least squares, eq. (5): the regressors are their own instruments."""
    rows = least_squares_rows(observation)
    return Problem(
        moments=lambda theta, active: layout.moments_of(rows),
        rows=lambda theta, active: rows[active],
        usable=lambda theta, active: np.ones(active.size, dtype=np.bool_),
        failed=np.zeros(rows.shape[0], dtype=np.bool_),
    )


@njit(cache=True)
def _instrument(
    theta: Array, factors: Array, u: Array, origin: float, made: Array, dt_s: float, z: Array
) -> None:
    """alpha and q of the auxiliary model and its input, at the samples that have a derivative."""
    samples = u.size
    alpha, q = z[4], z[5]
    if made.size == 0:
        respond(state_matrices(theta, factors), u, origin, dt_s, alpha, q)
        for k in range(1, samples - 1):
            z[2, k - 1] = u[k] - origin
    else:
        alpha[:] = made[0]
        q[:] = made[1]
        z[2, : samples - 2] = made[2, 1 : samples - 1]
    for k in range(1, samples - 1):
        z[0, k - 1] = alpha[k]
        z[1, k - 1] = q[k]
        z[3, k - 1] = 1.0


@njit(cache=True)
def _iv_moments(
    rows: Array,
    theta: Array,
    factors: Array,
    u: Array,
    origin: Array,
    made: Array,
    active: Ints,
    dt_s: float,
    moments: Array,
) -> None:
    samples = u.shape[1]
    z = np.empty((6, samples))
    nothing = np.empty((3, 0))
    for i in range(active.size):
        r = active[i]
        external = made[i] if made.shape[0] > 0 else nothing
        _instrument(theta[i], factors[r], u[r], origin[r], external, dt_s, z)
        layout.products(z[:4, : samples - 2], rows[r, 4:], moments[i])


@njit(cache=True)
def _iv_rows(
    theta: Array,
    factors: Array,
    u: Array,
    origin: Array,
    made: Array,
    active: Ints,
    dt_s: float,
    rows: Array,
) -> None:
    samples = u.shape[1]
    z = np.empty((6, samples))
    nothing = np.empty((3, 0))
    for i in range(active.size):
        r = active[i]
        external = made[i] if made.shape[0] > 0 else nothing
        _instrument(theta[i], factors[r], u[r], origin[r], external, dt_s, z)
        rows[i, :3] = z[:3, : samples - 2]


def iv_problem(
    observation: Observation,
    options: Options,
    u: Array,
    regressor: Array | None,
    failed: Bools,
) -> Problem:
    """IV with low-passed observations; Z comes from the auxiliary model driven by ``u``.

    Parameters
    ----------
    observation, options : signals and choices.
    u : (runs, samples) input of the auxiliary model and elevator of the instruments [rad].
    regressor : (runs, samples) replaces the measured elevator in X [rad], after the same low-pass;
        None keeps the measured elevator.
    failed : (runs,) runs without a usable ``u``.
    """
    rows = least_squares_rows(observation)
    dt_s = observation.dt_s
    factors = observation.factors
    u = np.ascontiguousarray(u)
    origin = origin_of(u, observation.window)
    if regressor is not None:
        smooth = zero_phase(regressor, butterworth(options.cutoff_hz, options.order, dt_s))
        smooth -= origin_of(smooth, observation.window)[:, None]
        rows[:, layout.X_DE] = smooth[:, 1:-1]
    duration_s = dt_s * u.shape[1]

    def instruments(theta: Array, active: Ints) -> Array:
        if options.auxiliary is None:
            return NOT_MADE
        inputs = u[active] - origin[active, None]
        return made_by(options.auxiliary, theta, inputs, dt_s, observation.scale, active)

    def moments(theta: Array, active: Ints) -> Array:
        result = np.empty((active.size, 4, 7))
        _iv_moments(rows, theta, factors, u, origin, instruments(theta, active), active, dt_s, result)
        return result

    def rows_at(theta: Array, active: Ints) -> Array:
        result = rows[active]
        _iv_rows(theta, factors, u, origin, instruments(theta, active), active, dt_s, result)
        return result

    def usable(theta: Array, active: Ints) -> Bools:
        return bounded(theta, factors[active], duration_s)

    return Problem(moments=moments, usable=usable, failed=failed, rows=rows_at)
