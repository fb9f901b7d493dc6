"""Statements of the mapping of an imported log about its channels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

KEY: Final = "mapping"
"""Key of a log's metadata: channel -> unit, sign, scale and offset that its mapping states."""


@dataclass(frozen=True)
class Stated:
    """Unit, sign, scale [-] and offset [unit of the file] of one channel in a mapping."""

    unit: str
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0

    @property
    def is_plain(self) -> bool:
        """Whether the numbers of the column are values in the unit."""
        return self.scale == 1.0 and self.offset == 0.0


def stated_of(metadata: Mapping[str, object]) -> dict[str, Stated]:
    """Return what the metadata of a log tell of its mapping; {} for a log that was not imported."""
    table = metadata.get(KEY)
    found = {}
    for name, entry in table.items() if isinstance(table, Mapping) else ():
        if not isinstance(entry, Mapping) or not isinstance(entry.get("unit"), str):
            continue
        numbers = {key: entry.get(key, 1.0) for key in ("sign", "scale")} | {
            "offset": entry.get("offset", 0.0)
        }
        if all(isinstance(value, int | float) for value in numbers.values()):
            found[str(name)] = Stated(
                entry["unit"], int(numbers["sign"]), float(numbers["scale"]), float(numbers["offset"])
            )
    return found


__all__ = ["KEY", "Stated", "stated_of"]
