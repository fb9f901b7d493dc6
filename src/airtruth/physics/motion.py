"""The motions of an aircraft as data: what every other module knows of an axis, it reads here.

A motion has states, controls, outputs, aerodynamic coefficients and the signals that drive them. Its derivatives are the
products coefficient x signal. Names, units, columns of tables and channels of logs follow from the description.

Signs: body axes, x forward, y right, z down. Sources: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006,
ch. 3 (equations of motion, nondimensional rates); M. Brunot, "An Instrumental Variable Approach for Aircraft
Identification", eqs (2)-(4) (short period).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Final, Literal

Reference = Literal["chord", "span"]
"""Reference length of a moment coefficient and of a nondimensional rate."""


@dataclass(frozen=True)
class State:
    """A state of the linear model.

    Attributes
    ----------
    name : short name.
    channel : column of the flight log with its measurement.
    """

    name: str
    channel: str


@dataclass(frozen=True)
class Control:
    """A control surface.

    Attributes
    ----------
    name : of the control in files and messages.
    channel, command : columns of the measured surface and of its command [rad].
    actuator : table of aircraft.toml with its servo.
    symbol : its part in the names of derivatives.
    """

    name: str
    channel: str
    command: str
    actuator: str
    symbol: str


@dataclass(frozen=True)
class Output:
    """A measured output of the motion.

    Attributes
    ----------
    name : short name.
    channel : column of the flight log.
    late : whether it needs the accelerations of the motion; the filter updates with the other outputs first.
    """

    name: str
    channel: str
    late: bool = False


@dataclass(frozen=True)
class Coefficient:
    """An aerodynamic coefficient about the centre of gravity.

    Attributes
    ----------
    name : symbol.
    description : the force or moment, with its positive sense.
    length : reference length of a moment; None for a force.
    sign : of the force or moment along the body axis per coefficient: lift acts along -z.
    """

    name: str
    description: str
    length: Reference | None
    sign: int = 1


@dataclass(frozen=True)
class Signal:
    """A signal that drives the coefficients.

    Attributes
    ----------
    name : of the signal in terms of effects.
    symbol : its part in the names of derivatives.
    channel : column of the flight log behind it.
    length : reference length l of a nondimensional rate, x l/(2 V); None for an angle [rad].
    """

    name: str
    symbol: str
    channel: str
    length: Reference | None = None

    @property
    def unit(self) -> str:
        """Unit of a derivative with respect to the signal."""
        return "1/rad" if self.length is None else "-"


@dataclass(frozen=True)
class Derivative:
    """A derivative: a coefficient and the signal that drives it.

    Attributes
    ----------
    name : the symbols of both.
    row, column : numbers of the coefficient and of the signal in the motion.
    unit : "1/rad", or "-" with respect to a nondimensional rate.
    """

    name: str
    row: int
    column: int
    unit: str


@dataclass(frozen=True)
class Mode:
    """A modal parameter of the linear model.

    Attributes
    ----------
    name : column of tables, with its unit.
    unit : in tables.
    description : in words.
    """

    name: str
    unit: str
    description: str


@dataclass(frozen=True)
class Motion:
    """One motion of the aircraft.

    Attributes
    ----------
    name : of the motion, as `--motion` takes it.
    heading : in reports.
    states : of the linear model, in order.
    controls : in order.
    known : columns that the analysis takes as known inputs, measured or at the values of the trim.
    outputs : early outputs first.
    coefficients : rows of the derivatives.
    signals : columns of the derivatives.
    implicit : coefficient and state whose rate drives it, the term that makes the equations implicit.
    gusts : gust components that enter the motion.
    declared : quantities of aircraft.toml that scale or shift the derivatives.
    modes : modal parameters of the linear model.
    required : columns without which no analysis is possible; air density or altitude is needed beside them.
    """

    name: str
    heading: str
    states: tuple[State, ...]
    controls: tuple[Control, ...]
    known: tuple[str, ...]
    outputs: tuple[Output, ...]
    coefficients: tuple[Coefficient, ...]
    signals: tuple[Signal, ...]
    implicit: tuple[str, str]
    gusts: tuple[str, ...]
    declared: tuple[str, ...]
    modes: tuple[Mode, ...]
    required: tuple[str, ...]

    def __reduce__(self) -> tuple[Callable[[str], Motion], tuple[str]]:
        """Pickle the name: a motion is the same object in every process."""
        return _named, (self.name,)

    @cached_property
    def derivatives(self) -> tuple[Derivative, ...]:
        """All derivatives, row by row: the order of every array of them."""
        return tuple(
            Derivative(c.name + s.symbol, row, column, s.unit)
            for row, c in enumerate(self.coefficients)
            for column, s in enumerate(self.signals)
        )

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of the derivatives in the order of `derivatives`."""
        return tuple(d.name for d in self.derivatives)

    @cached_property
    def modal(self) -> tuple[str, ...]:
        """Names of the modal parameters."""
        return tuple(mode.name for mode in self.modes)

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Derivative or modal parameter -> unit."""
        return MappingProxyType(
            {d.name: d.unit for d in self.derivatives} | {mode.name: mode.unit for mode in self.modes}
        )

    @cached_property
    def output_channels(self) -> tuple[str, ...]:
        """Columns of the outputs."""
        return tuple(output.channel for output in self.outputs)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Columns of outputs and controls."""
        return (*self.output_channels, *(control.channel for control in self.controls))

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of coefficients and of signals."""
        return len(self.coefficients), len(self.signals)

    def index(self, name: str) -> int:
        """Position of a derivative in `parameters`.

        Raises
        ------
        ValueError
            If it is no derivative of the motion.

        Examples
        --------
        >>> LONGITUDINAL.index("Cmalpha")
        3
        """
        return self.parameters.index(name)

    def row(self, coefficient: str) -> slice:
        """Positions of the derivatives of a coefficient.

        Raises
        ------
        ValueError
            If it is no coefficient of the motion.

        Examples
        --------
        >>> LONGITUDINAL.row("Cm")
        slice(3, 6, None)
        """
        number = [c.name for c in self.coefficients].index(coefficient)
        width = len(self.signals)
        return slice(number * width, (number + 1) * width)

    def column(self, signal: str) -> slice:
        """Positions of the derivatives with respect to a signal.

        Raises
        ------
        ValueError
            If it is no signal of the motion.

        Examples
        --------
        >>> LONGITUDINAL.column("elevator")
        slice(2, 6, 3)
        """
        number = [s.name for s in self.signals].index(signal)
        return slice(number, len(self.parameters), len(self.signals))


LONGITUDINAL: Final = Motion(
    name="longitudinal",
    heading="Longitudinal motion",
    states=(State("alpha", "alpha_rad"), State("q", "q_rad_s")),
    controls=(Control("elevator", "elevator_rad", "elevator_command_rad", "elevator_actuator", "de"),),
    known=("airspeed_m_s", "density_kg_m3", "theta_rad"),
    outputs=(
        Output("alpha", "alpha_rad"),
        Output("q", "q_rad_s"),
        Output("az", "az_m_s2", late=True),
    ),
    coefficients=(
        Coefficient("CL", "lift, along -z", None, -1),
        Coefficient("Cm", "pitching moment, nose up", "chord"),
    ),
    signals=(
        Signal("alpha", "alpha", "alpha_rad"),
        Signal("qhat", "q", "q_rad_s", "chord"),
        Signal("elevator", "de", "elevator_rad"),
    ),
    implicit=("CL", "alpha"),
    gusts=("u", "w"),
    declared=("mass", "inertia_yy", "cg", "thrust_arm"),
    modes=(
        Mode("wn_rad_s", "rad/s", "natural frequency of the short period"),
        Mode("zeta", "-", "damping ratio of the short period"),
    ),
    required=("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad"),
)
"""The short-period motion in the pitch plane."""

LATERAL: Final = Motion(
    name="lateral",
    heading="Lateral-directional motion",
    states=(
        State("beta", "beta_rad"),
        State("p", "p_rad_s"),
        State("r", "r_rad_s"),
        State("phi", "phi_rad"),
    ),
    controls=(
        Control("aileron", "aileron_rad", "aileron_command_rad", "aileron_actuator", "da"),
        Control("rudder", "rudder_rad", "rudder_command_rad", "rudder_actuator", "dr"),
    ),
    known=("airspeed_m_s", "density_kg_m3", "alpha_rad", "theta_rad", "q_rad_s"),
    outputs=(
        Output("beta", "beta_rad"),
        Output("p", "p_rad_s"),
        Output("r", "r_rad_s"),
        Output("phi", "phi_rad"),
        Output("ay", "ay_m_s2", late=True),
    ),
    coefficients=(
        Coefficient("CY", "side force, to the right", None),
        Coefficient("Cl", "rolling moment, right wing down", "span"),
        Coefficient("Cn", "yawing moment, nose right", "span"),
    ),
    signals=(
        Signal("beta", "beta", "beta_rad"),
        Signal("phat", "p", "p_rad_s", "span"),
        Signal("rhat", "r", "r_rad_s", "span"),
        Signal("aileron", "da", "aileron_rad"),
        Signal("rudder", "dr", "rudder_rad"),
    ),
    implicit=("CY", "beta"),
    gusts=("v", "p", "r"),
    declared=("mass", "inertia_xx", "inertia_zz", "inertia_xz", "cg", "cg_y"),
    modes=(
        Mode("dutch_roll_wn_rad_s", "rad/s", "natural frequency of the Dutch roll"),
        Mode("dutch_roll_zeta", "-", "damping ratio of the Dutch roll"),
        Mode("roll_1_s", "1/s", "root of the roll subsidence"),
        Mode("spiral_1_s", "1/s", "root of the spiral"),
    ),
    required=("airspeed_m_s", "p_rad_s", "r_rad_s", "ay_m_s2", "aileron_rad", "rudder_rad"),
)
"""The lateral-directional motion; a log holds beta_rad, or phi_rad or psi_rad from which it is reconstructed."""

MOTIONS: Final[Mapping[str, Motion]] = MappingProxyType({m.name: m for m in (LONGITUDINAL, LATERAL)})
"""Name -> motion, in the order of answers."""


def motion_of(columns: Iterable[str]) -> Motion:
    """The motion whose derivatives are among the columns of a table of estimates; the longitudinal one if none is."""
    names = set(columns)
    return next((m for m in MOTIONS.values() if names.issuperset(m.parameters)), LONGITUDINAL)


def _named(name: str) -> Motion:
    return MOTIONS[name]


__all__ = [
    "LATERAL",
    "LONGITUDINAL",
    "MOTIONS",
    "Coefficient",
    "Control",
    "Derivative",
    "Mode",
    "Motion",
    "Output",
    "Reference",
    "Signal",
    "State",
    "motion_of",
]
