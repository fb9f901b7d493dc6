"""The lateral-directional motion: equations of motion, outputs and modal parameters of the linear model.

Deviations from a steady straight flight; derivatives per radian, rate derivatives per p b/(2V), r b/(2V); body axes:

    beta' = q_bar S/(m V) CY + p sin(alpha) - r cos(alpha) + (g/V) cos(theta) phi
    p'    = q_bar S b (Izz Cl + Ixz Cn)/(Ixx Izz - Ixz^2),   r' = q_bar S b (Ixz Cl + Ixx Cn)/(Ixx Izz - Ixz^2)
    phi'  = p + r tan(theta),   ay = q_bar S/m CY

Source: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 3.2 and 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.linear_model import BodyConstants, Linear, Structure, assembled, bare, places
from airtruth.physics.motion import LATERAL
from airtruth.units import G0

Array = NDArray[np.float64]


class LateralConstants(BodyConstants, Protocol):
    """Constants of the aircraft that the lateral-directional motion needs."""

    @property
    def span_m(self) -> float:
        """Span b [m]."""

    @property
    def inertia_xx_kg_m2(self) -> float:
        """Roll inertia Ixx [kg m2]."""

    @property
    def inertia_zz_kg_m2(self) -> float:
        """Yaw inertia Izz [kg m2]."""

    @property
    def inertia_xz_kg_m2(self) -> float:
        """Product of inertia Ixz, the integral of x z dm [kg m2]."""


@dataclass(frozen=True)
class LateralScale:
    """Factors that turn the derivatives into the linear model; arrays of one shape.

    Attributes
    ----------
    airspeed_m_s : true airspeed V [m/s].
    force : q_bar S/m, from CY to ay [m/s2].
    roll, cross, yaw : q_bar S b over Ixx Izz - Ixz^2, times Izz, Ixz and Ixx: from Cl to p', from Cl to r' and Cn to p',
        and from Cn to r' [1/s2].
    half_span_time : b/(2V), from a rate to the dimensionless rate [s].
    alpha_rad, theta_rad : angle of attack and pitch attitude of the steady flight [rad].
    """

    airspeed_m_s: Array
    force: Array
    roll: Array
    cross: Array
    yaw: Array
    half_span_time: Array
    alpha_rad: Array
    theta_rad: Array


def lateral_scale(
    constants: LateralConstants,
    airspeed_m_s: Array | float,
    density_kg_m3: Array | float,
    alpha_rad: Array | float,
    theta_rad: Array | float,
) -> LateralScale:
    """Return the factors of the linear model at a flight condition.

    Parameters
    ----------
    constants : area, span, mass, inertias.
    airspeed_m_s, density_kg_m3 : true airspeed V [m/s], air density [kg/m3].
    alpha_rad, theta_rad : angle of attack and pitch attitude of the steady flight [rad]; all of one shape.

    Raises
    ------
    ValueError
        If Ixx Izz - Ixz^2 is not above 0: no body has such inertias.
    """
    c = constants
    determinant = c.inertia_xx_kg_m2 * c.inertia_zz_kg_m2 - c.inertia_xz_kg_m2**2
    if not determinant > 0.0:
        raise ValueError(
            f"inertia_xz = {c.inertia_xz_kg_m2:g} kg m2: its square must be below inertia_xx inertia_zz = "
            f"{c.inertia_xx_kg_m2 * c.inertia_zz_kg_m2:g} kg2 m4"
        )
    v, rho, alpha, theta = (
        np.asarray(x, dtype=np.float64)
        for x in np.broadcast_arrays(airspeed_m_s, density_kg_m3, alpha_rad, theta_rad)
    )
    lift = 0.5 * rho * v**2 * c.wing_area_m2
    moment = lift * c.span_m / determinant
    return LateralScale(
        airspeed_m_s=v,
        force=lift / c.mass_kg,
        roll=moment * c.inertia_zz_kg_m2,
        cross=moment * c.inertia_xz_kg_m2,
        yaw=moment * c.inertia_xx_kg_m2,
        half_span_time=c.span_m / (2.0 * v),
        alpha_rad=alpha,
        theta_rad=theta,
    )


def structure(s: LateralScale) -> Structure:
    """The parts of the linear model that the flight condition alone decides."""
    own = bare(LATERAL, s.half_span_time)
    kinematics, forces = own.kinematics, own.forces
    kinematics[..., 0, 1], kinematics[..., 0, 2] = np.sin(s.alpha_rad), -np.cos(s.alpha_rad)
    kinematics[..., 0, 3] = G0 / s.airspeed_m_s * np.cos(s.theta_rad)
    kinematics[..., 3, 1], kinematics[..., 3, 2] = 1.0, np.tan(s.theta_rad)
    forces[..., 0, 0] = s.force / s.airspeed_m_s
    forces[..., 1, 1], forces[..., 1, 2] = s.roll, s.cross
    forces[..., 2, 1], forces[..., 2, 2] = s.cross, s.yaw
    own.accelerations[..., -1, 0] = s.force
    return own


def lateral_system(theta: Array, s: LateralScale) -> Linear:
    """The linear model of derivatives.

    Parameters
    ----------
    theta : (..., 15) derivatives in the order of ``LATERAL.parameters`` [-].
    s : factors of shape (...).
    """
    return assembled(LATERAL, structure(s), theta)


def lateral_modal(theta: Array, s: LateralScale) -> Array:
    """Modal parameters (..., 4) in the order of ``LATERAL.modal``: see `lateral_modes`."""
    return lateral_modes(theta, s)[0]


def lateral_modes(theta: Array, s: LateralScale) -> tuple[Array, Array]:
    """Modal parameters of the four-state model, and their derivatives.

    The Dutch roll is the complex pair of the largest modulus, the roll subsidence the faster real root, the spiral the
    slower one; NaN where the motion has no such root. Derivatives are those of simple eigenvalues, w' dA v/(w' v).

    Parameters
    ----------
    theta : (..., 15) [-]; s : factors of shape (...).

    Returns
    -------
    values : (..., 4) natural frequency [rad/s], damping ratio [-], root of the roll and of the spiral [1/s].
    slopes : (..., 4, 15).
    """
    theta = np.asarray(theta, dtype=np.float64)
    flat = theta.reshape(-1, theta.shape[-1])
    one = LateralScale(
        *(
            np.broadcast_to(getattr(s, name), theta.shape[:-1]).reshape(-1)
            for name in LateralScale.__dataclass_fields__
        )
    )
    values, slopes = np.full((len(flat), 4), np.nan), np.full((len(flat), 4, flat.shape[1]), np.nan)
    a = lateral_system(flat, one).a
    known = np.flatnonzero(np.isfinite(a).all(axis=(1, 2)))
    roots, right = np.linalg.eig(a[known])
    own = structure(one)
    state = places(LATERAL)
    for run, lam, v in zip(known, roots, right, strict=True):
        with np.errstate(all="ignore"):
            left = np.linalg.pinv(v)
        # d lambda_k/d theta of row i and column j: (left forces)_i rate_j v_(state of j)
        by_row = left @ own.forces[run]
        by_column = np.stack(
            [own.rates[run, j] * v[n] if is_state else 0.0 * v[0] for j, (is_state, n) in enumerate(state)],
            axis=-1,
        )
        d = (by_row[:, :, None] * by_column[:, None, :]).reshape(len(lam), -1)
        pair = np.flatnonzero(lam.imag > 0.0)
        real = np.flatnonzero(lam.imag == 0.0)
        if pair.size:
            k = pair[np.argmax(np.abs(lam[pair]))]
            wn = abs(lam[k])
            d_wn = (lam[k].conjugate() * d[k]).real / wn
            values[run, :2] = wn, -lam[k].real / wn
            slopes[run, 0], slopes[run, 1] = d_wn, -d[k].real / wn + lam[k].real / wn**2 * d_wn
        if real.size == 2:
            fast, slow = real[np.argsort(lam[real].real)]
            values[run, 2], values[run, 3] = lam[fast].real, lam[slow].real
            slopes[run, 2], slopes[run, 3] = d[fast].real, d[slow].real
    shape = theta.shape[:-1]
    return values.reshape(*shape, 4), slopes.reshape(*shape, 4, theta.shape[-1])


__all__ = [
    "LateralConstants",
    "LateralScale",
    "lateral_modal",
    "lateral_modes",
    "lateral_scale",
    "lateral_system",
    "structure",
]
