"""The tangent linear model of the filter along a record: how its innovations change with small increments of the coefficients
and of the readings, at the gains that the filter has.

    x_k+1 = Phi_k (x_k + K_k e_k) + sum_p G_kp u_kp,   e_k = C_k x_k + D_k u_k + R_k v_k,

x, e : changes of state and innovation; u : increments of the coefficients at the points p of the steps after a sample; v :
those of the readings. Many increments share the matrices, which cost as much as a dozen flights of the filter.

Source: O. Talagrand and P. Courtier, Q. J. R. Meteorol. Soc. 113 (1987) 1311-1328, section 2 (the tangent linear equations).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.ahead import awaited
from airtruth.numerics.compiled import inner
from airtruth.physics.motion import Motion
from airtruth.physics.terms import QBAR, signals_of
from airtruth.tracing.model.advance import Steps, Work, advance_motion, advance_sensors, steps_of, work_of
from airtruth.tracing.model.by_motion import (
    air_at,
    coefficient_field,
    coefficients_of,
    rates,
    shifted,
    signals_at,
)
from airtruth.tracing.model.filter import Path, innovation, innovations, path_of
from airtruth.tracing.model.kernel_input import KernelInput, SensorArrays
from airtruth.tracing.model.linearise import FirstUpdate
from airtruth.tracing.model.response import LOST, FilterInputs, kernel_input
from airtruth.tracing.model.settings import Settings
from airtruth.tracing.model.steady import steady_filter

Array = NDArray[np.float64]

POINTS: Final = 3
"""Points of a step: its start, its middle and its end [-]."""
Ints = NDArray[np.int64]


def flown_of(motion: Motion) -> tuple[str, ...]:
    """Signals of a motion that are kept: those of its terms, and each rate over 2V/l without the rotary gust.

    Examples
    --------
    >>> flown_of(LONGITUDINAL)
    ('alpha', 'elevator', 'qhat', 'alpha_dot_hat', 'qbar', 'body_qhat')
    """
    return (*signals_of(motion), *(f"body_{s.name}" for s in motion.signals if s.length is not None))


_H: Final = 1e-6
"""Step of the differences in a state, a coefficient and a reading [its unit]; judgement: large against rounding, and small
against the cells of the tables."""


class TangentMatrices(NamedTuple):
    """The tangent linear model's matrices.

    Attributes
    ----------
    phi : (steps, states, states) transition of a step of integration; the first of a sample includes the decay of the
        correlated noise.
    force : (steps, states, coefficients, points) by increments of the coefficients at the points of the step.
    c, d : (samples, outputs, states) and (samples, outputs, coefficients).
    reading : (samples, outputs, outputs) by increments of the predicted outputs.
    flown : (steps, points, `flown_of`) signals of the motion; those in the middle of a step are means, but for those of the grid.
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
    start : (1 + controls,) flow angle and deflections with which memories are in equilibrium at first [rad].
    """

    matrices: TangentMatrices
    path: Path
    steps: int
    h_s: float
    lead: int
    sensors: SensorArrays
    start: Array


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
    given: KernelInput,
    steps: Steps,
    work: Work,
    path: Path,
    shown: float,
    of_grid: Ints,
    out: TangentMatrices,
) -> None:
    """Matrices along a path by one-sided differences; increments of the grid and the outputs are moved and return.

    Parameters
    ----------
    of_grid : numbers of the signals that are inputs, which are known in the middle of a step.
    """
    n, samples, count = given.model.states.size, given.y.shape[0], given.sub // 2
    grid, x, base, moved = given.grid, np.empty(n), np.empty(n), np.empty(n)
    outputs, forces, field = given.y.shape[1], out.d.shape[2], coefficient_field(grid)
    last = n + forces
    raw, near, rate = np.empty(outputs), np.empty(outputs), work.rate[0]
    for k in range(samples):
        at, first = air_at(grid, k * given.sub), FirstUpdate(path.first.gain[k], path.first.share[k])
        branch = max(k, 1)  # the first sample settles late sensors, which is no part of its innovation
        for j in range(last + outputs + 1):
            _copy(path.predicted[k], x)
            forced = at
            if 0 < j <= n:
                x[j - 1] += _H
            elif n < j <= last:
                forced = shifted(at, field + j - n - 1, _H)
            elif j > last:
                given.more[branch, j - last - 1] += _H
            innovation(x, branch, forced, given, first, path.direct[k], shown, work, raw)
            if j > last:
                given.more[branch, j - last - 1] -= _H
            for i in range(outputs):
                slope = (raw[i] - near[i]) / _H
                if j == 0:
                    near[i] = raw[i]
                elif j <= n:
                    out.c[k, i, j - 1] = slope
                elif j <= last:
                    out.d[k, i, j - n - 1] = slope
                else:
                    out.reading[k, i, j - last - 1] = slope
        if k + 1 == samples:
            break
        _copy(path.corrected[k], base)
        for part in range(count):
            step, point, forgets = k * count + part, k * given.sub + 2 * part, part == 0
            rates(base, air_at(grid, point), given.model, rate)
            signals_at(base, air_at(grid, point), rate[0], given.model, out.flown[step, 0])
            _copy(base, x)
            _advance(x, point, given, steps, work, forgets)
            for j in range(n):
                _copy(base, moved)
                moved[j] += _H
                _advance(moved, point, given, steps, work, forgets)
                for i in range(n):
                    out.phi[step, i, j] = (moved[i] - x[i]) / _H
            for m in range(forces):
                column = grid[field + m]
                for p in range(POINTS):
                    column[point + p] += _H
                    _copy(base, moved)
                    _advance(moved, point, given, steps, work, forgets)
                    column[point + p] -= _H
                    for i in range(n):
                        out.force[step, i, m, p] = (moved[i] - x[i]) / _H
            rates(x, air_at(grid, point + 2), given.model, rate)
            signals_at(x, air_at(grid, point + 2), rate[0], given.model, out.flown[step, 2])
            # the inputs in the middle, into the place of the means of the others
            signals_at(x, air_at(grid, point + 1), rate[0], given.model, out.flown[step, 1])
            for i in range(out.flown.shape[2]):
                known = False
                for m in range(of_grid.size):
                    known = known or of_grid[m] == i
                if not known:
                    out.flown[step, 1, i] = 0.5 * (out.flown[step, 0, i] + out.flown[step, 2, i])
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
    moved = {name: getattr(kernel.grid, name).copy() for name in coefficients_of(kernel.grid)}
    kernel = kernel._replace(grid=kernel.grid._replace(**moved))
    steady = steady_filter(kernel, given.along)
    if steady is None:
        return None
    n, samples = kernel.model.states.size, len(kernel.y)
    path, e = path_of(samples, n, kernel.y.shape[1]), np.full_like(kernel.y, LOST)
    if samples < 2 or not innovations(kernel, steady, e, path)[0]:
        return None
    motion = given.record.signals.motion
    names = flown_of(motion)
    controls = [names.index(control.name) for control in motion.controls]
    known = (QBAR, *(s.name for s in motion.known_signals))
    of_grid = np.array([*controls, *(names.index(name) for name in known)])
    matrices = matrices_along(kernel, path, steady.shown, of_grid, len(names))
    start = np.append(kernel.start[0], matrices.flown[0, 0, controls])
    h_s = 2.0 * kernel.dt_s / kernel.sub
    return Tangent(matrices, path, kernel.sub // 2, h_s, given.lead, kernel.model.sensors, start)


def matrices_along(
    given: KernelInput, path: Path, shown: float, of_grid: Ints, signals: int
) -> TangentMatrices:
    """Matrices along a path. The differences move coefficients and outputs, which return.

    Parameters
    ----------
    shown : as of `SteadyFilter`.
    of_grid : numbers of the signals that are inputs; signals : number of all signals.
    """
    n, (samples, outputs), forces = given.model.states.size, given.y.shape, len(coefficients_of(given.grid))
    every = (samples - 1) * (given.sub // 2)
    matrices = TangentMatrices(
        phi=np.zeros((every, n, n)),
        force=np.zeros((every, n, forces, POINTS)),
        c=np.zeros((samples, outputs, n)),
        d=np.zeros((samples, outputs, forces)),
        reading=np.zeros((samples, outputs, outputs)),
        flown=np.zeros((every, POINTS, signals)),
    )
    steps = steps_of(given.model, given.dt_s, given.sub)
    _differences(given, steps, work_of(given.model), path, shown, of_grid, matrices)
    return matrices


def propagated(tangent: Tangent, force: Array, reading: Array) -> Array:
    """Changes of the innovations, scaled to the common covariance, by increments.

    Parameters
    ----------
    force : (steps, points, coefficients, directions) increments [-].
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
    forces = own.force.shape[2] * POINTS
    by_force = own.force.transpose(0, 1, 3, 2).reshape(steps, n, forces)
    driven = by_force @ force.reshape(steps, forces, -1)
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


__all__ = ["POINTS", "Tangent", "matrices_along", "propagated", "tangent_of"]
