"""Replay of a measured lateral-directional record in six axes: measured aileron and rudder in JSBSim, at the measured airspeed.

Free are the initial sideslip, roll and yaw rate and bank, an offset of each surface (the moments at trim) and a bias of each
output. Elevator and throttle stay at the trim, so that the pitch motion is that of the aircraft itself. The air moves along the
flight path at the difference between the simulated speed over ground and the measured airspeed.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import AircraftError, FlightError
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.gearing import FollowedSurface, commands_for
from airtruth.simulation.readings import READ, READ_LATERAL, channels, lateral_channels, require_sound
from airtruth.simulation.replay import replay
from airtruth.simulation.simulator import Executive
from airtruth.simulation.tracks import Track, as_logged, first_of, fitted_outputs
from airtruth.simulation.trim import Trim
from airtruth.units import FT

Array = NDArray[np.float64]

_STEPS: Final = np.array([2e-3, 1e-2, 1e-2, 2e-3, 5e-4, 5e-4])
"""Steps of initial sideslip [rad], roll and yaw rate [rad/s], bank [rad], and offsets of aileron and rudder [rad]."""
_OVER_GROUND: Final = ("velocities/v-north-fps", "velocities/v-east-fps", "velocities/v-down-fps")
"""Velocity over ground."""
_GUST: Final = ("atmosphere/gust-north-fps", "atmosphere/gust-east-fps")
"""Horizontal velocity of the air."""


def replayed(aircraft: Aircraft, at: Trim, track: Track) -> dict[str, Array]:
    """Replay a record of either motion, as `airtruth.simulation.replay.replay` or `replay_lateral`."""
    return (replay if ELEVATOR in track.controls_rad else replay_lateral)(aircraft, at, track)


def replay_lateral(aircraft: Aircraft, at: Trim, track: Track) -> dict[str, Array]:
    """Replay a record and fit its free parameters.

    Parameters
    ----------
    aircraft : aircraft to fly; at : trim in six axes about which it starts; track : the record.

    Returns
    -------
    Channel of ``track.outputs`` -> (samples,) as the aircraft's sensors would log it without noise, biases fitted.

    Raises
    ------
    FlightError
        If the motion leaves the range in which the simulation has a meaning, or the model ends the simulation.
    AircraftError
        If the aircraft has no JSBSim model, or the model no aileron or no rudder.
    """
    executive = Executive(aircraft, track.dt_s / track.substeps)
    model = executive.model
    absent = [name for name in track.controls_rad if getattr(model, name) is None]
    if absent:
        raise AircraftError(f"{aircraft.folder}: [jsbsim.{absent[0]}] of aircraft.toml is needed in six axes")
    names, head = list(track.outputs), max(1, track.substeps * 5)
    trimmed = (at.controls.sideslip_rad, 0.0, 0.0, at.controls.bank_rad)
    start = [first_of(track, s.channel, at_trim) for s, at_trim in zip(LATERAL.states, trimmed, strict=True)]
    offsets = [at.surfaces_rad[name] - float(np.mean(own[:head])) for name, own in track.controls_rad.items()]

    def fly(x: Array) -> Array:
        logged = as_logged(aircraft, _run(executive, at, track, x), track)
        return np.stack([logged[n] for n in names])

    return fitted_outputs(fly, np.array([*start, *offsets]), _STEPS, track)


def _run(executive: Executive, at: Trim, track: Track, free: Array) -> dict[str, Array]:
    """One simulation; channels at every step, at the CG, without sensors."""
    beta, p, r, phi, *offsets = free.tolist()
    wanted = {n: own + more for (n, own), more in zip(track.controls_rad.items(), offsets, strict=True)}
    commands = {name: commands_for(executive, at, name, rad) for name, rad in wanted.items()}
    executive = executive.renewed()
    fdm, model = executive.fdm, executive.model
    surfaces = {name: getattr(model, name) for name in wanted}
    fdm.set_trim_status(True)  # actuators pass their input through
    fdm.reset_to_initial_conditions(2)  # time to zero; initialise() runs the initial conditions
    executive.configure()
    gusts = [node.set_double_value for node in executive.nodes(_GUST)]
    gusts[0]((at.airspeed_m_s - float(track.airspeed_m_s[0])) / FT)
    gusts[1](0.0)
    first = {name: float(command[0]) for name, command in commands.items()}
    controls = at.controls.moved(first, bank_rad=phi, sideslip_rad=beta)
    executive.initialise(at.condition, at.alpha_rad, controls, dict(zip(LATERAL.gyros, (p, r), strict=True)))
    executive.choose_integrator()
    own = len(READ) + 1
    read = [*READ, model.elevator.surface, *READ_LATERAL, *(s.surface for s in surfaces.values())]
    gets = [node.get_double_value for node in executive.nodes(read)]
    ground = [node.get_double_value for node in executive.nodes(_OVER_GROUND)]
    moved = [FollowedSurface(executive, one, commands[name], wanted[name]) for name, one in surfaces.items()]
    records = [get() for get in gets]
    for step, airspeed in enumerate((track.airspeed_m_s / FT).tolist()[1:], start=1):
        for one in moved:
            one.move(step)
        north, east, sink = (get() for get in ground)
        over = math.hypot(north, east)
        share = 1.0 - math.sqrt(max(airspeed * airspeed - sink * sink, 0.0)) / over if over > 0.0 else 0.0
        gusts[0](north * share)
        gusts[1](east * share)
        if not fdm.run():
            raise FlightError(f"the model ended the replay at {fdm.get_sim_time():.3f} s")
        records.extend([get() for get in gets])
    columns = np.array(records).reshape(-1, len(gets)).T
    require_sound(columns, executive.dt_s, f"{executive.aircraft.name}, flown through measured surfaces,")
    scales = [surface.surface_rad for surface in surfaces.values()]
    (pitch,), held = LONGITUDINAL.controls, at.controls
    still = {pitch.command: held.command(pitch.name), "throttle": held.throttle}
    return (
        channels(columns[:own], at.mass_kg, model.elevator.surface_rad)
        | lateral_channels(columns[own:], at.mass_kg, scales)
        | {name: np.full(columns.shape[1], value) for name, value in still.items()}
        | {control.command: commands[control.name] for control in LATERAL.controls}
    )


__all__ = ["replay_lateral", "replayed"]
