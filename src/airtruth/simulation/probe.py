"""The aircraft's forces and moment as tables, from JSBSim's response in every state of a grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import AircraftError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.simulator import Condition, Controls, Executive, SimulatorResponse
from airtruth.simulation.trim import Trim
from airtruth.units import DEG, G0, LBF

Array = NDArray[np.float64]

AXES: Final = (LONGITUDINAL.vane, *LONGITUDINAL.surfaces, *LONGITUDINAL.gyros)
"""Channels of the axes of the tables."""
FORCES: Final = ("forces/fbx-total-lbs", "forces/fbz-total-lbs", "accelerations/qdot-rad_sec2")
"""Properties behind the values of the tables."""
_FILTERS_S: Final = 0.25
"""Time for the filters of a model in each state, where engines have to run [s] (judgement: several lags of a servo)."""
_POWER_S: Final = 10.0
"""Time in which an engine regains the power that initial conditions take from it [s] (judgement: pc7 is within 4e-4 of its
thrust)."""
_SAME_RESPONSE: Final = 1e-3
"""Change of an acceleration at the trim from which an engine has lost power [m/s2], [rad/s2] (judgement: 1e-4 g)."""
_HOLDS: Final = 12
"""Largest number of commands that hold a surface against augmentation [-] (judgement: each reduces the error tenfold)."""
_SAME_SURFACE_RAD: Final = 1e-6
"""Largest difference of the surface at one command that counts as rounding [rad]."""

_BREAK: Final = 1e-3
"""Error of a cell's line at its middle, over the range of the force, from which the cell is divided [-] (judgement: 1e-3
of the lift of a flight test is a fifth of the noise of a good accelerometer)."""
_NEAR: Final = 0.02
"""Distance from the end of a cell at which its slope there is taken, over its width [-] (judgement: nearer than most
breaks, far above rounding)."""
_DIVISIONS: Final = 3
"""Number of times that the cells of an axis are searched for breaks [-] (judgement: a degree with three breaks is rare)."""

_DIVE_RAD: Final = 60.0 * DEG
"""Flight-path angle below that of the trim at which a term in alpha_dot shows [rad]; judgement: half of the weight's lift."""


@dataclass(frozen=True)
class ForceGrid:
    """States to evaluate; the trim's own value is added to each axis.

    Attributes
    ----------
    axes : (points,) of each of `AXES`, the command in place of the surface [rad], [rad/s].
    airspeed : true airspeed over that of the trim (points,) [-].
    """

    axes: tuple[Array, ...]
    airspeed: Array


@dataclass(frozen=True)
class ForceTables:
    """X, Z, M over four increasing axes; linear between points, constant outside.

    Attributes
    ----------
    airspeed_m_s : (nv,) [m/s].
    axes : (points,) of each of `AXES` [rad], [rad/s]; at least two points each.
    values : (nv, points of each axis, 3) forces X, Z along body x, z [N], moment M about the CG [N m].
    """

    airspeed_m_s: Array
    axes: tuple[Array, ...]
    values: Array


def grid_about(
    trim: Trim, reach: tuple[float, float, float] = (10.0 * DEG, 6.0 * DEG, 60.0 * DEG)
) -> ForceGrid:
    """Return whole degrees of angle of attack and command near the trim, and pitch rates 12 deg/s apart.

    Whole degrees put points on the breaks of tables that are stated in degrees; the rate has one at zero.
    Airspeed has 95, 100 and 105 % of the trim's.

    Parameters
    ----------
    reach : of each axis to both sides of the trim [rad], [rad/s].
    """

    def whole(centre: float, reach: float, step: float) -> Array:
        first, last = np.ceil((centre - reach) / step), np.floor((centre + reach) / step)
        return np.arange(first, last + 1.0) * step

    axes = zip(_centres(trim), reach, (DEG, DEG, 12.0 * DEG), strict=True)
    return ForceGrid(tuple(whole(*axis) for axis in axes), np.array([0.95, 1.0, 1.05]))


def _centres(trim: Trim) -> tuple[float, ...]:
    """Values of a trim on the axes of its tables, the command in place of the surface."""
    commanded = {c.channel: trim.controls.command(c.name) for c in LONGITUDINAL.controls}
    return tuple(commanded.get(channel, trim.controls.of(channel)) for channel in AXES)


def probe(
    aircraft: Aircraft, trim: Trim, grid: ForceGrid | None = None, dt_s: float = 1.0 / 200.0
) -> ForceTables:
    """Tabulate X, Z, M of the aircraft at the trim's throttle and altitude, engines settled.

    Terms in alpha_dot, if a model has them, are those of the state itself, as in `airtruth.simulation.linearise`.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.
    grid : states to evaluate; None for `grid_about` the trim.
    dt_s : simulation step of the executive [s].

    Raises
    ------
    AircraftError
        If the surface does not rise with its command, or moves with alpha, q or airspeed.
    """
    grid = grid or grid_about(trim)
    executive = Executive(aircraft, dt_s)
    own = [with_point(axis, centre) for axis, centre in zip(grid.axes, _centres(trim), strict=True)]
    axes = [with_point(grid.airspeed, 1.0) * trim.airspeed_m_s, *own]
    states, (control,) = HeldStates(executive, trim), LONGITUDINAL.controls
    values = np.empty((*(axis.size for axis in axes), len(FORCES)))
    surface = np.empty(values.shape[:-1])
    # commands innermost: they cost the least
    for i, j, n, k in product(*(range(axes[a].size) for a in (0, 1, 3, 2))):
        at = (i, j, k, n)
        v, *state = (float(axis[m]) for axis, m in zip(axes, at, strict=True))
        condition = replace(trim.condition, eas_m_s=trim.condition.eas_m_s * v / trim.airspeed_m_s)
        motion = dict(zip(AXES, state, strict=True))
        controls = trim.controls.moved({control.name: motion.pop(control.channel)}, **motion)
        answer = states.respond(condition, controls)
        surface[at] = answer.surfaces_rad[control.name]
        values[at] = _forces(executive, answer)
    return ForceTables(axes[0], (own[0], _surface(aircraft, surface), own[2]), values)


def with_breaks(aircraft: Aircraft, trim: Trim, grid: ForceGrid, dt_s: float = 1.0 / 200.0) -> ForceGrid:
    """Add the angles at which Z and M break between two angles of attack of a grid.

    X turns the flight path by the sine of the angle of attack alone, and its breaks are left out. The elevator is that of the
    trim and the aircraft does not pitch: the breaks of the other states are taken to be the same.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.
    grid : states to evaluate.
    dt_s : simulation step of the executive [s].
    """
    executive = Executive(aircraft, dt_s)
    force = executive.node(FORCES[1])
    states = HeldStates(executive, trim)

    def at(value: float) -> Array:
        answer = states.respond(trim.condition, trim.controls.moved({}, **{AXES[0]: value}))
        return np.array([force.get_double_value(), answer.q_dot_rad_s2])

    first, *others = grid.axes
    return replace(grid, axes=(with_breaks_of(at, first), *others))


def with_breaks_of(function: Callable[[float], Array], points: Array) -> Array:
    """Points of an axis between which a function is nearly linear, those given and the breaks between them.

    Where a cell is not linear, the lines at its two ends meet at its break. A curve, or several breaks, divide the cell
    instead at its middle.

    Parameters
    ----------
    function : (values,) at a point; points : (points,) increasing.
    """
    values = {float(x): function(float(x)) for x in points}
    scale = np.ptp(np.array(list(values.values())), axis=0)
    scale[scale == 0.0] = np.inf
    cells = list(pairwise(sorted(values)))
    for _ in range(_DIVISIONS):
        divided = []
        for low, high in cells:
            off = np.abs(function(0.5 * (low + high)) - 0.5 * (values[low] + values[high])) / scale
            if off.max() > _BREAK:
                x = _meeting(function, low, high, values, int(np.argmax(off)))
                values[x] = function(x)
                divided += [(low, x), (x, high)]
        cells = divided
    return np.array(sorted(values))


def _meeting(
    function: Callable[[float], Array], low: float, high: float, values: dict[float, Array], component: int
) -> float:
    """Where the lines at the ends of a cell meet; its middle where they meet outside."""
    near = _NEAR * (high - low)
    left, right = values[low][component], values[high][component]
    rise = (function(low + near)[component] - left) / near
    fall = (right - function(high - near)[component]) / near
    if rise == fall:
        return 0.5 * (low + high)
    x = float((right - left + rise * low - fall * high) / (rise - fall))
    return x if low + near < x < high - near else 0.5 * (low + high)


def forces_at_speeds(aircraft: Aircraft, trim: Trim, ratios: Array, dt_s: float = 1.0 / 200.0) -> Array:
    """Forces and moment of the aircraft at the attitude and controls of a trim, at other airspeeds.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.
    ratios : airspeed over that of the trim (points,) [-].
    dt_s : simulation step of the executive [s].

    Returns
    -------
    (points, 4) X, Z [N] and M [N m] of the aircraft, and X without that of the air [N].
    """
    executive = Executive(aircraft, dt_s)
    rows = []
    for ratio in ratios:
        condition = replace(trim.condition, eas_m_s=trim.condition.eas_m_s * float(ratio))
        executive = executive.again()
        air = executive.node("forces/fbx-aero-lbs")
        executive.initialise(condition, trim.controls)
        total = _forces(executive, executive.respond())
        rows.append([*total, total[0] - air.get_double_value() * LBF])
    return np.array(rows)


def alpha_dot_terms(aircraft: Aircraft, trim: Trim) -> Array:
    """CL and Cm per alpha_dot c/(2V) of the JSBSim model.

    In a dive at the attitude of the air of the trim, alpha_dot is g (cos(gamma) - cos(gamma of the trim))/V larger, and
    nothing else that the air feels differs.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.

    Returns
    -------
    (2,) [-].
    """
    level = trim.condition.gamma_rad
    dive = replace(trim, condition=replace(trim.condition, gamma_rad=level - _DIVE_RAD))
    change = np.subtract(*(forces_at_speeds(aircraft, at, np.ones(1))[0] for at in (dive, trim)))
    c, v = aircraft.constants, trim.airspeed_m_s
    rate = G0 * (np.cos(level - _DIVE_RAD) - np.cos(level)) / v * 0.5 * c.chord_m / v
    force = 0.5 * trim.density_kg_m3 * v**2 * c.wing_area_m2
    terms: Array = np.array([-change[1], change[2] / c.chord_m]) / (force * rate)
    return terms


def forces_over_alpha(
    aircraft: Aircraft, trim: Trim, alpha_rad: Array, ratios: Array, dt_s: float = 1.0 / 200.0
) -> Array:
    """Forces and moment at the controls of a trim over the angle of attack, at several airspeeds.

    Engines that run keep the speed of the trim, as they do for a moment in a flight.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.
    alpha_rad : (alpha,) [rad]; ratios : airspeed over that of the trim (points,) [-].
    dt_s : simulation step of the executive [s].

    Returns
    -------
    (points, alpha, 3) X, Z [N] and M [N m] of the aircraft.
    """
    executive = Executive(aircraft, dt_s)
    states = HeldStates(executive, trim)
    values = np.empty((ratios.size, alpha_rad.size, len(FORCES)))
    for i, j in np.ndindex(values.shape[:2]):
        condition = replace(trim.condition, eas_m_s=trim.condition.eas_m_s * float(ratios[i]))
        controls = trim.controls.moved({}, **{AXES[0]: float(alpha_rad[j])})
        values[i, j] = _forces(executive, states.respond(condition, controls))
    return values


def _forces(executive: Executive, answer: SimulatorResponse) -> list[float]:
    """X, Z [N] and M [N m] about the CG in the present state."""
    x, z = (node.get_double_value() * LBF for node in executive.nodes(FORCES[:2]))
    return [x, z, answer.q_dot_rad_s2 * executive.aircraft.constants.inertia_yy_kg_m2]


class HeldStates:
    """States of the grid, one after the other in one executive.

    Engines that run until they are steady keep the speed of the trim, because they cannot follow the motion of a flight
    test; the filters of the model have time to settle. A turboprop loses its power where initial conditions are set: it runs
    in each state of motion until it has regained that power. Where augmentation moves the surface, the command follows until
    the surface is where the same command puts it at the trim.
    """

    def __init__(self, executive: Executive, trim: Trim) -> None:
        self.executive, self.trim = executive, trim
        self.holds = executive.model.elevator.feedback
        self.loses_power = False
        if executive.model.engine_start_s > 0.0:
            executive.initialise(trim.condition, trim.controls)
            steady = executive.respond()
            executive.initialise(trim.condition, trim.controls, engines_s=_FILTERS_S)
            self.loses_power = executive.respond().differs(steady) > _SAME_RESPONSE
        self.motion: tuple[object, ...] | None = None

    def respond(self, condition: Condition, controls: Controls) -> SimulatorResponse:
        """Response in a state of the grid."""
        if not self.holds:
            return self._settled(condition, controls)
        at, name = self.trim, ELEVATOR
        wanted = {name: at.surfaces_rad[name] + controls.command(name) - at.controls.command(name)}
        return with_surfaces(lambda moved: self._settled(condition, moved), controls, wanted)

    def _settled(self, condition: Condition, controls: Controls) -> SimulatorResponse:
        motion = (condition, controls.motion)
        if self.loses_power and motion == self.motion:
            self.executive.change_controls(controls, _FILTERS_S)
        else:
            settling_s = _POWER_S if self.loses_power else _FILTERS_S
            self.executive.initialise(condition, controls, settling_s)
        self.motion = motion
        return self.executive.respond()


def with_surfaces(
    respond: Callable[[Controls], SimulatorResponse], controls: Controls, wanted: Mapping[str, float]
) -> SimulatorResponse:
    """Response with surfaces where they are wanted, or at the end of their range, whatever augmentation adds.

    Parameters
    ----------
    respond : response to controls; controls : where the search begins; wanted : control -> surface [rad].
    """
    for _ in range(_HOLDS):
        answer = respond(controls)
        errors = {name: angle - answer.surfaces_rad[name] for name, angle in wanted.items()}
        if all(abs(error) < _SAME_SURFACE_RAD for error in errors.values()):
            break
        controls = controls.moved({name: controls.command(name) + e for name, e in errors.items()})
    return answer


def with_point(axis: Array, value: float) -> Array:
    """The axis and one value more, unless a point is there already."""
    kept = axis[np.abs(axis - value) > 1e-9 * (1.0 + abs(value))]
    return np.sort(np.append(kept, value))


def _surface(aircraft: Aircraft, surface: Array) -> Array:
    """Surface of each command, where it depends on nothing else."""
    axis = surface[0, 0, :, 0]
    spread = np.abs(surface - axis[:, None])
    if spread.max() > _SAME_SURFACE_RAD:
        raise AircraftError(
            f"{aircraft.name}: the elevator moves by up to {spread.max() / DEG:.3g} deg with alpha, q or airspeed at a "
            "held command; switch its feedback off (jsbsim.set in aircraft.toml) or probe a smaller range"
        )
    if not np.all(np.diff(axis) > 0.0):
        raise AircraftError(
            f"{aircraft.name}: the elevator surface does not rise with its command between {axis[0] / DEG:.3g} and "
            f"{axis[-1] / DEG:.3g} deg; stay within its limits, or check jsbsim.elevator in aircraft.toml"
        )
    return np.ascontiguousarray(axis)
