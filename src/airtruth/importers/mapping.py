"""The mapping file: which column of a foreign file is which channel, in which unit and with which sign."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any, Final, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from airtruth.channels import ATTITUDE, SIGNALS
from airtruth.documents import read_toml
from airtruth.errors import ConfigurationError, choices
from airtruth.importers.channel_table import (
    TIME_UNITS,
    AttitudeTable,
    BodyVelocity,
    Channel,
    Clock,
    ColumnKey,
    Place,
    RecordConstant,
    Unit,
    unit_factor,
)
from airtruth.physics.motion import LONGITUDINAL, MOTIONS
from airtruth.quantity import Strict, explain

CONSTANTS: Final[dict[str, str]] = {
    "mass_kg": "mass",
    "inertia_yy_kg_m2": "inertia",
    "wing_area_m2": "area",
    "chord_m": "length",
    "cg_mac": "ratio",
}
"""Facts of a record that a mapping may state: name -> dimension."""
AIRSPEEDS: Final = (
    "dynamic_pressure_pa",
    "indicated_airspeed_m_s",
    "calibrated_airspeed_m_s",
    "equivalent_airspeed_m_s",
)
"""Quantities from which the true airspeed is computed."""
DERIVED: Final[dict[str, str]] = {
    "dynamic_pressure_pa": "pressure",
    "indicated_airspeed_m_s": "speed",
    "calibrated_airspeed_m_s": "speed",
    "equivalent_airspeed_m_s": "speed",
    "height_m": "length",
    "static_pressure_pa": "pressure",
    "air_temperature_k": "temperature",
}
"""Quantities that a mapping may state instead of a channel, which is computed from them: name -> dimension."""
MAPPED: Final[dict[str, str]] = {
    **{name: signal.dimension for name, signal in SIGNALS.items()},
    **DERIVED,
}
"""Every name below [channels] -> dimension."""
METHODS: Final = ("linear", "cubic", "previous")
"""Interpolations onto a uniform time base that a mapping may choose."""


class SourceSection(Strict):
    """How the file is read; only what its format has use for.

    format : left out, the suffix says it. variable : matrix that column numbers refer to (.mat).
    structs : structs of one layout, each of which becomes a run; columns are named within them (.mat, .h5).
    delimiter, decimal, skip_rows, header, encoding : of text; header = false
        numbers the columns, an encoding that is left out is recognised.
    """

    format: Literal["csv", "table", "mat", "parquet", "ulg", "dataflash", "mdf", "hdf5"] | None = None
    variable: str | None = None
    structs: tuple[str, ...] = ()
    delimiter: str = ","
    decimal: Literal[".", ","] = "."
    skip_rows: int = Field(default=0, ge=0)
    header: bool | None = None
    encoding: Literal["utf-8", "utf-16", "windows-1252"] | None = None

    @field_validator("structs")
    @classmethod
    def _each_once(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        twice = sorted({name for name in value if value.count(name) > 1})
        if twice:
            raise ValueError(f"{twice[0]!r} is given twice; name each struct once")
        return value

    @field_validator("delimiter")
    @classmethod
    def _divides_cells(cls, value: str) -> str:
        if len(value) != 1 or value.isalnum() or value in "\"'\r\n.+- ":
            raise ValueError(
                f'{value!r} cannot divide cells; write one character such as , ; | or "\\t", '
                'or format = "table" for columns between blanks'
            )
        return value


class TimeSection(Strict):
    """Times of samples: a column, or a rate; run: a column that names the run of each row."""

    column: ColumnKey | None = None
    variable: str | None = None
    unit: Unit = "s"
    rate_hz: float | None = Field(default=None, gt=0.0)
    run: ColumnKey | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if self.column is not None and self.rate_hz is not None:
            raise ValueError("state column or rate_hz, not both; another rate is asked for in [resample]")
        unit_factor("time", self.unit)
        return self


class Resample(Strict):
    """A uniform rate that all channels are brought to, and how values between samples are made."""

    rate_hz: float = Field(gt=0.0)
    method: Literal["linear", "cubic", "previous"]


class Align(Strict):
    """Clock of a file that is merged with another one.

    offset_s, std_s : declared offset, added to the times of this file, and its standard deviation [s].
    channel : channel of both files, by whose cross-correlation the offset is estimated.
    """

    offset_s: float | None = None
    std_s: float = Field(default=0.0, ge=0.0)
    channel: str | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if (self.offset_s is None) == (self.channel is None):
            raise ValueError("state one of offset_s (with std_s) or channel")
        return self


class Reconstruct(Strict):
    """Channels that are computed from others where the aircraft has no sensor for them.

    alpha : angle of attack from inertial measurements and airspeed. The others are standard deviations of the errors
    that this assumes: constant errors of az and q, and a relative error of the airspeed.
    """

    alpha: bool = False
    az_bias_m_s2: float = Field(default=0.1, gt=0.0)
    q_bias_deg_s: float = Field(default=0.2, gt=0.0)
    airspeed_error: float = Field(default=0.02, gt=0.0)


class ManoeuvreSpan(Strict):
    """A part of the file that becomes a run; times on the file's own clock [s]."""

    run_id: str = Field(min_length=1)
    start_s: float
    end_s: float

    @model_validator(mode="after")
    def _forward(self) -> Self:
        if self.end_s <= self.start_s:
            raise ValueError(f"end_s {self.end_s:g} is not after start_s {self.start_s:g}")
        return self


class MappingFile(Strict):
    """MAP.toml; see docs/measured.md."""

    schema_: Literal[1] = Field(default=1, alias="schema")
    aircraft: str = ""
    run_id: str = ""
    source: SourceSection = SourceSection()
    time: TimeSection = TimeSection()
    resample: Resample | None = None
    align: Align | None = None
    reconstruct: Reconstruct = Reconstruct()
    attitude: AttitudeTable | None = None
    body_velocity: BodyVelocity | None = None
    channels: dict[str, Channel]
    constants: dict[str, RecordConstant] = Field(default_factory=dict)
    manoeuvre: tuple[ManoeuvreSpan, ...] = ()

    @field_validator("channels")
    @classmethod
    def _known_channels(cls, value: dict[str, Channel]) -> dict[str, Channel]:
        _units_of(value, MAPPED, "channel")
        for name, channel in value.items():
            if name == "height_m" and channel.reference_m is None:
                raise ValueError(
                    "height_m: state reference_m, the elevation above sea level of the point from which it counts [m] (0 "
                    "for a height above sea level); the density is 1 % wrong for each 100 m"
                )
            if name != "height_m" and channel.reference_m is not None:
                raise ValueError(f"{name}: reference_m belongs to height_m; leave it out")
        return value

    @field_validator("constants")
    @classmethod
    def _known_constants(cls, value: dict[str, RecordConstant]) -> dict[str, RecordConstant]:
        _units_of(value, CONSTANTS, "constant")
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        names = [m.run_id for m in self.manoeuvre]
        repeated = sorted({n for n in names if names.count(n) > 1})
        if repeated:
            raise ValueError(f"manoeuvre: run_id {', '.join(map(repr, repeated))} is given twice")
        if self.manoeuvre and self.time.run is not None:
            raise ValueError("[time] run and [[manoeuvre]] both divide the file into runs; keep one")
        if len(self.source.structs) > 1 and (self.manoeuvre or self.time.run is not None):
            other = "[[manoeuvre]]" if self.manoeuvre else "[time] run"
            raise ValueError(f"[source] structs and {other} both divide the file into runs; keep one")
        self._require_one_origin()
        self._require_own_surfaces()
        clocked = [f"channels.{name}" for name, channel in self.channels.items() if channel.clock]
        clocked += ["attitude"] if self.attitude and self.attitude.clock else []
        clocked += ["body_velocity"] if self.body_velocity and self.body_velocity.clock else []
        if clocked and self.resample is None:
            raise ValueError(
                f"{clocked[0]} has a clock of its own; state [resample] rate_hz and method "
                f"({', '.join(METHODS)})"
            )
        return self

    def _require_one_origin(self) -> None:
        """Refuse a channel that the mapping states in two ways."""
        given = self.channels.keys()
        speeds = [name for name in ("airspeed_m_s", *AIRSPEEDS) if name in given]
        if len(speeds) > 1:
            raise ValueError(f"channels.{speeds[1]} is used instead of {speeds[0]}; keep one of the two")
        if "height_m" in given and "altitude_m" in given:
            raise ValueError("channels.height_m is used instead of altitude_m; keep one of the two")
        if "static_pressure_pa" in given and {"height_m", "altitude_m"} & given:
            raise ValueError(
                "channels.static_pressure_pa gives altitude_m; keep it, or altitude_m (height_m)"
            )
        if "air_temperature_k" in given and "density_kg_m3" in given:
            raise ValueError("channels.air_temperature_k gives density_kg_m3; keep one of the two")
        if self.reconstruct.alpha and LONGITUDINAL.vane in given:
            raise ValueError(
                "[reconstruct] alpha replaces a missing vane; leave channels.alpha_rad out, or it"
            )
        angles = [name for name in ATTITUDE if name in given]
        if self.attitude is not None and angles:
            raise ValueError(f"channels.{angles[0]} is computed from [attitude]; keep one of the two")
        if self.body_velocity is None:
            return
        if speeds and LONGITUDINAL.vane in given:
            raise ValueError(
                f"[body_velocity] gives airspeed_m_s and alpha_rad, and channels.{speeds[0]} and channels.alpha_rad are "
                "stated; leave one out"
            )
        if self.reconstruct.alpha:
            raise ValueError(
                "[reconstruct] alpha and [body_velocity] both give alpha_rad; keep one of the two"
            )

    def _require_own_surfaces(self) -> None:
        """Refuse two surfaces of one combination of two columns: of elevons or a V-tail one of them holds the other motion."""
        for names in itertools.combinations((name for m in MOTIONS.values() for name in m.surfaces), 2):
            pair = [self.channels[name] for name in names if name in self.channels]
            if len(pair) < 2 or pair[0].calibration != pair[1].calibration or len(pair[0].places) != 2:
                continue
            one, other = (dict(zip(c.places, c.weights or (0.5, 0.5), strict=True)) for c in pair)
            left, right = one
            if one.keys() == other.keys() and one[left] * other[right] == one[right] * other[left]:
                raise ValueError(
                    f"channels.{names[1]} is a multiple of channels.{names[0]}: both weigh {left.column!r} and {right.column!r} "
                    "alike; reverse the sign of one weight of the channel that is wrong"
                )


def _units_of(table: dict[str, Any], dimensions: dict[str, str], what: str) -> None:
    wrong = []
    for name, entry in table.items():
        if name not in dimensions:
            wrong.append(f"{name!r} is not a {what}; {choices(name, dimensions)}")
            continue
        try:
            unit_factor(dimensions[name], entry.unit)
        except ValueError as error:
            wrong.append(f"{name}: {error}")
    if wrong:
        raise ValueError("; ".join(wrong))


def read_mapping(path: Path | str) -> MappingFile:
    """Read and validate a mapping file.

    Raises
    ------
    ConfigurationError
        With every problem of the file, not only the first.
    """
    path = Path(path)
    raw = read_toml(path, ConfigurationError, "`airtruth import --guess FILE` proposes a mapping")
    try:
        return MappingFile.model_validate(raw)
    except ValidationError as error:
        problems = "\n  ".join(explain(error, MappingFile))
        raise ConfigurationError(f"{path}:\n  {problems}") from None


__all__ = [
    "AIRSPEEDS",
    "CONSTANTS",
    "DERIVED",
    "MAPPED",
    "TIME_UNITS",
    "Align",
    "AttitudeTable",
    "BodyVelocity",
    "Channel",
    "Clock",
    "ManoeuvreSpan",
    "MappingFile",
    "Place",
    "Reconstruct",
    "RecordConstant",
    "Resample",
    "read_mapping",
    "unit_factor",
]
