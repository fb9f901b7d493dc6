"""Derivatives of the filter's gains in the parameters.

The slopes of the equations give those of the linearisation. One step of Newton's method from the steady covariance leads to that
of the moved linearisation: the residual of the Riccati equation, propagated by the closed loop, whose powers all parameters
share. The gains of a small step less those of none are then divided by the step.

Source: P. Lancaster and L. Rodman, *Algebraic Riccati Equations* (1995), section 13.5 (Newton's method; its step solves a Stein
equation, summed here by doubling as by R. A. Smith, SIAM J. Appl. Math. 16 (1968) 198-201).
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.numerics.compiled import allocating
from airtruth.numerics.discretise import DOUBLINGS, congruence, multiply, riccati, step, whitener
from airtruth.tracing.model.corners import (
    corrected,
    drive_sensors,
    spread_of,
)
from airtruth.tracing.model.kernel_input import AnyPoint, FilterModel
from airtruth.tracing.model.linear_slopes import LinearSlopes, linear_slopes
from airtruth.tracing.model.linearise import (
    FirstUpdate,
    add_sensors,
    covariance_of,
    first_update,
    process_intensity,
    update_gain,
)

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SMALL: Final = 1e-9
"""Largest entry of a power of the closed loop whose square adds nothing [-]; judgement: far below the step of a difference."""


class Moves(NamedTuple):
    """Small steps of the parameters, and where they lead; row 0 is none.

    Attributes
    ----------
    h : (rows,) [units of the parameters]; zero for a parameter that moves no gain.
    column : (rows,) column of the motion's slopes behind those of the states; -1 for none.
    variance, slow_std : (rows, outputs) of the sensors' noise after a step; slow_time_s : (rows,).
    """

    h: Array
    column: Ints
    variance: Array
    slow_std: Array
    slow_time_s: Array


class Conditions(NamedTuple):
    """The filter at one flight condition after each step of the parameters; see `SteadyFilter` and `Corners`."""

    k_gain: Array
    first: FirstUpdate
    direct: Array
    white: Array
    covariance: Array
    logdet: Array
    steady: Array
    phi: Array
    noise: Array
    spread: Array
    c: Array


@allocating
def _moved_system(
    row: int,
    linear: LinearSlopes,
    moves: Moves,
    model: FilterModel,
    a: Array,
    c: Array,
    direct: Array,
    column: Array,
) -> None:
    """Linearisation after a step of a parameter, late sensors and correlated noise included."""
    motion, h, q = model.states.motion, moves.h[row], moves.column[row]
    for i in range(a.shape[0]):
        direct[i] = 0.0
        for j in range(a.shape[0]):
            a[i, j] = 0.0
    for i in range(motion):
        for j in range(motion):
            a[i, j] = linear.a[i, j] + (h * linear.d_a[i, j, q] if q >= 0 else 0.0)
    for i in range(c.shape[0]):
        for j in range(a.shape[0]):
            c[i, j] = 0.0
        for j in range(motion):
            c[i, j] = linear.c[i, j] + (h * linear.d_c[i, j, q] if q >= 0 else 0.0)
    for j in range(a.shape[0]):
        direct[j] = c[c.shape[0] - 1, j]
    add_sensors(model, moves.slow_std[row], moves.slow_time_s[row], a, c)
    driven = np.zeros(c.shape[0])
    for control in range(column.shape[0]):
        at = motion + control
        for i in range(motion):
            column[control, i] = linear.a[i, at] + (h * linear.d_a[i, at, q] if q >= 0 else 0.0)
        for i in range(c.shape[0]):
            driven[i] = linear.c[i, at] + (h * linear.d_c[i, at, q] if q >= 0 else 0.0)
        drive_sensors(driven, model, column[control])


@allocating
def _powers(phi: Array, k_gain: Array, c: Array) -> tuple[int, Array]:
    """Number of powers 1, 2, 4, ... of the closed loop phi (I - K C), and these (powers, states, states)."""
    n = phi.shape[0]
    powers, work, keep = np.zeros((DOUBLINGS, n, n)), np.zeros((n, n)), np.zeros((n, n))
    multiply(k_gain, c, work)
    for i in range(n):
        for j in range(n):
            keep[i, j] = (1.0 if i == j else 0.0) - work[i, j]
    multiply(phi, keep, powers[0])
    for number in range(1, DOUBLINGS):
        multiply(powers[number - 1], powers[number - 1], powers[number])
        largest = 0.0
        for i in range(n):
            for j in range(n):
                largest = max(largest, abs(powers[number, i, j]))
        if largest < _SMALL:
            return number + 1, powers
    return DOUBLINGS, powers


@allocating
def _newton(p: Array, after: Array, count: int, powers: Array, out: Array) -> None:
    """One step of Newton's method from a covariance, where the equation leads to another one."""
    n = p.shape[0]
    change, work, more = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            change[i, j] = after[i, j] - p[i, j]
    for number in range(count):
        congruence(powers[number], change, work, more)
        for i in range(n):
            for j in range(n):
                change[i, j] += more[i, j]
    for i in range(n):
        for j in range(n):
            out[i, j] = p[i, j] + change[i, j]


@allocating
def _gains(row: int, c: Array, variance: Array, out: Conditions) -> None:
    """Gains of a steady covariance of the prediction."""
    pc = np.empty(out.k_gain[row].shape)
    covariance_of(out.steady[row], c, variance, pc, out.covariance[row])
    out.logdet[row] = whitener(out.covariance[row], out.white[row])
    update_gain(pc, out.white[row], out.k_gain[row])
    first_update(pc, out.covariance[row], FirstUpdate(out.first.gain[row], out.first.share[row]))


@allocating
def _predicted(row: int, out: Conditions) -> Array:
    """Covariance of the prediction that follows the update of the steady covariance with the gains of a row."""
    n = out.phi.shape[1]
    work, following = np.empty((n, n)), np.empty((n, n))
    congruence(out.phi[row], corrected(out.steady[0], out.k_gain[row], out.c[row]), work, following)
    for i in range(n):
        for j in range(n):
            following[i, j] += out.noise[row, i, j]
    return following


@njit(cache=True, nogil=True, error_model="numpy")
def _conditions(
    x: Array,
    at: AnyPoint,
    model: FilterModel,
    aircraft: Any,
    columns: int,
    moves: Moves,
    process: Array,
    dt_s: float,
    out: Conditions,
) -> None:
    """`conditions` into ``out``."""
    n, rows, controls = x.size, moves.h.size, out.spread.shape[1]
    linear = linear_slopes(x, at, model, aircraft, columns, controls)
    system, column = np.zeros((n, n + 1)), np.zeros((controls, n))
    a, early, late = np.zeros((n, n)), np.empty((n, 1)), np.empty((n, 1))
    count, powers, base = 0, np.zeros((0, n, n)), np.zeros((n, n))
    for row in range(rows):
        if row > 0 and moves.h[row] == 0.0:
            continue
        _moved_system(row, linear, moves, model, a, out.c[row], out.direct[row], column)
        moves_motion = row == 0 or moves.slow_time_s[row] != moves.slow_time_s[0]
        for i in range(n):
            for j in range(n):
                moves_motion = moves_motion or a[i, j] != system[i, j]
        if moves_motion:
            if model.states.noise >= 0:
                for i in range(model.states.noise, n):
                    process[i] = 2.0 / moves.slow_time_s[row]
            own = np.zeros((n, n + 1))
            for i in range(n):
                for j in range(n):
                    own[i, j] = a[i, j]
            step(own, process, n, dt_s, out.phi[row], early, late, out.noise[row])
            if row == 0:
                system = own
        else:
            for i in range(n):
                for j in range(n):
                    out.phi[row, i, j], out.noise[row, i, j] = out.phi[0, i, j], out.noise[0, i, j]
        for control in range(controls):
            out.spread[row, control] = spread_of(a, column[control], dt_s)
        if row == 0:
            out.steady[0] = riccati(out.phi[0], out.c[0], out.noise[0], moves.variance[0])
            _gains(0, out.c[0], moves.variance[0], out)
            count, powers = _powers(out.phi[0], out.k_gain[0], out.c[0])
            # a slope counts from what the equation makes of the covariance, which is not quite steady
            base = _predicted(0, out)
            continue
        # the gains of the steady covariance with the moved sensors, and the prediction that follows
        for i in range(n):
            for j in range(n):
                out.steady[row, i, j] = out.steady[0, i, j]
        _gains(row, out.c[row], moves.variance[row], out)
        after = out.steady[0] + (_predicted(row, out) - base)
        _newton(out.steady[0], after, count, powers, out.steady[row])
        _gains(row, out.c[row], moves.variance[row], out)


def conditions(
    x: Array,
    at: AnyPoint,
    model: FilterModel,
    aircraft: Any,
    columns: int,
    moves: Moves,
    dt_s: float,
    controls: int,
) -> Conditions:
    """The filter at one flight condition after small steps of the parameters.

    Parameters
    ----------
    x, at : (states,) where it is linearised, and the inputs there.
    aircraft : what the parameters move of it; columns : number of the slopes' columns behind those of the states.
    controls : number of surfaces that are uncertain between samples.
    """
    n, count, rows = x.size, model.sensors.scale.size, moves.h.size
    square = (rows, n, n)
    out = Conditions(
        k_gain=np.zeros((rows, n, count)),
        first=FirstUpdate(np.zeros((rows, n, count - 1)), np.zeros((rows, count - 1))),
        direct=np.zeros((rows, n)),
        white=np.zeros((rows, count, count)),
        covariance=np.zeros((rows, count, count)),
        logdet=np.zeros(rows),
        steady=np.zeros(square),
        phi=np.zeros(square),
        noise=np.zeros(square),
        spread=np.zeros((rows, controls, n, n)),
        c=np.zeros((rows, count, n)),
    )
    _conditions(
        x.copy(), at, model, aircraft, columns, moves, process_intensity(at.airspeed_m_s, model), dt_s, out
    )
    return out


__all__ = ["Conditions", "Moves", "conditions"]
