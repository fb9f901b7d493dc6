"""The derivatives of a motion of an aircraft at a trim, by differences in JSBSim."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import BANK
from airtruth.errors import TrimError
from airtruth.physics import short_period
from airtruth.physics.lateral import LateralScale, lateral_modal, lateral_scale
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.simulation.probe_lateral import FORCES
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import DEG, FT, PSF

Array = NDArray[np.float64]

STEPS: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        LONGITUDINAL.name: {"alpha": 0.01 * DEG, "elevator": 0.01 * DEG, "qhat": 0.05 * DEG},
        LATERAL.name: dict(
            zip((s.name for s in LATERAL.signals), (0.5 * DEG, DEG, DEG, 0.5 * DEG, 0.5 * DEG), strict=True)
        ),
    }
)
"""Motion -> steps in the flow angle [rad], rates [rad/s] and commands [rad] of its signals (judgement). In the
pitch plane inside a cell of tables stated in degrees, and far above rounding; tables of a symmetric
aircraft break at zero, a tenth of a degree beside its trim, and central differences over the break are the mean of its sides,
which a flight sees."""
_TRUTH: Final = {
    LONGITUDINAL.name: (("plus", "minus", "central"), (LONGITUDINAL.vane, *LONGITUDINAL.surfaces)),
    LATERAL.name: (("central", "plus", "minus"), (*LATERAL.surfaces, BANK, LATERAL.vane)),
}
"""Motion -> sides of its differences in truth.parquet, the true ones first, and channels of its trim there."""
_LEAST_MOTION: Final = 1e-6
"""Least determinant of the motion of the surfaces with their commands [-]: a surface that stands still is refused."""


@dataclass(frozen=True)
class Linearisation:
    """Declared derivatives about the CG, in the order of the parameters of a motion.

    Attributes
    ----------
    plus, minus, central : (derivatives,) one-sided (upward, downward) and central differences [-].
        Tables are piecewise linear: at a break the sides differ. ``plus`` of the pitch plane is the paper's truth.
    scale : factors at this trim.
    modes : modal parameters by name, of ``plus`` in the pitch plane and of ``central`` in six axes.
    """

    plus: Array
    minus: Array
    central: Array
    scale: short_period.Scale | LateralScale
    modes: Mapping[str, float]


def linearise(
    aircraft: Aircraft, trim: Trim, dt_s: float = 1.0 / 200.0, motion: Motion = LONGITUDINAL
) -> Linearisation:
    """Differences in the signals of a motion, at constant airspeed and constant surfaces.

    In the pitch plane they are those of alpha_dot and q_dot at a constant flight path, and the derivatives make eq. (2) of the
    paper equal to them: CLalpha is -(m V/(q_bar S)) d(alpha_dot)/d(alpha), thrust and drag terms included. In six axes they are
    those of CY, Cl and Cn of all forces but weight, about the CG, in body axes, at constant alpha. Where feedback moves a surface
    with the motion, its contribution is subtracted.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium, in six axes for the lateral-directional motion.
    dt_s : simulation step of the executive [s].
    motion : whose derivatives.

    Raises
    ------
    TrimError
        If the surfaces do not follow their commands at the trim, or the trim is one of the pitch plane for a lateral motion.
    """
    if motion is LATERAL and not trim.condition.six_axes:
        raise TrimError(
            f"{aircraft.name}: lateral derivatives need a trim in six axes; state wings-level or no-sideslip in the condition"
        )
    executive = Executive(aircraft, dt_s)
    origin = _answer(executive, trim, motion, {})
    sides = [_one_sided(executive, trim, motion, origin, side) for side in (1.0, -1.0)]
    return (_in_six_axes if motion is LATERAL else _in_pitch)(aircraft, trim, sides)


def _answer(executive: Executive, trim: Trim, motion: Motion, change: Mapping[str, float]) -> Array:
    """Answers of a motion in a state off the trim, and its surfaces [rad]: see `_accelerations` and `_coefficients`."""
    executive = executive.again()
    off = {signal.channel: change.get(signal.name, 0.0) for signal in motion.signals}
    at = trim.controls
    commands = {c.name: at.command(c.name) + off.pop(c.channel) for c in motion.controls}
    at = at.moved(commands, **{channel: at.of(channel) + more for channel, more in off.items()})
    executive.initialise(trim.condition, at)
    flow = at.of(LONGITUDINAL.vane)
    answered = _coefficients(executive, trim) if motion is LATERAL else _accelerations(executive, trim, flow)
    response = executive.respond()
    return np.array([*answered, *(response.surfaces_rad[c.name] for c in motion.controls)])


def _accelerations(executive: Executive, trim: Trim, alpha: float) -> tuple[float, ...]:
    """alpha_dot [rad/s] and q_dot [rad/s2] in the present state."""
    r = executive.respond()
    return (r.w_dot_m_s2 * np.cos(alpha) - r.u_dot_m_s2 * np.sin(alpha)) / trim.airspeed_m_s, r.q_dot_rad_s2


def _coefficients(executive: Executive, trim: Trim) -> tuple[float, ...]:
    """CY, Cl and Cn in the present state [-]."""
    c = executive.aircraft.constants
    force, roll, yaw = (executive.fdm[name] for name in FORCES)
    area = 0.5 * trim.density_kg_m3 * trim.airspeed_m_s**2 / PSF * c.wing_area_m2 / FT**2  # q_bar S [lbf]
    span = c.span_m / FT
    return force / area, roll / (area * span), yaw / (area * span)


def _one_sided(
    executive: Executive, trim: Trim, motion: Motion, origin: Array, side: float
) -> tuple[Array, Array]:
    """Slopes of the answers over the states at constant surfaces, and over the surfaces."""
    columns = {
        name: (_answer(executive, trim, motion, {name: side * step}) - origin) / (side * step)
        for name, step in STEPS[motion.name].items()
    }
    slopes = np.column_stack([columns[signal.name] for signal in motion.signals])
    surfaces = len(motion.controls)
    of_surfaces, by_command = slopes[-surfaces:], slopes[:-surfaces, -surfaces:]
    if abs(np.linalg.det(of_surfaces[:, -surfaces:])) < _LEAST_MOTION:
        names = [control.name for control in motion.controls]
        raise TrimError(
            f"{' and '.join(names)} do not follow their commands at the trim; check command, surface and command_per_rad of "
            f"{' and '.join(f'jsbsim.{name}' for name in names)} in aircraft.toml"
        )
    by_surface: Array = np.asarray(
        np.linalg.solve(of_surfaces[:, -surfaces:].T, by_command.T).T, dtype=np.float64
    )
    return slopes[:-surfaces, :-surfaces] - by_surface @ of_surfaces[:, :-surfaces], by_surface


def _in_pitch(aircraft: Aircraft, trim: Trim, sides: list[tuple[Array, Array]]) -> Linearisation:
    c = aircraft.constants.model_copy(update={"mass_kg": trim.mass_kg})
    s = short_period.scale_of(c, trim.airspeed_m_s, trim.density_kg_m3)
    plus, minus = (short_period.derivatives(a, b[:, 0], s) for a, b in sides)
    modes = map(float, short_period.modal(plus, s))
    named = dict(zip(LONGITUDINAL.modal, modes, strict=True))
    return Linearisation(plus, minus, 0.5 * (plus + minus), s, named)


def _in_six_axes(aircraft: Aircraft, trim: Trim, sides: list[tuple[Array, Array]]) -> Linearisation:
    c = aircraft.constants
    s = lateral_scale(
        c.model_copy(update={"mass_kg": trim.mass_kg}),
        trim.airspeed_m_s,
        trim.density_kg_m3,
        trim.alpha_rad,
        trim.controls.attitude(trim.condition.gamma_rad).theta_rad,
    )
    rates = np.array([1.0, *2 * [2.0 * trim.airspeed_m_s / c.span_m]])
    plus, minus = (np.hstack([a * rates, b]).ravel() for a, b in sides)
    central = 0.5 * (plus + minus)
    modes = dict(zip(LATERAL.modal, lateral_modal(central, s).tolist(), strict=True))
    return Linearisation(plus, minus, central, s, modes)


def truth_of(motion: Motion, linear: Linearisation | None, trim: Trim | None) -> dict[str, float]:
    """Columns of truth.parquet of a motion: its derivatives with those of the other sides beside them, modes, and trim.

    Parameters
    ----------
    linear, trim : of the run's condition; None for a run that failed, whose columns are NaN.
    """
    missing = np.full(len(motion.parameters), np.nan)
    result: dict[str, float] = {}
    sides, at_trim = _TRUTH[motion.name]
    for side in sides:
        suffix = "" if side == sides[0] else f"_{side}"
        values = missing if linear is None else getattr(linear, side)
        result |= {name + suffix: float(v) for name, v in zip(motion.parameters, values, strict=True)}
    result |= {name: np.nan if linear is None else linear.modes[name] for name in motion.modal}
    return result | {f"trim_{channel}": np.nan if trim is None else trim.of(channel) for channel in at_trim}


__all__ = ["STEPS", "Linearisation", "linearise", "truth_of"]
