"""The tangent linear model of the filter along a record: how its innovations change with small increments of CL, of Cm and of
the readings, at the gains that the filter has.

    x_k+1 = Phi_k (x_k + K_k e_k) + sum_p G_kp u_kp,   e_k = C_k x_k + D_k u_k + R_k v_k,

x, e : changes of state and innovation; u : increments of CL and Cm at the points p of the steps after a sample; v : those of the
readings. Many increments share the matrices, which cost as much as a dozen flights of the filter.

Source: O. Talagrand and P. Courtier, Q. J. R. Meteorol. Soc. 113 (1987) 1311-1328, section 2 (the tangent linear equations).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import inner
from airtruth.tracing.model.advance import Steps, Work, advance_motion, advance_sensors, steps_of, work_of
from airtruth.tracing.model.by_motion import air_at, coefficient_field, coefficients_of, rates, shifted
from airtruth.tracing.model.equations import air_alpha, effective_elevator, gust
from airtruth.tracing.model.filter import Path, innovation, innovations, path_of
from airtruth.tracing.model.kernel_input import AirPoint, GridSignals, KernelInput, SensorArrays
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.parameters import OUTPUTS
from airtruth.tracing.model.response import LOST, FilterInputs, kernel_input
from airtruth.tracing.model.settings import Settings
from airtruth.tracing.model.steady import steady_filter

Array = NDArray[np.float64]

POINTS: Final = 3
"""Points of a step: its start, its middle and its end [-]."""
FLOWN: Final = ("alpha", "elevator", "qhat", "alpha_dot_hat", "qbar", "body_qhat")
"""Signals of the motion that are kept, of `airtruth.physics.terms.SIGNALS`; body_qhat is q c/(2V) without the rotary gust."""
_H: Final = 1e-6
"""Step of the differences in a state, a coefficient and a reading [its unit]; judgement: large against rounding, and small
against the cells of the tables."""


class Matrices(NamedTuple):
    """The tangent linear model's matrices.

    Attributes
    ----------
    phi : (steps, states, states) transition of a step of integration; the first of a sample includes the decay of the
        correlated noise.
    force : (steps, states, 2, points) by increments of CL and Cm at the points of the step.
    c, d : (samples, outputs, states) and (samples, outputs, 2).
    reading : (samples, outputs, outputs) by increments of the predicted outputs.
    flown : (steps, points, `FLOWN`) signals of the motion; those in the middle of a step are means, but for those of the grid.
    """

    phi: Array
    force: Array
    c: Array
    d: Array
    reading: Array
    flown: Array


class Tangent(NamedTuple):
    """The tangent linear model of one record.

    Attributes
    ----------
    matrices : see there; path : gains of the filter.
    steps : number of steps of integration to a sample; h_s : their length [s].
    lead : samples before the part of a run that counts.
    sensors : whose scales, lags and delays increments of readings share.
    start : (2,) angle of attack and elevator with which memories are in equilibrium at first [rad].
    """

    matrices: Matrices
    path: Path
    steps: int
    h_s: float
    lead: int
    sensors: SensorArrays
    start: Array


@inner
def _flown(x: Array, at: AirPoint, given: KernelInput, work: Work, out: Array) -> None:
    """The signals `FLOWN` at a state."""
    aircraft, gusts = given.model.aircraft, given.model.gusts
    upward, half = gust(x, gusts.rolloff), 0.5 * aircraft.chord_m / at.airspeed_m_s
    late = (upward - x[4]) / gusts.rotary_time_s
    rates(x, at, given.model, work.rate[0])
    out[0] = air_alpha(x, upward, gusts.level_m_s, at)
    out[1] = effective_elevator(at.elevator_rad, aircraft)
    out[2] = (x[1] - gusts.rotary * gusts.level_m_s * late / at.airspeed_m_s) * half
    out[3] = work.rate[0, 0] * half
    out[4] = at.qbar_pa
    out[5] = x[1] * half


@inner
def _advance(x: Array, point: int, given: KernelInput, steps: Steps, work: Work, forgets: bool) -> None:
    """One step of integration, after the decay of the correlated noise where a sample precedes it."""
    states = given.model.states
    if forgets and states.noise >= 0:
        for i in range(states.noise, states.size):
            x[i] *= steps.forget
    advance_motion(x, point, given.grid, given.model, steps, work)
    if steps.has_late_sensors:
        advance_sensors(x, point, given.grid, given.model, steps, work)


@inner
def _copy(x: Array, to: Array) -> None:
    for i in range(x.size):
        to[i] = x[i]


@awaited
@njit(cache=True, nogil=True, error_model="numpy")
def _differences(
    given: KernelInput, steps: Steps, work: Work, path: Path, shown: float, out: Matrices
) -> None:
    """Matrices along a path by one-sided differences; increments of the grid and the outputs are moved and return."""
    n, samples, count = given.model.states.size, given.y.shape[0], given.sub // 2
    grid, x, base, moved = given.grid, np.empty(n), np.empty(n), np.empty(n)
    raw, near = np.empty(OUTPUTS), np.empty(OUTPUTS)
    for k in range(samples):
        at, first = air_at(grid, k * given.sub), FirstUpdate(path.first.gain[k], path.first.share[k])
        branch = max(k, 1)  # the first sample settles late sensors, which is no part of its innovation
        for j in range(n + 2 + OUTPUTS + 1):
            _copy(path.predicted[k], x)
            lift = moment = 0.0
            if 0 < j <= n:
                x[j - 1] += _H
            elif j == n + 1:
                lift = _H
            elif j == n + 2:
                moment = _H
            elif j > n + 2:
                given.more[branch, j - n - 3] += _H
            forced = _with_force(at, lift, moment)
            innovation(x, branch, forced, given, first, path.direct[k], shown, work, raw)
            if j > n + 2:
                given.more[branch, j - n - 3] -= _H
            for i in range(OUTPUTS):
                slope = (raw[i] - near[i]) / _H
                if j == 0:
                    near[i] = raw[i]
                elif j <= n:
                    out.c[k, i, j - 1] = slope
                elif j <= n + 2:
                    out.d[k, i, j - n - 1] = slope
                else:
                    out.reading[k, i, j - n - 3] = slope
        if k + 1 == samples:
            break
        _copy(path.corrected[k], base)
        for part in range(count):
            step, point, forgets = k * count + part, k * given.sub + 2 * part, part == 0
            _flown(base, air_at(grid, point), given, work, out.flown[step, 0])
            _copy(base, x)
            _advance(x, point, given, steps, work, forgets)
            for j in range(n):
                _copy(base, moved)
                moved[j] += _H
                _advance(moved, point, given, steps, work, forgets)
                for i in range(n):
                    out.phi[step, i, j] = (moved[i] - x[i]) / _H
            for m in range(2):
                column = grid.lift if m == 0 else grid.moment
                for p in range(POINTS):
                    column[point + p] += _H
                    _copy(base, moved)
                    _advance(moved, point, given, steps, work, forgets)
                    column[point + p] -= _H
                    for i in range(n):
                        out.force[step, i, m, p] = (moved[i] - x[i]) / _H
            _flown(x, air_at(grid, point + 2), given, work, out.flown[step, 2])
            middle = air_at(grid, point + 1)
            for i in range(out.flown.shape[2]):
                out.flown[step, 1, i] = 0.5 * (out.flown[step, 0, i] + out.flown[step, 2, i])
            out.flown[step, 1, 1] = effective_elevator(middle.elevator_rad, given.model.aircraft)
            out.flown[step, 1, 4] = middle.qbar_pa
            _copy(x, base)


def tangent_of(given: FilterInputs, settings: Settings, common: Array, per_record: Array) -> Tangent | None:
    """The tangent linear model of a record at a vector of parameters; None where the filter loses the motion.

    Parameters
    ----------
    given : what the record gives to the filter.
    common, per_record : see `CommonEntries` and `RecordEntries`.
    """
    kernel = kernel_input(given, settings, common, per_record)
    # the differences move these
    own = GridSignals(*(x.copy() for x in kernel.grid))
    kernel = kernel._replace(grid=own)
    steady = steady_filter(kernel, given.along)
    if steady is None:
        return None
    n, samples = kernel.model.states.size, len(kernel.y)
    path, e = path_of(samples, n, OUTPUTS), np.full_like(kernel.y, LOST)
    if samples < 2 or not innovations(kernel, steady, e, path)[0]:
        return None
    matrices = matrices_along(kernel, path, steady.shown)
    surface = effective_elevator(float(kernel.grid.elevator_rad[0]), kernel.model.aircraft)
    start = np.array([kernel.start[0], surface])
    h_s = 2.0 * kernel.dt_s / kernel.sub
    return Tangent(matrices, path, kernel.sub // 2, h_s, given.lead, kernel.model.sensors, start)


def matrices_along(given: KernelInput, path: Path, shown: float) -> Matrices:
    """Matrices along a path; ``shown`` as of `SteadyFilter`. The differences move coefficients and outputs, which return."""
    n, samples = given.model.states.size, len(given.y)
    every = (samples - 1) * (given.sub // 2)
    matrices = Matrices(
        phi=np.zeros((every, n, n)),
        force=np.zeros((every, n, 2, POINTS)),
        c=np.zeros((samples, OUTPUTS, n)),
        d=np.zeros((samples, OUTPUTS, 2)),
        reading=np.zeros((samples, OUTPUTS, OUTPUTS)),
        flown=np.zeros((every, POINTS, len(FLOWN))),
    )
    steps = steps_of(given.model, given.dt_s, given.sub)
    _differences(given, steps, work_of(given.model), path, shown, matrices)
    return matrices


def propagated(tangent: Tangent, force: Array, reading: Array) -> Array:
    """Changes of the innovations, scaled to the common covariance, by increments.

    Parameters
    ----------
    force : (steps, points, 2, directions) increments of CL and Cm [-].
    reading : (samples, outputs, directions) increments of the readings behind lags and delays, before their scale factors [units
        of the outputs].

    Returns
    -------
    (directions, samples, outputs), those of the lead left out.
    """
    own, path, count = tangent.matrices, tangent.path, tangent.steps
    samples, n = path.predicted.shape
    # the first sample counts with the coefficients' increments at the start of its step
    at_sample = np.concatenate([force[:1, 0], force[count - 1 :: count, POINTS - 1]])
    seen = own.reading @ (tangent.sensors.scale[:, None] * reading) + own.d @ at_sample
    steps = len(own.phi)
    by_force = own.force.transpose(0, 1, 3, 2).reshape(steps, n, 2 * POINTS)
    driven = by_force @ force.reshape(steps, 2 * POINTS, -1)
    phi, driven = _whole_samples(own.phi, driven, count)
    k_gain = path.k_gain[:-1]
    closed = phi @ (np.eye(n) + k_gain @ own.c[:-1])
    driven += (phi @ k_gain) @ seen[:-1]
    x = np.zeros((samples, n, force.shape[-1]))
    for k in range(samples - 1):
        np.matmul(closed[k], x[k], out=x[k + 1])
        x[k + 1] += driven[k]
    e = path.scale @ (own.c @ x + seen)
    return np.ascontiguousarray(np.moveaxis(e[tangent.lead :], 2, 0))


def _whole_samples(phi: Array, driven: Array, count: int) -> tuple[Array, Array]:
    """Transitions and increments of the state of whole samples from those of their steps."""
    if count == 1:
        return phi, driven
    by_step = phi.reshape(-1, count, *phi.shape[1:])
    increments = driven.reshape(-1, count, *driven.shape[1:])
    whole, total = by_step[:, 0], increments[:, 0]
    for part in range(1, count):
        whole = by_step[:, part] @ whole
        total = by_step[:, part] @ total + increments[:, part]
    return whole, total


__all__ = ["FLOWN", "POINTS", "Tangent", "matrices_along", "propagated", "tangent_of"]
