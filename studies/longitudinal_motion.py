"""Nonlinear longitudinal motion with tabulated forces, and the auxiliary model made of it.

Equations of motion in the vertical plane, point mass and pitch, still air (B. Etkin and L. D. Reid,
*Dynamics of Flight*, 3rd ed., 1996, eqs 4.7,1 and 4.7,2 without lateral motion, in wind axes; M. Brunot,
"An Instrumental Variable Approach for Aircraft Identification", eq. (1)). X, Z, M are the body-axis forces
and the pitching moment of air and engines, gravity left out:

    m V'       = X cos(alpha) + Z sin(alpha) - m g sin(gamma)
    m V gamma' = X sin(alpha) - Z cos(alpha) - m g cos(gamma)
    alpha'     = q - gamma'
    Iyy q'     = M
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.numerics.cells import lower_point
from airtruth.physics.short_period import Scale
from airtruth.simulation.probe import ForceGrid, ForceTables, probe
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import FT

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Longitudinal:
    """An aircraft in the vertical plane about a steady state.

    Attributes
    ----------
    tables : forces and moment at the throttle of the steady state.
    mass_kg, inertia_kg_m2, gravity_m_s2 : mass [kg], pitch inertia [kg m2], gravity [m/s2].
    airspeed_m_s, alpha_rad, elevator_rad, gamma_rad : the steady state [m/s], [rad].
    drift : factor on the influence of airspeed and flight path [-]: 1 for the aircraft; 0 keeps the airspeed and the
        direction of gravity constant and leaves the short period.
    """

    tables: ForceTables
    mass_kg: float
    inertia_kg_m2: float
    gravity_m_s2: float
    airspeed_m_s: float
    alpha_rad: float
    elevator_rad: float
    gamma_rad: float
    drift: float = 1.0


def model_of(aircraft: Aircraft, trim: Trim, grid: ForceGrid | None = None) -> Longitudinal:
    """The aircraft in the vertical plane, from its forces in JSBSim; see `airtruth.simulation.probe.probe`."""
    executive = Executive(aircraft, 1.0 / 200.0)
    executive.initialise(trim.condition, trim.controls)
    return Longitudinal(
        tables=probe(aircraft, trim, grid),
        mass_kg=trim.mass_kg,
        inertia_kg_m2=aircraft.constants.inertia_yy_kg_m2,
        gravity_m_s2=executive.node("accelerations/gravity-ft_sec2").get_double_value() * FT,
        airspeed_m_s=trim.airspeed_m_s,
        alpha_rad=trim.alpha_rad,
        elevator_rad=trim.elevator_rad,
        gamma_rad=trim.condition.gamma_rad,
    )


@dataclass(frozen=True)
class SimulatedMotion:
    """Response of runs, (runs, samples) each.

    Attributes
    ----------
    airspeed_m_s, alpha_rad, q_rad_s, gamma_rad : state [m/s], [rad], [rad/s], [rad].
    ax_m_s2, az_m_s2 : specific force at the CG along body x, z [m/s2].
    """

    airspeed_m_s: Array
    alpha_rad: Array
    q_rad_s: Array
    gamma_rad: Array
    ax_m_s2: Array
    az_m_s2: Array


@njit(cache=True)
def _cell(axis: Array, x: float) -> tuple[int, float]:
    """Lower point of the cell that holds x, and the share of the cell below x, held to 0..1."""
    low = lower_point(axis, x)
    share = (x - axis[low]) / (axis[low + 1] - axis[low])
    return low, min(max(share, 0.0), 1.0)


@njit(cache=True)
def _look_up(
    v_axis: Array,
    alpha_axis: Array,
    elevator_axis: Array,
    q_axis: Array,
    values: Array,
    v: float,
    alpha: float,
    elevator: float,
    q: float,
) -> tuple[float, float, float]:
    i, si = _cell(v_axis, v)
    j, sj = _cell(alpha_axis, alpha)
    k, sk = _cell(elevator_axis, elevator)
    n, sn = _cell(q_axis, q)
    x = z = m = 0.0
    for a in range(2):
        wa = si if a else 1.0 - si
        for b in range(2):
            wb = wa * (sj if b else 1.0 - sj)
            for c in range(2):
                wc = wb * (sk if c else 1.0 - sk)
                for d in range(2):
                    w = wc * (sn if d else 1.0 - sn)
                    cell = values[i + a, j + b, k + c, n + d]
                    x += w * cell[0]
                    z += w * cell[1]
                    m += w * cell[2]
    return x, z, m


@njit(cache=True)
def _rates(
    state: Array,
    elevator: float,
    trim: Array,
    shift: Array,
    v_axis: Array,
    alpha_axis: Array,
    elevator_axis: Array,
    q_axis: Array,
    values: Array,
    out: Array,
) -> None:
    """V', alpha', q', gamma', ax, az into out (6,).

    trim : V, alpha, elevator, gamma, mass, inertia, gravity, drift. shift : (6,) increments of gamma' [1/s per rad,
    1, 1/s per rad] and q' [1/s2 per rad, 1/s, 1/s2 per rad] per alpha, q and elevator.
    """
    v, alpha, q, gamma = state[0], state[1], state[2], state[3]
    x, z, m = _look_up(v_axis, alpha_axis, elevator_axis, q_axis, values, v, alpha, elevator, q)
    mass, gravity, drift = trim[4], trim[6], trim[7]
    ax, az = x / mass, z / mass
    d_alpha, d_elevator = alpha - trim[1], elevator - trim[2]
    more = shift[0] * d_alpha + shift[1] * q + shift[2] * d_elevator
    down = trim[3] + drift * (gamma - trim[3])
    sine, cosine = np.sin(alpha), np.cos(alpha)
    turn = (ax * sine - az * cosine - gravity * np.cos(down)) / v + more
    out[0] = drift * (ax * cosine + az * sine - gravity * np.sin(down))
    out[1] = q - turn
    out[2] = m / trim[5] + shift[3] * d_alpha + shift[4] * q + shift[5] * d_elevator
    out[3] = turn
    out[4], out[5] = ax + more * v * sine, az - more * v * cosine


@njit(cache=True)
def _integrate(
    elevator: Array,
    trim: Array,
    shift: Array,
    dt_s: float,
    v_axis: Array,
    alpha_axis: Array,
    elevator_axis: Array,
    q_axis: Array,
    values: Array,
    out: Array,
) -> None:
    rate = np.empty((4, 6))
    state, tried = np.empty(4), np.empty(4)
    for r in range(elevator.shape[0]):
        state[0], state[1], state[2], state[3] = trim[0], trim[1], 0.0, trim[3]
        for k in range(elevator.shape[1]):
            now = elevator[r, k]
            _rates(state, now, trim, shift[r], v_axis, alpha_axis, elevator_axis, q_axis, values, rate[0])
            out[r, :4, k] = state
            out[r, 4:, k] = rate[0, 4:]
            if k + 1 == elevator.shape[1]:
                break
            then = elevator[r, k + 1]
            for stage in range(1, 4):
                share = 1.0 if stage == 3 else 0.5
                for i in range(4):
                    tried[i] = state[i] + share * dt_s * rate[stage - 1, i]
                at = now + share * (then - now)
                _rates(
                    tried,
                    at,
                    trim,
                    shift[r],
                    v_axis,
                    alpha_axis,
                    elevator_axis,
                    q_axis,
                    values,
                    rate[stage],
                )
            for i in range(4):
                slope = rate[0, i] + 2.0 * rate[1, i] + 2.0 * rate[2, i] + rate[3, i]
                state[i] += dt_s / 6.0 * slope


def simulate(
    model: Longitudinal, elevator_rad: Array, dt_s: float, shift: Array | None = None
) -> SimulatedMotion:
    """Motion from the steady state, by the classical Runge-Kutta method of fourth order.

    Parameters
    ----------
    model : aircraft and steady state.
    elevator_rad : (runs, samples) surface, linear between samples [rad].
    dt_s : sample period and step [s].
    shift : (runs, 6) increments to the tables, linear about the steady state: of gamma' per alpha, q and elevator
        [1/s, 1, 1/s], then of q' [1/s2, 1/s, 1/s2]; None for none.

    Returns
    -------
    Motion
        Channels of shape (runs, samples).
    """
    t = model.tables
    trim = np.array(
        [
            model.airspeed_m_s,
            model.alpha_rad,
            model.elevator_rad,
            model.gamma_rad,
            model.mass_kg,
            model.inertia_kg_m2,
            model.gravity_m_s2,
            model.drift,
        ]
    )
    elevator = np.ascontiguousarray(elevator_rad, dtype=np.float64)
    runs, samples = elevator.shape
    added = np.zeros((runs, 6)) if shift is None else np.ascontiguousarray(shift)
    out = np.empty((runs, 6, samples))
    _integrate(elevator, trim, added, dt_s, t.airspeed_m_s, *t.axes, t.values, out)
    return SimulatedMotion(*(np.ascontiguousarray(out[:, i]) for i in range(6)))


def auxiliary(
    model: Longitudinal, declared: Array
) -> Callable[[Array, Array, float, Scale], tuple[Array, Array]]:
    """Return the nonlinear aircraft as the auxiliary model of instrumental variables.

    The current estimate enters linearly about the steady state: (theta - declared) times the deviations of alpha,
    q c/(2V) and elevator adds to the coefficients of the tables. With theta equal to ``declared`` the model is the
    tables alone. If a linear model is fitted to curved tables, ``declared`` should be the result of such a fit to the
    tables themselves, not a slope at a point.

    Parameters
    ----------
    model : aircraft and steady state; all runs start there.
    declared : (6,) derivatives that represent the tables [-].

    Returns
    -------
    callable
        (theta (runs, 6), elevator deviation (runs, samples) [rad], dt [s], scale (runs,)) ->
        alpha [rad], q [rad/s] deviations, (runs, samples).
    """

    def respond(theta: Array, u: Array, dt_s: float, scale: Scale) -> tuple[Array, Array]:
        change = np.asarray(theta) - declared
        rate = scale.half_chord_time
        lift = np.stack([scale.lift, scale.lift * rate, scale.lift], axis=-1) * change[:, :3]
        moment = np.stack([scale.moment, scale.moment * rate, scale.moment], axis=-1) * change[:, 3:]
        motion = simulate(model, model.elevator_rad + u, dt_s, np.concatenate([lift, moment], axis=1))
        return motion.alpha_rad - model.alpha_rad, motion.q_rad_s

    return respond
