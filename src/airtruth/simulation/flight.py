"""One run in JSBSim: inputs on the simulator's grid in, noise-free channels out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import ConfigurationError, FlightError
from airtruth.simulation.readings import READ, channels, require_sound
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import FT

Array = NDArray[np.float64]


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
    surface : the command drives the surface itself, past the actuator.
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
        self._rotary = model.rotary_gust
        self._read = executive.nodes([*READ, model.elevator.surface])

    def fly(self, inputs: Inputs) -> dict[str, Array]:
        """Fly one run.

        Returns
        -------
        dict
            Channels of `airtruth.simulation.readings.channels`, with elevator_command_rad and throttle, (records,)
            each [SI]; record k is the state at the time k record_every dt.

        Raises
        ------
        FlightError
            If the state leaves the range in which the simulation has a meaning, or the model ends the simulation.
        ConfigurationError
            If the inputs need an augmentation or a rotary gust that the aircraft lacks.
        """
        columns = self._simulate(inputs)
        require_sound(columns, self._record_every * self._executive.dt_s, "the flight")
        command = inputs.command_rad[:: self._record_every]
        return channels(columns, self.trim.mass_kg, self._elevator.surface_rad) | {
            "elevator_command_rad": self.trim.controls.elevator_command_rad + command,
            "throttle": np.full(columns.shape[1], self.trim.controls.throttle),
        }

    def _simulate(self, inputs: Inputs) -> Array:
        renewed = self._executive.renewed() if self._flown else self._executive
        if renewed is not self._executive:
            self._executive = renewed
            self._start()
        self._flown = True
        executive, trim = self._executive, self.trim
        fdm = executive.fdm
        controls = trim.controls
        setters, series = self._inputs(inputs)
        fdm.set_trim_status(True)
        fdm.reset_to_initial_conditions(2)  # a reset without run_ic, which settle() does
        executive.configure()
        first = controls.elevator_command_rad + float(inputs.command_rad[0])
        executive.hold(replace(controls, elevator_command_rad=first))
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
        for first in range(0, len(steps) - every + 1, every):
            for values in steps[first : first + every]:
                for setter, value in zip(setters, values):  # noqa: B905 (hot loop)
                    setter(value)
                if not run():
                    raise FlightError(f"the model ended the flight at {fdm.get_sim_time():.3f} s")
            extend([get() for get in gets])
        return np.array(records).reshape(-1, len(gets)).T

    def _inputs(self, inputs: Inputs) -> tuple[list[Callable[[float], None]], list[list[float]]]:
        """Setters and their values at every step; the elevator first."""
        executive, elevator = self._executive, self._elevator
        absolute = self.trim.controls.elevator_command_rad + inputs.command_rad
        late = 0 if inputs.surface else elevator.command_frames
        command = np.concatenate([np.repeat(absolute[:1], late), absolute[: len(absolute) - late]])
        pairs = [
            (elevator.command, command * elevator.command_per_rad),
            ("atmosphere/gust-north-fps", inputs.gust_u_m_s / FT),
            ("atmosphere/gust-down-fps", inputs.gust_w_m_s / FT),
        ]
        if inputs.gust_q_rad_s is not None:
            if self._rotary is None:
                raise ConfigurationError(
                    "the aircraft has no property for a rotary gust (jsbsim.rotary_gust)"
                )
            pairs.append((self._rotary, inputs.gust_q_rad_s))
        if self._augmentation is not None and inputs.q_error_rad_s is not None:
            pairs.append((self._augmentation.q_error, inputs.q_error_rad_s))
        if self._augmentation is not None and inputs.theta_error_rad is not None:
            pairs.append((self._augmentation.theta_error, inputs.theta_error_rad))
        setters = [executive.node(name).set_double_value for name, _ in pairs]
        return setters, [np.asarray(values, dtype=np.float64).tolist() for _, values in pairs]

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
