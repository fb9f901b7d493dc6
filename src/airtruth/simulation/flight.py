"""One run in JSBSim: inputs on the simulator's grid in, noise-free channels out."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.model import SurfaceProperties
from airtruth.channels import BANK, SIGNALS
from airtruth.errors import ConfigurationError, FlightError
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.lateral_feedback import FED, LateralFeedback, Loop
from airtruth.simulation.readings import READ, READ_LATERAL, channels, lateral_channels, require_sound
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import Trim
from airtruth.units import FT

Array = NDArray[np.float64]

_ROTATION: Final = dict(
    zip((*LONGITUDINAL.gyros, *LATERAL.gyros), ("rotary_gust", "roll_gust", "yaw_gust"), strict=True)
)
"""Channel of an angular rate -> entry of the [jsbsim] table with the property of the rotation of the air."""
_ERRORS: Final = {LONGITUDINAL.gyros[0]: "q_error", "theta_rad": "theta_error"}
"""Channel -> entry of the augmentation with the property of the error of its sensor."""
_SELDOM: Final = 0.1
"""Share of the steps at which a property changes up to which it is written at those alone [-] (judgement: it costs no bits)."""


@dataclass(frozen=True)
class LateralInputs:
    """Lateral inputs of one run in six axes, at the times of `Inputs`; (samples,) each.

    Attributes
    ----------
    commands_rad : control -> command, deviation from trim [rad]; aileron (right - left)/2, trailing edges down positive,
        rudder trailing edge left positive. A control without an entry keeps its trim.
    gust_v_m_s : velocity of the air to the right of the flight direction [m/s], or None.
    rotation_rad_s : channel of an angular rate -> rotation of the air about that axis [rad/s].
    feedback : yaw damper and bank hold, or None.
    """

    commands_rad: Mapping[str, Array]
    gust_v_m_s: Array | None = None
    rotation_rad_s: Mapping[str, Array] = field(default_factory=dict)
    feedback: LateralFeedback | None = None


@dataclass(frozen=True)
class Inputs:
    """Inputs of one run at the times 0, dt, 2 dt and so on; (samples,) each.

    Attributes
    ----------
    command_rad : elevator command, deviation from trim [rad].
    gust_u_m_s, gust_w_m_s : velocity of the air along the flight direction and downward [m/s].
    rotation_rad_s : channel of the pitch rate -> rotation of the air, nose-up positive, -dw/dx [rad/s].
    errors : channel -> sensor error fed into the augmentation [rad/s], [rad].
    damper_gain_s, attitude_gain : gains of the augmentation [s], [-].
    surface : the commands drive the surfaces themselves, past the actuators.
    lateral : lateral inputs of a run in six axes; None for fixed lateral controls in air without lateral gusts.
    """

    command_rad: Array
    gust_u_m_s: Array
    gust_w_m_s: Array
    rotation_rad_s: Mapping[str, Array] = field(default_factory=dict)
    errors: Mapping[str, Array] = field(default_factory=dict)
    damper_gain_s: float = 0.0
    attitude_gain: float = 0.0
    surface: bool = False
    lateral: LateralInputs | None = None


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
        executive.initialise(trim.condition, trim.controls)
        model = executive.model
        self._elevator = model.elevator
        self._augmentation = model.augmentation
        self._lateral: dict[str, SurfaceProperties] = {}
        read = [*READ, model.elevator.surface]
        if trim.condition.six_axes:
            self._lateral = model.surfaces(LATERAL)
            read += [*READ_LATERAL, *(surface.surface for surface in self._lateral.values())]
        self._read = executive.nodes(read)

    def fly(self, inputs: Inputs) -> dict[str, Array]:
        """Fly one run.

        Returns
        -------
        dict
            Channels of `airtruth.simulation.readings.channels`, with elevator_command_rad and throttle, (records,)
            each [SI]; record k is the state at the time k record_every dt. In six axes also those of
            `airtruth.simulation.readings.lateral_channels`, with aileron_command_rad and rudder_command_rad. The commands are
            those of the inputs, without feedback.

        Raises
        ------
        FlightError
            If the state leaves the range in which the simulation has a meaning, or the model ends the simulation.
        ConfigurationError
            If the inputs need an augmentation or a rotary gust that the aircraft lacks, or lateral inputs meet a trim of the
            pitch plane.
        """
        if inputs.lateral is not None and not self._lateral:
            raise ConfigurationError(
                "lateral inputs need a trim in six axes; state wings-level or no-sideslip in the condition"
            )
        columns = self._simulate(inputs)
        require_sound(columns, self._record_every * self._executive.dt_s, "the flight")
        own, controls, mass = len(READ) + 1, self.trim.controls, self.trim.mass_kg
        command = inputs.command_rad[:: self._record_every]
        result = channels(columns[:own], mass, self._elevator.surface_rad) | {
            LONGITUDINAL.commands[0]: controls.command(ELEVATOR) + command,
            "throttle": np.full(columns.shape[1], controls.throttle),
        }
        if not self._lateral:
            return result
        result |= lateral_channels(
            columns[own:], mass, [surface.surface_rad for surface in self._lateral.values()]
        )
        commands = (c[:: self._record_every] for c in self._lateral_commands(inputs))
        return result | dict(zip(LATERAL.commands, commands, strict=True))

    def _lateral_commands(self, inputs: Inputs) -> list[Array]:
        """Commands of the lateral controls at every step [rad]."""
        given = {} if inputs.lateral is None else inputs.lateral.commands_rad
        still = np.zeros_like(inputs.command_rad)
        return [self.trim.controls.command(name) + given.get(name, still) for name in self._lateral]

    @property
    def _theta_rad(self) -> float:
        """Pitch attitude of the trim [rad]."""
        at, gamma = self.trim, self.trim.condition.gamma_rad
        if not at.condition.six_axes:
            return at.alpha_rad + gamma
        return at.controls.attitude(gamma).theta_rad

    def _simulate(self, inputs: Inputs) -> Array:
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
        first = controls.command(ELEVATOR) + float(inputs.command_rad[0])
        executive.hold(controls.moved({ELEVATOR: first}))
        self._engage(inputs)
        for setter, values in zip(setters[1:], series[1:], strict=True):
            setter(float(values[0]))
        executive.settle()
        fdm.set_trim_status(inputs.surface)  # trim status lets actuators pass their input through
        executive.choose_integrator()

        gets = [node.get_double_value for node in self._read]
        records = array("d", [get() for get in gets])
        run, every, extend = fdm.run, self._record_every, records.extend
        driven = _Schedule(setters, series, () if loop is None else loop.setters)
        write, steps, changes = driven.write, driven.steps, driven.changes
        eventful = {(step - 1) // every for step in changes}
        for record, first in enumerate(range(0, len(steps) - every + 1, every)):
            if loop is not None:
                loop.sample(first)
            if record in eventful:
                for step in range(first + 1, first + every + 1):
                    for setter, value in changes.get(step, ()):
                        setter(value)
                    write(*steps[step - 1])
                    if not run():
                        raise _ended(fdm)
            else:
                for present in steps[first : first + every]:
                    write(*present)
                    if not run():
                        raise _ended(fdm)
            extend([get() for get in gets])
        return np.frombuffer(records).reshape(-1, len(gets)).T

    def _loop(self, inputs: Inputs) -> Loop | None:
        """The feedback of a run, connected to the motion."""
        if inputs.lateral is None or inputs.lateral.feedback is None:
            return None
        motion = self._executive.nodes([SIGNALS[name].jsbsim for name in FED])
        reads = [node.get_double_value for node in motion]
        return Loop(inputs.lateral.feedback, self._executive.dt_s, self.trim.controls.of(BANK), reads)

    def _inputs(
        self, inputs: Inputs, loop: Loop | None
    ) -> tuple[list[Callable[[float], object]], list[Array]]:
        """Setters and their values at every step; the elevator first."""
        executive, elevator = self._executive, self._elevator
        absolute = self.trim.controls.command(ELEVATOR) + inputs.command_rad
        pairs = [
            (elevator.command, _in_time(elevator, absolute, inputs)),
            ("atmosphere/gust-north-fps", inputs.gust_u_m_s / FT),
            ("atmosphere/gust-down-fps", inputs.gust_w_m_s / FT),
        ]
        pairs += self._rotating(inputs.rotation_rad_s)
        if self._augmentation is not None:
            fed_in = {name: getattr(self._augmentation, key) for name, key in _ERRORS.items()}
            pairs += [(fed_in[name], values) for name, values in inputs.errors.items()]
        first = len(pairs)
        if self._lateral:
            pairs += self._lateral_inputs(inputs)
        setters = [executive.node(name).set_double_value for name, _ in pairs]
        if loop is not None:
            fed = slice(first, first + len(self._lateral))
            setters[fed] = loop.added(
                setters[fed], [surface.command_per_rad for surface in self._lateral.values()]
            )
        return setters, [np.asarray(values, dtype=np.float64) for _, values in pairs]

    def _lateral_inputs(self, inputs: Inputs) -> list[tuple[str, Array]]:
        """Properties and values of the lateral inputs, the commands of aileron and rudder first."""
        commands = zip(self._lateral.values(), self._lateral_commands(inputs), strict=True)
        pairs = [(surface.command, _in_time(surface, values, inputs)) for surface, values in commands]
        lateral = inputs.lateral
        if lateral is None:
            return pairs
        if lateral.gust_v_m_s is not None:
            pairs.append(("atmosphere/gust-east-fps", lateral.gust_v_m_s / FT))
        return pairs + self._rotating(lateral.rotation_rad_s)

    def _rotating(self, rotation_rad_s: Mapping[str, Array]) -> list[tuple[str, Array]]:
        """Properties and values of rotations of the air."""
        pairs = []
        for channel, values in rotation_rad_s.items():
            name = getattr(self._executive.model, _ROTATION[channel])
            if name is None:
                raise ConfigurationError(
                    f"the aircraft has no property for a rotary gust (jsbsim.{_ROTATION[channel]})"
                )
            pairs.append((name, values))
        return pairs

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
        fdm[names.theta_reference] = self._theta_rad


class _Schedule:
    """Values to write at every step, and those to write at the steps where they change, which a command of steps does seldom.

    Parameters
    ----------
    setters, series : of each property, its setter and its (samples,) values.
    fed : setters that add to what they are given, and are called at every step.

    Attributes
    ----------
    write : writes the values of one step; steps : (samples - 1) values of each step from the first.
    changes : step -> setters and values of properties that seldom change.
    """

    def __init__(
        self,
        setters: Sequence[Callable[[float], object]],
        series: Sequence[Array],
        fed: Sequence[Callable[[float], object]],
    ) -> None:
        count = len(series[0]) - 1
        always, values = [], []
        self.changes: dict[int, list[tuple[Callable[[float], object], float]]] = {}
        for setter, column in zip(setters, series, strict=True):
            changed = np.flatnonzero(np.diff(column)) + 1
            if setter in fed or len(changed) > _SELDOM * count:
                always.append(setter)
                values.append(column[1:].tolist())
                continue
            for step in changed.tolist():
                self.changes.setdefault(step, []).append((setter, float(column[step])))
        self.steps: list[tuple[float, ...]] = list(zip(*values, strict=True)) or [()] * count
        self.write = _writer(always)


def _ended(fdm: Any) -> FlightError:
    return FlightError(f"the model ended the flight at {fdm.get_sim_time():.3f} s")


def _writer(setters: Sequence[Callable[[float], object]]) -> Callable[..., object]:
    """One call that writes a value with each setter; without a loop, which takes twice the time."""
    match setters:
        case []:
            return lambda: None
        case [a]:
            return a
        case [a, b]:
            return lambda x, y: (a(x), b(y))
        case [a, b, c]:
            return lambda x, y, z: (a(x), b(y), c(z))
        case [a, b, c, d, e]:  # aileron, rudder and three gusts
            return lambda v, w, x, y, z: (a(v), b(w), c(x), d(y), e(z))
        case [a, b, c, *rest]:
            others = _writer(rest)
            return lambda x, y, z, *more: (a(x), b(y), c(z), others(*more))
    raise AssertionError("setters are a list")


def _in_time(surface: SurfaceProperties, absolute_rad: Array, inputs: Inputs) -> Array:
    """Values to write of a command, later by the frames between reading it and acting on it."""
    late = 0 if inputs.surface else surface.command_frames
    command = np.concatenate([np.repeat(absolute_rad[:1], late), absolute_rad[: len(absolute_rad) - late]])
    return command * surface.command_per_rad


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
