"""Regressions of low-passed signals and their central differences: LS and the IV variants by input.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", III.D, figure 2, and
IV.B: "the transfer between de_r and de is identified as a continuous-time first order system" by SRIVC.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.identification.condition import ALPHA, AZ, ELEVATOR, Observation, Q, origin_of, relative
from airtruth.identification.options import Options
from airtruth.identification.regression import rows as layout
from airtruth.identification.regression.auxiliary import bounded, respond, state_matrices
from airtruth.identification.regression.rows import NO_INSTRUMENTS, Problem, made_by
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.numerics.srivc import TransferFunctions, simulate, srivc

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

START_RAD_S: Final = 2.0 * np.pi * 5.0
"""Pole of the first filter in the identification of the actuator [rad/s]: 5 Hz, judgement; the estimate does
not depend on it."""

_ALPHA: Final = 4
"""Row of scratch for alpha of the auxiliary model."""
_Q: Final = 5
"""Row of scratch for q of the auxiliary model."""


@njit(cache=True)
def _fill(smooth: Array, origin: Array, left: Array, dt_s: float, rows: Array) -> None:
    """Rows of LS of all runs; ``left`` without runs where the signals give the left sides."""
    last = smooth.shape[2] - 1
    half = 0.5 / dt_s
    for r in range(smooth.shape[0]):
        alpha, q, az, elevator = smooth[r, ALPHA], smooth[r, Q], smooth[r, AZ], smooth[r, ELEVATOR]
        o = origin[r]
        w = rows[r]
        for k in range(1, last):
            w[layout.Z_ALPHA, k - 1] = w[layout.X_ALPHA, k - 1] = alpha[k] - o[ALPHA]
            w[layout.Z_Q, k - 1] = w[layout.X_Q, k - 1] = q[k] - o[Q]
            w[layout.Z_DE, k - 1] = w[layout.X_DE, k - 1] = elevator[k] - o[ELEVATOR]
            w[layout.TRIM, k - 1] = 1.0
            w[layout.Y_LIFT, k - 1] = half * (alpha[k + 1] - alpha[k - 1]) - (q[k] - o[Q])
            w[layout.Y_MOMENT, k - 1] = half * (q[k + 1] - q[k - 1])
            w[layout.Y_NORMAL, k - 1] = az[k] - o[AZ]
        if left.shape[0] > 0:
            x, y, to_lift, to_moment = left[r, 0], left[r, 1], left[r, 2], left[r, 3]
            for k in range(1, last):
                w[layout.Y_LIFT, k - 1] = half * (x[k + 1] - x[k - 1]) + to_lift[k]
                w[layout.Y_MOMENT, k - 1] = half * (y[k + 1] - y[k - 1]) + to_moment[k]


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
    """Fill z (6, samples): instruments at the samples that have a derivative, and two rows of scratch."""
    samples = u.size
    alpha, q = z[_ALPHA], z[_Q]
    if made.size == 0:
        respond(state_matrices(theta, factors), u, origin, dt_s, alpha, q)
        for k in range(1, samples - 1):
            z[layout.Z_DE, k - 1] = u[k] - origin
    else:
        alpha[:] = made[0]
        q[:] = made[1]
        z[layout.Z_DE, : samples - 2] = made[2, 1 : samples - 1]
    for k in range(1, samples - 1):
        z[layout.Z_ALPHA, k - 1] = alpha[k]
        z[layout.Z_Q, k - 1] = q[k]
        z[layout.TRIM, k - 1] = 1.0


@njit(cache=True)
def _instruments(
    theta: Array, factors: Array, u: Array, origin: Array, made: Array, active: Ints, dt_s: float, rows: Array
) -> None:
    """Instruments of the active runs, into the first rows of rows (active, 10, samples - 2)."""
    samples = u.shape[1]
    z = np.empty((_Q + 1, samples))
    nothing = np.empty((3, 0))
    for i in range(active.size):
        r = active[i]
        external = made[i] if made.shape[0] > 0 else nothing
        _instrument(theta[i], factors[r], u[r], origin[r], external, dt_s, z)
        rows[i, : layout.TRIM + 1] = z[: layout.TRIM + 1, : samples - 2]


def iv_problem(
    observation: Observation,
    options: Options,
    u: Array,
    regressor: Array | None,
    failed: Bools,
    instruments: Callable[[Array, Ints], Array] | None = None,
) -> Problem:
    """IV with low-passed observations; Z comes from the auxiliary model driven by ``u``.

    Parameters
    ----------
    observation, options : signals and choices.
    u : (runs, samples) input of the auxiliary model and elevator of the instruments [rad].
    regressor : (runs, samples) replaces the measured elevator in X [rad], after the same low-pass;
        None keeps the measured elevator.
    failed : (runs,) runs without a usable ``u``.
    instruments : (theta (active, 6), active) -> instruments alpha, q, elevator (active, 3, samples) in place of the
        auxiliary model's.
    """
    rows = least_squares_rows(observation)
    dt_s = observation.dt_s
    factors = observation.factors
    u = np.ascontiguousarray(u)
    origin = origin_of(u, observation.window)
    if regressor is not None:
        smooth = zero_phase(regressor, butterworth(options.cutoff_of(dt_s), options.order, dt_s))
        smooth -= origin_of(smooth, observation.window)[:, None]
        rows[:, layout.X_DE] = smooth[:, 1:-1]
    duration_s = dt_s * u.shape[1]

    def rows_at(theta: Array, active: Ints) -> Array:
        made = NO_INSTRUMENTS
        if instruments is not None:
            made = instruments(theta, active)
        elif options.auxiliary is not None:
            inputs = u[active] - origin[active, None]
            made = made_by(options.auxiliary, theta, inputs, dt_s, observation.scale, active)
        result = rows[active]
        _instruments(theta, factors, u, origin, made, active, dt_s, result)
        return result

    def usable(theta: Array, active: Ints) -> Bools:
        return bounded(theta, factors[active], duration_s)

    return Problem(
        moments=lambda theta, active: layout.moments_of(rows_at(theta, active)),
        usable=usable,
        failed=failed,
        rows=rows_at,
    )


def identify_actuator(command: Array, elevator: Array, dt_s: float) -> TransferFunctions:
    """First-order actuator b/(p + a) of each run; the command is held between samples.

    Parameters
    ----------
    command, elevator : (runs, samples) [rad].
    dt_s : sample period [s].
    """
    return srivc(command, elevator, dt_s, na=1, nb=1, start_rad_s=START_RAD_S)


def estimated_elevator(command: Array, elevator: Array, dt_s: float) -> tuple[Array, Bools]:
    """Noise-free elevator (runs, samples), relative to its start [rad], and the runs that have none.

    A run without a stable actuator model has none; its row is zero.
    """
    model = identify_actuator(command, elevator, dt_s)
    failed = ~model.converged
    usable = TransferFunctions(
        np.where(failed[:, None], 1.0, model.a),
        np.where(failed[:, None], 0.0, model.b),
        model.converged,
        model.iterations,
    )
    return simulate(usable, command - command[:, :1], dt_s), failed
