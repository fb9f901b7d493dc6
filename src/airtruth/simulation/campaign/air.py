"""The air of a run: histories of the gusts from their own random streams."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from airtruth.physics import dryden, lateral_gusts
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.simulation.campaign import streams
from airtruth.simulation.campaign.plan import Plan, PlannedRun

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Air:
    """Velocity and rotation of the air at the steps of the simulation, (samples,) each.

    Attributes
    ----------
    u_m_s, w_m_s : along the flight path and downward [m/s].
    v_m_s : to the right [m/s]; None without side gusts.
    rotation_rad_s : channel of an angular rate -> rotation about that axis, in its sense [rad/s]; none without rotary gusts.
    """

    u_m_s: Array
    w_m_s: Array
    v_m_s: Array | None = None
    rotation_rad_s: Mapping[str, Array] = field(default_factory=dict)

    def rotation_of(self, motion: Motion) -> dict[str, Array]:
        """The rotations about the axes of a motion."""
        return {name: self.rotation_rad_s[name] for name in motion.gyros if name in self.rotation_rad_s}


def air_of(plan: Plan, run: PlannedRun, airspeed_m_s: float) -> Air:
    """The gusts of a run.

    The side gusts have a random stream of their own: those in the pitch plane are the same with and without them.

    Parameters
    ----------
    plan, run : the campaign and the run.
    airspeed_m_s : true airspeed of its trim [m/s].
    """
    u, w, *turning = _in_the_pitch_plane(plan, run, airspeed_m_s)
    rotation = dict(zip(LONGITUDINAL.gyros, turning, strict=False))
    if not plan.campaign.side_gusts:
        return Air(u, w, None, rotation)
    v, *turning = _to_the_side(plan, run, airspeed_m_s)
    return Air(u, w, v, rotation | dict(zip(LATERAL.gyros, turning, strict=False)))


def _in_the_pitch_plane(plan: Plan, run: PlannedRun, airspeed: float) -> list[Array]:
    """u, w and, of rotary gusts, q."""
    rotary, sigma_u, sigma_w = plan.campaign.gust.rotary, run.sigma_u_m_s, run.sigma_w_m_s
    if sigma_u == 0.0 and sigma_w == 0.0:
        still = np.zeros(plan.samples)
        return [still, still, *([-still] if rotary else [])]
    unit = _unit_gust(run.length_u_m, run.length_w_m, airspeed, _span(plan), plan.dt_s)
    u, w, *q = (
        _simulated(plan, run, unit, streams.GUST) * np.array([[sigma_u], [sigma_w], [sigma_w]])[: 2 + rotary]
    )
    return [u, w, *(-turning for turning in q)]


def _to_the_side(plan: Plan, run: PlannedRun, airspeed: float) -> list[Array]:
    """v and, of rotary gusts, p and r."""
    rotary, sigma_v, sigma_w = plan.campaign.gust.rotary, run.sigma_v_m_s, run.sigma_w_m_s
    if sigma_v == 0.0 and sigma_w == 0.0:
        return (1 + 2 * rotary) * [np.zeros(plan.samples)]
    unit = _unit_side_gust(run.length_v_m, run.length_w_m, airspeed, _span(plan), plan.dt_s)
    deviations = np.array([[sigma_v], [sigma_w], [sigma_v]])[: 1 + 2 * rotary]
    return [*(_simulated(plan, run, unit, streams.SIDE_GUST) * deviations)]


def _simulated(plan: Plan, run: PlannedRun, unit: dryden.DiscreteGust, stream: int) -> Array:
    """(outputs, samples) of a gust of unit standard deviations."""
    states = unit.phi.shape[-1]
    normals = streams.normals(plan.seed, run.run, stream, plan.samples * states)
    drawn = normals.reshape(1, plan.samples, states)
    return np.asarray(dryden.simulate(unit, drawn, plan.campaign.gust.start)[0].T)


def _span(plan: Plan) -> float | None:
    return plan.aircraft.constants.span_m if plan.campaign.gust.rotary else None


@lru_cache(maxsize=64)
def _unit_gust(
    length_u: float, length_w: float, airspeed: float, span: float | None, dt_s: float
) -> dryden.DiscreteGust:
    """Gusts of unit standard deviation; the rotary gust goes with w."""
    return dryden.discretise(dryden.Dryden(1.0, 1.0, length_u, length_w, airspeed, span), dt_s)


@lru_cache(maxsize=64)
def _unit_side_gust(
    length_v: float, length_w: float, airspeed: float, span: float | None, dt_s: float
) -> dryden.DiscreteGust:
    """Side gusts where v and w have unit standard deviation; p goes with w and r with v."""
    gust = lateral_gusts.LateralDryden(1.0, 1.0, length_v, length_w, airspeed, span)
    return lateral_gusts.discretise(gust, dt_s)


__all__ = ["Air", "air_of"]
