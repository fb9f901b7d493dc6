"""Where the numbers of a result come from: version, options, and digests of the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from airtruth.logs.digest import sha256_of
from airtruth.logs.sources import Logs, sources

PROVENANCE: Final = "provenance"
"""Key of the provenance among the facts of a file of records."""


@dataclass(frozen=True)
class Provenance:
    """Origin of a result.

    Attributes
    ----------
    version : of airtruth.
    aircraft, folder : name of the aircraft, and its folder.
    options : name of a choice -> its value in words.
    digests : name of a log or of a file of the aircraft -> SHA-256 of its bytes.
    """

    version: str = ""
    aircraft: str = ""
    options: Mapping[str, str] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The fields in types that JSON has."""
        return asdict(self)

    @classmethod
    def read(cls, raw: object) -> Provenance:
        """Read what `to_dict` makes; empty where it is anything else."""
        from pydantic import TypeAdapter, ValidationError

        try:
            return TypeAdapter(cls).validate_python(raw)
        except ValidationError:
            return cls()


def digests_of(logs: Logs, folder: Path) -> dict[str, str]:
    """SHA-256 of the files among logs, and of aircraft.toml and the XML files of an aircraft's folder.

    Raises
    ------
    StoreError, ConfigurationError
        If a file cannot be read, or a log does not exist.
    """
    return _digests({path.name: path for path in sources(logs) if isinstance(path, Path)}) | aircraft_digests(
        folder
    )


def aircraft_digests(folder: Path) -> dict[str, str]:
    """SHA-256 of aircraft.toml and of the XML files of an aircraft's folder.

    Raises
    ------
    StoreError
        If a file cannot be read.
    """
    every = (path for suffix in ("toml", "xml") for path in sorted(folder.rglob(f"*.{suffix}")))
    return _digests({path.relative_to(folder).as_posix(): path for path in every})


def _digests(files: Mapping[str, Path]) -> dict[str, str]:
    found = {name: sha256_of(path) for name, path in files.items()}
    return {name: digest for name, digest in found.items() if digest is not None}


__all__ = ["PROVENANCE", "Provenance", "aircraft_digests", "digests_of"]
