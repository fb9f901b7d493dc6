"""Columns of the two sides of an aircraft: their mean, or half their difference."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from airtruth.importers.guessing.readings import Candidates, Reading
from airtruth.importers.guessing.slots import limits, size_of

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


def mixed_with(name: str) -> str:
    """Surface that a surface of both axes is, beside the elevator: that of a V-tail moves the rudder, an elevon the aileron."""
    plain = side_of(name)[0]
    return "rudder_rad" if plain.startswith("vtail") or "rudder" in plain else "aileron_rad"


def pair(found: Candidates, mixed: Candidates, why: str) -> None:
    """Add the mean and half the difference of the two sides of ailerons, and of surfaces of both axes.

    Parameters
    ----------
    found : readings of a file; a single aileron is left out where both are known.
    mixed : readings of surfaces of both axes, as each channel that they move.
    why : reason by which ``found.surfaces`` names them.
    """
    made = {slot: list(_pairs(readings)) for slot, readings in mixed.readings.items()}
    ailerons = list(_pairs(found.readings.get("aileron", ())))
    used = {id(column) for one in ailerons for column in one.columns}
    if ailerons:
        kept = [one for one in found.readings["aileron"] if id(one.column) not in used]
        found.readings["aileron"] = [*kept, *ailerons]
    for slot, readings in made.items():
        found.readings.setdefault(slot, []).extend(readings)
    both = {id(column) for one in made.get("elevator", ()) for column in one.columns}
    found.surfaces[:] = [(c, text) for c, text in found.surfaces if text != why or id(c) not in both]


def _pairs(readings: Sequence[Reading]) -> Iterator[Reading]:
    """Mean and half the difference, right less left, of readings of both sides, each of which is an angle of a surface."""
    for left in readings:
        if side_of(left.column.name)[1] != "left" or not _is_deflection(left):
            continue
        for right in readings:
            if not are_sides(left, right) or not _is_deflection(right):
                continue
            for weight in (-0.5, 0.5):
                values = 0.5 * right.values + weight * left.values
                evidence = right.evidence - size_of(right.slot, right.values) + size_of(right.slot, values)
                yield replace(
                    right,
                    columns=(right.column, left.column),
                    values=values,
                    evidence=evidence,
                    kind="pair",
                    weights=(0.5, weight),
                )


def _is_deflection(one: Reading) -> bool:
    """Whether a column is in the range of a surface: pulse widths are not, and their difference may be."""
    low, high, _, _ = limits(one.channel)
    return bool(low <= one.values.min() and one.values.max() <= high)


__all__ = ["are_sides", "mixed_with", "other_side", "pair", "side_of"]
