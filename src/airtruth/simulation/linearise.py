"""The derivatives of an aircraft at a trim, by differences in JSBSim."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import TrimError
from airtruth.physics import short_period
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import DEG

Array = NDArray[np.float64]

STEPS: Final = (0.01 * DEG, 0.01 * DEG, 0.05 * DEG)
"""Default steps in alpha [rad], elevator command [rad] and q [rad/s] (judgement: inside a cell of
tables stated in degrees, and far above rounding)."""


@dataclass(frozen=True)
class Linearisation:
    """Declared derivatives about the CG, in the order of `short_period.PARAMETERS`.

    Attributes
    ----------
    plus, minus, central : (6,) one-sided (upward, downward) and central differences [-].
        Tables are piecewise linear: at a break the sides differ. ``plus`` is the paper's truth.
    scale : factors at this trim.
    wn_rad_s, zeta : modal parameters of ``plus``.
    """

    plus: Array
    minus: Array
    central: Array
    scale: short_period.Scale
    wn_rad_s: float
    zeta: float


def linearise(
    aircraft: Aircraft, trim: Trim, dt_s: float = 1.0 / 200.0, steps: tuple[float, float, float] = STEPS
) -> Linearisation:
    """Differences of alpha_dot and q_dot in alpha, q and elevator surface, at constant airspeed and flight path.

    The derivatives are those that make eq. (2) of the paper equal to the differences: CLalpha is
    -(m V/(q_bar S)) d(alpha_dot)/d(alpha), thrust and drag terms included. Where feedback moves
    the elevator with alpha or q, its contribution is subtracted: the derivatives are at a constant surface.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.
    dt_s : simulation step of the executive [s].
    steps : steps in alpha [rad], elevator command [rad] and q [rad/s].

    Raises
    ------
    TrimError
        If the elevator surface does not follow its command at the trim.
    """
    executive = Executive(aircraft, dt_s)
    c = aircraft.constants
    s = short_period.scale(
        c.wing_area_m2, c.chord_m, trim.mass_kg, c.inertia_yy_kg_m2, trim.airspeed_m_s, trim.density_kg_m3
    )
    origin = _probe(executive, trim, 0.0, 0.0, 0.0)
    plus = _one_sided(executive, trim, origin, s, steps, 1.0)
    minus = _one_sided(executive, trim, origin, s, steps, -1.0)
    wn, zeta = short_period.modal(plus, s)
    return Linearisation(plus, minus, 0.5 * (plus + minus), s, float(wn), float(zeta))


def _probe(executive: Executive, trim: Trim, d_alpha: float, d_elevator: float, d_q: float) -> Array:
    """[alpha_dot, q_dot, elevator] in a state off the trim."""
    executive = executive.again()
    alpha = trim.alpha_rad + d_alpha
    command = trim.controls.elevator_command_rad + d_elevator
    controls = replace(trim.controls, elevator_command_rad=command)
    executive.initialise(trim.condition, alpha, controls, d_q)
    r = executive.respond()
    alpha_dot = (r.w_dot_m_s2 * np.cos(alpha) - r.u_dot_m_s2 * np.sin(alpha)) / trim.airspeed_m_s
    return np.array([alpha_dot, r.q_dot_rad_s2, r.elevator_rad])


def _one_sided(
    executive: Executive,
    trim: Trim,
    origin: Array,
    s: short_period.Scale,
    steps: tuple[float, float, float],
    side: float,
) -> Array:
    d_alpha, d_elevator, d_q = (side * h for h in steps)
    by_alpha = (_probe(executive, trim, d_alpha, 0.0, 0.0) - origin) / d_alpha
    by_elevator = (_probe(executive, trim, 0.0, d_elevator, 0.0) - origin) / d_elevator
    by_q = (_probe(executive, trim, 0.0, 0.0, d_q) - origin) / d_q
    if abs(by_elevator[2]) < 1e-6:
        raise TrimError(
            "the elevator surface does not follow its command at the trim; "
            "check jsbsim.elevator.command, surface and command_per_rad in aircraft.toml"
        )
    b = by_elevator[:2] / by_elevator[2]
    a = np.column_stack([by_alpha[:2] - b * by_alpha[2], by_q[:2] - b * by_q[2]])
    return short_period.derivatives(a, b, s)
