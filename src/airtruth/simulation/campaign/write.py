"""A campaign as the text of a campaign file, in SI."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from airtruth.simulation.campaign.effect_table import EffectTable
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.tables import Constant, Distribution, UnitTable
from airtruth.toml_values import toml_value
from airtruth.units import UNITS


def as_toml(campaign: Campaign, heading: str = "") -> str:
    """Return the text of a campaign file; reading it gives the same campaign.

    Parameters
    ----------
    campaign : the campaign.
    heading : comment at the head of the file.
    """
    lines = [f"# {line}".rstrip() for line in heading.splitlines()]
    lines += [f"{key} = {_value(value)}" for key, value in _entries(campaign) if not _is_table(value)]
    for key, value in _entries(campaign):
        if isinstance(value, BaseModel) and not isinstance(value, Distribution):
            lines += ["", f"[{key}]", *_lines(value)]
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for row in value:
                lines += _rows(key, row)
    return "\n".join(lines) + "\n"


def _rows(key: str, row: BaseModel) -> list[str]:
    """A table of an array, followed by the arrays of tables in it."""
    lines = ["", f"[[{key}]]", *_lines(row)]
    inner = [] if isinstance(row, EffectTable) else [e for e in _entries(row) if _is_table(e[1])]
    return lines + [line for name, rows in inner for each in rows for line in _rows(f"{key}.{name}", each)]


def _is_table(value: object) -> bool:
    if isinstance(value, Distribution):
        return False
    return isinstance(value, BaseModel) or (
        isinstance(value, tuple) and bool(value) and isinstance(value[0], BaseModel)
    )


def _entries(model: BaseModel) -> Iterator[tuple[str, Any]]:
    """Keys with their SI unit, and values, of the fields that differ from their defaults."""
    dimensions = model.dimensions if isinstance(model, UnitTable) else {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if (
            not field.is_required()
            and value == field.get_default(call_default_factory=True)
            and name != "schema_"
        ):
            continue
        key = field.alias or name
        unit = next(iter(UNITS[dimensions[name]])) if name in dimensions else ""
        yield (f"{key}_{unit}" if unit else key), value


def _lines(model: BaseModel) -> list[str]:
    if isinstance(model, EffectTable):
        variant = {"variant": model.variant} if model.variant else {}
        stated = {"name": model.name, **variant, **model.parameters}
        return [f"{key} = {_value(value)}" for key, value in stated.items()]
    return [f"{key} = {_value(value)}" for key, value in _entries(model) if not _is_table(value)]


def _value(value: Any) -> str:
    if isinstance(value, Constant):
        return toml_value(value.value)
    if isinstance(value, Distribution):
        return toml_value({name: getattr(value, name) for name in type(value).model_fields})
    return toml_value(value)


__all__ = ["as_toml"]
