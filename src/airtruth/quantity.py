"""Quantities with a unit, as files state them, turned into SI at the border.

Two notations are read. In aircraft.toml a quantity is a table, ``{ value = 57.75, unit = "lb",
std = 0.3, source = "..." }``. In a campaign the unit ends the key, ``eas_kt = 75``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from airtruth.errors import choices
from airtruth.units import UNITS


class Strict(BaseModel):
    """Base of every file model: frozen, and a key it does not know is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Quantity(Strict):
    """A value in SI with its standard uncertainty and where it comes from.

    Attributes
    ----------
    value : value in SI.
    std : standard uncertainty in SI, 0 if it is not stated.
    source : where the figure comes from.
    """

    value: float
    std: float = Field(default=0.0, ge=0.0)
    source: str = ""


def _from_table(dimension: str) -> BeforeValidator:
    def convert(raw: Any) -> Any:
        if isinstance(raw, Quantity):
            return raw
        if not isinstance(raw, Mapping):
            raise ValueError(f'write it as {{ value = ..., unit = "..." }}; units: {_units(dimension)}')
        table = dict(raw)
        unit = table.pop("unit", "" if dimension == "ratio" else None)
        if unit not in UNITS[dimension]:
            raise ValueError(
                f"unit {unit!r} is not a unit of {dimension.replace('_', ' ')}; {_units(dimension)}"
            )
        factor = UNITS[dimension][unit]
        for key in ("value", "std"):
            if isinstance(table.get(key), int | float):
                table[key] = table[key] * factor
        return table

    return BeforeValidator(convert)


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
    """Read one quantity table of a dimension that is known only at run time.

    Raises
    ------
    ValueError
        If it is not a table, the unit is of another dimension, or a key is unknown.
    """
    converted = _from_table(dimension).func(raw)  # type: ignore[call-arg]
    return converted if isinstance(converted, Quantity) else Quantity.model_validate(converted)


def keys_to_si(
    raw: Mapping[str, Any], dimensions: Mapping[str, str], fields: Iterable[str]
) -> dict[str, Any]:
    """Rename ``eas_kt = 75`` to ``eas = 38.58`` for every name in ``dimensions``.

    Parameters
    ----------
    raw : table as read.
    dimensions : bare name -> dimension. Numbers, and the numbers in lists and tables (distributions),
        are multiplied by the unit's factor.
    fields : every bare name that the table knows.

    Raises
    ------
    ValueError
        If keys are unknown, have a unit of another dimension, or are given twice; names them all.
    """
    known = set(fields)
    result: dict[str, Any] = {}
    problems: list[str] = []
    for key, value in raw.items():
        name = _longest_name(key, dimensions)
        if name is None:
            if key not in known:
                problems.append(f"{key}: unknown key; {choices(key, _keys(known, dimensions))}")
            result[key] = value
            continue
        dimension = dimensions[name]
        unit = key[len(name) + 1 :] if key != name else ""
        if unit not in UNITS[dimension]:
            allowed = [f"{name}_{u}" if u else name for u in UNITS[dimension]]
            problems.append(
                f"{key}: {unit or 'no unit'!r} is not a unit of {dimension.replace('_', ' ')}; write {', '.join(allowed)}"
            )
        elif name in result:
            problems.append(f"{key}: {name} is given twice, in two units")
        else:
            result[name] = _scaled(value, UNITS[dimension][unit])
    if problems:
        raise ValueError("; ".join(problems))
    return result


def _keys(fields: Iterable[str], dimensions: Mapping[str, str]) -> list[str]:
    """Keys as a user writes them, with the first unit that the dimension has."""
    return [f"{n}_{next(iter(UNITS[dimensions[n]]))}" if n in dimensions else n for n in fields]


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
    if isinstance(value, int | float):
        return value * factor
    if isinstance(value, list):
        return [_scaled(v, factor) for v in value]
    if isinstance(value, Mapping):
        return {k: _scaled(v, factor) for k, v in value.items()}
    return value


def explain(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One sentence per problem of a file: its path, what is wrong, and the allowed or nearest names.

    Parameters
    ----------
    error : what pydantic found, all of it.
    model : the model that was read.
    """
    sentences = []
    for item in error.errors():
        path = ".".join(str(part) for part in item["loc"]) or "(top level)"
        message = item["msg"].removeprefix("Value error, ")
        if item["type"] == "extra_forbidden":
            message = f"unknown key; {choices(str(item['loc'][-1]), _fields_at(model, item['loc'][:-1]))}"
        elif item["type"] not in ("value_error", "missing"):
            message = f"{message} (found {item['input']!r})"
        sentences.append(f"{path}: {message}")
    return sentences


def _fields_at(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    current: type[BaseModel] | None = model
    for part in path:
        field = current.model_fields.get(str(part)) if current else None
        if field is not None:  # else an index into a list or a key of a mapping: its items' model stays
            current = _model_of(field.annotation)
    return [f.alias or name for name, f in current.model_fields.items()] if current else []


def _model_of(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _model_of(argument)
        if found is not None:
            return found
    return None
