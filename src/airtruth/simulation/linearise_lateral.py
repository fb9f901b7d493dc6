"""The lateral-directional derivatives of an aircraft at a trim in six axes, by differences in JSBSim."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import TrimError
from airtruth.physics.lateral import LateralScale, lateral_modal, lateral_scale
from airtruth.physics.motion import LATERAL
from airtruth.simulation.attitude import straight_attitude
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import DEG, FT, PSF

Array = NDArray[np.float64]

STEPS: Final = (0.5 * DEG, 1.0 * DEG, 1.0 * DEG, 0.5 * DEG, 0.5 * DEG)
"""Steps in beta [rad], p, r [rad/s], aileron and rudder command [rad] (judgement: tables of a symmetric aircraft break at zero, a
tenth of a degree beside its trim; central differences over the break are the mean of its sides, which a flight sees)."""
_LEAST_MOTION: Final = 1e-6
"""Least determinant of the motion of aileron and rudder with their commands [-]: a surface that stands still is refused."""
_MOMENTS: Final = ("forces/fby-total-lbs", "moments/l-total-lbsft", "moments/n-total-lbsft")
"""Side force [lbf], rolling and yawing moment about the CG [lbf ft], without gravity."""


@dataclass(frozen=True)
class LateralLinearisation:
    """Declared derivatives about the CG, in the order of ``LATERAL.parameters``.

    Attributes
    ----------
    plus, minus, central : (15,) one-sided (upward, downward) and central differences [-].
        Tables are piecewise linear: at a break the sides differ.
    scale : factors at this trim.
    modes : (4,) modal parameters of ``central``, in the order of ``LATERAL.modal``.
    """

    plus: Array
    minus: Array
    central: Array
    scale: LateralScale
    modes: Array


def linearise_lateral(aircraft: Aircraft, trim: Trim, dt_s: float = 1.0 / 200.0) -> LateralLinearisation:
    """Differences of CY, Cl and Cn in beta, p b/(2V), r b/(2V), aileron and rudder, at constant airspeed and alpha.

    The coefficients are those of all forces but weight, about the CG, in body axes. Where feedback moves a surface with the
    motion, its contribution is subtracted: the derivatives are at constant surfaces.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium in six axes.
    dt_s : simulation step of the executive [s].

    Raises
    ------
    TrimError
        If the trim is one of the pitch plane, or aileron and rudder do not follow their commands.
    """
    if not trim.condition.six_axes:
        raise TrimError(
            f"{aircraft.name}: lateral derivatives need a trim in six axes; state wings-level or no-sideslip in the condition"
        )
    executive = Executive(aircraft, dt_s)
    origin = _probe(executive, trim, np.zeros(5))
    sides = [_one_sided(executive, trim, origin, side) for side in (1.0, -1.0)]
    c, controls = aircraft.constants, trim.controls
    theta = straight_attitude(
        trim.alpha_rad, controls.sideslip_rad, controls.bank_rad, trim.condition.gamma_rad
    ).theta_rad
    s = lateral_scale(
        c.model_copy(update={"mass_kg": trim.mass_kg}),
        trim.airspeed_m_s,
        trim.density_kg_m3,
        trim.alpha_rad,
        theta,
    )
    central = 0.5 * (sides[0] + sides[1])
    return LateralLinearisation(sides[0], sides[1], central, s, lateral_modal(central, s))


def lateral_truth(linear: LateralLinearisation | None, trim: Trim | None) -> dict[str, float]:
    """Columns of truth.parquet of a run in six axes.

    The derivatives are central differences, with those of each side beside them; then modes and the lateral trim.

    Parameters
    ----------
    linear, trim : of the run's condition; None for a run that failed, whose columns are NaN.
    """
    names = LATERAL.parameters
    missing = np.full(len(names), np.nan)
    result: dict[str, float] = {}
    for suffix, side in (("", "central"), ("_plus", "plus"), ("_minus", "minus")):
        values = missing if linear is None else getattr(linear, side)
        result |= {name + suffix: float(v) for name, v in zip(names, values, strict=True)}
    modes = missing[: len(LATERAL.modal)] if linear is None else linear.modes
    result |= {name: float(v) for name, v in zip(LATERAL.modal, modes, strict=True)}
    at = None if trim is None else trim.controls
    return result | {
        "trim_aileron_rad": trim.aileron_rad if trim else np.nan,
        "trim_rudder_rad": trim.rudder_rad if trim else np.nan,
        "trim_phi_rad": at.bank_rad if at else np.nan,
        "trim_beta_rad": at.sideslip_rad if at else np.nan,
    }


def _probe(executive: Executive, trim: Trim, change: Array) -> Array:
    """[CY, Cl, Cn, aileron, rudder] in a state off the trim."""
    executive = executive.again()
    at, (beta, p, r, aileron, rudder) = trim.controls, map(float, change)
    controls = replace(
        at,
        sideslip_rad=at.sideslip_rad + beta,
        aileron_command_rad=at.aileron_command_rad + aileron,
        rudder_command_rad=at.rudder_command_rad + rudder,
    )
    executive.initialise(trim.condition, trim.alpha_rad, controls, p_rad_s=p, r_rad_s=r)
    c, response = executive.aircraft.constants, executive.respond()
    force, roll, yaw = (executive.fdm[name] for name in _MOMENTS)
    area = 0.5 * trim.density_kg_m3 * trim.airspeed_m_s**2 / PSF * c.wing_area_m2 / FT**2  # q_bar S [lbf]
    span = c.span_m / FT
    return np.array(
        [
            force / area,
            roll / (area * span),
            yaw / (area * span),
            response.aileron_rad,
            response.rudder_rad,
        ]
    )


def _one_sided(executive: Executive, trim: Trim, origin: Array, side: float) -> Array:
    steps = side * np.array(STEPS)
    columns = [(_probe(executive, trim, h) - origin) / s for h, s in zip(np.diag(steps), steps, strict=True)]
    slopes = np.column_stack(columns)
    by_state, by_command = slopes[:, :3], slopes[:, 3:]
    if abs(np.linalg.det(by_command[3:])) < _LEAST_MOTION:
        raise TrimError(
            "aileron and rudder do not follow their commands at the trim; check command, surface and command_per_rad of "
            "jsbsim.aileron and jsbsim.rudder in aircraft.toml"
        )
    by_surface = by_command[:3] @ np.linalg.inv(by_command[3:])
    at_rest = by_state[:3] - by_surface @ by_state[3:]
    rates = np.array([1.0, *2 * [2.0 * trim.airspeed_m_s / executive.aircraft.constants.span_m]])
    return np.hstack([at_rest * rates, by_surface]).ravel()


__all__ = ["STEPS", "LateralLinearisation", "lateral_truth", "linearise_lateral"]
