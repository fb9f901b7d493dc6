"""One relation between channels, tested in every run of a batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ATMOSPHERE_M: Final = (-2000.0, 20000.0)
"""Altitudes of the standard atmosphere between which a density is compared [m]."""


@dataclass(frozen=True)
class Relation:
    """One relation between channels, tested in each run and, in the last row, in all runs together.

    Attributes
    ----------
    name : of the test.
    channels : all channels that enter, the likeliest culprit first.
    distance : (runs + 1,) squared distance from the required value; 0 where nothing can be tested.
    figures : (runs + 1, k) figures of the estimate, see `airtruth.checks.sentences`.
    informed : (runs + 1,) whether each run, and all together, tell a right value from a wrong one.
    """

    name: str
    channels: tuple[str, ...]
    distance: Array
    figures: Array
    informed: NDArray[np.bool_]


def informed_everywhere(distance: Array) -> NDArray[np.bool_]:
    """A test that always tells a right value from a wrong one."""
    return np.ones(len(distance), dtype=np.bool_)


def finite(x: Array) -> Array:
    """Zero where a distance is not finite: nothing can be tested."""
    return np.asarray(np.where(np.isfinite(x), x, 0.0))


__all__ = ["ATMOSPHERE_M", "Relation", "finite", "informed_everywhere"]
