"""One run in JSBSim: inputs on the simulator's grid in, noise-free channels out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.model import SurfaceProperties
from airtruth.channels import SIGNALS
from airtruth.errors import ConfigurationError, FlightError
from airtruth.simulation.lateral_feedback import LateralFeedback, Loop
from airtruth.simulation.readings import LATERAL_READ, READ, channels, lateral_channels, require_sound
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import FT

Array = NDArray[np.float64]

_PITCH_PLANE: Final = len(READ) + 1
"""Properties of a flight in the pitch plane: those of `READ` and the elevator."""


@dataclass(frozen=True)
class Inputs:
    """Inputs of one run at the times 0, dt, 2 dt and so on; (samples,) each.

    Attributes
    ----------
    command_rad : elevator command, deviation from trim [rad].
    gust_u_m_s, gust_w_m_s : velocity of the air along the flight direction and downward [m/s].
    gust_q_rad_s : rotation of the air, nose-up positive, -dw/dx [rad/s], or None.
    q_error_rad_s, theta_error_rad : sensor errors fed into the augmentation, or None.
    damper_gain_s, attitude_gain : gains of the augmentation [s], [-].
    surface : the commands drive the surfaces themselves, past the actuators.
    aileron_command_rad, rudder_command_rad : commands in six axes, deviations from trim [rad]; None for the trim's.
    gust_v_m_s : velocity of the air to the right of the flight direction [m/s], or None.
    gust_p_rad_s, gust_r_rad_s : rotation of the air, right wing down and nose right positive [rad/s], or None.
    feedback : yaw damper and bank hold, or None.
    """

    command_rad: Array
    gust_u_m_s: Array
    gust_w_m_s: Array
    gust_q_rad_s: Array | None = None
    q_error_rad_s: Array | None = None
    theta_error_rad: Array | None = None
    damper_gain_s: float = 0.0
    attitude_gain: float = 0.0
    surface: bool = False
    aileron_command_rad: Array | None = None
    rudder_command_rad: Array | None = None
    gust_v_m_s: Array | None = None
    gust_p_rad_s: Array | None = None
    gust_r_rad_s: Array | None = None
    feedback: LateralFeedback | None = None

    def moves_laterally(self) -> bool:
        """Whether the inputs need six axes."""
        return any(
            value is not None
            for value in (
                self.aileron_command_rad,
                self.rudder_command_rad,
                self.gust_v_m_s,
                self.gust_p_rad_s,
                self.gust_r_rad_s,
                self.feedback,
            )
        )


class Flight:
    """An aircraft at a trim, ready to fly any number of runs; each starts from the same bits.

    Parameters
    ----------
    aircraft : aircraft to fly.
    trim : state at the start.
    dt_s : simulation step [s].
    record_every : steps between two records.
    """

    def __init__(self, aircraft: Aircraft, trim: Trim, dt_s: float, record_every: int = 1) -> None:
        self.trim = trim
        self._record_every = record_every
        self._executive = Executive(aircraft, dt_s)
        self._flown = False
        self._start()

    def _start(self) -> None:
        executive, trim = self._executive, self.trim
        executive.initialise(trim.condition, trim.alpha_rad, trim.controls)
        model = executive.model
        self._elevator = model.elevator
        self._augmentation = model.augmentation
        self._model = model
        names = [*READ, model.elevator.surface]
        if trim.condition.six_axes:
            names += [*LATERAL_READ, *(surface.surface for surface in self._surfaces)]
        self._read = executive.nodes(names)

    @property
    def _surfaces(self) -> tuple[SurfaceProperties, SurfaceProperties]:
        """Aileron and rudder, which an aircraft that is trimmed in six axes has."""
        aileron, rudder = self._model.aileron, self._model.rudder
        assert aileron is not None
        assert rudder is not None
        return aileron, rudder

    def fly(self, inputs: Inputs) -> dict[str, Array]:
        """Fly one run.

        Returns
        -------
        dict
            Channels of `airtruth.simulation.readings.channels`, with elevator_command_rad and throttle, (records,)
            each [SI]; record k is the state at the time k record_every dt. In six axes also those of `lateral_channels`,
            aileron_command_rad and rudder_command_rad.

        Raises
        ------
        FlightError
            If the state leaves the range in which the simulation has a meaning, or the model ends the simulation.
        ConfigurationError
            If the inputs need an augmentation or a rotary gust that the aircraft lacks, or six axes and the trim is in the
            pitch plane.
        """
        trim = self.trim
        if inputs.moves_laterally() and not trim.condition.six_axes:
            raise ConfigurationError(
                "lateral inputs need a trim in six axes: state how the condition is held straight (wings-level, no-sideslip)"
            )
        columns, fed_back = self._simulate(inputs)
        require_sound(columns, self._record_every * self._executive.dt_s, "the flight")
        command = inputs.command_rad[:: self._record_every]
        result = channels(columns[:_PITCH_PLANE], trim.mass_kg, self._elevator.surface_rad) | {
            "elevator_command_rad": trim.controls.elevator_command_rad + command,
            "throttle": np.full(columns.shape[1], trim.controls.throttle),
        }
        if not trim.condition.six_axes:
            return result
        aileron, rudder = self._surfaces
        result |= lateral_channels(
            columns[_PITCH_PLANE:], trim.mass_kg, aileron.surface_rad, rudder.surface_rad
        )
        for name, absolute, more in zip(("aileron", "rudder"), self._lateral(inputs), fed_back, strict=True):
            result[f"{name}_command_rad"] = absolute[:: self._record_every] + more
        return result

    def _lateral(self, inputs: Inputs) -> tuple[Array, Array]:
        """Commands of aileron and rudder at every step [rad]."""
        controls, still = self.trim.controls, np.zeros_like(inputs.command_rad)
        aileron = still if inputs.aileron_command_rad is None else inputs.aileron_command_rad
        rudder = still if inputs.rudder_command_rad is None else inputs.rudder_command_rad
        return controls.aileron_command_rad + aileron, controls.rudder_command_rad + rudder

    def _simulate(self, inputs: Inputs) -> tuple[Array, Array]:
        """(properties, records) values of the properties, and (2, records) feedback to aileron and rudder [rad]."""
        renewed = self._executive.renewed() if self._flown else self._executive
        if renewed is not self._executive:
            self._executive = renewed
            self._start()
        self._flown = True
        executive, trim = self._executive, self.trim
        fdm = executive.fdm
        controls = trim.controls
        loop = self._loop(inputs)
        setters, series = self._inputs(inputs, loop)
        fdm.set_trim_status(True)
        fdm.reset_to_initial_conditions(2)  # a reset without run_ic, which settle() does
        executive.configure()
        first = controls.elevator_command_rad + float(inputs.command_rad[0])
        held = replace(controls, elevator_command_rad=first)
        if trim.condition.six_axes:
            aileron, rudder = (float(values[0]) for values in self._lateral(inputs))
            held = replace(held, aileron_command_rad=aileron, rudder_command_rad=rudder)
        executive.hold(held)
        self._engage(inputs)
        for setter, first_value in zip(setters[1:], (values[0] for values in series[1:]), strict=True):
            setter(first_value)
        executive.settle()
        fdm.set_trim_status(inputs.surface)  # trim status lets actuators pass their input through
        executive.choose_integrator()

        gets = [node.get_double_value for node in self._read]
        records = [get() for get in gets]
        run, every = fdm.run, self._record_every
        extend = records.extend
        steps = list(zip(*(values[1:] for values in series), strict=True))
        fed_back = []
        for first in range(0, len(steps) - every + 1, every):
            if loop is not None:
                fed_back.append(loop.at(first))
            for values in steps[first : first + every]:
                for setter, value in zip(setters, values):  # noqa: B905 (hot loop)
                    setter(value)
                if not run():
                    raise FlightError(f"the model ended the flight at {fdm.get_sim_time():.3f} s")
            extend([get() for get in gets])
        columns = np.array(records).reshape(-1, len(gets)).T
        if loop is None:
            return columns, np.zeros((2, columns.shape[1]))
        return columns, np.array([*fed_back, loop.at(len(fed_back) * every)]).T

    def _loop(self, inputs: Inputs) -> Loop | None:
        """The feedback of a run, connected to the motion."""
        if inputs.feedback is None:
            return None
        motion = self._executive.nodes([SIGNALS[name].jsbsim for name in ("p_rad_s", "r_rad_s", "phi_rad")])
        held = self.trim.controls.bank_rad
        return Loop(inputs.feedback, self._executive.dt_s, held, [n.get_double_value for n in motion])

    def _inputs(
        self, inputs: Inputs, loop: Loop | None
    ) -> tuple[list[Callable[[float], None]], list[list[float]]]:
        """Setters and their values at every step; the elevator first."""
        executive, model = self._executive, self._model
        absolute = self.trim.controls.elevator_command_rad + inputs.command_rad
        pairs = [
            _sent(self._elevator, absolute, inputs.surface),
            ("atmosphere/gust-north-fps", inputs.gust_u_m_s / FT),
            ("atmosphere/gust-down-fps", inputs.gust_w_m_s / FT),
        ]
        if inputs.gust_v_m_s is not None:
            pairs.append(("atmosphere/gust-east-fps", inputs.gust_v_m_s / FT))
        for entry, rotation in (
            ("rotary_gust", inputs.gust_q_rad_s),
            ("roll_gust", inputs.gust_p_rad_s),
            ("yaw_gust", inputs.gust_r_rad_s),
        ):
            if rotation is None:
                continue
            name = getattr(model, entry)
            if name is None:
                raise ConfigurationError(f"the aircraft has no property for a rotary gust (jsbsim.{entry})")
            pairs.append((name, rotation))
        if self._augmentation is not None and inputs.q_error_rad_s is not None:
            pairs.append((self._augmentation.q_error, inputs.q_error_rad_s))
        if self._augmentation is not None and inputs.theta_error_rad is not None:
            pairs.append((self._augmentation.theta_error, inputs.theta_error_rad))
        setters = [executive.node(name).set_double_value for name, _ in pairs]
        series = [values for _, values in pairs]
        if self.trim.condition.six_axes:
            surfaces = zip(("aileron", "rudder"), self._surfaces, self._lateral(inputs), strict=True)
            for control, surface, command in surfaces:
                name, values = _sent(surface, command, inputs.surface)
                setter = executive.node(name).set_double_value
                setters.append(
                    setter if loop is None else loop.added(control, setter, surface.command_per_rad)
                )
                series.append(values)
        return setters, [np.asarray(values, dtype=np.float64).tolist() for values in series]

    def _engage(self, inputs: Inputs) -> None:
        if inputs.damper_gain_s == 0.0 and inputs.attitude_gain == 0.0:
            return
        if self._augmentation is None:
            raise ConfigurationError(
                "the aircraft has no pitch augmentation (jsbsim.augmentation in aircraft.toml)"
            )
        fdm, names = self._executive.fdm, self._augmentation
        fdm[names.damper_gain] = inputs.damper_gain_s
        fdm[names.attitude_gain] = inputs.attitude_gain
        fdm[names.theta_reference] = self.trim.alpha_rad + self.trim.condition.gamma_rad


def _sent(surface: SurfaceProperties, command_rad: Array, directly: bool) -> tuple[str, Array]:
    """Property of a command and its values at every step, of which a model that reads them a frame early gets them later."""
    late = 0 if directly else surface.command_frames
    sent = np.concatenate([np.repeat(command_rad[:1], late), command_rad[: len(command_rad) - late]])
    return surface.command, sent * surface.command_per_rad


def fly_all(
    planes: Sequence[tuple[Aircraft, Trim]], inputs: Inputs, dt_s: float, record_every: int
) -> list[dict[str, Array]]:
    """Fly the same inputs with several aircraft, each from its trim; see `Flight.fly`.

    Raises
    ------
    FlightError, ConfigurationError
        As `Flight.fly`.
    """
    return [Flight(plane, at, dt_s, record_every).fly(inputs) for plane, at in planes]
