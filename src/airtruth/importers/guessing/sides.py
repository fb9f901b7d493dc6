"""Columns of the two sides of an aircraft."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from airtruth.importers.guessing.candidates import Reading

_SIDES: Final = {
    **dict.fromkeys(("left", "l", "lh", "port", "links", "lt"), "left"),
    **dict.fromkeys(("right", "r", "rh", "stbd", "starboard", "rechts", "rt"), "right"),
}
"""Word of a name -> side."""


def side_of(name: str) -> tuple[str, str]:
    """Name without the word of its side, and the side; "" if no word or several name one.

    Examples
    --------
    >>> side_of("ELEV_L"), side_of("right elevator position"), side_of("elevatorRight")
    (('elev', 'left'), ('elevatorposition', 'right'), ('elevator', 'right'))
    """
    words = [w.lower() for w in re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", name)]
    sides = [w for w in words if w in _SIDES]
    if len(sides) != 1:
        return "".join(words), ""
    return "".join(w for w in words if w not in _SIDES), _SIDES[sides[0]]


def are_sides(one: Reading, other: Reading) -> bool:
    """Whether two readings are of one quantity on the two sides, in one unit and with one sign."""
    (name, side), (further, opposite) = side_of(one.column.name), side_of(other.column.name)
    alike = (name, one.channel, one.unit, one.sign) == (further, other.channel, other.unit, other.sign)
    return alike and bool(side and opposite) and side != opposite


def other_side(reading: Reading, others: Sequence[Reading]) -> Reading | None:
    """The same quantity of the other side; None if there is none."""
    return next((one for one in others if are_sides(reading, one)), None)


__all__ = ["are_sides", "other_side", "side_of"]
