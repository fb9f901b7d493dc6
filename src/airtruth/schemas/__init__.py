"""JSON schemas of the TOML files, for editors; generated from the models that validate the files."""

from __future__ import annotations

import json
from typing import Final

from pydantic import BaseModel

from airtruth.aircraft import AircraftFile
from airtruth.errors import ConfigurationError, choices
from airtruth.importers.mapping import MappingFile
from airtruth.schemas.generate import TomlSchema
from airtruth.simulation.campaign.file import Campaign

FILES: Final[dict[str, type[BaseModel]]] = {
    "campaign": Campaign,
    "aircraft": AircraftFile,
    "mapping": MappingFile,
}
"""Kind of a TOML file -> the model that validates it."""
DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
"""Dialect of the schemas: the one that pydantic generates."""


def schema(kind: str) -> str:
    """The JSON schema of a kind of TOML file, as JSON.

    A file that airtruth accepts is valid. The reverse does not hold: relations between keys (an upper end above a
    lower end, a unit of the dimension of its channel) are tested when a command reads the file.

    Parameters
    ----------
    kind : key of `FILES`.

    Raises
    ------
    ConfigurationError
        If there is no such kind.
    """
    if kind not in FILES:
        raise ConfigurationError(f"schema {kind!r} does not exist; {choices(kind, FILES)}")
    generated = FILES[kind].model_json_schema(schema_generator=TomlSchema)
    return json.dumps({"$schema": DIALECT, **generated, "title": f"airtruth {kind} file"}, indent=1)


__all__ = ["DIALECT", "FILES", "schema"]
