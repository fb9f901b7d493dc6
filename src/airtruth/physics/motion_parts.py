"""Parts of the description of a motion (`airtruth.physics.motion`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
    damped : column of the angular rate that a damper feeds back to it.
    """

    name: str
    channel: str
    command: str
    actuator: str
    symbol: str
    damped: str


@dataclass(frozen=True)
class Output:
    """A measured output of the motion.

    Attributes
    ----------
    name : short name.
    channel : column of the flight log.
    instrument : name of its sensor in the names of errors.
    late : whether it needs the accelerations of the motion; the filter updates with the other outputs first.
    quantity : in words.
    """

    name: str
    channel: str
    instrument: str
    late: bool = False
    quantity: str = ""


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
    stated : its name in answers; empty for ``name``.
    """

    name: str
    symbol: str
    channel: str
    length: Reference | None = None
    stated: str = ""

    @property
    def unit(self) -> str:
        """Unit of a derivative with respect to the signal."""
        return "1/rad" if self.length is None else "-"


@dataclass(frozen=True)
class Declared:
    """A quantity of aircraft.toml beside the derivatives.

    Attributes
    ----------
    name : of the quantity in terms of effects.
    neutral : value of an error that changes nothing: 1 of a factor, 0 of a shift.
    divides : coefficients that a factor on it divides: mass the forces, an inertia its moment.
    entry : its entry in the table [mass] of aircraft.toml; empty for none.
    """

    name: str
    neutral: float = 0.0
    divides: tuple[str, ...] = ()
    entry: str = ""


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


def reference_length_m(constants: object, length: Reference | None) -> float:
    """Reference length of a moment or a rate of an aircraft [m]; 1 for a force or an angle, which have none.

    Parameters
    ----------
    constants : of the aircraft, with one attribute for each reference length.
    """
    return 1.0 if length is None else float(getattr(constants, f"{length}_m"))


__all__ = [
    "Coefficient",
    "Control",
    "Declared",
    "Derivative",
    "Mode",
    "Output",
    "Reference",
    "Signal",
    "State",
    "reference_length_m",
]
