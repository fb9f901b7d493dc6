"""Damaged aircraft of an independent truth: both motions at once, asymmetric trims, and an aircraft without its fin.

Each case changes a plane of `validation.lateral_truth` by formulas of its own: an elliptical lift distribution for a lost wing
tip, where the tracer has strip theory with a constant lift slope; arms and shares of fin and tail from the derivatives.
Nothing here imports `airtruth.effects`, `airtruth.identification` or `airtruth.tracing`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from validation.lateral_truth import GTM, Flight, Plane, record_pair, steps, still

Array = NDArray[np.float64]
_DEG = np.pi / 180.0
_CL, _CM = 0, 1
_BETA, _P, _R, _DA, _DR = range(5)


def without_fin(plane: Plane, lost: float) -> Plane:
    """A part of the fin and of its rudder is lost (Etkin and Reid, ch. 5): arms from the rudder, nine tenths of Cnr."""
    lateral = plane.lateral.copy()
    behind, above = -lateral[2, _DR] / lateral[0, _DR], lateral[1, _DR] / lateral[0, _DR]
    slope = -0.9 * lateral[2, _R] / (2.0 * behind**2)
    felt = np.array([-1.0, -2.0 * above, 2.0 * behind])
    lateral[:, :3] -= lost * slope * np.outer([1.0, above, -behind], felt)
    lateral[:, _DR] *= 1.0 - lost
    return replace(plane, lateral=lateral)


def without_rudder(plane: Plane, lost: float) -> Plane:
    """The rudder is lost, with a part of the fin's chord: seven tenths of CYr and Cnr are left, and Cnbeta falls by 0.03."""
    lateral = plane.lateral.copy()
    lateral[[0, 2], _R] *= 1.0 - 0.3 * lost
    lateral[2, _BETA] -= 0.03 * lost
    lateral[:, _DR] *= 1.0 - lost
    return replace(plane, lateral=lateral)


def without_tip(plane: Plane, lost: float) -> Plane:
    """The outer part of the left semispan is lost: elliptical lift, a seventh of the wing's mass in proportion to the lift."""
    y = np.linspace(0.0, 1.0, 4001)
    chord = np.sqrt(1.0 - y**2)
    gone = y > 1.0 - lost

    def share(power: int) -> float:
        return float(0.5 * (chord * y**power)[gone].sum() / (chord * y**power).sum())

    aileron = (y > 0.6) & (y < 0.95)
    left = float(0.5 * (chord * y)[aileron & gone].sum() / (chord * y)[aileron].sum())
    lateral, pitch = plane.lateral.copy(), plane.pitch.copy()
    lateral[1, _P] *= 1.0 - share(2)
    lateral[1, _BETA] *= 1.0 - share(1)
    lateral[:, _DA] *= 1.0 - left
    pitch[_CL, 0] *= 1.0 - share(0)
    out = float((chord * y)[gone].sum() / chord[gone].sum()) * 0.5 * plane.span
    mass = 0.14 * share(0) * plane.mass
    ixx, iyy, izz, ixz = plane.inertia
    return replace(
        plane,
        lateral=lateral,
        pitch=pitch,
        mass=plane.mass - mass,
        inertia=(ixx - mass * out**2, iyy, izz - mass * out**2, ixz),
        roll_per_lift=plane.roll_per_lift - share(0) * out / plane.span,
        cg_right=plane.cg_right + mass / plane.mass * out,
    )


def without_stabiliser(plane: Plane, lost: float) -> Plane:
    """A part of the left half of the stabiliser and of its elevator is lost, with the rolling moment of the other half's lift."""
    pitch, lateral = plane.pitch.copy(), plane.lateral.copy()
    arm = -pitch[_CM, 2] / pitch[_CL, 2]
    slope = -pitch[_CM, 1] / 1.1 / (2.0 * arm**2)
    tail = np.array([0.6 * slope, 2.0 * arm * slope, pitch[_CL, 2]])
    pitch[_CL] -= lost * tail
    pitch[_CM] += lost * np.array([arm * tail[0], arm * tail[1], -pitch[_CM, 2]])
    lateral[1, _P] *= 1.0 - 0.04 * lost
    down = -0.05 * lost  # the lift of the tail at the trim, that of the right half alone
    return replace(plane, pitch=pitch, lateral=lateral, at_rest=(0.0, -0.1 * down, 0.0))


def stuck_aileron(plane: Plane, at_rad: float) -> Plane:
    """The right aileron is stuck: half of the effectiveness, and a constant moment that the left one balances."""
    lateral = plane.lateral.copy()
    half = 0.5 * lateral[:, _DA]
    lateral[:, _DA] -= half
    y, roll, yaw = (half * at_rad).tolist()
    return replace(plane, lateral=lateral, at_rest=(y, roll, yaw))


def without_flap(plane: Plane) -> Plane:
    """The left inboard flap is gone: less lift of that side, a rolling moment with the lift, and a nose-up moment slope."""
    pitch = plane.pitch.copy()
    pitch[_CL, 0] *= 0.96
    pitch[_CM, 0] *= 0.94
    return replace(plane, pitch=pitch, roll_per_lift=-0.04 * 0.18)


def cg_to_the_side(plane: Plane, right_m: float) -> Plane:
    return replace(plane, cg_right=right_m)


def heavier(plane: Plane, factor: float) -> Plane:
    """A load at the CG: the mass grows, and the lift at the trim with it."""
    return replace(plane, mass=factor * plane.mass)


@dataclass(frozen=True)
class Damage:
    """A case: aircraft, causes that the answer has to contain in one of its sets, and whether records have to be short."""

    plane: Plane
    causes: tuple[str, ...]
    short: bool = False


def _case(change: Callable[..., Plane], size: float, *causes: str, short: bool = False) -> Damage:
    return Damage(change(GTM, size), causes, short)


CASES: Mapping[str, Damage] = {
    "fin-30": _case(without_fin, 0.3, "fin_effectiveness"),
    "fin-60": _case(without_fin, 0.6, "fin_effectiveness"),
    "fin-100": _case(without_fin, 1.0, "fin_effectiveness", short=True),
    "rudder-100": _case(without_rudder, 1.0, "rudder_effectiveness"),
    "tip-10": _case(without_tip, 0.10, "wing_tip_loss"),
    "tip-20": _case(without_tip, 0.20, "wing_tip_loss"),
    "tip-25": _case(without_tip, 0.25, "wing_tip_loss"),
    "stabiliser-50": _case(without_stabiliser, 0.5, "tail_effectiveness"),
    "stabiliser-25": _case(without_stabiliser, 0.25, "tail_effectiveness"),
    "aileron-stuck-0": _case(stuck_aileron, 0.0, "aileron_effectiveness"),
    "aileron-stuck-4": _case(stuck_aileron, 4.0 * _DEG, "aileron_effectiveness"),
    "flap": Damage(without_flap(GTM), ("flap_loss",)),
    "cg-side-3": _case(cg_to_the_side, 0.03, "cg_shift_y"),
    "mass-12": _case(heavier, 1.12, "mass_error"),
    "none": Damage(GTM, ()),
}
"""Name of each case -> aircraft and causes."""


def flights(case: Damage, seed: int, gust: float = 0.5, records: int = 4) -> list[Flight]:
    """Records of aileron and rudder, and of the elevator, in both signs; where the aircraft diverges, short ones of the first."""
    if case.short:
        return [
            Flight(
                case.plane,
                aileron=steps(0.1, 0.15, 1, -1, -1, 1),
                rudder=steps(0.8, 0.15, 1, -1),
                amplitudes=(s * 3.5 * _DEG, s * 3.5 * _DEG, 0.0),
                duration_s=1.5,
                seed=1000 * seed + i,
            )
            for i, s in enumerate((1.0, -1.0) * records)
        ]
    lateral = [
        replace(f, plane=case.plane, gust=gust, duration_s=8.0, seed=1000 * seed + i)
        for i, f in enumerate(record_pair() * (records // 2))
    ]
    pitch = [
        Flight(
            case.plane,
            aileron=still,
            rudder=still,
            elevator=steps(0.5, 0.3, s, s, s, -s, -s, s, -s),
            amplitudes=(0.0, 0.0, 1.5 * _DEG),
            gust=gust,
            duration_s=6.0,
            seed=1000 * seed + 500 + i,
        )
        for i, s in enumerate((1.0, -1.0) * (records // 2))
    ]
    return lateral + pitch


__all__ = ["CASES", "Damage", "flights"]
