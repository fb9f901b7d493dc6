"""Effects on the derivatives, resolved at a flight condition of an aircraft in JSBSim."""

from __future__ import annotations

from airtruth.aircraft import Aircraft
from airtruth.aircraft.tail import tail_geometry
from airtruth.physics.resolution import LinearPoint, resolved
from airtruth.physics.terms import Change
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim


def linear_point(aircraft: Aircraft, condition: Condition, dt_s: float = 1.0 / 200.0) -> LinearPoint:
    """Derivatives (central differences), trim and tail of an aircraft.

    Parameters
    ----------
    aircraft : with a JSBSim model.
    condition : flight condition of the trim.
    dt_s : simulation step of the executive [s].

    Raises
    ------
    TrimError
        If the aircraft cannot be trimmed.
    """
    at = trim(aircraft, condition, dt_s)
    return LinearPoint(
        linearise(aircraft, at, dt_s).central, at.alpha_rad, at.elevator_rad, tail_geometry(aircraft)
    )


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
    return resolved(change, linear_point(aircraft, condition, dt_s))


__all__ = ["at_condition", "linear_point"]
