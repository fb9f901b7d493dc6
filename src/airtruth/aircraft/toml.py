"""Write an aircraft.toml: every quantity in SI, with its uncertainty and source."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from airtruth.aircraft import AircraftFile, Dynamics
from airtruth.channels import SIGNALS
from airtruth.physics.sensor_errors import KINDS
from airtruth.physics.terms import entries
from airtruth.quantity import Quantity
from airtruth.toml_values import toml_value
from airtruth.units import UNITS

_UNITS: Final = {
    "wing_area": "m2",
    "chord": "m",
    "span": "m",
    "arm": "m",
    "height": "m",
    "area": "m2",
    "mass": "kg",
    "inertia_yy": "kg_m2",
    "inertia_xx": "kg_m2",
    "inertia_zz": "kg_m2",
    "inertia_xz": "kg_m2",
    "cg": "",
    "bandwidth": "hz",
    "rate_limit": "rad_s",
    "minimum": "rad",
    "maximum": "rad",
    "delay": "s",
}
"""SI unit of each quantity."""
_SENSOR_UNITS: Final = {k.key: next(iter(UNITS[k.dimension])) for k in KINDS.values() if k.dimension}
"""SI unit of a sensor's entry where it is not that of its channel."""


def write(file: AircraftFile, heading: str) -> str:
    """The file as TOML; reading it gives the same values to the last bit.

    Parameters
    ----------
    file : content; entries that were not stated stay out.
    heading : comment at the head of the file.
    """
    lines = [f"# {line}".rstrip() for line in heading.splitlines()]
    content = {k: getattr(file, k) for k in type(file).model_fields if k in file.model_fields_set}
    lines += [
        "schema = 1",
        f"name = {toml_value(file.name)}",
        f"description = {toml_value(file.description)}",
    ]
    for name, table in content.items():
        if name in ("schema_", "name", "description") or table is None:
            continue
        if name == "sensors":
            for channel, sensor in table.items():
                lines += _table((name, channel), _stated(sensor))
        elif isinstance(table, Mapping):
            lines += _table((name,), table)
        elif isinstance(table, Dynamics):
            for key, rows in table:
                for row in rows:
                    lines += [
                        f"\n[[{name}.{key}]]",
                        *(f"{k} = {toml_value(v)}" for k, v in entries(row).items()),
                    ]
        else:
            lines += _table((name,), _stated(table))
    return "\n".join(lines) + "\n"


def _stated(model: Any) -> dict[str, Any]:
    return {k: getattr(model, k) for k in type(model).model_fields if k in model.model_fields_set}


def unit_of(path: tuple[str | int, ...]) -> str:
    """SI unit of a quantity.

    Parameters
    ----------
    path : its keys from the top of the file.

    Examples
    --------
    >>> unit_of(("mass", "inertia_yy")), unit_of(("sensors", "q_rad_s", "bias"))
    ('kg_m2', 'rad_s')
    """
    key = str(path[-1])
    if path[0] != "sensors":
        return _UNITS.get(key, "")
    return _SENSOR_UNITS.get(key, next(iter(UNITS[SIGNALS[str(path[1])].dimension])))


def _table(path: tuple[str, ...], entries: Mapping[str, Any]) -> list[str]:
    plain, tables = [f"\n[{'.'.join(path)}]"], []
    for key, value in entries.items():
        if value is None:
            continue
        if isinstance(value, Quantity):
            plain.append(f"{key} = {quantity(value, unit_of((*path, key)))}")
        elif isinstance(value, Mapping):
            if value:
                inner = ", ".join(f"{toml_value(k)} = {toml_value(v)}" for k, v in value.items())
                plain.append(f"{key} = {{ {inner} }}")
        elif hasattr(value, "model_fields_set"):
            tables += _table((*path, key), _stated(value))
        else:
            plain.append(f"{key} = {toml_value(value)}")
    return plain + tables


def quantity(stated: Quantity, unit: str) -> str:
    """A quantity as a table in braces, in its SI unit; "" for a ratio."""
    parts = [f"value = {stated.value!r}"]
    parts += [f"unit = {toml_value(unit)}"] if unit else []
    parts += [f"std = {stated.std!r}"] if stated.std else []
    parts += [f"source = {toml_value(stated.source)}"] if stated.source else []
    return f"{{ {', '.join(parts)} }}"
