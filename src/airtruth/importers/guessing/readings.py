"""A column as a channel, and all such readings of a file."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from airtruth.importers.guessing.columns import Column

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """A column as a channel, in a unit and with a sign.

    Attributes
    ----------
    slot, channel : what it fills.
    columns : its columns; several of a quaternion or a velocity.
    unit, sign, offset : as in a mapping.
    values : (samples,) on the common grid [SI].
    evidence : logarithm of the evidence of name, unit and size.
    named : "format PX4" or "named".
    unit_from : "stated", "by its size".
    rank : preference among columns of one channel.
    kind : "column", "attitude", "velocity" or "pair".
    order, frame : of a quaternion, as in a mapping.
    weights : of a pair, as in a mapping.
    """

    slot: str
    channel: str
    columns: tuple[Column, ...]
    unit: str
    sign: int
    values: Array
    evidence: float
    named: str
    unit_from: str
    offset: float = 0.0
    rank: int = 1
    kind: str = "column"
    order: str = ""
    frame: str = ""
    weights: tuple[float, ...] = ()

    @property
    def column(self) -> Column:
        """Its first column."""
        return self.columns[0]


@dataclass
class Candidates:
    """Readings of each slot, and columns that are not taken.

    refused : (column, what it is, channel that its name resembles).
    surfaces : columns that move with the elevator, without the throw of the surface, and why.
    synthetic : columns with an angle of attack that no vane measured.
    zero : channels whose column is zero throughout.
    """

    readings: dict[str, list[Reading]] = field(default_factory=dict)
    refused: list[tuple[Column, str, str]] = field(default_factory=list)
    surfaces: list[tuple[Column, str]] = field(default_factory=list)
    synthetic: list[tuple[Column, str]] = field(default_factory=list)
    zero: list[tuple[str, Column]] = field(default_factory=list)


__all__ = ["Candidates", "Reading"]
