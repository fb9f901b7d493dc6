"""Generation of JSON schemas for TOML files: units in keys, quantity tables, distributions, effects, sensors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import Any, Final, cast

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from airtruth.aircraft import AircraftFile
from airtruth.aircraft.file import DERIVATIVES
from airtruth.channels import SIGNALS
from airtruth.effects.effect import Effect, Parameter
from airtruth.effects.registry import EFFECTS
from airtruth.importers.mapping import (
    CONSTANTS,
    MAPPED,
    TIME_UNITS,
    BodyVelocity,
    Channel,
    Clock,
    MappingFile,
    RecordConstant,
    TimeSection,
)
from airtruth.physics.gust_figures import FIGURES, LEVELS
from airtruth.physics.sensor_errors import KINDS as ERROR_KINDS
from airtruth.quantity import FromTable
from airtruth.simulation.campaign.effect_table import EffectTable
from airtruth.simulation.campaign.file import NO_GUST, GustTable, SensorTable
from airtruth.simulation.campaign.manoeuvre_table import InputTable, ManoeuvreTable
from airtruth.simulation.campaign.tables import UnitTable, distribution
from airtruth.simulation.manoeuvres import CONTROLS, KINDS
from airtruth.units import UNITS

Schema = dict[str, Any]

NAMES: Final[Mapping[tuple[type[BaseModel], str], tuple[str, ...]]] = {
    (GustTable, "figures"): tuple(FIGURES),
    (GustTable, "level"): (NO_GUST, *LEVELS),
    **{(table, "kind"): tuple(KINDS) for table in (InputTable, ManoeuvreTable)},
    **{(table, "control"): CONTROLS for table in (InputTable, ManoeuvreTable)},
}
"""Fields whose names a validator tests -> the names."""
_BOUNDS: Final = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
"""Keywords whose numbers have the unit of the key."""


class TomlSchema(GenerateJsonSchema):
    """Schema of a file as it is written, where the models hold it in SI."""

    def function_before_schema(self, schema: core_schema.BeforeValidatorFunctionSchema) -> JsonSchemaValue:
        """Quantities are tables with a unit; a draw is a number or a distribution."""
        function = schema["function"]["function"]
        if isinstance(function, FromTable):
            return quantity(function.dimension)
        if function is distribution:
            drawn = super().function_before_schema(schema)
            return {"anyOf": [{"type": "number"}, *drawn["anyOf"]]}
        return super().function_before_schema(schema)

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """TOML has no null: an optional key is left out."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """State a default only where the file may hold it: a number, text, true or false."""
        described = super().default_schema(schema)
        if not isinstance(described.get("default", ""), bool | int | float | str):
            del described["default"]
        return described

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        """Change what a model cannot state of its file."""
        model = cast(type[BaseModel], schema["cls"])
        described = super().model_schema(schema)
        for field in described.get("properties", {}).values():
            field.pop("title", None)
        for (owner, name), names in NAMES.items():
            if owner is model:
                described["properties"][name]["enum"] = list(names)
        if issubclass(model, UnitTable):
            _with_units(described, model.dimensions)
        _complete(model, described)
        return described


def _complete(model: type[BaseModel], described: Schema) -> None:
    properties = described.get("properties", {})
    if model is EffectTable:
        described.clear()
        described |= {
            "description": "An effect that is flown: `airtruth effects`.",
            "anyOf": effects(EFFECTS.values()),
        }
    elif model is SensorTable:
        properties["channel"] = sensors()
    elif model is AircraftFile:
        properties["sensors"] = sensors()
        properties["derivatives"] = _table({name: quantity("ratio") for name in DERIVATIVES})
    elif model is MappingFile:
        properties["channels"] = _by_dimension(properties["channels"], MAPPED)
        properties["constants"] = _by_dimension(properties["constants"], CONSTANTS)
    elif model in (Clock, TimeSection):
        properties["unit"] = unit_text(TIME_UNITS)
    elif model is BodyVelocity:
        properties["unit"] = unit_text(UNITS["speed"])
    elif model in (Channel, RecordConstant):
        properties["unit"] = {"type": "string"}


def quantity(dimension: str) -> Schema:
    """Schema of a quantity table of a dimension.

    Parameters
    ----------
    dimension : key of `airtruth.units.UNITS`.
    """
    bare = dimension == "ratio"
    return {
        "type": "object",
        "properties": {
            "value": {"type": "number"},
            "unit": {"enum": list(UNITS[dimension])},
            "std": {
                "type": "number",
                "minimum": 0.0,
                "description": "standard uncertainty, in the same unit",
            },
            "source": {"type": "string", "description": "publication or measurement"},
        },
        "required": ["value"] if bare else ["value", "unit"],
        "additionalProperties": False,
    }


def unit_text(units: Iterable[str]) -> Schema:
    """Schema of a unit as text: the usual spellings are offered, others (`deg / s`) are allowed.

    Parameters
    ----------
    units : suffixes of units.
    """
    offered = dict.fromkeys(u.replace("_", "/") for u in units)
    return {"anyOf": [{"enum": list(offered)}, {"type": "string"}]}


def sensors() -> Schema:
    """Schema of the tables of sensors by channel; units are those of the channel."""
    return _table(
        {
            name: _table(
                {kind.key: quantity(kind.dimension or signal.dimension) for kind in ERROR_KINDS.values()}
            )
            | {"description": signal.description}
            for name, signal in SIGNALS.items()
        }
    )


def effects(library: Iterable[Effect]) -> list[Schema]:
    """Schema of each effect, its parameters in every unit.

    Parameters
    ----------
    library : effects.
    """
    return [_effect(effect) for effect in library]


def _effect(effect: Effect) -> Schema:
    properties: Schema = {"name": {"const": effect.name}}
    if effect.variant:
        properties["variant"] = {"const": effect.variant}
    if effect.variant in SIGNALS:
        properties["channel"] = {"const": effect.variant}
    required: list[Schema] = []
    for parameter in effect.parameters:
        spellings = parameter.spellings()
        properties |= {key: _within(parameter, factor) for key, factor in spellings.items()}
        if parameter.default is None:
            required.append({"oneOf": [{"required": [key]} for key in spellings]})
    described: Schema = _table(properties) | {"description": effect.explanation, "required": ["name"]}
    if required:
        described["allOf"] = required
    return described


def _within(parameter: Parameter, factor: float) -> Schema:
    """Range of a parameter in the unit of a key; its neutral value is allowed too."""
    meant = {"description": parameter.meaning}
    span: Schema = {"type": "number", "minimum": parameter.low / factor, "maximum": parameter.high / factor}
    return meant | {"anyOf": [span, {"type": "number", "const": parameter.neutral / factor}]}


def _by_dimension(described: Schema, dimensions: Mapping[str, str]) -> Schema:
    """Tables by name, each with the units of its dimension."""
    reference = described["additionalProperties"]
    return {
        "type": "object",
        "properties": {
            name: {"allOf": [reference, {"properties": {"unit": unit_text(UNITS[dimension])}}]}
            for name, dimension in dimensions.items()
        },
        "additionalProperties": False,
    }


def _with_units(described: Schema, dimensions: Mapping[str, str]) -> None:
    """Replace each quantity by one key for each unit, of which a file states one."""
    properties, required = described["properties"], described.get("required", [])
    rules: list[Schema] = []
    for name, dimension in dimensions.items():
        if name not in properties:
            continue
        field = properties.pop(name)
        keys = {f"{name}_{unit}" if unit else name: factor for unit, factor in UNITS[dimension].items()}
        properties |= {key: _scaled(field, factor) for key, factor in keys.items()}
        if name in required:
            required.remove(name)
            rules.append({"oneOf": [{"required": [key]} for key in keys]})
        elif len(keys) > 1:
            rules.append({"not": {"anyOf": [{"required": list(pair)} for pair in combinations(keys, 2)]}})
    if rules:
        described["allOf"] = [*described.get("allOf", []), *rules]


def _scaled(field: Schema, factor: float) -> Schema:
    """A field in the unit of a key; a default that is not zero is that of SI and is stated there alone."""
    scaled = {key: value / factor if key in _BOUNDS else value for key, value in field.items()}
    if factor != 1.0 and scaled.get("default"):
        del scaled["default"]
    return scaled


def _table(properties: Schema) -> Schema:
    return {"type": "object", "properties": properties, "additionalProperties": False}


__all__ = ["NAMES", "TomlSchema", "effects", "quantity", "sensors", "unit_text"]
