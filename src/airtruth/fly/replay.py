"""A measured record flown again: the measured surface in JSBSim, at the measured airspeed.

Free of each record are what the trace frees as well: initial angle of attack and pitch rate, an offset of the
surface (the moment at trim) and a bias of each output. The air's horizontal velocity takes up, step by step, the
difference between the airspeed that the simulation would fly and the measured one, which carries the
horizontal gusts; a change of that velocity is no force of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import FlightError
from airtruth.fly import measure
from airtruth.fly.engine import Controls, Executive
from airtruth.fly.flight import READ
from airtruth.fly.trim import Trim
from airtruth.physics import atmosphere
from airtruth.units import FT, SLUG

Array = NDArray[np.float64]

STEP_S: Final = 0.005
"""Longest step of the simulation."""
_FIT_PASSES: Final = 2
_STEPS: Final = np.array([2e-3, 1e-2, 5e-4])
"""Steps of initial alpha [rad], initial q [rad/s] and surface offset [rad] for differences."""
_MOST_ALPHA_RAD: Final = 1.5


@dataclass(frozen=True)
class Track:
    """A record as it is flown again.

    Attributes
    ----------
    dt_s : sample period [s].
    substeps : steps of the simulation per sample, see `substeps`.
    outputs : channel -> (samples,) measured, in SI; those that are compared.
    weight : channel -> standard deviation by which its residual counts.
    elevator_rad, airspeed_m_s : ((samples - 1) substeps + 1,) on the simulation's grid; true values, what
        their sensors do taken out.
    """

    dt_s: float
    substeps: int
    outputs: Mapping[str, Array]
    weight: Mapping[str, float]
    elevator_rad: Array
    airspeed_m_s: Array


def substeps(dt_s: float) -> int:
    """Steps of the simulation per sample of the log."""
    return max(1, math.ceil(dt_s / STEP_S - 1e-9))


def replay(aircraft: Aircraft, at: Trim, track: Track) -> dict[str, Array]:
    """Fly a record again and fit what is free of it.

    Parameters
    ----------
    aircraft, at : what flies, and the trim about which it starts.
    track : the record.

    Returns
    -------
    Channel of ``track.outputs`` -> (samples,) as the aircraft's sensors would log it without noise, biases
    fitted.

    Raises
    ------
    FlightError
        If the motion leaves the range in which the simulation means anything.
    AircraftError
        If the aircraft has no JSBSim model.
    """
    executive = Executive(aircraft, track.dt_s / track.substeps)
    names = list(track.outputs)
    free = np.array([_first(track, "alpha_rad", at.alpha_rad), _first(track, "q_rad_s", 0.0), 0.0])
    # the surface about the aircraft's own trim: the offset is free in any case
    free[2] = at.elevator_rad - float(np.mean(track.elevator_rad[: max(1, track.substeps * 5)]))

    def fly(x: Array) -> Array:
        logged = _logged(aircraft, _run(executive, at, track, x), track)
        return np.stack([logged[n] for n in names])

    weight = np.array([[track.weight[n]] for n in names])
    measured = np.stack([track.outputs[n] for n in names])
    flown = fly(free)
    tangents = np.stack([(fly(free + np.eye(3)[i] * _STEPS[i]) - flown) / _STEPS[i] for i in range(3)])
    best = _residual(measured, flown, weight)
    for _ in range(_FIT_PASSES):
        centred = (tangents - tangents.mean(axis=2, keepdims=True)) / weight
        step = np.linalg.lstsq(centred.reshape(3, -1).T, best.ravel(), rcond=None)[0]
        trial = fly(free + step)
        after = _residual(measured, trial, weight)
        if not float((after**2).sum()) < float((best**2).sum()):
            break
        free, flown, best = free + step, trial, after
    fitted = flown + (measured - flown).mean(axis=1, keepdims=True)
    return dict(zip(names, fitted, strict=True))


def _residual(measured: Array, flown: Array, weight: Array) -> Array:
    difference = (measured - flown) / weight
    return np.asarray(difference - difference.mean(axis=1, keepdims=True))


def _first(track: Track, channel: str, otherwise: float) -> float:
    return float(np.mean(track.outputs[channel][:5])) if channel in track.outputs else otherwise


def _logged(aircraft: Aircraft, truth: Mapping[str, Array], track: Track) -> dict[str, Array]:
    rows = {name: values[None, :] for name, values in truth.items()}
    sensors = {name: s for name, s in aircraft.file.sensors.items() if name in track.outputs}
    logged = measure.log_channels(rows, sensors, {}, track.dt_s / track.substeps, track.substeps)
    return {name: values[0] for name, values in logged.items()}


def _run(executive: Executive, at: Trim, track: Track, free: Array) -> dict[str, Array]:
    """One simulation; channels at every step, at the CG, without sensors."""
    executive = executive.renewed()
    fdm, elevator = executive.fdm, executive.model.elevator
    offset = at.controls.elevator_command_rad - at.elevator_rad
    command = track.elevator_rad + free[2] + offset
    fdm.set_trim_status(True)  # actuators pass their input through
    fdm.reset_to_initial_conditions(2)  # time to zero; initialise() runs the initial conditions
    executive.configure()
    gust = executive.node("atmosphere/gust-north-fps")
    gust.set_double_value((at.airspeed_m_s - float(track.airspeed_m_s[0])) / FT)
    executive.initialise(
        at.condition, float(free[0]), Controls(float(command[0]), at.controls.throttle), float(free[1])
    )
    executive.choose_integrator()
    gets = [node.get_double_value for node in executive.nodes([*READ, elevator.surface])]
    over_ground = executive.nodes(["velocities/v-north-fps", "velocities/v-down-fps"])
    columns = _stepped(
        fdm,
        gets,
        [node.get_double_value for node in over_ground],
        (executive.node(elevator.command).set_double_value, gust.set_double_value),
        (command * elevator.command_per_rad, track.airspeed_m_s / FT),
    )
    v, alpha, theta, q, fx, fz, q_dot, height, density, surface = columns
    with np.errstate(over="ignore", invalid="ignore"):
        sound = np.isfinite(columns).all(axis=0) & (v > 0.0) & (np.abs(alpha) < _MOST_ALPHA_RAD)
    if not sound.all():
        first = int(np.flatnonzero(~sound)[0])
        raise FlightError(
            f"{executive.aircraft.name}, flown through a measured surface, left the simulation's range at "
            f"{first * executive.dt_s:.3f} s"
        )
    return {
        "airspeed_m_s": v * FT,
        "alpha_rad": alpha,
        "theta_rad": theta,
        "q_rad_s": q,
        "ax_m_s2": fx * (SLUG * FT / at.mass_kg),
        "az_m_s2": fz * (SLUG * FT / at.mass_kg),
        "q_dot_rad_s2": q_dot,
        "elevator_rad": surface * elevator.surface_rad,
        "elevator_command_rad": command,
        "throttle": np.full(len(v), at.controls.throttle),
        "altitude_m": atmosphere.geopotential_m(height * FT),
        "density_kg_m3": density * (SLUG / FT**3),
    }


def _stepped(
    fdm: Any,
    gets: Sequence[Any],
    over_ground: Sequence[Any],
    setters: tuple[Any, Any],
    series: tuple[Array, Array],
) -> Array:
    """What ``gets`` say at every step; setters and series: of the command, and of the air from the airspeed."""
    north, down = over_ground
    set_command, set_gust = setters
    records = [get() for get in gets]
    for command, airspeed in zip(series[0][1:].tolist(), series[1][1:].tolist(), strict=True):
        set_command(command)
        sink = down()
        set_gust(north() - math.sqrt(max(airspeed * airspeed - sink * sink, 0.0)))
        fdm.run()
        records.extend([get() for get in gets])
    return np.array(records).reshape(-1, len(gets)).T


__all__ = ["STEP_S", "Track", "replay", "substeps"]
