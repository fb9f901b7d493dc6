"""Regressions of low-passed signals and their central differences: LS and the IV variants by input.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", III.D, figure 2, and
IV.B: "the transfer between de_r and de is identified as a continuous-time first order system" by SRIVC.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.condition import Observation, origin_of, relative
from airtruth.identification.options import Options
from airtruth.identification.regression import rows as layout
from airtruth.identification.regression.auxiliary import bounded, short_period
from airtruth.identification.regression.rows import Problem, made_by
from airtruth.identification.signals import ALPHA, AZ, ELEVATOR, Q
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.numerics.srivc import HOLDS, TransferFunctions, simulate, srivc

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

START_RAD_S: Final = 2.0 * np.pi * 5.0
"""Pole of the first filter in the identification of the actuator [rad/s]: 5 Hz, judgement; the estimate does
not depend on it."""


def least_squares_rows(observation: Observation) -> Array:
    """Rows (runs, 10, samples - 2) of LS: Z = X.

    Derivatives are central differences, (x[k+1] - x[k-1])/(2 dt), of the low-passed signals; the first
    and the last sample have none. Their gain, sin(w dt)/(w dt), is a bias that falls as dt^2.
    """
    smooth = observation.smooth
    rows = np.empty((smooth.shape[0], layout.COUNT, smooth.shape[2] - 2))
    half = 0.5 / observation.dt_s
    inside = smooth[:, :, 1:-1] - origin_of(smooth, observation.window)[:, :, None]
    for name, to in (
        (ALPHA, (layout.Z_ALPHA, layout.X_ALPHA)),
        (Q, (layout.Z_Q, layout.X_Q)),
        (ELEVATOR, (layout.Z_DE, layout.X_DE)),
    ):
        rows[:, to] = inside[:, None, name]
    rows[:, layout.TRIM] = 1.0
    rows[:, layout.Y_NORMAL] = inside[:, AZ]
    left = relative(observation.left_smooth, observation.window)
    if left.shape[0] > 0:
        derivative = half * (left[:, :2, 2:] - left[:, :2, :-2])
        rows[:, layout.Y_LIFT] = derivative[:, 0] + left[:, 2, 1:-1]
        rows[:, layout.Y_MOMENT] = derivative[:, 1] + left[:, 3, 1:-1]
    else:
        rows[:, layout.Y_LIFT] = half * (smooth[:, ALPHA, 2:] - smooth[:, ALPHA, :-2]) - inside[:, Q]
        rows[:, layout.Y_MOMENT] = half * (smooth[:, Q, 2:] - smooth[:, Q, :-2])
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
        result = rows[active]
        if instruments is not None:
            made = instruments(theta, active)
        else:
            inputs = u[active] - origin[active, None]
            if options.auxiliary is not None:
                made = made_by(options.auxiliary, theta, inputs, dt_s, observation.scale, active)
            else:
                made = np.stack((*short_period(theta, factors[active], inputs, dt_s), inputs), axis=1)
        result[:, layout.Z_ALPHA : layout.Z_DE + 1] = made[:, :, 1:-1]
        result[:, layout.TRIM] = 1.0
        return result

    def usable(theta: Array, active: Ints) -> Bools:
        return bounded(theta, factors[active], duration_s)

    return Problem(
        moments=lambda theta, active: layout.moments_of(rows_at(theta, active)),
        usable=usable,
        failed=failed,
        rows=rows_at,
    )


def identify_actuator(command: Array, elevator: Array, dt_s: float, hold: str = "zoh") -> TransferFunctions:
    """First-order actuator b/(p + a) of each run.

    Parameters
    ----------
    command, elevator : (runs, samples) [rad].
    dt_s : sample period [s].
    hold : of the command between samples, one of `airtruth.numerics.srivc.HOLDS`.
    """
    return srivc(command, elevator, dt_s, na=1, nb=1, start_rad_s=START_RAD_S, hold=hold)


def estimated_elevator(command: Array, elevator: Array, dt_s: float) -> tuple[Array, Bools]:
    """Noise-free elevator (runs, samples), relative to its start [rad], and the runs that have none.

    The command is held between samples. Where no servo fits that, it is linear: in a slow log the surface follows a step
    faster than a servo behind a held command does. A run without a stable actuator model has no elevator; its row is zero.
    """
    result = np.zeros_like(command)
    failed = np.ones(command.shape[0], dtype=np.bool_)
    for hold in HOLDS:
        tried = np.flatnonzero(failed)
        model = identify_actuator(command[tried], elevator[tried], dt_s, hold)
        fits = model.converged
        stable = TransferFunctions(model.a[fits], model.b[fits], fits[fits], model.iterations[fits])
        inputs = command[tried[fits]]
        result[tried[fits]] = simulate(stable, inputs - inputs[:, :1], dt_s, hold)
        failed[tried[fits]] = False
    return result, failed
