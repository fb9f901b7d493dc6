"""An aircraft: a folder with aircraft.toml and, usually, a JSBSim model."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from airtruth import quantity as qt
from airtruth.aircraft.model import JsbsimModel
from airtruth.aircraft.parts import Fin, Tail, Wing
from airtruth.aircraft.probe import Constants
from airtruth.channels import SIGNALS
from airtruth.errors import choices
from airtruth.physics import terms
from airtruth.physics.motion import MOTIONS, Motion
from airtruth.physics.sensor_errors import KINDS, SensorErrors
from airtruth.physics.terms import AeroTerm, ReadingTerm, StateTerm, SurfaceTerm
from airtruth.quantity import Quantity, Strict

DERIVATIVES: Final = tuple(name for motion in MOTIONS.values() for name in motion.parameters)
"""Names in the table [derivatives]."""
FILE: Final = "aircraft.toml"
"""Name of the file that makes a folder an aircraft."""

AIRSPEED: Final = "airspeed_m_s"
"""The channel whose sensor may have a position error."""
_SENSOR_DIMENSIONS: Final = {kind.key: kind.dimension for kind in KINDS.values() if kind.dimension}
"""Dimension of a sensor's entry where it is not that of its channel."""


class Sensor(Strict):
    """How one channel is measured; every quantity in SI of the channel.

    noise_std: white, one sample to the next [unit of the channel]; bias, quantum, minimum, maximum
    likewise; scale: factor [-]; lag: time constant [s]; delay, hold (sample and hold) [s];
    x, y, z: position ahead of, right of and below the CG [m] (vane, accelerometer); alpha_slope: relative change of the
    airspeed with the angle of attack about its mean [1/rad].
    """

    noise_std: Quantity = Quantity(value=0.0)
    bias: Quantity = Quantity(value=0.0)
    scale: Quantity = Quantity(value=1.0)
    lag: Quantity = Quantity(value=0.0)
    delay: Quantity = Quantity(value=0.0)
    hold: Quantity = Quantity(value=0.0)
    quantum: Quantity = Quantity(value=0.0)
    minimum: Quantity | None = None
    maximum: Quantity | None = None
    x: Quantity = Quantity(value=0.0)
    y: Quantity = Quantity(value=0.0)
    z: Quantity = Quantity(value=0.0)
    alpha_slope: Quantity = Quantity(value=0.0)

    _checked = field_validator(*(kind.key for kind in KINDS.values() if not kind.may_be_negative))(
        qt.not_negative
    )

    @model_validator(mode="after")
    def _ordered(self) -> Sensor:
        qt.require_order(self.minimum, self.maximum)
        return self

    def errors(self) -> SensorErrors:
        """The errors as numbers in SI, without their uncertainties and sources."""
        stated = {kind.field: getattr(self, kind.key) for kind in KINDS.values()}
        return SensorErrors(**{name: entry.value for name, entry in stated.items() if entry is not None})


class Actuator(Strict):
    """First-order servo of a control surface; the delay counts from command to surface."""

    bandwidth: qt.Frequency
    rate_limit: qt.Rate
    minimum: qt.Angle
    maximum: qt.Angle
    delay: qt.Time = Quantity(value=0.0)

    _checked = field_validator("delay")(qt.not_negative)

    @model_validator(mode="after")
    def _possible(self) -> Actuator:
        qt.require_positive(self, ("bandwidth", "rate_limit"))
        qt.require_order(self.minimum, self.maximum)
        return self


class Geometry(Strict):
    """Reference lengths and areas."""

    wing_area: qt.Area
    chord: qt.Length
    span: qt.Length

    @model_validator(mode="after")
    def _positive(self) -> Geometry:
        qt.require_positive(self, type(self).model_fields)
        return self


class MassProperties(Strict):
    """Mass, inertias about the CG, and CG behind the leading edge of the MAC as a fraction of it.

    inertia_xx, inertia_zz and inertia_xz, the integral of x z dm, serve the lateral-directional motion.
    """

    mass: qt.Mass
    inertia_yy: qt.Inertia
    cg: qt.Ratio = Quantity(value=0.25)
    inertia_xx: qt.Inertia | None = None
    inertia_zz: qt.Inertia | None = None
    inertia_xz: qt.Inertia | None = None

    @model_validator(mode="after")
    def _positive(self) -> MassProperties:
        qt.require_positive(self, ("mass", "inertia_yy", "inertia_xx", "inertia_zz"))
        return self


class Dynamics(Strict):
    """Dynamics of the JSBSim model that its forces in a steady state do not show; a trace adds them to its filter.

    `airtruth trace` writes them into an updated aircraft. surface: terms between the measured surface and the air, in
    sequence; states: lags, modes and plays; aero: increments of coefficients whose signal is alpha_dot c/(2V),
    beta_dot b/(2V) or a state; readings: increments of what the sensors read, which campaigns fly as well.
    """

    surface: tuple[SurfaceTerm, ...] = ()
    states: tuple[StateTerm, ...] = ()
    aero: tuple[AeroTerm, ...] = ()
    readings: tuple[ReadingTerm, ...] = ()

    @model_validator(mode="after")
    def _positive(self) -> Dynamics:
        values = [(f"surface {t.kind}: value", t.value) for t in self.surface]
        values += [
            (f"state {t.name}: half_width", t.half_width)
            if t.kind == "play"
            else (f"state {t.name}: time_s", t.time_s)
            for t in self.states
        ]
        for name, value in values:
            if value <= 0.0:
                raise ValueError(f"{name} has to be above 0 (is {value:g})")
        return self

    @model_validator(mode="after")
    def _named(self) -> Dynamics:
        controls = tuple(c.name for m in MOTIONS.values() for c in m.controls)
        named: list[tuple[str, str, tuple[str, ...]]]
        named = [(f"surface {t.kind}: control", t.control, controls) for t in self.surface]
        for s in self.states:
            of = terms.factors_of if s.kind == "play" else terms.drivers_of
            named.append((f"state {s.name}: signal", s.signal, _of_any(of)))
        for t in self.aero:
            named.append(("aero: coefficient", t.coefficient, _of_any(terms.coefficients_of)))
            motion = next((m for m in MOTIONS.values() if t.coefficient in terms.coefficients_of(m)), None)
            if motion is not None:
                signals = (*terms.signals_of(motion), *self._states_of(terms.drivers_of(motion)))
                named.append((f"aero {t.coefficient}: signal", t.signal, signals))
                named.append((f"aero {t.coefficient}: factor", t.factor, ("", *terms.factors_of(motion))))
        for r in self.readings:
            named.append(("readings: channel", r.channel, tuple(sorted(terms.OUTPUTS))))
            motion = next((m for m in MOTIONS.values() if r.channel in m.output_channels), None)
            if motion is not None:
                signals = terms.measured_of(motion)
                measured = self._states_of(signals)
                named.append((f"readings {r.channel}: signal", r.signal, (*signals, *measured)))
                named.append((f"readings {r.channel}: behind", r.behind, ("", *measured)))
        for name, value, allowed in named:
            if value not in allowed:
                known = [n for n in allowed if n]
                raise ValueError(
                    f"{name} {value!r}: {choices(value, known) if known else 'declare it in states'}"
                )
        return self

    def _states_of(self, signals: tuple[str, ...]) -> tuple[str, ...]:
        """Names of the states that one of some signals drives."""
        return tuple(s.name for s in self.states if s.signal in signals)


def _of_any(of: Callable[[Motion], tuple[str, ...]]) -> tuple[str, ...]:
    """Names of all motions, each once."""
    return tuple(dict.fromkeys(name for motion in MOTIONS.values() for name in of(motion)))


class AircraftFile(Strict):
    """aircraft.toml.

    derivatives: those of any motion about the CG, by their names (`airtruth.physics.motion`), with their
    uncertainty. Where there is a JSBSim model its own values count, and only the ratio std/value is taken from here.
    """

    schema_: Literal[1] = Field(default=1, alias="schema")
    name: str = Field(pattern=r"^[A-Za-z0-9_.-]+$")
    description: str = ""
    geometry: Geometry | None = None
    mass: MassProperties | None = None
    tail: Tail | None = None
    fin: Fin | None = None
    wing: Wing | None = None
    jsbsim: JsbsimModel | None = None
    elevator_actuator: Actuator | None = None
    aileron_actuator: Actuator | None = None
    rudder_actuator: Actuator | None = None
    dynamics: Dynamics | None = None
    derivatives: dict[str, qt.Ratio] = Field(default_factory=dict)
    sensors: dict[str, Sensor] = Field(default_factory=dict)

    @field_validator("derivatives")
    @classmethod
    def _known_derivatives(cls, value: dict[str, Quantity]) -> dict[str, Quantity]:
        for name in value:
            if name not in DERIVATIVES:
                raise ValueError(f"{name!r} is not a derivative; {choices(name, DERIVATIVES)}")
        control = value.get("Cmde")
        if control is not None and control.value > 0.0:
            raise ValueError(
                f"Cmde has to be below 0 (is {control.value:g}): a trailing edge down, which is positive, pitches the nose down; "
                "for a canard state elevator_rad and its derivatives positive with the trailing edge up"
            )
        return value

    @field_validator("sensors", mode="before")
    @classmethod
    def _sensors_in_si(cls, raw: Any) -> Any:
        if not isinstance(raw, dict):
            return raw
        return {name: sensor_tables(name, table) for name, table in raw.items()}


def sensor_tables(channel: str, raw: Any) -> Any:
    """Turn the quantity tables of one sensor into SI of its channel.

    Raises
    ------
    ValueError
        If the channel is unknown, or a unit is of another dimension.
    """
    if channel not in SIGNALS:
        raise ValueError(f"{channel!r} is not a channel; {choices(channel, SIGNALS)}")
    if not isinstance(raw, dict):
        return raw
    dimension = SIGNALS[channel].dimension
    result = {}
    for key, table in raw.items():
        if key not in Sensor.model_fields:
            result[key] = table
            continue
        if key == "alpha_slope" and channel != AIRSPEED:
            raise ValueError(
                f"{channel}.{key}: only {AIRSPEED} has a slope over the angle of attack; delete the entry"
            )
        try:
            result[key] = qt.table_in(_SENSOR_DIMENSIONS.get(key, dimension), table)
        except ValidationError as error:
            raise ValueError(f"{channel}.{key}: {'; '.join(qt.explain(error, Quantity))}") from None
        except ValueError as error:
            raise ValueError(f"{channel}.{key}: {error}") from None
    return result


class Aircraft(Strict):
    """An aircraft that was read and checked.

    Attributes
    ----------
    folder : folder of aircraft.toml.
    file : its content.
    constants : geometry and mass; from aircraft.toml, or else as the JSBSim model has them.
    """

    folder: Path
    file: AircraftFile
    constants: Constants

    def __repr__(self) -> str:
        """Return name, folder and constants in a line."""
        return (
            f"Aircraft({self.name}: mass {self.mass_kg:.4g} kg, wing {self.wing_area_m2:.4g} m2, chord {self.chord_m:.4g} m, "
            f"inertia {self.inertia_yy_kg_m2:.4g} kg m2; {self.folder})"
        )

    @property
    def name(self) -> str:
        """Name of the aircraft, as logs state it."""
        return self.file.name

    @property
    def wing_area_m2(self) -> float:
        """Reference area S [m2]."""
        return self.constants.wing_area_m2

    @property
    def chord_m(self) -> float:
        """Mean aerodynamic chord c [m]."""
        return self.constants.chord_m

    @property
    def mass_kg(self) -> float:
        """Mass [kg]."""
        return self.constants.mass_kg

    @property
    def inertia_yy_kg_m2(self) -> float:
        """Pitch inertia about the CG [kg m2]."""
        return self.constants.inertia_yy_kg_m2

    @property
    def servo_time_s(self) -> float:
        """Time constant of the elevator's servo [s]; 0 where none is declared."""
        servo = self.file.elevator_actuator
        return 0.0 if servo is None else 1.0 / (2.0 * math.pi * servo.bandwidth.value)


__all__ = ["FILE", "Actuator", "Aircraft", "AircraftFile", "Sensor", "sensor_tables"]
