"""Effects on the derivatives, resolved at a flight condition of an aircraft in JSBSim."""

from __future__ import annotations

from dataclasses import replace

from airtruth.aircraft import Aircraft
from airtruth.aircraft.tail import tail_geometry
from airtruth.physics.composition import CAUSES, cause_motion
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.resolution import LinearPoint, resolved
from airtruth.physics.terms import Change
from airtruth.simulation.disposable import isolated
from airtruth.simulation.linearise import Linearisation, linearise
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import Trim, trim


def trimmed_and_linear(
    aircraft: Aircraft, condition: Condition, dt_s: float = 1.0 / 200.0, motion: Motion = LONGITUDINAL
) -> tuple[Trim, Linearisation]:
    """Trim an aircraft and return its derivatives there, in a disposable process.

    Parameters
    ----------
    aircraft, condition, dt_s : as in `airtruth.simulation.trim.trim`; motion : whose derivatives.

    Raises
    ------
    TrimError
        If the aircraft cannot be trimmed.
    AircraftError
        If the model ends or blocks its process.
    """
    return isolated(f"the trim of {aircraft.name}", _trimmed_and_linear, aircraft, condition, dt_s, motion)


def _trimmed_and_linear(
    aircraft: Aircraft, condition: Condition, dt_s: float, motion: Motion
) -> tuple[Trim, Linearisation]:
    at = trim(aircraft, condition, dt_s)
    return at, linearise(aircraft, at, dt_s, motion)


def linear_point(
    aircraft: Aircraft, condition: Condition, dt_s: float = 1.0 / 200.0, motion: Motion = LONGITUDINAL
) -> LinearPoint:
    """Derivatives (central differences), trim and geometry of an aircraft; JSBSim runs in a disposable process.

    Parameters
    ----------
    aircraft : with a JSBSim model.
    condition : flight condition of the trim; for the lateral motion in six axes, with the wings level where it states the pitch
        plane.
    dt_s : simulation step of the executive [s].
    motion : whose derivatives.

    Raises
    ------
    TrimError
        If the aircraft cannot be trimmed.
    """
    if motion is LONGITUDINAL:
        return point_of(aircraft, *trimmed_and_linear(aircraft, condition, dt_s))
    straight = condition if condition.six_axes else replace(condition, straight="wings-level")
    at, linear = trimmed_and_linear(aircraft, straight, dt_s, LATERAL)
    return point_of(aircraft, at, linear, LATERAL)


def point_of(
    aircraft: Aircraft, at: Trim, linear: Linearisation, motion: Motion = LONGITUDINAL
) -> LinearPoint:
    """Derivatives, trim and tail of an aircraft that was trimmed and linearised for a motion."""
    origin = zip(motion.signals, at.origin(motion).tolist(), strict=True)
    trimmed = {s.name: value for s, value in origin if s.length is None}
    trimmed |= {s.name: at.controls.of(s.channel) for s in motion.known_signals}
    return LinearPoint(linear.central, trimmed, tail_geometry(aircraft), motion)


def at_condition(
    change: Change, aircraft: Aircraft, condition: Condition, dt_s: float = 1.0 / 200.0
) -> Change:
    """Return a change whose causes are resolved into linear terms at a flight condition; the others are kept.

    Parameters
    ----------
    change : terms of one or several effects.
    aircraft, condition, dt_s : as in `linear_point`; the aircraft is the declared one, without the change.

    Raises
    ------
    TrimError
        If there is a cause to resolve and the aircraft cannot be trimmed.
    """
    if not change.derivatives:
        return change
    motions = [cause_motion(term.cause) for term in change.derivatives if term.cause in CAUSES]
    points = (linear_point(aircraft, condition, dt_s, m) for m in dict.fromkeys(motions or [LONGITUDINAL]))
    return resolved(change, *points)


__all__ = ["at_condition", "linear_point", "point_of", "trimmed_and_linear"]
