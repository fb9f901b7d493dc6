"""Replay of a measured record: the measured surface in JSBSim, at the measured airspeed.

Each record has the free parameters of a trace: initial angle of attack and pitch rate, an offset of the surface (the
moment at trim) and a bias of each output. At every step the horizontal velocity of the air is the difference between
the simulated speed over ground and the measured airspeed, which contains the horizontal gusts; a change of that
velocity exerts no force of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import FlightError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.gearing import FollowedSurface, commands_for
from airtruth.simulation.readings import READ, channels, require_sound
from airtruth.simulation.simulator import Executive
from airtruth.simulation.tracks import Track, as_logged, first_of, fitted_outputs
from airtruth.simulation.trim import Trim
from airtruth.units import FT

Array = NDArray[np.float64]

_STEPS: Final = np.array([2e-3, 1e-2, 5e-4])
"""Steps of initial alpha [rad], initial q [rad/s] and surface offset [rad] for differences."""


def replay(aircraft: Aircraft, at: Trim, track: Track) -> dict[str, Array]:
    """Replay a record and fit its free parameters.

    Parameters
    ----------
    aircraft : aircraft to fly.
    at : trim about which it starts.
    track : the record.

    Returns
    -------
    Channel of ``track.outputs`` -> (samples,) as the aircraft's sensors would log it without noise, biases
    fitted.

    Raises
    ------
    FlightError
        If the motion leaves the range in which the simulation has a meaning, or the model ends the simulation.
    AircraftError
        If the aircraft has no JSBSim model.
    """
    executive = Executive(aircraft, track.dt_s / track.substeps)
    names = list(track.outputs)
    free = np.array(
        [first_of(track, LONGITUDINAL.vane, at.alpha_rad), first_of(track, LONGITUDINAL.gyros[0], 0.0), 0.0]
    )
    # the surface about the aircraft's own trim: the offset is free in any case
    free[2] = at.elevator_rad - float(np.mean(track.controls_rad[ELEVATOR][: max(1, track.substeps * 5)]))

    def fly(x: Array) -> Array:
        logged = as_logged(aircraft, _run(executive, at, track, x), track)
        return np.stack([logged[n] for n in names])

    return fitted_outputs(fly, free, _STEPS, track)


def flown_through(aircraft: Aircraft, at: Trim, track: Track) -> dict[str, Array]:
    """Fly a record's surface and airspeed from a trim, without sensors and without a fit.

    Parameters
    ----------
    aircraft : aircraft to fly.
    at : trim about which it starts; the surface is counted from the record's start.
    track : the record; its outputs do not count.

    Returns
    -------
    Channel -> (steps,) at every step of the simulation, at the CG; see `airtruth.simulation.readings.channels`.

    Raises
    ------
    FlightError
        If the motion leaves the range in which the simulation has a meaning, or the model ends the simulation.
    AircraftError
        If the aircraft has no JSBSim model.
    """
    executive = Executive(aircraft, track.dt_s / track.substeps)
    first = float(np.mean(track.controls_rad[ELEVATOR][: max(1, track.substeps * 5)]))
    return _run(executive, at, track, np.array([at.alpha_rad, 0.0, at.elevator_rad - first]))


def each_flown_through(
    aircraft: Aircraft, flights: Sequence[tuple[Trim, Track]]
) -> list[dict[str, Array] | None]:
    """`flown_through` of several records; None for one whose motion leaves the range.

    Parameters
    ----------
    aircraft : aircraft to fly.
    flights : trim about which each record starts, and the record.

    Raises
    ------
    AircraftError
        If the aircraft has no JSBSim model.
    """
    flown: list[dict[str, Array] | None] = []
    for at, track in flights:
        try:
            flown.append(flown_through(aircraft, at, track))
        except FlightError:
            flown.append(None)
    return flown


def _run(executive: Executive, at: Trim, track: Track, free: Array) -> dict[str, Array]:
    """One simulation; channels at every step, at the CG, without sensors."""
    wanted = track.controls_rad[ELEVATOR] + free[2]
    command = commands_for(executive, at, ELEVATOR, wanted)
    executive = executive.renewed()
    fdm, surface = executive.fdm, executive.model.elevator
    fdm.set_trim_status(True)  # actuators pass their input through
    fdm.reset_to_initial_conditions(2)  # time to zero; initialise() runs the initial conditions
    executive.configure()
    gust = executive.node("atmosphere/gust-north-fps")
    gust.set_double_value((at.airspeed_m_s - float(track.airspeed_m_s[0])) / FT)
    executive.initialise(
        at.condition,
        float(free[0]),
        at.controls.moved({ELEVATOR: float(command[0])}),
        {LONGITUDINAL.gyros[0]: float(free[1])},
    )
    executive.choose_integrator()
    followed = FollowedSurface(executive, surface, command, wanted)
    gets = [node.get_double_value for node in executive.nodes([*READ, surface.surface])]
    north, down = executive.nodes(["velocities/v-north-fps", "velocities/v-down-fps"])
    records = [get() for get in gets]
    for step, airspeed in enumerate((track.airspeed_m_s / FT).tolist()[1:], start=1):
        followed.move(step)
        sink = down.get_double_value()
        over_ground = math.sqrt(max(airspeed * airspeed - sink * sink, 0.0))
        gust.set_double_value(north.get_double_value() - over_ground)
        if not fdm.run():
            raise FlightError(f"the model ended the replay at {fdm.get_sim_time():.3f} s")
        records.extend([get() for get in gets])
    columns = np.array(records).reshape(-1, len(gets)).T
    require_sound(columns, executive.dt_s, f"{executive.aircraft.name}, flown through a measured surface,")
    return channels(columns, at.mass_kg, surface.surface_rad) | {
        LONGITUDINAL.commands[0]: command,
        "throttle": np.full(columns.shape[1], at.controls.throttle),
    }


__all__ = ["each_flown_through", "flown_through", "replay"]
