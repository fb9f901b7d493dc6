"""Input of the compiled filter for the pitch plane: its aircraft, and its inputs along a record."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T")


class AircraftArrays(NamedTuple):
    """The declared aircraft with its changes of declared quantities.

    Attributes
    ----------
    area_m2, chord_m : reference area [m2] and chord [m].
    mass_kg, inertia_kg_m2 : mass [kg] and pitch inertia [kg m2].
    trim_alpha_rad, trim_elevator_rad : about which increments of derivatives count [rad].
    neutral_elevator_rad : about which a deflection is scaled [rad]; effectiveness : that scale [-].
    cg_shift : CG aft of the declared one [chords].
    thrust_arm_m : arm of the thrust below the CG beyond the declared one [m].
    thrust_n, thrust_slope_m2 : thrust at no dynamic pressure [N], and its slope over that [m2].
    constant : (alpha, 3) X, Z [N] and M [N m] that the dynamic pressure leaves alone.
    increments : (6,) of CLalpha, CLq, CLde, Cmalpha, Cmq, Cmde [-].
    alpha_rad, elevator_rad, qhat : axes of the tables [rad, rad, -].
    values : (alpha, elevator, qhat, 3) X, Z [m2] and M [m3] of the air over the dynamic pressure.
    """

    area_m2: float
    chord_m: float
    mass_kg: float
    inertia_kg_m2: float
    trim_alpha_rad: float
    trim_elevator_rad: float
    neutral_elevator_rad: float
    effectiveness: float
    cg_shift: float
    thrust_arm_m: float
    thrust_n: float
    thrust_slope_m2: float
    constant: Array
    increments: Array
    alpha_rad: Array
    elevator_rad: Array
    qhat: Array
    values: Array


class AirInputs(NamedTuple, Generic[T]):
    """Known inputs, numbers at one time or (points,) each on the filter's grid.

    Attributes
    ----------
    elevator_rad : surface that the air sees [rad].
    airspeed_m_s, ground_m_s : speed through the air, and without the gust along the path [m/s].
    qbar_pa : dynamic pressure [Pa].
    theta_rad : pitch attitude [rad].
    turn_rad_s, pitch_rad_s2 : parts of alpha' [rad/s] and q' [rad/s2] that the other motion causes.
    lift, moment : increments of CL and Cm [-].
    """

    elevator_rad: T
    airspeed_m_s: T
    ground_m_s: T
    qbar_pa: T
    theta_rad: T
    turn_rad_s: T
    pitch_rad_s2: T
    lift: T
    moment: T


AirPoint: TypeAlias = AirInputs[float]
"""Inputs at one time."""

__all__ = ["AirInputs", "AirPoint", "AircraftArrays"]
