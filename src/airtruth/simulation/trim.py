"""Steady flight at a stated airspeed, altitude and flight-path angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import BANK
from airtruth.errors import TrimError
from airtruth.physics.motion import LATERAL, LONGITUDINAL, MOTIONS, Motion
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.manoeuvres import LATERAL_CONTROLS
from airtruth.simulation.simulator import Condition, Controls, Executive, SimulatorResponse
from airtruth.units import DEG, FT, KT

Array = NDArray[np.float64]

TOLERANCE: Final = 1e-6
"""Largest residual of a trim, in u_dot, w_dot [m/s2] and q_dot [rad/s2] (judgement: a drift of 1 um/s in a second).

The iteration continues to `_AIM`; a model with a piston engine or with rounded tables ends earlier.
"""
_AIM: Final = 1e-11
"""Residual at which the iteration ends [m/s2], [rad/s2] (judgement: near the rounding of JSBSim's accelerations)."""
_START: Final = ((4.0, 0.0, 0.4), (8.0, 0.0, 0.7), (1.0, 0.0, 0.2), (12.0, 0.0, 0.6))
"""Starts, tried in turn: angle of attack [deg], elevator command [rad], throttle [-] (judgement)."""
_STEPS: Final = np.array([1e-5, 1e-5, 1e-4, 1e-4, 1e-4, 1e-5])
"""Steps of the differences in angle of attack [rad], elevator command [rad], throttle [-], aileron and rudder [-], in six axes
[rad], and bank or sideslip [rad]."""
_LARGEST_STEP: Final = np.array([4.0 * DEG, 0.2, 0.15, 0.3, 0.3, 5.0 * DEG])
"""Largest Newton step, same order (judgement: the thrust of an engine is flat near full throttle)."""
_ITERATIONS: Final = 40
"""Largest number of Newton steps from one start."""
_LIMITS: Final = (
    np.array([-20.0 * DEG, -1.2, 0.0, -1.0, -1.0, -15.0 * DEG]),
    np.array([40.0 * DEG, 1.2, 1.0, 1.0, 1.0, 15.0 * DEG]),
)
"""Range, same order (judgement: beyond any trim)."""
_GLIDE: Final = (2, 1e-5, 5.0 * DEG, -30.0 * DEG, 5.0 * DEG, -4.0 * DEG)
"""Without a throttle: its place is taken by the flight-path angle, with this step, largest step, range and start [rad]
(judgement)."""
_CHORD: Final = 0.2
"""Reduction of the residual by a step below which a lateral trim or a glide keeps its Jacobian [-] (judgement: a state
whose engines have to become steady is costly)."""
_STALL: Final = 0.9
"""Reduction of the residual by a step above which such a trim does not get on [-] (judgement)."""
_PATIENCE: Final = 3
"""Number of such steps after which it ends [-] (judgement)."""
_PITCH: Final = 3
"""Number of unknowns in the pitch plane, which come first."""
_NAMES: Final = ("angle of attack", f"{ELEVATOR} command", "throttle", *LATERAL_CONTROLS, "bank")
"""Names of the unknowns."""


@dataclass(frozen=True)
class Trim:
    """An equilibrium of the aircraft in JSBSim.

    Attributes
    ----------
    condition : requested flight condition.
    surfaces_rad : control -> surface [rad], of the controls that fly.
    controls : commands, throttle and motion.
    airspeed_m_s, density_kg_m3, mass_kg : true airspeed [m/s], air density [kg/m3], mass [kg].
    residual : largest of |u_dot|, |w_dot| [m/s2] and |q_dot| [rad/s2], with lateral properties or in six axes also of
        |v_dot|, |p_dot| and |r_dot|.
    """

    condition: Condition
    surfaces_rad: Mapping[str, float]
    controls: Controls
    airspeed_m_s: float
    density_kg_m3: float
    mass_kg: float
    residual: float

    @property
    def alpha_rad(self) -> float:
        """Angle of attack [rad]."""
        return self.controls.of(LONGITUDINAL.vane)

    def of(self, channel: str) -> float:
        """Value of a surface, a flow angle, the bank or an angular rate at the equilibrium [rad], [rad/s]."""
        controls = (control for motion in MOTIONS.values() for control in motion.controls)
        surface = next((self.surfaces_rad.get(c.name) for c in controls if c.channel == channel), None)
        return self.controls.of(channel) if surface is None else surface

    def origin(self, motion: Motion) -> Array:
        """(signals,) values of the signals of a motion at the equilibrium, the rates per second [rad], [rad/s]."""
        return np.array([self.of(signal.channel) for signal in motion.signals])

    @property
    def elevator_rad(self) -> float:
        """Surface of the pitch plane [rad]."""
        return self.surfaces_rad[ELEVATOR]


class _Problem:
    """Unknowns, their ranges and the residual of one trim."""

    def __init__(
        self, aircraft: Aircraft, condition: Condition, dt_s: float, throttle: float | None = None
    ) -> None:
        self.executive = Executive(aircraft, dt_s)
        self.condition = condition
        model = self.executive.model
        self.throttle = throttle if model.throttle.command else 0.0
        self.glides = self.throttle is not None
        self.count = 6 if condition.six_axes or model.lateral is not None else _PITCH
        if condition.six_axes and len(model.surfaces(LATERAL)) < len(LATERAL_CONTROLS):
            needed = " and ".join(f"jsbsim.{name}" for name in LATERAL_CONTROLS)
            raise TrimError(
                f"{aircraft.name} has no lateral controls: a trim in six axes needs {needed} in aircraft.toml"
            )
        self.thrifty = self.glides or model.engine_start_s > 0.0 or self.count == 6
        self.names = list(_NAMES[: self.count])
        if condition.straight == "wings-level":
            self.names[5] = "sideslip"
        self.steps, self.largest = _STEPS[: self.count].copy(), _LARGEST_STEP[: self.count].copy()
        self.low, self.high = _LIMITS[0][: self.count].copy(), _LIMITS[1][: self.count].copy()
        if self.glides:
            i, self.steps[2], self.largest[2], self.low[2], self.high[2], _ = _GLIDE
            self.names[i] = "flight path"

    @property
    def free(self) -> str:
        """Channel of the angle that holds the aircraft straight in six axes."""
        return LATERAL.vane if self.condition.straight == "wings-level" else BANK

    def start(self, alpha_deg: float, command_rad: float, throttle: float) -> Array:
        """(unknowns,) of a start."""
        x = np.zeros(self.count)
        x[:_PITCH] = alpha_deg * DEG, command_rad, _GLIDE[-1] if self.glides else throttle
        return x

    def controls(self, x: Array) -> Controls:
        """Controls of a vector of unknowns."""
        throttle = float(x[2]) if self.throttle is None else self.throttle
        commands = {ELEVATOR: float(x[1])}
        lateral = dict(zip(LATERAL_CONTROLS, map(float, x[_PITCH:5]), strict=False))
        motion = dict(zip((LONGITUDINAL.vane, self.free), (float(x[0]), *map(float, x[5:])), strict=False))
        if self.condition.six_axes:
            return Controls(throttle, commands | lateral, motion=motion)
        return Controls(throttle, commands, lateral, motion)

    def path(self, x: Array) -> Condition:
        """Condition of a vector of unknowns."""
        return replace(self.condition, gamma_rad=float(x[2])) if self.glides else self.condition

    def respond(self, x: Array) -> SimulatorResponse:
        """Response in the state of a vector of unknowns."""
        self.executive = self.executive.again()
        self.executive.initialise(self.path(x), self.controls(x))
        return self.executive.respond()

    def residual(self, x: Array) -> Array:
        """(unknowns,) accelerations [m/s2], [rad/s2]."""
        return self.accelerations(self.respond(x))

    def accelerations(self, r: SimulatorResponse) -> Array:
        """(unknowns,) of a response."""
        every = (r.u_dot_m_s2, r.w_dot_m_s2, r.q_dot_rad_s2, r.v_dot_m_s2, r.p_dot_rad_s2, r.r_dot_rad_s2)
        return np.array(every[: self.count])


def trim(
    aircraft: Aircraft,
    condition: Condition,
    dt_s: float = 1.0 / 200.0,
    tolerance: float = TOLERANCE,
    near: Trim | None = None,
    throttle: float | None = None,
) -> Trim:
    """Solve u_dot = w_dot = q_dot = 0 for angle of attack, elevator and throttle by Newton's method.

    An aircraft with lateral properties is held straight as well: v_dot = p_dot = r_dot = 0 by aileron, rudder and bank,
    without sideslip. In six axes, sideslip takes the place of bank where the condition has the wings level. Where the throttle is
    given, and for an aircraft without one, which glides, the flight-path angle takes its place.

    Parameters
    ----------
    aircraft : aircraft with a JSBSim model.
    condition : flight condition; its flight-path angle is a result if the aircraft glides.
    dt_s : simulation step of the executive [s].
    tolerance : largest residual of a trim [m/s2], [rad/s2].
    near : trim to start from, instead of the usual starts.
    throttle : lever that is held [0..1]; None for one that is a result.

    Raises
    ------
    TrimError
        If no start leads to a residual below the tolerance; the message has the residual and the limit reached. In six axes,
        also if the aircraft has no aileron or no rudder.
    """
    problem = _Problem(aircraft, condition, dt_s, throttle)
    best: tuple[float, Array] | None = None
    for x in _near(problem, near) or [problem.start(*start) for start in _START]:
        x, size = _newton(problem, x)
        if best is None or size < best[0]:
            best = (size, x)
        if size <= tolerance:
            break
    assert best is not None
    size, x = best
    if not size <= tolerance:
        raise TrimError(_explain(problem, x, size, tolerance))
    return _result(problem, x)


def _near(problem: _Problem, trim: Trim | None) -> list[Array]:
    """The unknowns of another trim, if there is one."""
    if trim is None:
        return []
    c = trim.controls
    third = trim.condition.gamma_rad if problem.glides else c.throttle
    lateral = c.commands_rad if problem.condition.six_axes else c.held
    moved = [lateral.get(name, 0.0) for name in LATERAL_CONTROLS]
    every = [trim.alpha_rad, c.command(ELEVATOR), third, *moved, c.of(problem.free)]
    return [np.array(every[: problem.count])]


def _newton(problem: _Problem, x: Array) -> tuple[Array, float]:
    """Newton with one-sided differences and step halving; piecewise-linear tables may need the halving."""
    low, high = problem.low, problem.high
    r = problem.residual(x)
    jacobian: Array | None = None
    stalled = 0
    for _ in range(_ITERATIONS):
        if not np.all(np.isfinite(r)) or np.max(np.abs(r)) <= _AIM or stalled >= _PATIENCE:
            break
        fresh = jacobian is None
        if jacobian is None:
            jacobian = _jacobian(problem, x, r)
        if not np.all(np.isfinite(jacobian)):
            break
        change = np.linalg.lstsq(jacobian, -r, rcond=1e-12)[0]
        change /= max(1.0, float(np.max(np.abs(change) / problem.largest)))
        for _ in range(8):
            tried = np.clip(x + change, low, high)
            r_tried = problem.residual(tried)
            if np.max(np.abs(r_tried)) < np.max(np.abs(r)):
                break
            change = change / 2.0
        else:
            if fresh:
                break
            jacobian = None
            continue
        ratio = float(np.max(np.abs(r_tried)) / np.max(np.abs(r)))
        if not (problem.thrifty and ratio < _CHORD):
            jacobian = None
        if problem.thrifty:
            stalled = stalled + 1 if ratio > _STALL else 0
        x, r = tried, r_tried
    return x, float(np.max(np.abs(r)))


def _jacobian(problem: _Problem, x: Array, r: Array) -> Array:
    """(unknowns, unknowns) one-sided differences of the residual."""
    steps = np.where(x + problem.steps > problem.high, -problem.steps, problem.steps)
    columns = [(problem.residual(x + h) - r) / s for h, s in zip(np.diag(steps), steps, strict=True)]
    return np.column_stack(columns)


def _result(problem: _Problem, x: Array) -> Trim:
    at = problem.respond(x)
    airspeed, density, mass = problem.executive.surroundings()
    return Trim(
        condition=problem.path(x),
        surfaces_rad=at.surfaces_rad,
        controls=problem.controls(x),
        airspeed_m_s=airspeed,
        density_kg_m3=density,
        mass_kg=mass,
        residual=float(np.max(np.abs(problem.accelerations(at)))),
    )


def _explain(problem: _Problem, x: Array, size: float, tolerance: float) -> str:
    condition, name = problem.condition, problem.executive.aircraft.name
    at = [
        n
        for n, v, lo, hi in zip(problem.names, x, problem.low, problem.high, strict=True)
        if v <= lo or v >= hi
    ]
    cause = f"; it ended at the limit of {' and '.join(at)}" if at else ""
    lever = f"flight path {x[2] / DEG:.1f} deg" if problem.glides else f"throttle {x[2]:.2f}"
    if condition.six_axes:
        lever += "".join(
            f", {n} {v / DEG:.1f} deg" for n, v in zip(problem.names[_PITCH:], x[_PITCH:], strict=True)
        )
    return (
        f"{name} cannot be trimmed at EAS {condition.eas_m_s / KT:.1f} kt, {condition.altitude_m / FT:.0f} ft, "
        f"flight path {condition.gamma_rad / DEG:.1f} deg: residual {size:.2e} (allowed {tolerance:.0e} in SI) at "
        f"alpha {x[0] / DEG:.1f} deg, elevator {x[1] / DEG:.1f} deg, {lever}{cause}. "
        "Choose another speed, altitude or flight path."
    )
