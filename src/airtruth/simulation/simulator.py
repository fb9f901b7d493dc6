"""JSBSim behind a small interface: open an executive, put it into a state, read its response.

Every flight condition has an executive of its own, whose initial conditions are written once: rewriting them drifts in
the last bits, and a result must not depend on earlier runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

import jsbsim

from airtruth.aircraft import Aircraft, JsbsimModel
from airtruth.aircraft.model import SurfaceProperties
from airtruth.aircraft.probe import load_model, model_root
from airtruth.channels import BANK
from airtruth.errors import AircraftError
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.simulation.attitude import Attitude, straight_attitude
from airtruth.simulation.quiet import no_files
from airtruth.units import FT, KT, SLUG

_AB3: Final = 4.0
"""JSBSim's number of the third-order Adams-Bashforth method."""
_INTEGRATORS: Final = tuple(
    f"simulation/integrator/{order}/{kind}"
    for order in ("rate", "position")
    for kind in ("rotational", "translational")
)
"""Properties that choose JSBSim's integrators."""
_FROZEN: Final = 0.0
"""JSBSim's number of no integration: the motion is held while engines and filters go on."""
_BLOCK_S: Final = 0.25
"""Time between two looks at the engines while they start [s] (judgement)."""
_STEADY: Final = 1e-9
"""Change of the accelerations over a block below which engines and filters are steady [m/s2], [rad/s2] (judgement: an
engine that settles with a time constant of 10 s is then 4e-8 from its steady state, less than the residual of a trim)."""
_ENGINE_ROUNDS: Final = 4
"""Steady states of the engines before a run: the thrust of a piston engine is constant after two (measured)."""
_RATES: Final = dict(
    zip(
        (*LATERAL.gyros, *LONGITUDINAL.gyros),
        ("ic/p-rad_sec", "ic/r-rad_sec", "ic/q-rad_sec"),
        strict=True,
    )
)
"""Channel of an angular rate -> its initial condition."""
STOPS: Final = (jsbsim.BaseError, RuntimeError, KeyError)
"""Exceptions that JSBSim raises on a model or a property."""
_PLANET: Final = Path(__file__).with_name("flat_planet.xml")
"""A planet that is flat and does not rotate, see docs/design.md."""


Straight = Literal["pitch-plane", "wings-level", "no-sideslip"]
"""How a straight flight is held: in the pitch plane, or in six axes with sideslip or with bank as the unknown."""


@dataclass(frozen=True)
class Condition:
    """A steady straight flight condition in calm air.

    Attributes
    ----------
    eas_m_s : equivalent airspeed [m/s].
    altitude_m : geometric altitude above sea level in the standard atmosphere [m].
    gamma_rad : flight-path angle, climb positive [rad].
    straight : in the pitch plane, or in six axes with the wings level or without sideslip.
    """

    eas_m_s: float
    altitude_m: float
    gamma_rad: float = 0.0
    straight: Straight = "pitch-plane"

    @property
    def six_axes(self) -> bool:
        """Whether the aircraft flies in six axes."""
        return self.straight != "pitch-plane"


@dataclass(frozen=True)
class Controls:
    """Commands, and the motion in which they hold the aircraft.

    Attributes
    ----------
    throttle : lever, 0 to 1 [-].
    commands_rad : control -> command [rad]; a control without an entry is at 0.
    held : lateral control -> command that holds an asymmetric aircraft straight in a longitudinal flight, -1 to 1 [-].
    motion : channel of a flow angle, of the bank or of an angular rate -> its value [rad], [rad/s]; one without an entry is 0.
    """

    throttle: float
    commands_rad: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    motion: Mapping[str, float] = field(default_factory=dict)

    def command(self, control: str) -> float:
        """Command of a control [rad]."""
        return self.commands_rad.get(control, 0.0)

    def of(self, channel: str) -> float:
        """Value of a channel of the motion [rad], [rad/s]."""
        return self.motion.get(channel, 0.0)

    def moved(self, commands_rad: Mapping[str, float], **motion: float) -> Controls:
        """The controls with other commands, and in another motion."""
        return replace(
            self, commands_rad={**self.commands_rad, **commands_rad}, motion={**self.motion, **motion}
        )

    def attitude(self, gamma_rad: float) -> Attitude:
        """Attitude of the straight flight along a path [rad]."""
        return straight_attitude(self.of(LONGITUDINAL.vane), self.of(LATERAL.vane), self.of(BANK), gamma_rad)


@dataclass(frozen=True)
class SimulatorResponse:
    """Accelerations in body axes [m/s2], [rad/s2], and the control surfaces that fly, by control [rad], in one state."""

    u_dot_m_s2: float
    w_dot_m_s2: float
    q_dot_rad_s2: float
    v_dot_m_s2: float
    p_dot_rad_s2: float
    r_dot_rad_s2: float
    surfaces_rad: Mapping[str, float]

    def differs(self, other: SimulatorResponse) -> float:
        """Largest difference to another response [m/s2], [rad/s2], [rad]; infinite where one is not finite."""
        values = ((*astuple(r)[:-1], *r.surfaces_rad.values()) for r in (self, other))
        pairs = zip(*values, strict=True)
        return max(d if math.isfinite(d) else math.inf for d in (abs(a - b) for a, b in pairs))


class Executive:
    """One JSBSim executive with one aircraft; it has no state beyond JSBSim's own.

    Parameters
    ----------
    aircraft : an aircraft of `airtruth.aircraft.load`, which has loaded the model in a child process before.
    dt_s : simulation step [s].

    Raises
    ------
    AircraftError
        If the aircraft has no JSBSim model or JSBSim refuses it.
    """

    def __init__(self, aircraft: Aircraft, dt_s: float) -> None:
        self.aircraft = aircraft
        self.model = jsbsim_model(aircraft)
        self.dt_s = dt_s
        self.six_axes = False
        self.fdm = jsbsim.FGFDMExec(str(model_root(aircraft.folder, self.model.root)[0]))
        self.fdm.set_debug_level(0)
        self.fdm.load_planet(str(_PLANET), False)
        self.fdm.set_dt(dt_s)
        for name, value in self.model.declare.items():
            self.fdm[name] = value
        if not load_model(self.fdm, aircraft.folder, self.model.root, self.model.model):
            raise AircraftError(f"{aircraft.folder}: JSBSim refused the model {self.model.model!r}")
        no_files(self.fdm)
        self._manager = self.fdm.get_property_manager()
        self._propulsion = self.fdm.get_propulsion()
        self._has_engines = self._propulsion.get_num_engines() > 0
        self.unsteadiness = (
            0.0  # change of the accelerations in the last block of the last state [m/s2], [rad/s2]
        )
        self.choose_integrator()
        self.configure()

    def choose_integrator(self) -> None:
        """Third-order Adams-Bashforth throughout; a reset restores Euler."""
        for name in _INTEGRATORS:
            self.fdm[name] = _AB3

    def configure(self) -> None:
        """Write the properties that aircraft.toml sets (engines running, gear up), and that of the six axes."""
        for name, value in self.model.set.items():
            self.fdm[name] = value
        self._choose_axes()

    def _choose_axes(self) -> None:
        if self.model.six_axes is not None:
            self.fdm[self.model.six_axes] = float(self.six_axes)

    def renewed(self) -> Executive:
        """Return an executive in which nothing has run: itself, or a new one if it has engines, which keep their state."""
        return Executive(self.aircraft, self.dt_s) if self._has_engines else self

    def again(self) -> Executive:
        """Return an executive for a further steady state: this one if its engines run until they are steady.

        A steady state depends on earlier ones by less than the residual of a trim; a flight starts from a renewed one.
        """
        return self if self.model.engine_start_s > 0.0 else self.renewed()

    def node(self, name: str) -> Any:
        """Return a property's node; unlike JSBSim's own setters it never creates a property.

        Raises
        ------
        AircraftError
            If the property does not exist.
        """
        if not self._manager.hasNode(name):
            raise AircraftError(
                f"JSBSim property {name!r} does not exist in {self.model.model}; correct its name in [jsbsim] of aircraft.toml"
            )
        return self._manager.get_node(name)

    def nodes(self, names: Iterable[str]) -> list[Any]:
        """Return the nodes of several properties."""
        return [self.node(name) for name in names]

    def initialise(
        self,
        condition: Condition,
        controls: Controls,
        engines_s: float | None = None,
    ) -> None:
        """Put the aircraft into a state at time zero, with lags, filters and engines settled.

        Parameters
        ----------
        condition : airspeed, altitude and flight path.
        controls : commands, throttle and motion.
        engines_s : longest time for which engines and filters run, instead of that of the model [s].
        """
        fdm, flow = self.fdm, controls.of(LONGITUDINAL.vane)
        self.six_axes = condition.six_axes
        self._choose_axes()
        fdm.set_trim_status(True)  # actuators pass their input through
        for name, value in (
            ("ic/h-sl-ft", condition.altitude_m / FT),
            ("ic/lat-gc-deg", 0.0),
            ("ic/long-gc-deg", 0.0),
            ("ic/psi-true-rad", 0.0),
            ("ic/phi-rad", controls.of(BANK)),
            ("ic/ve-kts", condition.eas_m_s / KT),
            ("ic/theta-rad", flow + condition.gamma_rad),
            ("ic/alpha-rad", flow),
            ("ic/beta-rad", 0.0),
            ("ic/gamma-rad", condition.gamma_rad),
            *((name, controls.of(channel)) for channel, name in _RATES.items()),
        ):
            fdm[name] = value
        if self.six_axes:
            self._orient(controls, condition.gamma_rad)
        self.hold(controls)
        self.settle(engines_s)

    def _orient(self, controls: Controls, gamma_rad: float) -> None:
        """Write attitude and velocity of a straight flight with sideslip and bank, which JSBSim's own angles disturb."""
        fdm, speed = self.fdm, self.fdm["ic/vt-fps"]
        at = controls.attitude(gamma_rad)
        fdm["ic/psi-true-rad"] = at.psi_rad
        fdm["ic/theta-rad"] = at.theta_rad
        fdm["ic/phi-rad"] = controls.of(BANK)
        for axis, part in zip("uvw", at.velocity, strict=True):
            fdm[f"ic/{axis}-fps"] = speed * part

    def hold(self, controls: Controls) -> None:
        """Write the controls, the throttle's trim included."""
        for control, name in self.model.lateral or ():
            self.fdm[name] = controls.held.get(control, 0.0)
        # in six axes the commands of the surfaces take the place of those that hold the aircraft straight
        for name, surface in self.surfaces.items():
            self.fdm[surface.command] = controls.command(name) * surface.command_per_rad
        for name in (*self.model.throttle.command, *self.model.throttle.trim):
            self.fdm[name] = controls.throttle

    def change_controls(self, controls: Controls, engines_s: float) -> None:
        """Write other controls in the present state, and let filters and engines follow for a time [s]."""
        self.fdm.set_trim_status(True)
        self.hold(controls)
        self._start_engines(engines_s)

    def settle(self, engines_s: float | None = None) -> None:
        """Run the initial conditions and, where there are engines, bring them to their steady state.

        Parameters
        ----------
        engines_s : as in `initialise`.
        """
        self.fdm.run_ic()
        if self._has_engines and self.model.engine_start_s > 0.0:
            self._start_engines(self.model.engine_start_s if engines_s is None else engines_s)
        elif self._has_engines:
            self.fdm.suspend_integration()
            for _ in range(_ENGINE_ROUNDS):
                self.fdm.run()  # engines see the controls of the frame before
                self._propulsion.get_steady_state()
            self.fdm.run()
            self.fdm.resume_integration()

    def _start_engines(self, longest_s: float) -> None:
        """Run the engines, and start those that do not run, until the forces are steady; the motion is held."""
        fdm, count = self.fdm, self._propulsion.get_num_engines()
        running = [f"propulsion/engine[{i}]/set-running" for i in range(count)]
        for name in _INTEGRATORS:
            fdm[name] = _FROZEN
        if not all(fdm[name] for name in running):
            levers = {n: fdm[n] for n in self._levers}
            fdm["propulsion/cutoff_cmd"] = 0.0
            fdm["propulsion/set-running"] = -1.0  # moves the levers
            for name, value in levers.items():
                fdm[name] = value
        last = None
        for _ in range(math.ceil(longest_s / _BLOCK_S)):
            still = not all(fdm[name] for name in running)
            fdm["propulsion/starter_cmd"] = float(still)
            for _ in range(math.ceil(_BLOCK_S / self.dt_s)):
                fdm.run()
            now = self.respond()
            self.unsteadiness = math.inf if still or last is None else now.differs(last)
            if self.unsteadiness < _STEADY:
                break
            last = now
        fdm["propulsion/starter_cmd"] = 0.0
        self.choose_integrator()

    @property
    def _levers(self) -> list[str]:
        """Levers of the engines that exist."""
        count = self._propulsion.get_num_engines()
        kinds = ("throttle", "mixture", "advance")
        names = [f"fcs/{kind}-cmd-norm[{i}]" for kind in kinds for i in range(count)]
        return [name for name in names if self._manager.hasNode(name)]

    def respond(self) -> SimulatorResponse:
        """Return accelerations and surfaces in the present state."""
        fdm = self.fdm
        return SimulatorResponse(
            u_dot_m_s2=fdm["accelerations/udot-ft_sec2"] * FT,
            w_dot_m_s2=fdm["accelerations/wdot-ft_sec2"] * FT,
            q_dot_rad_s2=fdm["accelerations/qdot-rad_sec2"],
            v_dot_m_s2=fdm["accelerations/vdot-ft_sec2"] * FT,
            p_dot_rad_s2=fdm["accelerations/pdot-rad_sec2"],
            r_dot_rad_s2=fdm["accelerations/rdot-rad_sec2"],
            surfaces_rad={name: fdm[s.surface] * s.surface_rad for name, s in self.surfaces.items()},
        )

    @property
    def surfaces(self) -> dict[str, SurfaceProperties]:
        """Control -> properties of its surface, of those that fly: in the pitch plane the elevator alone."""
        motions = (LONGITUDINAL, LATERAL) if self.six_axes else (LONGITUDINAL,)
        return {name: s for motion in motions for name, s in self.model.surfaces(motion).items()}

    def surroundings(self) -> tuple[float, float, float]:
        """Return true airspeed [m/s], air density [kg/m3] and mass [kg] in the present state."""
        return (
            self.fdm["velocities/vt-fps"] * FT,
            self.fdm["atmosphere/rho-slugs_ft3"] * SLUG / FT**3,
            self.fdm["inertia/mass-slugs"] * SLUG,
        )


def jsbsim_model(aircraft: Aircraft) -> JsbsimModel:
    """Return the [jsbsim] table of an aircraft.

    Raises
    ------
    AircraftError
        If the aircraft has no JSBSim model.
    """
    if aircraft.file.jsbsim is None:
        raise AircraftError(
            f"{aircraft.folder}: has no JSBSim model to fly, or no [jsbsim] table in aircraft.toml; "
            "`airtruth aircraft new` writes one"
        )
    return aircraft.file.jsbsim
