"""The declared aircraft and the gusts of the lateral-directional motion as the compiled filter reads them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.lateral_gusts import roll_deviation_rad_s
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.tracing.model.by_motion import register
from airtruth.tracing.model.compile import CompiledChange
from airtruth.tracing.model.kernel_input import GustModel
from airtruth.tracing.model.lateral.equations import EQUATIONS
from airtruth.tracing.model.lateral.input import LateralAircraft, LateralAirInputs
from airtruth.tracing.model.packing import AirPath, Packing, turned_increments
from airtruth.tracing.model.parameters import CommonEntries
from airtruth.tracing.model.plant import Plant
from airtruth.tracing.model.records import Signals
from airtruth.tracing.model.records import fine as on_grid
from airtruth.units import G0

Array = NDArray[np.float64]

_STEPS: Final = 4
"""Steps that give the first climb [-] (judgement: each reduces its error by the square of the bank)."""

register(LateralAircraft, LateralAirInputs, EQUATIONS)


def pack_lateral(
    plant: Plant, compiled: CompiledChange, common: Array, entries: CommonEntries
) -> LateralAircraft:
    """The declared aircraft of a flight condition, with its changes and increments.

    A relative change of the inertia at equal derivatives of the angular accelerations changes all inertias alike.
    """
    c, declared = plant.aircraft.constants, compiled.declared
    points, values = plant.stacked
    inertia = float(common[entries.inertia])
    ixx, izz = c.inertia_xx_kg_m2, c.inertia_zz_kg_m2
    ixz = c.inertia_xz_kg_m2 + declared["inertia_xz"] * math.sqrt(ixx * izz)
    return LateralAircraft(
        area_m2=c.wing_area_m2,
        span_m=c.span_m,
        chord_m=c.chord_m,
        mass_kg=c.mass_kg * declared["mass"],
        inertia_xx_kg_m2=ixx * declared["inertia_xx"] * (1.0 + inertia),
        inertia_yy_kg_m2=c.inertia_yy_kg_m2 * (1.0 + inertia),
        inertia_zz_kg_m2=izz * declared["inertia_zz"] * (1.0 + inertia),
        inertia_xz_kg_m2=ixz * (1.0 + inertia),
        trim=plant.trim_signals,
        neutral_rad=plant.neutral_rad,
        effectiveness=np.array([declared[control.name] for control in LATERAL.controls]),
        cg_shift=declared["cg"],
        cg_y_m=declared["cg_y"],
        load_y_m=declared["cg_y"] + declared["load_y"],
        yaw_moment_n_m=declared["yaw_moment"],
        constant=plant.constant,
        increments=turned_increments(plant, common, entries, inertia),
        alpha_rad=plant.alpha_rad,
        points=points,
        values=values,
    )


def side_gusts(vertical: GustModel, span_m: float) -> GustModel:
    """Side gusts of the level, length, rolloff and share of vertical ones, with the times of their own rotary parts."""
    return vertical._replace(
        rotary_time_s=0.75 * vertical.rotary_time_s,
        roll_1_m=roll_deviation_rad_s(1.0, vertical.length_m, span_m),
        roll_time_s=vertical.rotary_time_s,
    )


def _angle_of_attack(compiled: CompiledChange, s: Signals) -> Array:
    """Angle of attack at the CG, without the errors of a vane that may be off the plane of symmetry [rad]."""
    errors = compiled.inputs.get(s.motion.known_signals[0].channel)
    if errors is None:
        return s.alpha_rad
    roll = on_grid(s.y[:, s.motion.output_channels.index(s.motion.controls[0].damped)], s.sub)
    return errors.unscaled(s.alpha_rad) - roll * errors.y_m / s.airspeed_m_s


def _over_ground(alpha_rad: Array, ground_m_s: Array, theta_rad: Array, s: Signals) -> Array:
    """Angle of attack over ground, from the climb that the specific forces give, with the mean of the one of the air [rad].

    The gusts that the vane reads do not turn the path of the aircraft. The mean gust of the record remains unknown; it is a
    parameter of the record (`airtruth.tracing.model.parameters.RecordEntries.mean_gust`).

    Source: B. L. Stevens and F. L. Lewis, Aircraft Control and Simulation, 2nd ed., 2003, table 2.5-1 (h').
    """
    if {LONGITUDINAL.vane, "theta_rad", LONGITUDINAL.outputs[-1].channel} & {*s.assumed}:
        return alpha_rad
    outputs = dict(zip((y.name for y in s.motion.outputs), s.y.T, strict=True))
    beta, phi, ay = (on_grid(outputs[name], s.sub) for name in ("beta", "phi", "ay"))
    sine, cosine = np.sin(theta_rad), np.cos(theta_rad)
    upward = s.ax_m_s2 * sine - cosine * (ay * np.sin(phi) + s.az_m_s2 * np.cos(phi)) - G0
    climb = np.concatenate([[0.0], np.cumsum(0.5 * s.dt_s / s.sub * (upward[1:] + upward[:-1]))])

    def attack(first_m_s: float) -> Array:
        # sin(gamma) = sin(theta) cos(alpha) cos(beta) - cos(theta) (sin(phi) sin(beta) + cos(phi) sin(alpha) cos(beta))
        along, across = sine * np.cos(beta), cosine * np.cos(phi) * np.cos(beta)
        rest = (climb + first_m_s) / ground_m_s + cosine * np.sin(phi) * np.sin(beta)
        return np.asarray(np.arctan2(along, across) - np.arcsin(rest / np.hypot(along, across)))

    first = 0.0
    for _ in range(_STEPS):
        first += float(ground_m_s.mean() * (attack(first) - alpha_rad).mean())
    return attack(first)


def _relative_rate(ground_m_s: Array, s: Signals) -> Array:
    """V'/V of the speed without the gust, from its samples [1/s]."""
    sampled = ground_m_s[:: s.sub]
    return on_grid(np.gradient(sampled, s.dt_s, edge_order=2 if sampled.size > 2 else 1) / sampled, s.sub)


def _known(s: Signals, compiled: CompiledChange, air: AirPath) -> Sequence[Array]:
    """Known inputs of `LateralAirInputs`."""
    alpha, q = _angle_of_attack(compiled, s), compiled.undone(LONGITUDINAL.gyros[0], s.q_rad_s)
    v, ground, qbar, theta = air
    turned = _over_ground(alpha, ground, theta, s)
    return v, ground, qbar, alpha, turned, theta, q, _relative_rate(ground, s), s.ax_m_s2, s.az_m_s2


PACKING: Final = Packing(LateralAirInputs, _known, pack_lateral, side_gusts)
"""Packing of records of the lateral-directional motion."""

__all__ = ["PACKING", "pack_lateral", "side_gusts"]
