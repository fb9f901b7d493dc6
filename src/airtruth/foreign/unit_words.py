"""Texts that are units and no names of columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from airtruth.units import UNITS

_FURTHER: Final = frozenset(
    {
        "", "-", "--", "1", "%", "sec", "min", "us", "ns", "usec", "msec", "degrees", "degree", "radians", "kts", "knots", "kn",
        "kias", "ktas", "feet", "meters", "mb", "c", "f", "v", "a", "volt", "volts", "amps", "rpm", "mach", "lbs", "n/a", "none",
        "dimensionless", "nd", "bool", "counts", "gal", "gph",
    }
)  # fmt: skip
"""Texts that units are written as, besides the keys of `airtruth.units.UNITS`."""
_KNOWN: Final = _FURTHER | {unit for table in UNITS.values() for unit in table}
"""Every such text."""


def is_unit(text: str) -> bool:
    """Whether a cell is a unit: "deg", "[m/s^2]", "1/s", "°C", or nothing."""
    word = text.strip().strip("[](){}\"'").strip().lower()
    return word in _KNOWN or "/" in word or "°" in word


def are_units(cells: Sequence[str]) -> bool:
    """Whether most of the cells that hold something are units, and one at least is."""
    words = [cell for cell in cells if cell.strip()]
    return sum(map(is_unit, words)) > 0.5 * len(words)


__all__ = ["are_units", "is_unit"]
