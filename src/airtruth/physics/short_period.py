"""The short-period pitch oscillation: equations of motion, outputs and modal parameters.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (2)-(4).
Deviations from trim; derivatives per radian, rate derivatives per q c/(2V).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.linear_model import BodyConstants, Linear, Structure, assembled, bare
from airtruth.physics.motion import LONGITUDINAL

Array = NDArray[np.float64]

CL_ALPHA, CL_Q, CL_DE, CM_ALPHA, CM_Q, CM_DE = range(len(LONGITUDINAL.parameters))
"""Positions in ``LONGITUDINAL.parameters``."""


class PitchConstants(BodyConstants, Protocol):
    """Constants of the aircraft that the short period needs."""

    @property
    def chord_m(self) -> float:
        """Mean aerodynamic chord c [m]."""


@dataclass(frozen=True)
class Scale:
    """Factors that turn the six derivatives into the linear model; scalars or arrays of one shape.

    Attributes
    ----------
    airspeed_m_s : true airspeed V [m/s].
    lift : q_bar S/(m V), from a lift coefficient to alpha_dot [1/s].
    moment : q_bar S c/Iyy, from a moment coefficient to q_dot [1/s2].
    normal : q_bar S/m, from a lift coefficient to -az [m/s2].
    half_chord_time : c/(2V), from q to the dimensionless rate [s].
    """

    airspeed_m_s: Array
    lift: Array
    moment: Array
    normal: Array
    half_chord_time: Array


def scale(
    wing_area_m2: float,
    chord_m: float,
    mass_kg: float,
    inertia_kg_m2: float,
    airspeed_m_s: Array | float,
    density_kg_m3: Array | float,
) -> Scale:
    """Return the factors of the linear model at a flight condition.

    Parameters
    ----------
    wing_area_m2, chord_m : reference area S [m2] and mean aerodynamic chord c [m].
    mass_kg, inertia_kg_m2 : mass m [kg], pitch inertia Iyy [kg m2].
    airspeed_m_s, density_kg_m3 : true airspeed V [m/s] and density [kg/m3], one shape.
    """
    v = np.asarray(airspeed_m_s, dtype=np.float64)
    force = 0.5 * np.asarray(density_kg_m3, dtype=np.float64) * v**2 * wing_area_m2
    return Scale(
        airspeed_m_s=v,
        lift=force / (mass_kg * v),
        moment=force * chord_m / inertia_kg_m2,
        normal=force / mass_kg,
        half_chord_time=chord_m / (2.0 * v),
    )


def scale_of(constants: PitchConstants, airspeed_m_s: Array | float, density_kg_m3: Array | float) -> Scale:
    """`scale` of an aircraft at an airspeed [m/s] and a density [kg/m3]."""
    c = constants
    return scale(c.wing_area_m2, c.chord_m, c.mass_kg, c.inertia_yy_kg_m2, airspeed_m_s, density_kg_m3)


def system(theta: Array, s: Scale) -> tuple[Array, Array]:
    """State and input matrix of eq. (2) for the state [alpha, q] and the elevator.

    Parameters
    ----------
    theta : (..., 6) derivatives in the order of ``LONGITUDINAL.parameters`` [-].
    s : factors, scalars or arrays of shape (...).

    Returns
    -------
    a, b : (..., 2, 2) and (..., 2); alpha [rad], q [rad/s], elevator [rad].
    """
    th = np.asarray(theta, dtype=np.float64)
    h = s.half_chord_time
    a = np.stack(
        [
            np.stack([-s.lift * th[..., 0], 1.0 - s.lift * h * th[..., 1]], axis=-1),
            np.stack([s.moment * th[..., 3], s.moment * h * th[..., 4]], axis=-1),
        ],
        axis=-2,
    )
    b = np.stack([-s.lift * th[..., 2], s.moment * th[..., 5]], axis=-1)
    return a, b


def normal_force_row(theta: Array, s: Scale) -> Array:
    """Row (..., 3) that gives az - az_trim [m/s2] from [alpha, q, elevator], third line of eq. (3).

    The paper states az in g; divide by `airtruth.units.G0` for its figures.
    """
    th = np.asarray(theta, dtype=np.float64)
    n = s.normal
    return np.stack([-n * th[..., 0], -n * s.half_chord_time * th[..., 1], -n * th[..., 2]], axis=-1)


def linear_system(theta: Array, s: Scale) -> Linear:
    """The linear model of derivatives, that of `system` and `normal_force_row`.

    Parameters
    ----------
    theta : (..., 6) derivatives [-]; s : factors of shape (...).
    """
    return assembled(LONGITUDINAL, structure(s), theta)


def structure(s: Scale) -> Structure:
    """The parts of the linear model that the flight condition alone decides."""
    own = bare(LONGITUDINAL, s.half_chord_time)
    own.kinematics[..., 0, 1] = 1.0
    own.forces[..., 0, 0], own.forces[..., 1, 1] = -s.lift, s.moment
    own.accelerations[..., -1, 0] = -s.normal
    return own


def modal(theta: Array, s: Scale) -> tuple[Array, Array]:
    """Natural frequency [rad/s] and damping ratio [-] of the two-state model.

    From the characteristic polynomial p^2 - tr(A) p + det(A) (paper, below eq. 7). Where det(A) is
    not positive the motion does not oscillate about the trim: both are NaN.
    """
    a, _ = system(theta, s)
    trace = a[..., 0, 0] + a[..., 1, 1]
    det = a[..., 0, 0] * a[..., 1, 1] - a[..., 0, 1] * a[..., 1, 0]
    wn = np.sqrt(np.where(det > 0.0, det, np.nan))
    return wn, -trace / (2.0 * wn)


def derivatives(a: Array, b: Array, s: Scale) -> Array:
    """Inverse of `system`: the six derivatives (..., 6) of given state and input matrices."""
    h = s.half_chord_time
    return np.stack(
        [
            -a[..., 0, 0] / s.lift,
            (1.0 - a[..., 0, 1]) / (s.lift * h),
            -b[..., 0] / s.lift,
            a[..., 1, 0] / s.moment,
            a[..., 1, 1] / (s.moment * h),
            b[..., 1] / s.moment,
        ],
        axis=-1,
    )


__all__ = [
    "CL_ALPHA",
    "CL_DE",
    "CL_Q",
    "CM_ALPHA",
    "CM_DE",
    "CM_Q",
    "PitchConstants",
    "Scale",
    "derivatives",
    "linear_system",
    "modal",
    "normal_force_row",
    "scale",
    "scale_of",
    "structure",
    "system",
]
