"""The truth in JSBSim at 1 kHz: trim, and one record."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("JSBSIM_DEBUG", "0")
import jsbsim

from validation.blind import aircraft_xml
from validation.blind.aircraft_xml import ALIVE, ELEVATOR, LIFT, MOMENT, Body, Shape
from validation.blind.figures import ALTITUDE_FT, DEG, EAS_M_S, FT, KT, SLUG, STEP_S

Array = NDArray[np.float64]
State = Callable[[float, float, float, float], tuple[float, float]]
"""Called once a step with alpha [rad], q [rad/s], V [m/s], dt [s]; answers increments of CL and Cm."""
Start = Callable[[float], State]
"""Given the first angle of attack of a record, a state at rest there."""
Feedback = Callable[[float], float]
"""Called once a step with the pitch rate before it [rad/s]; answers the surface after it, deviation from trim [rad]."""

_READ: Final = (
    "velocities/vt-fps",
    "aero/alpha-rad",
    "attitude/theta-rad",
    "velocities/q-rad_sec",
    "forces/fbx-total-lbs",
    "forces/fbz-total-lbs",
    "accelerations/qdot-rad_sec2",
    "atmosphere/pressure-altitude",
    "atmosphere/rho-slugs_ft3",
)
_INTEGRATORS: Final = tuple(
    f"simulation/integrator/{order}/{kind}"
    for order in ("rate", "position")
    for kind in ("rotational", "translational")
)
_AB3: Final = 4.0


class LeftRangeError(RuntimeError):
    """An aircraft that departed: an angle of attack beyond 0.6 rad."""


@dataclass(frozen=True)
class Model:
    """What flies: see `aircraft_xml.write`; ``states`` are computed here, beside JSBSim."""

    body: Body
    shapes: tuple[Shape, ...] = ()
    elevator_factor: float = 1.0
    thrust_arm_m: float = 0.0
    states: tuple[Start, ...] = ()


class Truth:
    """A model, loaded and trimmed at 75 kt EAS, 7000 ft, ready to fly records.

    Attributes
    ----------
    alpha_rad, elevator_rad, throttle : the trim.
    airspeed_m_s : true airspeed [m/s].
    """

    def __init__(self, model: Model, step_s: float = STEP_S) -> None:
        self.model = model
        self.step_s = step_s
        with tempfile.TemporaryDirectory() as folder:
            aircraft_xml.write(
                Path(folder), model.body, model.shapes, model.elevator_factor, model.thrust_arm_m
            )
            self._fdm = _load(Path(folder), step_s)
        self._mass_kg = 0.0
        self._nodes = _bind(self._fdm, (ELEVATOR, LIFT, MOMENT, ALIVE))
        self._gusts = _bind(
            self._fdm, ("atmosphere/gust-north-fps", "atmosphere/gust-down-fps", "aero/gust/q-rad_sec")
        )
        self._read = _bind(self._fdm, _READ)
        self.alpha_rad, self.elevator_rad, self.throttle = self._trim()
        self._place(self.alpha_rad, self.elevator_rad, self.throttle)
        self._mass_kg = self._fdm["inertia/mass-slugs"] * SLUG
        self.airspeed_m_s = self._fdm["velocities/vt-fps"] * FT

    def _place(
        self, alpha: float, elevator: float, throttle: float, entry: tuple[float, float] = (1.0, 0.0)
    ) -> None:
        """Initial conditions; ``entry``: airspeed over that of the trim [-], angle of climb [rad]."""
        fdm = self._fdm
        fdm.set_trim_status(True)
        for name, value in (
            ("ic/h-sl-ft", ALTITUDE_FT),
            ("ic/lat-gc-deg", 0.0),
            ("ic/long-gc-deg", 0.0),
            ("ic/psi-true-rad", 0.0),
            ("ic/phi-rad", 0.0),
            ("ic/ve-kts", EAS_M_S * entry[0] / KT),
            ("ic/theta-rad", alpha + entry[1]),
            ("ic/alpha-rad", alpha),
            ("ic/beta-rad", 0.0),
            ("ic/gamma-rad", entry[1]),
            ("ic/p-rad_sec", 0.0),
            ("ic/q-rad_sec", 0.0),
            ("ic/r-rad_sec", 0.0),
            ("fcs/throttle-cmd-norm", throttle),
            ("fcs/throttle-trim-norm", throttle),
        ):
            fdm[name] = value
        self._nodes[0].set_double_value(elevator)
        fdm.run_ic()

    def _residual(self, x: Array) -> Array:
        self._place(*x.tolist())
        fdm = self._fdm
        return np.array(
            [
                fdm["accelerations/udot-ft_sec2"] * FT,
                fdm["accelerations/wdot-ft_sec2"] * FT,
                fdm["accelerations/qdot-rad_sec2"],
            ]
        )

    def _trim(self) -> tuple[float, float, float]:
        """Newton's method on alpha, elevator, throttle; the tables are linear by pieces."""
        x = np.array([5.57 * DEG, 0.18 * DEG, 0.418])
        steps = np.array([1e-5, 1e-5, 1e-4])
        for node in self._nodes[1:]:
            node.set_double_value(0.0)
        r = self._residual(x)
        for _ in range(30):
            if np.max(np.abs(r)) < 1e-10:
                break
            jacobian = np.column_stack(
                [(self._residual(x + h) - r) / s for h, s in zip(np.diag(steps), steps, strict=True)]
            )
            change = np.linalg.solve(jacobian, -r)
            for _ in range(6):
                tried = self._residual(x + change)
                if np.max(np.abs(tried)) < np.max(np.abs(r)):
                    break
                change = change / 2.0
            x, r = x + change, tried
        if np.max(np.abs(r)) > 1e-7:
            raise RuntimeError(f"the truth cannot be trimmed, residual {np.max(np.abs(r)):.1e}: {self.model}")
        return float(x[0]), float(x[1]), float(x[2])

    def fly(
        self,
        surface_rad: Array,
        gusts: Array | None = None,
        d_alpha: float = 0.0,
        entry: tuple[float, float] = (1.0, 0.0),
        feedback: Feedback | None = None,
    ) -> dict[str, Array]:
        """One record.

        Parameters
        ----------
        surface_rad : (n,) surface that the air sees, deviation from trim, at 0, dt, ... [rad].
        gusts : (3, n) velocity of the air forward and down [m/s], its rotation nose-up [rad/s]; None is calm.
        d_alpha : angle of attack at the start less that of the trim [rad].
        entry : airspeed at the start over that of the trim [-], angle of climb there [rad].
        feedback : computes the surface where a damper moves it; ``surface_rad`` then counts at the start alone.

        Returns
        -------
        dict
            (n,) each: channels at the CG in SI, and q_dot_rad_s2.
        """
        fdm = self._fdm
        elevator = (self.elevator_rad + surface_rad).tolist()
        air = np.zeros((3, len(elevator))) if gusts is None else gusts / np.array([[FT], [FT], [1.0]])
        u, w, r = air.tolist()
        put_e, put_l, put_m, alive = (node.set_double_value for node in self._nodes)
        put_u, put_w, put_r = (node.set_double_value for node in self._gusts)
        for put in (put_l, put_m, alive):
            put(0.0)
        fdm.set_trim_status(True)
        fdm.reset_to_initial_conditions(2)
        for put, first in ((put_u, u), (put_w, w), (put_r, r)):
            put(first[0])
        self._place(self.alpha_rad + d_alpha, elevator[0], self.throttle, entry)
        fdm.set_trim_status(False)
        for name in _INTEGRATORS:
            fdm[name] = _AB3
        alive(1.0)
        gets = [node.get_double_value for node in self._read]
        records = [get() for get in gets]
        states = [start(records[1]) for start in self.model.states]
        run, extend, dt = fdm.run, records.extend, self.step_s
        latest = records[-len(gets) :]
        for k in range(1, len(elevator)):
            put_e(elevator[k] if feedback is None else self.elevator_rad + feedback(latest[3]))
            if gusts is not None:
                put_u(u[k])
                put_w(w[k])
                put_r(r[k])
            if states:
                lift, moment = _increments(states, latest, dt)
                put_l(lift)
                put_m(moment)
            run()
            latest = [get() for get in gets]
            extend(latest)
        return self._channels(np.array(records).reshape(-1, len(gets)).T)

    def _channels(self, columns: Array) -> dict[str, Array]:
        v, alpha, theta, q, fx, fz, q_dot, height, density = columns
        if not (np.isfinite(columns).all() and np.all(v > 0.0) and np.all(np.abs(alpha) < 0.6)):
            raise LeftRangeError(f"the truth left its range: {self.model}")
        return {
            "airspeed_m_s": v * FT,
            "alpha_rad": alpha,
            "theta_rad": theta,
            "q_rad_s": q,
            "ax_m_s2": fx * (SLUG * FT / self._mass_kg),
            "az_m_s2": fz * (SLUG * FT / self._mass_kg),
            "q_dot_rad_s2": q_dot,
            "altitude_m": height * FT,
            "density_kg_m3": density * (SLUG / FT**3),
        }


def _increments(states: Sequence[State], latest: Sequence[float], dt: float) -> tuple[float, float]:
    lift = moment = 0.0
    for state in states:
        cl, cm = state(latest[1], latest[3], latest[0] * FT, dt)
        lift += cl
        moment += cm
    return lift, moment


def _bind(fdm: Any, names: Sequence[str]) -> list[Any]:
    manager = fdm.get_property_manager()
    missing = [name for name in names if not manager.hasNode(name)]
    if missing:
        raise RuntimeError(f"JSBSim has no property {missing[0]!r}")
    return [manager.get_node(name) for name in names]


def _load(folder: Path, step_s: float) -> Any:
    fdm = jsbsim.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    fdm.load_planet(str(folder / "planet.xml"), False)
    fdm.set_dt(step_s)
    for set_path in (fdm.set_aircraft_path, fdm.set_engine_path, fdm.set_systems_path):
        set_path(str(folder))
    if not fdm.load_model(aircraft_xml.NAME):
        raise RuntimeError("JSBSim refused the truth's model")
    fdm.disable_output()
    return fdm
