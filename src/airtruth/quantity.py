"""Quantities with a unit in files, and their conversion to SI.

Two notations are read. In aircraft.toml a quantity is a table, ``{ value = 57.75, unit = "lb",
std = 0.3, source = "..." }``. In a campaign the unit ends the key, ``eas_kt = 75``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from types import NoneType
from typing import Annotated, Any, Final, Literal, Self, get_args, get_origin

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from airtruth.errors import choices
from airtruth.units import UNITS

LARGEST: Final = 1e15
"""Largest magnitude of a number in a file [SI] (judgement: no quantity of flight comes near it, and its powers do not
overflow)."""


class Strict(BaseModel):
    """Base of every file model: frozen; an unknown key is an error, and so is a number beyond `LARGEST`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _of_its_type(cls, value: Any, info: ValidationInfo) -> Any:
        """pydantic would read "5" and true as numbers, and 1 as true; JSON may hold an infinity as text."""
        if cls.model_config.get("allow_inf_nan"):
            return value
        wanted = set(_leaves(cls.model_fields[info.field_name or ""].annotation))
        entries = (
            value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else [value]
        )
        if wanted & {float, int} and not wanted & {str, bool}:
            for entry in entries:
                if isinstance(entry, bool | str):
                    raise ValueError(f"write a number (got {entry!r})")
        if {int, str} <= wanted and any(isinstance(entry, bool) for entry in entries):
            raise ValueError(f"write a number or a name (got {value!r})")
        numbers = [leaf for leaf in wanted if isinstance(leaf, int)]
        if numbers and isinstance(value, bool):
            raise ValueError(f"write {' or '.join(map(str, sorted(numbers)))} (got {value!r})")
        if bool in wanted and wanted <= {bool, NoneType} and not isinstance(value, bool | None):
            raise ValueError(f"write true or false (got {value!r})")
        return value

    @model_validator(mode="after")
    def _within_range(self) -> Self:
        for name in type(self).model_fields:
            for number in _numbers(getattr(self, name)):
                if LARGEST < abs(number) < math.inf:
                    raise ValueError(
                        f"{name} is {number:g}; write a number between -{LARGEST:g} and {LARGEST:g}"
                    )
        return self


def _leaves(annotation: Any) -> Iterator[Any]:
    """The types of a field without their containers and constraints, and the values of a literal."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from _leaves(parts[0])
    elif parts and origin is not Literal:
        for part in parts:
            yield from _leaves(part)
    else:
        yield from parts or (annotation,)


def _numbers(value: object) -> Iterator[float]:
    """The floating-point numbers of a field, which may be a list or a table of them."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, tuple | list):
        yield from (one for one in value if isinstance(one, float))
    elif isinstance(value, Mapping):
        yield from (one for one in value.values() if isinstance(one, float))


class Quantity(Strict):
    """A value in SI with its standard uncertainty and its source.

    Attributes
    ----------
    value : value in SI.
    std : standard uncertainty in SI, 0 if the file gives none.
    source : publication or measurement behind the value.
    """

    value: float
    std: float = Field(default=0.0, ge=0.0)
    source: str = ""


@dataclass(frozen=True)
class FromTable:
    """Reads a quantity table of a dimension; a schema asks for the dimension.

    Attributes
    ----------
    dimension : key of `airtruth.units.UNITS`.
    """

    dimension: str

    def __call__(self, raw: Any) -> Any:
        """Return the table in SI, a `Quantity` as it is.

        Raises
        ------
        ValueError
            If it is no table, or its unit is of another dimension.
        """
        units = UNITS[self.dimension]
        if isinstance(raw, Quantity):
            return raw
        if not isinstance(raw, Mapping):
            raise ValueError(f'write it as {{ value = ..., unit = "..." }}; units: {_units(self.dimension)}')
        table = dict(raw)
        unit = table.pop("unit", "" if self.dimension == "ratio" else None)
        if not isinstance(unit, str) or unit not in units:
            raise ValueError(
                f"unit {unit!r} is not a unit of {_plain(self.dimension)}; {_units(self.dimension)}"
            )
        for key in ("value", "std"):
            if key in table:
                table[key] = _scaled(table[key], units[unit])
        return table


def _from_table(dimension: str) -> BeforeValidator:
    return BeforeValidator(FromTable(dimension))


def _plain(dimension: str) -> str:
    return dimension.replace("_", " ")


def _units(dimension: str) -> str:
    return "use one of " + ", ".join(u or "(none)" for u in UNITS[dimension])


Angle = Annotated[Quantity, _from_table("angle")]
Rate = Annotated[Quantity, _from_table("angular_rate")]
Speed = Annotated[Quantity, _from_table("speed")]
Length = Annotated[Quantity, _from_table("length")]
Area = Annotated[Quantity, _from_table("area")]
Mass = Annotated[Quantity, _from_table("mass")]
Inertia = Annotated[Quantity, _from_table("inertia")]
Time = Annotated[Quantity, _from_table("time")]
Frequency = Annotated[Quantity, _from_table("frequency")]
Ratio = Annotated[Quantity, _from_table("ratio")]


def table_in(dimension: str, raw: Any) -> Quantity:
    """Read one quantity table of a dimension.

    Parameters
    ----------
    dimension : key of `airtruth.units.UNITS`.
    raw : the table.

    Raises
    ------
    ValueError
        If it is not a table, the unit belongs to another dimension, or a key is unknown.
    """
    converted = FromTable(dimension)(raw)
    return converted if isinstance(converted, Quantity) else Quantity.model_validate(converted)


def not_negative(value: Quantity) -> Quantity:
    """Return a quantity of a file that may be zero and not below it.

    Raises
    ------
    ValueError
        If it is negative.
    """
    if value.value < 0.0:
        raise ValueError(f"must not be negative (is {value.value:g} in SI)")
    return value


def require_positive(table: BaseModel, names: Iterable[str]) -> None:
    """Refuse quantities of a table that are not above 0, of those that are stated.

    Raises
    ------
    ValueError
        Naming the first.
    """
    for name in names:
        entry: Quantity | None = getattr(table, name)
        if entry is not None and not entry.value > 0.0:
            raise ValueError(f"{name} has to be above 0 (is {entry.value:g} in SI)")


def require_order(low: Quantity | None, high: Quantity | None) -> None:
    """Refuse a minimum that is not below the maximum, where both are stated.

    Raises
    ------
    ValueError
        With both.
    """
    if low is not None and high is not None and low.value >= high.value:
        raise ValueError(f"minimum has to be below maximum (are {low.value:g} and {high.value:g} in SI)")


def keys_to_si(raw: Mapping[str, object], dimensions: Mapping[str, str]) -> dict[str, object]:
    """Rename ``eas_kt = 75`` to ``eas = 38.58`` for every name in ``dimensions``.

    Parameters
    ----------
    raw : table of the file. A key that is no such name, or has a unit of another dimension, is kept: the model
        then refuses it, and `explain` explains why.
    dimensions : name without unit -> dimension. Numbers, also in lists and tables (distributions), are
        multiplied by the factor of the unit.

    Raises
    ------
    ValueError
        If a quantity is given twice, in two units.
    """
    result: dict[str, object] = {}
    for key, value in raw.items():
        name = _longest_name(key, dimensions)
        unit = "" if name is None else key[len(name) + 1 :]
        if name is None:
            result[key] = value
        elif unit not in UNITS[dimensions[name]]:
            result[key if unit else key + _NO_UNIT] = (
                value  # differs from the field's name, so the model refuses it
            )
        elif name in result:
            raise ValueError(f"{key}: {name} is given twice, in two units")
        else:
            result[name] = _scaled(value, UNITS[dimensions[name]][unit])
    return result


_NO_UNIT = "_?"
"""Suffix of a key without a unit: it makes the key unknown to the model, and `explain` recognises it."""
_TABLE, _LIST = "must be a table", "must be a list"
_SHAPES: Final = {
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type", "dataclass_type"), _TABLE),
    **dict.fromkeys(("tuple_type", "list_type"), _LIST),
}
"""Type of a problem in pydantic -> words of a TOML file."""


def _longest_name(key: str, dimensions: Mapping[str, str]) -> str | None:
    names = [n for n in dimensions if key == n or key.startswith(n + "_")]
    known = {f"{n}_{u}" if u else n for n in names for u in UNITS[dimensions[n]]}
    exact = [n for n in names if any(key == (f"{n}_{u}" if u else n) for u in UNITS[dimensions[n]])]
    if key in known and exact:
        return max(exact, key=len)
    return max(names, key=len) if names else None


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, bool):
        return value
    if isinstance(value, int) and abs(value) > LARGEST:  # it may be too large for a float
        raise ValueError(f"is too large; write a number between -{LARGEST:g} and {LARGEST:g}")
    if isinstance(value, int | float):
        return value * factor
    if isinstance(value, list):
        return [_scaled(v, factor) for v in value]
    if isinstance(value, Mapping):
        return {k: _scaled(v, factor) for k, v in value.items()}
    return value


def explain(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Return one sentence per problem of a file: its key, the fault, and the allowed or nearest names.

    Parameters
    ----------
    error : all problems that pydantic reports.
    model : the model that refused the file.
    """
    items = error.errors()
    unknown = [
        (item["loc"][:-1], str(item["loc"][-1])) for item in items if item["type"] == "extra_forbidden"
    ]
    sentences = []
    for item in items:
        table, key = item["loc"][:-1], str(item["loc"][-1]) if item["loc"] else ""
        path = ".".join(str(part) for part in item["loc"]).removesuffix(_NO_UNIT) or "(top level)"
        message = item["msg"].removeprefix("Value error, ")
        if item["type"] == "missing" and any(
            at == table and name.startswith(f"{key}_") for at, name in unknown
        ):
            continue  # present with a wrong unit, which another sentence explains
        if item["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
            message = _explain_key(key, _model_at(model, table))
        elif item["type"] == "missing":
            message = _explain_missing(key, _model_at(model, table))
        elif item["type"] != "value_error":
            message = f"{_SHAPES.get(item['type'], message)} (got {item['input']!r})"
        sentences.append(f"{path}: {message}")
    return sentences


def _explain_missing(key: str, model: type[Any] | None) -> str:
    dimension = getattr(model, "dimensions", {}).get(key)
    if dimension is None:
        return "is required"
    return f"is required; write {', '.join(f'{key}_{u}' if u else key for u in UNITS[dimension])}"


def _explain_key(key: str, model: type[Any] | None) -> str:
    dimensions: Mapping[str, str] = getattr(model, "dimensions", {})
    name = _longest_name(key, dimensions)
    if name is not None:
        unit, dimension = key[len(name) + 1 :], dimensions[name]
        allowed = ", ".join(f"{name}_{u}" if u else name for u in UNITS[dimension])
        fault = "the unit is missing" if unit == "?" else f"{unit!r} is not a unit of {_plain(dimension)}"
        return f"{fault}; write {allowed}"
    keys = _keys(model) if model else []
    shown = [f"{n}_{next(iter(UNITS[dimensions[n]]))}" if n in dimensions else n for n in keys]
    return f"unknown key; {choices(key, shown)}"


def _keys(model: type[Any]) -> list[str]:
    """Keys of a table of a file: the fields of its model, or of a plain dataclass."""
    if is_dataclass(model):
        return [field.name for field in fields(model)]
    return [field.alias or name for name, field in model.model_fields.items()]


def _model_at(model: type[BaseModel], path: tuple[int | str, ...]) -> type[Any] | None:
    current: type[Any] | None = model
    for part in path:
        field = getattr(current, "model_fields", {}).get(str(part))
        if field is not None:  # an index of a list or a key of a mapping keeps the model of its items
            current = _model_of(field.annotation)
    return current


def _model_of(annotation: Any) -> type[Any] | None:
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation)):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        model = _model_of(argument)
        if model is not None:
            return model
    return None
