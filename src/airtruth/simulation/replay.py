"""Replay of a measured record: the measured surfaces in JSBSim, at the measured airspeed.

Each record has the free parameters of a trace: the initial state, an offset of each surface (the moments at trim) and a bias of
each output. The other controls stay at the trim. At every step the air moves along the horizontal flight path at the difference
between the simulated speed over ground and the measured airspeed, which contains the horizontal gusts; a change of that
velocity exerts no force of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import AircraftError, FlightError
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion
from airtruth.simulation.gearing import FollowedSurface, commands_for
from airtruth.simulation.readings import READ, READ_LATERAL, channels, lateral_channels, require_sound
from airtruth.simulation.simulator import Executive
from airtruth.simulation.tracks import Track, as_logged, first_of, fitted_outputs
from airtruth.simulation.trim import Trim
from airtruth.units import FT

Array = NDArray[np.float64]

_STEPS: Final = {"vane": 2e-3, "gyro": 1e-2, "attitude": 2e-3}
"""Instrument of a state -> step of its initial value for differences [rad], [rad/s]."""
_OFFSET_STEP_RAD: Final = 5e-4
"""The same of the offset of a surface [rad]."""
_OVER_GROUND: Final = ("velocities/v-north-fps", "velocities/v-east-fps", "velocities/v-down-fps")
"""Velocity over ground."""
_GUST: Final = ("atmosphere/gust-north-fps", "atmosphere/gust-east-fps")
"""Horizontal velocity of the air."""


def replay(aircraft: Aircraft, at: Trim, track: Track) -> dict[str, Array]:
    """Replay a record and fit its free parameters.

    Parameters
    ----------
    aircraft : aircraft to fly.
    at : trim about which it starts, in six axes for the lateral-directional motion.
    track : the record.

    Returns
    -------
    Channel of ``track.outputs`` -> (samples,) as the aircraft's sensors would log it without noise, biases fitted.

    Raises
    ------
    FlightError
        If the motion leaves the range in which the simulation has a meaning, or the model ends the simulation.
    AircraftError
        If the aircraft has no JSBSim model, or the model lacks a control of the record.
    """
    executive = Executive(aircraft, track.dt_s / track.substeps)
    motion, names = _motion_of(track), list(track.outputs)
    absent = [name for name in track.controls_rad if name not in executive.model.surfaces(motion)]
    if absent:
        raise AircraftError(f"{aircraft.folder}: [jsbsim.{absent[0]}] of aircraft.toml is needed in six axes")
    start = [first_of(track, state.channel, at.controls.of(state.channel)) for state in motion.states]
    instruments = {output.channel: output.instrument for output in motion.outputs}
    steps = [*(_STEPS[instruments[s.channel]] for s in motion.states)]
    steps += len(motion.controls) * [_OFFSET_STEP_RAD]

    def fly(x: Array) -> Array:
        logged = as_logged(aircraft, _run(executive, at, track, x), track)
        return np.stack([logged[n] for n in names])

    # the surfaces about the aircraft's own trim: their offsets are free in any case
    return fitted_outputs(fly, np.array([*start, *_offsets(at, track)]), np.array(steps), track)


def flown_through(aircraft: Aircraft, at: Trim, track: Track) -> dict[str, Array]:
    """Fly a record's surfaces and airspeed from a trim, without sensors and without a fit.

    Parameters
    ----------
    aircraft : aircraft to fly.
    at : trim about which it starts; the surfaces are counted from the record's start.
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
    start = [at.controls.of(state.channel) for state in _motion_of(track).states]
    return _run(executive, at, track, np.array([*start, *_offsets(at, track)]))


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


def _motion_of(track: Track) -> Motion:
    """The motion whose controls a record has."""
    return next(m for m in MOTIONS.values() if m.controls[0].name in track.controls_rad)


def _offsets(at: Trim, track: Track) -> list[float]:
    """Surfaces of the trim less those at the start of a record [rad]."""
    head = max(1, track.substeps * 5)
    return [at.surfaces_rad[name] - float(np.mean(own[:head])) for name, own in track.controls_rad.items()]


def _run(executive: Executive, at: Trim, track: Track, free: Array) -> dict[str, Array]:
    """One simulation; channels at every step, at the CG, without sensors."""
    motion = _motion_of(track)
    count = len(motion.states)
    moved = zip(track.controls_rad.items(), free[count:].tolist(), strict=True)
    wanted = {name: own + more for (name, own), more in moved}
    commands = {name: commands_for(executive, at, name, rad) for name, rad in wanted.items()}
    executive = executive.renewed()
    fdm, surfaces = executive.fdm, executive.model.surfaces(motion)
    fdm.set_trim_status(True)  # actuators pass their input through
    fdm.reset_to_initial_conditions(2)  # time to zero; initialise() runs the initial conditions
    executive.configure()
    gusts = [node.set_double_value for node in executive.nodes(_GUST)]
    gusts[0]((at.airspeed_m_s - float(track.airspeed_m_s[0])) / FT)
    gusts[1](0.0)
    first = {name: float(command[0]) for name, command in commands.items()}
    start = dict(zip((state.channel for state in motion.states), free[:count].tolist(), strict=True))
    executive.initialise(at.condition, at.controls.moved(first, **start))
    executive.choose_integrator()
    every = executive.surfaces
    (pitch,) = LONGITUDINAL.controls
    read = [*READ, every[pitch.name].surface]
    own = len(read)
    if executive.six_axes:
        read += [*READ_LATERAL, *(every[control.name].surface for control in LATERAL.controls)]
    gets = [node.get_double_value for node in executive.nodes(read)]
    ground = [node.get_double_value for node in executive.nodes(_OVER_GROUND)]
    follow = [FollowedSurface(executive, one, commands[name], wanted[name]) for name, one in surfaces.items()]
    records = [get() for get in gets]
    for step, airspeed in enumerate((track.airspeed_m_s / FT).tolist()[1:], start=1):
        for one in follow:
            one.move(step)
        north, east, sink = (get() for get in ground)
        over = math.hypot(north, east)
        level = math.sqrt(max(airspeed * airspeed - sink * sink, 0.0))
        for gust, velocity in zip(gusts, (north, east), strict=True):
            gust(velocity - level * (velocity / over if over > 0.0 else 1.0))
        if not fdm.run():
            raise FlightError(f"the model ended the replay at {fdm.get_sim_time():.3f} s")
        records.extend([get() for get in gets])
    columns = np.array(records).reshape(-1, len(gets)).T
    require_sound(columns, executive.dt_s, f"{executive.aircraft.name}, flown through measured surfaces,")
    found = channels(columns[:own], at.mass_kg, every[pitch.name].surface_rad)
    if executive.six_axes:
        scales = [every[control.name].surface_rad for control in LATERAL.controls]
        found |= lateral_channels(columns[own:], at.mass_kg, scales)
    still = {pitch.command: at.controls.command(pitch.name), "throttle": at.controls.throttle}
    found |= {name: np.full(columns.shape[1], value) for name, value in still.items()}
    return found | {control.command: commands[control.name] for control in motion.controls}


__all__ = ["each_flown_through", "flown_through", "replay"]
