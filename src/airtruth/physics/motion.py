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
from typing import Final

from airtruth.physics.motion_parts import (
    Coefficient,
    Control,
    Declared,
    Derivative,
    Mode,
    Output,
    Signal,
    State,
)


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
    gusts : gust components that enter the motion; the filter estimates the first.
    declared : quantities of aircraft.toml that scale or shift the coefficients.
    modes : modal parameters of the linear model.
    required : columns without which no analysis is possible; air density or altitude is needed beside them.
    forces, incidence : its coefficients together, and its flow angle, in words.
    known_signals : known inputs over which an increment of a coefficient may depend beside the signals.
    unscored : derivatives that a record does not determine; scores leave them out.
    linear : its linear model, in words.
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
    declared: tuple[Declared, ...]
    modes: tuple[Mode, ...]
    required: tuple[str, ...]
    forces: str
    incidence: str
    known_signals: tuple[Signal, ...] = ()
    unscored: tuple[str, ...] = ()
    linear: str = ""

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
    def estimated(self) -> tuple[str, ...]:
        """Names of the derivatives, followed by those of the modal parameters: the columns of tables."""
        return (*self.parameters, *self.modal)

    @cached_property
    def scored(self) -> tuple[str, ...]:
        """Names of the derivatives that scores count."""
        return tuple(name for name in self.parameters if name not in self.unscored)

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
    def surfaces(self) -> tuple[str, ...]:
        """Columns of the controls."""
        return tuple(control.channel for control in self.controls)

    @cached_property
    def commands(self) -> tuple[str, ...]:
        """Columns of the commands of the controls."""
        return tuple(control.command for control in self.controls)

    @cached_property
    def vane(self) -> str:
        """Column of the vane that measures the flow angle."""
        return next(output.channel for output in self.outputs if output.instrument == "vane")

    @cached_property
    def gyros(self) -> tuple[str, ...]:
        """Columns of the angular rates among the outputs."""
        return tuple(output.channel for output in self.outputs if output.instrument == "gyro")

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Columns of outputs and controls."""
        return (*self.output_channels, *self.surfaces)

    @cached_property
    def neutral(self) -> Mapping[str, float]:
        """Declared quantity, or control whose effectiveness is one -> value of an error that changes nothing."""
        return MappingProxyType(
            {d.name: d.neutral for d in self.declared} | {c.name: 1.0 for c in self.controls}
        )

    @cached_property
    def derivative_units(self) -> str:
        """Units of its derivatives in headings: ``1/rad, rates as q c/(2V)``."""
        letters = {"chord": "c", "span": "b"}
        rates = (f"{s.symbol} {letters[s.length]}/(2V)" for s in self.signals if s.length is not None)
        return f"1/rad, rates as {', '.join(rates)}"

    @cached_property
    def inertias(self) -> tuple[str, ...]:
        """Moments and products of inertia that it needs, as aircraft.toml names them."""
        return tuple(
            "inertia_yy" if d.name == "inertia" else d.name
            for d in self.declared
            if d.name.startswith("inertia")
        )

    @cached_property
    def names(self) -> frozenset[str]:
        """Names that a term of an effect may have if it concerns the motion."""
        return frozenset(
            (
                *(c.name for c in self.coefficients),
                *(s.name for s in (*self.signals, *self.known_signals)),
                *self.parameters,
                *self.neutral,
                *self.channels,
                *self.known,
                *(f"sigma_{component}" for component in self.gusts),
                self.flow_rate,
                "qbar",
            )
        )

    @property
    def flow(self) -> str:
        """Signal of the flow angle, whose rate makes the equations implicit."""
        return self.implicit[1]

    @property
    def flow_rate(self) -> str:
        """Signal of the nondimensional rate of the flow angle."""
        return f"{self.flow}_dot_hat"

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

    def at(self, coefficient: str, signal: str) -> int:
        """Position of the derivative of a coefficient with respect to a signal.

        Raises
        ------
        ValueError
            If the motion lacks the coefficient or the signal.

        Examples
        --------
        >>> LONGITUDINAL.at("Cm", "elevator")
        5
        """
        of = [(c.name, s.name) for c in self.coefficients for s in self.signals]
        return of.index((coefficient, signal))

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
    controls=(
        Control("elevator", "elevator_rad", "elevator_command_rad", "elevator_actuator", "de", "q_rad_s"),
    ),
    known=("airspeed_m_s", "density_kg_m3", "theta_rad"),
    outputs=(
        Output("alpha", "alpha_rad", "vane", quantity="angle of attack"),
        Output("q", "q_rad_s", "gyro", quantity="pitch rate"),
        Output("az", "az_m_s2", "accelerometer", late=True, quantity="normal acceleration"),
    ),
    coefficients=(
        Coefficient("CL", "lift, along -z", None, -1),
        Coefficient("Cm", "pitching moment, nose up", "chord"),
    ),
    signals=(
        Signal("alpha", "alpha", "alpha_rad", stated="alpha_rad"),
        Signal("qhat", "q", "q_rad_s", "chord", stated="q_hat"),
        Signal("elevator", "de", "elevator_rad", stated="elevator_rad"),
    ),
    implicit=("CL", "alpha"),
    gusts=("w", "u"),
    declared=(
        Declared("mass", 1.0, divides=("CL",), entry="mass"),
        Declared("inertia", 1.0, divides=("Cm",), entry="inertia_yy"),
        Declared("cg", entry="cg"),
        Declared("thrust_arm"),
    ),
    modes=(
        Mode("wn_rad_s", "rad/s", "natural frequency of the short period"),
        Mode("zeta", "-", "damping ratio of the short period"),
    ),
    required=("airspeed_m_s", "alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad"),
    forces="lift or moment",
    incidence="angle of attack",
    linear="short-period",
)
"""The short-period motion in the pitch plane."""

LATERAL: Final = Motion(
    name="lateral",
    heading="Lateral-directional motion",
    states=(State("beta", "beta_rad"), State("p", "p_rad_s"), State("r", "r_rad_s"), State("phi", "phi_rad")),
    controls=(
        Control("aileron", "aileron_rad", "aileron_command_rad", "aileron_actuator", "da", "p_rad_s"),
        Control("rudder", "rudder_rad", "rudder_command_rad", "rudder_actuator", "dr", "r_rad_s"),
    ),
    known=("airspeed_m_s", "density_kg_m3", "alpha_rad", "theta_rad", "q_rad_s", "ax_m_s2", "az_m_s2"),
    outputs=(
        Output("beta", "beta_rad", "vane", quantity="sideslip"),
        Output("p", "p_rad_s", "gyro", quantity="roll rate"),
        Output("r", "r_rad_s", "gyro", quantity="yaw rate"),
        Output("phi", "phi_rad", "attitude", quantity="bank"),
        Output("ay", "ay_m_s2", "accelerometer", late=True, quantity="side acceleration"),
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
    declared=(
        Declared("mass", 1.0, divides=("CY",), entry="mass"),
        Declared("inertia_xx", 1.0, divides=("Cl",), entry="inertia_xx"),
        Declared("inertia_zz", 1.0, divides=("Cn",), entry="inertia_zz"),
        Declared("inertia_xz", entry="inertia_xz"),
        Declared("cg", entry="cg"),
        Declared("cg_y"),
        Declared("load_y"),
        Declared("yaw_moment"),
    ),
    modes=(
        Mode("dutch_roll_wn_rad_s", "rad/s", "natural frequency of the Dutch roll"),
        Mode("dutch_roll_zeta", "-", "damping ratio of the Dutch roll"),
        Mode("roll_1_s", "1/s", "root of the roll subsidence"),
        Mode("spiral_1_s", "1/s", "root of the spiral"),
    ),
    required=("airspeed_m_s", "p_rad_s", "r_rad_s", "ay_m_s2", "aileron_rad", "rudder_rad"),
    forces="side force or moment",
    incidence="angle of sideslip",
    known_signals=(Signal("alpha", "alpha", "alpha_rad"),),
    unscored=("CYp", "CYda", "Cnda"),
    linear="lateral-directional",
)
"""The lateral-directional motion; a log holds beta_rad, or phi_rad or psi_rad from which it is reconstructed. Of the three
unscored derivatives a record of 10 s leaves a standard deviation of 20 to 100 % at the Cramer-Rao bound (docs/lateral.md)."""

_MOTIONS: Final = {m.name: m for m in (LONGITUDINAL, LATERAL)}
"""The same, which a test may extend."""
MOTIONS: Final[Mapping[str, Motion]] = MappingProxyType(_MOTIONS)
"""Name -> motion, in the order of answers."""


VANES: Final = frozenset(motion.vane for motion in MOTIONS.values())
"""Columns of the vanes of every motion."""


FOLDERS: Final = ("", *list(MOTIONS)[1:])
"""Folders of the answers of several motions within that of a command; the first motion that is answered has none of its own."""


def motion_with(outputs: Iterable[str]) -> Motion:
    """The motion with most of some outputs; the longitudinal one of none.

    Examples
    --------
    >>> motion_with(["p_rad_s", "r_rad_s"]).name
    'lateral'
    """
    names = set(outputs)
    return max(MOTIONS.values(), key=lambda motion: len(names & set(motion.output_channels)))


def motion_of(columns: Iterable[str]) -> Motion:
    """The motion whose derivatives are among the columns of a table of estimates; the longitudinal one if none is."""
    names = set(columns)
    return next((m for m in MOTIONS.values() if names.issuperset(m.parameters)), LONGITUDINAL)


def _named(name: str) -> Motion:
    return MOTIONS[name]


__all__ = ["FOLDERS", "LATERAL", "LONGITUDINAL", "MOTIONS", "VANES", "Motion", "motion_of", "motion_with"]
