"""The tables of a mapping that say what a column holds: its place, its unit, its sign and its times."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, Self, cast

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from airtruth.quantity import Strict
from airtruth.units import UNITS

TIME_UNITS: Final = {**UNITS["time"], "us": 1e-6, "ns": 1e-9}
"""Units of a time column -> factor to seconds [s]."""
_SPELLINGS: Final = {
    "1": "", "-": "", "%": "pct",
    "feet": "ft", "fps": "ft_s", "knots": "kt", "kts": "kt", "kn": "kt", "meters": "m", "metres": "m",
    "°": "deg", "°_s": "deg_s", "degrees": "deg", "radians": "rad", "centideg": "cdeg", "°c": "degc", "°f": "degf",
    "seconds": "s", "milliseconds": "ms", "microseconds": "us", "µs": "us", "mb": "mbar", "millibar": "mbar",
}  # fmt: skip
"""Other spelling of a unit -> its key in `airtruth.units.UNITS`."""


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
    return _SPELLINGS.get(plain, plain)


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


Points = tuple[tuple[float, float], ...]
"""Points (raw, value in the unit of the channel) of a calibration."""


class Channel(Strict):
    """One channel: sign * factor(unit) * (scale * sum(weight * calibrated column) + offset), offset in the unit of the file.

    columns : several columns in place of column; the mean is taken, or the sum with the weights.
    weights : one for each of columns: [0.5, -0.5] is half the difference.
    calibration : points [raw, value], between and beyond which a column is linear; one list for all columns, or one for
        each of them.
    value : a constant in place of a column.
    reference_m : elevation above sea level of the point from which a height counts; height_m alone has it.
    clock : times of this channel where they are not those of [time]; asks for [resample].
    """

    column: ColumnKey | None = None
    columns: tuple[ColumnKey, ...] = ()
    weights: tuple[float, ...] = ()
    calibration: Points | tuple[Points, ...] = ()
    variable: str | None = None
    value: float | None = None
    unit: Unit
    sign: Literal[1, -1] = 1
    scale: float = 1.0
    offset: float = 0.0
    reference_m: float | None = None
    clock: Clock | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        given = (self.column is not None) + bool(self.columns) + (self.value is not None)
        if given != 1:
            raise ValueError("state one of column, columns or value")
        if self.weights and len(self.weights) != len(self.columns):
            raise ValueError(
                f"weights has {len(self.weights)} numbers and columns {len(self.columns)} names; state one weight for each "
                "of columns"
            )
        if self.weights and not any(self.weights):
            raise ValueError("weights are all 0, so no column is used; write for example [0.5, -0.5]")
        return self

    @model_validator(mode="after")
    def _calibrated(self) -> Self:
        if self.calibration and self.value is not None:
            raise ValueError("calibration converts columns; with value leave it out")
        each = self.calibrations
        if self._several and len(each) != len(self.places):
            raise ValueError(
                f"calibration has {len(each)} lists and the channel {len(self.places)} columns; state one list of points, or "
                "one for each column"
            )
        for points in each:
            raw = [point[0] for point in points]
            if len(points) < 2 or len(set(raw)) < len(raw):
                raise ValueError(
                    "calibration needs two or more points with different raw values, as [[1100, -25], [1500, 0], [1900, 25]]"
                )
        return self

    @property
    def places(self) -> tuple[Place, ...]:
        """Columns that are read."""
        keys = self.columns or ((self.column,) if self.column is not None else ())
        return tuple(Place(column=key, variable=self.variable) for key in keys)

    @property
    def calibrations(self) -> tuple[Points, ...]:
        """Points for each column, by increasing raw value; () without a calibration."""
        if not self.calibration:
            return ()
        one, each = cast(Points, self.calibration), cast(tuple[Points, ...], self.calibration)
        return tuple(tuple(sorted(p)) for p in (each if self._several else (one,) * len(self.places)))

    @property
    def _several(self) -> bool:
        """Whether each column has a calibration of its own."""
        return bool(self.calibration) and isinstance(self.calibration[0][0], tuple)


class RecordConstant(Strict):
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


class AttitudeTable(Strict):
    """A quaternion of the attitude, from which theta_rad, phi_rad and psi_rad are computed.

    quaternion : four columns, the scalar first ("wxyz") or last ("xyzw").
    frame : "ned" where it relates body axes forward, right, down to north, east, down; "enu" where it relates body axes
        forward, left, up to east, north, up (ROS REP 103).
    rotates : "body_to_earth", or "earth_to_body" for its conjugate.
    """

    quaternion: tuple[ColumnKey, ColumnKey, ColumnKey, ColumnKey]
    order: Literal["wxyz", "xyzw"] = "wxyz"
    frame: Literal["ned", "enu"] = "ned"
    rotates: Literal["body_to_earth", "earth_to_body"] = "body_to_earth"
    variable: str | None = None
    clock: Clock | None = None


class BodyVelocity(Strict):
    """Velocity of the aircraft relative to the air in body axes, from which airspeed, alpha and beta are computed.

    u, v, w : columns of the components forward, to the right and down; without v it is zero, and there is no beta_rad.
    """

    u: ColumnKey
    v: ColumnKey | None = None
    w: ColumnKey
    unit: Unit
    variable: str | None = None
    clock: Clock | None = None

    @field_validator("unit")
    @classmethod
    def _speed_unit(cls, value: str) -> str:
        unit_factor("speed", value)
        return value


__all__ = [
    "TIME_UNITS",
    "AttitudeTable",
    "BodyVelocity",
    "Channel",
    "Clock",
    "ColumnKey",
    "Place",
    "Points",
    "RecordConstant",
    "Unit",
    "unit_factor",
]
