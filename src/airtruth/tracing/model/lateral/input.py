"""Input of the compiled filter for the lateral-directional motion: its aircraft, and its inputs along a record."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T")


class LateralAircraft(NamedTuple):
    """The declared aircraft with its changes of declared quantities.

    The forces of the air are a sum of tables, one for each signal of the motion (beta, phat, rhat, aileron, rudder), each over
    the angle of attack and its signal.

    Attributes
    ----------
    area_m2, span_m, chord_m : reference area [m2], span and chord [m].
    mass_kg : mass [kg].
    inertia_xx_kg_m2, inertia_yy_kg_m2, inertia_zz_kg_m2, inertia_xz_kg_m2 : moments and product of inertia [kg m2].
    trim : (signals,) values about which increments of derivatives count [rad, -].
    neutral_rad : (controls,) deflections about which a deflection is scaled [rad]; effectiveness : (controls,) that scale [-].
    cg_shift, cg_y_m : CG aft of the declared one [chords], and to the right of it [m].
    load_y_m : distance of the CG to the right of the line along which the normal force acts [m].
    yaw_moment_n_m : of an asymmetric thrust, nose right [N m].
    constant : (alpha, 3) Y [N], L and N [N m] that the dynamic pressure leaves alone.
    increments : (15,) of the derivatives, in the order of the motion [-].
    alpha_rad : (alpha,) axis of the tables [rad].
    points : (signals, points) axis of each signal, ascending [rad, -].
    values : (signals, alpha, points, 3) Y [m2], L and N [m3] of the air over the dynamic pressure.
    """

    area_m2: float
    span_m: float
    chord_m: float
    mass_kg: float
    inertia_xx_kg_m2: float
    inertia_yy_kg_m2: float
    inertia_zz_kg_m2: float
    inertia_xz_kg_m2: float
    trim: Array
    neutral_rad: Array
    effectiveness: Array
    cg_shift: float
    cg_y_m: float
    load_y_m: float
    yaw_moment_n_m: float
    constant: Array
    increments: Array
    alpha_rad: Array
    points: Array
    values: Array


class LateralAirInputs(NamedTuple, Generic[T]):
    """Known inputs, numbers at one time or (points,) each on the filter's grid.

    Attributes
    ----------
    aileron_rad, rudder_rad : surfaces that the air sees [rad].
    airspeed_m_s, ground_m_s : speed through the air, and without the gust along the path [m/s].
    qbar_pa : dynamic pressure [Pa].
    alpha_rad, ground_attack_rad : angle of attack of the air and over ground [rad]; theta_rad : pitch attitude [rad].
    q_rad_s : pitch rate [rad/s]; speed_rate_1_s : V'/V of the speed without the gust [1/s].
    forward_m_s2, down_m_s2 : specific force along body x and z [m/s2].
    side, roll, yaw : increments of CY, Cl and Cn [-].
    """

    aileron_rad: T
    rudder_rad: T
    airspeed_m_s: T
    ground_m_s: T
    qbar_pa: T
    alpha_rad: T
    ground_attack_rad: T
    theta_rad: T
    q_rad_s: T
    speed_rate_1_s: T
    forward_m_s2: T
    down_m_s2: T
    side: T
    roll: T
    yaw: T


LateralPoint: TypeAlias = LateralAirInputs[float]
"""Inputs at one time."""

__all__ = ["LateralAirInputs", "LateralAircraft", "LateralPoint"]
