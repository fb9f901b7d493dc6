"""The mapping file: which column of a foreign file is which channel, in which unit and with which sign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, field_validator, model_validator

from airtruth.channels import SIGNALS
from airtruth.documents import read_toml
from airtruth.errors import ConfigurationError, choices
from airtruth.quantity import Strict, explain
from airtruth.units import UNITS

CONSTANTS: Final[dict[str, str]] = {
    "mass_kg": "mass",
    "inertia_yy_kg_m2": "inertia",
    "wing_area_m2": "area",
    "chord_m": "length",
    "cg_mac": "ratio",
}
"""Facts of a record that a mapping may state: name -> dimension."""
DERIVED: Final[dict[str, str]] = {"dynamic_pressure_pa": "pressure"}
"""Quantities that a mapping may state instead of a channel, which is computed from them: name -> dimension."""
TIME_UNITS: Final = {**UNITS["time"], "us": 1e-6}
"""Units of a time column -> factor to seconds [s]."""
METHODS: Final = ("linear", "cubic", "previous")
"""Interpolations onto a uniform time base that a mapping may choose."""


def _from_one(column: str | int) -> str | int:
    if isinstance(column, int) and column < 1:
        raise ValueError("columns are counted from 1")
    return column


ColumnKey = Annotated[str | int, Field(union_mode="left_to_right"), AfterValidator(_from_one)]


def _without_slashes(unit: Any) -> Any:
    """ "deg/s", "m/s^2" as "deg_s", "m_s2"; "1" and "-" as no unit."""
    if not isinstance(unit, str):
        return unit
    plain = unit.strip().lower().replace("^", "").replace("**", "").replace("²", "2").replace("³", "3")
    for sign in ("/", " ", "*", "·"):
        plain = plain.replace(sign, "_")
    return {"1": "", "-": "", "%": "pct", "feet": "ft", "knots": "kt", "kts": "kt", "kn": "kt"}.get(
        plain, plain
    )


Unit = Annotated[str, BeforeValidator(_without_slashes)]


def unit_factor(dimension: str, unit: str) -> float:
    """Factor from a unit to SI.

    Raises
    ------
    ValueError
        Listing the units of the dimension.
    """
    units = TIME_UNITS if dimension == "time" else UNITS[dimension]
    if unit not in units:
        owner = next((d for d, table in UNITS.items() if unit in table), None)
        what = f"a unit of {owner.replace('_', ' ')}" if owner else "not a known unit"
        raise ValueError(
            f"unit {unit!r} is {what}, where {dimension.replace('_', ' ')} is wanted; "
            f"use one of {', '.join(u or '(none)' for u in units)}"
        )
    return units[unit]


class Place(Strict):
    """Where values lie in a file.

    column: a name, or a number counted from 1; a struct field is a path, "imu.q". variable: the matrix
    whose column is meant (.mat, or [source] variable).
    """

    column: ColumnKey
    variable: str | None = None


class Clock(Place):
    """Times of samples; offset_s is added to them."""

    unit: Unit = "s"
    offset_s: float = 0.0

    @field_validator("unit")
    @classmethod
    def _time_unit(cls, value: str) -> str:
        unit_factor("time", value)
        return value


class Channel(Strict):
    """One channel: sign * factor(unit) * (scale * raw + offset), offset in the unit of the file.

    columns : several columns, of which the mean is taken (surfaces), in place of column.
    value : a constant in place of a column.
    clock : times of this channel where they are not those of [time]; asks for [resample].
    """

    column: ColumnKey | None = None
    columns: tuple[ColumnKey, ...] = ()
    variable: str | None = None
    value: float | None = None
    unit: Unit
    sign: Literal[1, -1] = 1
    scale: float = 1.0
    offset: float = 0.0
    clock: Clock | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        given = (self.column is not None) + bool(self.columns) + (self.value is not None)
        if given != 1:
            raise ValueError("state one of column, columns or value")
        return self

    @property
    def places(self) -> tuple[Place, ...]:
        """Columns that are read."""
        keys = self.columns or ((self.column,) if self.column is not None else ())
        return tuple(Place(column=key, variable=self.variable) for key in keys)


class Constant(Strict):
    """A fact of a record: a number above 0, or a column whose mean over the run is taken."""

    column: ColumnKey | None = None
    variable: str | None = None
    value: float | None = Field(default=None, gt=0.0)
    unit: Unit

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if (self.column is None) == (self.value is None):
            raise ValueError("state one of column or value")
        return self


class SourceSection(Strict):
    """How the file is read; only what its format has use for.

    format : left out, the suffix says it. variable : matrix that column numbers refer to (.mat).
    delimiter, decimal, skip_rows, header : of text; header = false numbers the columns.
    """

    format: Literal["csv", "table", "mat", "parquet", "ulg", "dataflash", "mdf", "hdf5"] | None = None
    variable: str | None = None
    delimiter: str = ","
    decimal: Literal[".", ","] = "."
    skip_rows: int = Field(default=0, ge=0)
    header: bool | None = None

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


class Manoeuvre(Strict):
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
    channels: dict[str, Channel]
    constants: dict[str, Constant] = Field(default_factory=dict)
    manoeuvre: tuple[Manoeuvre, ...] = ()

    @field_validator("channels")
    @classmethod
    def _known_channels(cls, value: dict[str, Channel]) -> dict[str, Channel]:
        _units_of(
            value, {**{name: signal.dimension for name, signal in SIGNALS.items()}, **DERIVED}, "channel"
        )
        return value

    @field_validator("constants")
    @classmethod
    def _known_constants(cls, value: dict[str, Constant]) -> dict[str, Constant]:
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
        if "dynamic_pressure_pa" in self.channels and "airspeed_m_s" in self.channels:
            raise ValueError(
                "channels.dynamic_pressure_pa is used instead of airspeed_m_s; keep one of the two"
            )
        if self.reconstruct.alpha and "alpha_rad" in self.channels:
            raise ValueError(
                "[reconstruct] alpha replaces a missing vane; leave channels.alpha_rad out, or it"
            )
        clocked = [name for name, channel in self.channels.items() if channel.clock]
        if clocked and self.resample is None:
            raise ValueError(
                f"channels.{clocked[0]} has a clock of its own; state [resample] rate_hz and method "
                f"({', '.join(METHODS)})"
            )
        return self


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
    "CONSTANTS",
    "DERIVED",
    "TIME_UNITS",
    "Align",
    "Channel",
    "Clock",
    "Constant",
    "Manoeuvre",
    "MappingFile",
    "Place",
    "Reconstruct",
    "Resample",
    "read_mapping",
    "unit_factor",
]
