"""JSBSim behind a narrow door: open an executive, put it into a state, read what it answers.

An executive is opened anew for every flight condition, and its initial conditions are written once:
rewriting them drifts in the last bits, and a result must not depend on what ran before.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import jsbsim

from airtruth.aircraft import Aircraft, JsbsimModel
from airtruth.aircraft_probe import load_model, model_root
from airtruth.errors import AircraftError
from airtruth.units import FT, KT, SLUG

_AB3: Final = 4.0  # JSBSim's number for third-order Adams-Bashforth
_INTEGRATORS: Final = tuple(
    f"simulation/integrator/{order}/{kind}"
    for order in ("rate", "position")
    for kind in ("rotational", "translational")
)
_ENGINE_ROUNDS: Final = 4  # a piston engine's thrust stands still after two
_PLANET: Final = Path(__file__).with_name("flat_planet.xml")


@dataclass(frozen=True)
class Condition:
    """A steady flight condition, wings level, in still air.

    Attributes
    ----------
    eas_m_s : equivalent airspeed [m/s].
    altitude_m : geometric altitude above sea level in the standard atmosphere [m].
    gamma_rad : flight-path angle, climb positive [rad].
    """

    eas_m_s: float
    altitude_m: float
    gamma_rad: float = 0.0


@dataclass(frozen=True)
class Controls:
    """What a pilot holds: elevator command [rad, trailing edge down positive] and throttle [0..1]."""

    elevator_command_rad: float
    throttle: float


@dataclass(frozen=True)
class Response:
    """What JSBSim answers in one state; body accelerations, SI."""

    u_dot_m_s2: float
    w_dot_m_s2: float
    q_dot_rad_s2: float
    elevator_rad: float


class Executive:
    """One JSBSim executive with one aircraft; holds no state of a flight beyond JSBSim's own.

    Parameters
    ----------
    aircraft : the aircraft, already loaded once in a child process by `airtruth.aircraft.load`.
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
        self.fdm = jsbsim.FGFDMExec(str(model_root(aircraft.folder, self.model.root)[0]))
        self.fdm.set_debug_level(0)
        self.fdm.load_planet(str(_PLANET), False)
        self.fdm.set_dt(dt_s)
        if not load_model(self.fdm, aircraft.folder, self.model.root, self.model.model):
            raise AircraftError(f"{aircraft.folder}: JSBSim refused the model {self.model.model!r}")
        _no_files(self.fdm)
        self._manager = self.fdm.get_property_manager()
        self._propulsion = self.fdm.get_propulsion()
        self._has_engines = self._propulsion.get_num_engines() > 0
        self.choose_integrator()
        self.configure()

    def choose_integrator(self) -> None:
        """Third-order Adams-Bashforth throughout; a reset restores Euler."""
        for name in _INTEGRATORS:
            self.fdm[name] = _AB3

    def configure(self) -> None:
        """Write the properties that aircraft.toml sets (engines running, gear up ...)."""
        for name, value in self.model.set.items():
            self.fdm[name] = value

    def renewed(self) -> Executive:
        """An executive in which nothing has run: itself, or a new one if it has engines, whose state stays."""
        return Executive(self.aircraft, self.dt_s) if self._has_engines else self

    def node(self, name: str) -> Any:
        """Bound property node; unlike JSBSim's own setters it never creates a property.

        Raises
        ------
        AircraftError
            If the property does not exist.
        """
        if not self._manager.hasNode(name):
            raise AircraftError(f"JSBSim property {name!r} does not exist in {self.model.model}")
        return self._manager.get_node(name)

    def nodes(self, names: Iterable[str]) -> list[Any]:
        """Bound nodes of several properties."""
        return [self.node(name) for name in names]

    def initialise(
        self, condition: Condition, alpha_rad: float, controls: Controls, q_rad_s: float = 0.0
    ) -> None:
        """Put the aircraft into a state with lags, filters and engines settled, at time zero."""
        fdm = self.fdm
        fdm.set_trim_status(True)  # actuators pass their input through
        for name, value in (
            ("ic/h-sl-ft", condition.altitude_m / FT),
            ("ic/lat-gc-deg", 0.0),
            ("ic/long-gc-deg", 0.0),
            ("ic/psi-true-rad", 0.0),
            ("ic/phi-rad", 0.0),
            ("ic/ve-kts", condition.eas_m_s / KT),
            ("ic/theta-rad", alpha_rad + condition.gamma_rad),
            ("ic/alpha-rad", alpha_rad),
            ("ic/beta-rad", 0.0),
            ("ic/gamma-rad", condition.gamma_rad),
            ("ic/p-rad_sec", 0.0),
            ("ic/q-rad_sec", q_rad_s),
            ("ic/r-rad_sec", 0.0),
        ):
            fdm[name] = value
        self.hold(controls)
        self.settle()

    def hold(self, controls: Controls) -> None:
        """Write the controls, the throttle's trim included."""
        self.fdm[self.model.elevator.command] = (
            controls.elevator_command_rad * self.model.elevator.command_per_rad
        )
        for name in (*self.model.throttle.command, *self.model.throttle.trim):
            self.fdm[name] = controls.throttle

    def settle(self) -> None:
        """Run the initial conditions and, where there are engines, bring them to their steady state."""
        self.fdm.run_ic()
        if self._has_engines:
            self.fdm.suspend_integration()
            for _ in range(_ENGINE_ROUNDS):
                self.fdm.run()  # engines see the controls of the frame before
                self._propulsion.get_steady_state()
            self.fdm.run()
            self.fdm.resume_integration()

    def respond(self) -> Response:
        """Accelerations and surface in the present state."""
        fdm = self.fdm
        return Response(
            u_dot_m_s2=fdm["accelerations/udot-ft_sec2"] * FT,
            w_dot_m_s2=fdm["accelerations/wdot-ft_sec2"] * FT,
            q_dot_rad_s2=fdm["accelerations/qdot-rad_sec2"],
            elevator_rad=fdm[self.model.elevator.surface] * self.model.elevator.surface_rad,
        )

    def surroundings(self) -> tuple[float, float, float]:
        """True airspeed [m/s], air density [kg/m3] and mass [kg] in the present state."""
        return (
            self.fdm["velocities/vt-fps"] * FT,
            self.fdm["atmosphere/rho-slugs_ft3"] * SLUG / FT**3,
            self.fdm["inertia/mass-slugs"] * SLUG,
        )


class _Silent(jsbsim.FGLogger):
    """JSBSim writes its messages to stdout, which is the result's; the probe has shown them already."""

    def set_level(self, level: object) -> None:
        """Pass over."""

    def message(self, message: str) -> None:
        """Pass over."""

    def file_location(self, filename: str, line: int) -> None:
        """Pass over."""

    def format(self, format: object) -> None:
        """Pass over."""

    def flush(self) -> None:
        """Pass over."""


jsbsim.set_logger(_Silent())


def _no_files(fdm: Any) -> None:
    """Some models write files of their own at every start: send them nowhere."""
    number = 0
    while fdm.set_output_filename(number, os.devnull):
        number += 1
    fdm.disable_output()


def jsbsim_model(aircraft: Aircraft) -> JsbsimModel:
    """The JSBSim part of an aircraft.

    Raises
    ------
    AircraftError
        If aircraft.toml has no [jsbsim] table.
    """
    if aircraft.file.jsbsim is None:
        raise AircraftError(
            f"{aircraft.folder}: aircraft.toml has no [jsbsim] table, so there is nothing to fly"
        )
    return aircraft.file.jsbsim
