"""Quantities with a unit, as files state them, turned into SI at the border.

Two notations are read. In aircraft.toml a quantity is a table, ``{ value = 57.75, unit = "lb",
std = 0.3, source = "..." }``. In a campaign the unit ends the key, ``eas_kt = 75``.
"""

from __future__ import annotations

from collections.abc import Mapping
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


def keys_to_si(raw: Mapping[str, Any], dimensions: Mapping[str, str]) -> dict[str, Any]:
    """Rename ``eas_kt = 75`` to ``eas = 38.58`` for every name in ``dimensions``.

    Parameters
    ----------
    raw : table as read. Keys that are no such name, or whose unit is of another dimension, stay as they
        are, for the model to refuse and `explain` to explain.
    dimensions : bare name -> dimension. Numbers, and the numbers in lists and tables (distributions),
        are multiplied by the unit's factor.

    Raises
    ------
    ValueError
        If a quantity is given twice, in two units.
    """
    result: dict[str, Any] = {}
    for key, value in raw.items():
        name = _longest_name(key, dimensions)
        unit = "" if name is None else key[len(name) + 1 :]
        if name is None:
            result[key] = value
        elif unit not in UNITS[dimensions[name]]:
            result[key if unit else key + _NO_UNIT] = value  # not the field's own name, so it is refused
        elif name in result:
            raise ValueError(f"{key}: {name} is given twice, in two units")
        else:
            result[name] = _scaled(value, UNITS[dimensions[name]][unit])
    return result


_NO_UNIT = "_?"


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
            continue  # it is there, with a unit that the other sentence is about
        if item["type"] == "extra_forbidden":
            message = _explain_key(key, _model_at(model, table))
        elif item["type"] not in ("value_error", "missing"):
            message = f"{message} (found {item['input']!r})"
        sentences.append(f"{path}: {message}")
    return sentences


def _explain_key(key: str, model: type[BaseModel] | None) -> str:
    dimensions: Mapping[str, str] = getattr(model, "dimensions", {})
    name = _longest_name(key, dimensions)
    if name is not None:
        unit, dimension = key[len(name) + 1 :], dimensions[name]
        allowed = ", ".join(f"{name}_{u}" if u else name for u in UNITS[dimension])
        found = (
            "no unit is stated" if unit == "?" else f"{unit!r} is not a unit of {dimension.replace('_', ' ')}"
        )
        return f"{found}; write {allowed}"
    fields = [field.alias or name for name, field in model.model_fields.items()] if model else []
    shown = [f"{n}_{next(iter(UNITS[dimensions[n]]))}" if n in dimensions else n for n in fields]
    return f"unknown key; {choices(key, shown)}"


def _model_at(model: type[BaseModel], path: tuple[int | str, ...]) -> type[BaseModel] | None:
    current: type[BaseModel] | None = model
    for part in path:
        field = current.model_fields.get(str(part)) if current else None
        if field is not None:  # else an index into a list or a key of a mapping: its items' model stays
            current = _model_of(field.annotation)
    return current


def _model_of(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _model_of(argument)
        if found is not None:
            return found
    return None
