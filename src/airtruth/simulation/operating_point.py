"""Forces, engines and derivatives of a JSBSim aircraft about one trim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.physics.motion import LATERAL
from airtruth.simulation.linearise import Linearisation, linearise
from airtruth.simulation.probe import (
    ForceGrid,
    ForceTables,
    forces_at_speeds,
    forces_over_alpha,
    probe,
    with_breaks,
)
from airtruth.simulation.probe_lateral import LateralTables, probe_lateral
from airtruth.simulation.trim import Trim

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OperatingPoint:
    """An aircraft about a trim.

    Attributes
    ----------
    tables : forces and moment over the states of a grid.
    at_speeds : (speeds, 4) see `airtruth.simulation.probe.forces_at_speeds`.
    over_alpha : (speeds, alpha, 3) at the angles of attack of the tables, see
        `airtruth.simulation.probe.forces_over_alpha`.
    derivatives : about the trim.
    """

    tables: ForceTables
    at_speeds: Array
    over_alpha: Array
    derivatives: Linearisation


def operating_point(aircraft: Aircraft, trim: Trim, grid: ForceGrid, ratios: Array) -> OperatingPoint:
    """Probe an aircraft about a trim.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.
    grid : states of the tables; breaks of the forces over the angle of attack are added.
    ratios : (speeds,) airspeed over that of the trim, of the forces at other airspeeds [-].

    Raises
    ------
    AircraftError
        If the surface does not rise with its command, or moves with alpha, q or airspeed.
    TrimError
        If the elevator surface does not follow its command at the trim.
    """
    tables = probe(aircraft, trim, with_breaks(aircraft, trim, grid))
    return OperatingPoint(
        tables=tables,
        at_speeds=forces_at_speeds(aircraft, trim, ratios),
        over_alpha=forces_over_alpha(aircraft, trim, tables.axes[0], ratios),
        derivatives=linearise(aircraft, trim),
    )


@dataclass(frozen=True)
class LateralOperatingPoint:
    """An aircraft about a trim in six axes: its tables and its derivatives."""

    tables: LateralTables
    derivatives: Linearisation


def lateral_operating_point(aircraft: Aircraft, trim: Trim, grid: ForceGrid) -> LateralOperatingPoint:
    """Probe the lateral forces of an aircraft about a trim in six axes.

    Parameters
    ----------
    aircraft, trim : the aircraft and its equilibrium.
    grid : states of the tables.

    Raises
    ------
    TrimError
        If aileron and rudder do not follow their commands at the trim.
    """
    return LateralOperatingPoint(
        probe_lateral(aircraft, trim, grid), linearise(aircraft, trim, motion=LATERAL)
    )


__all__ = ["LateralOperatingPoint", "OperatingPoint", "lateral_operating_point", "operating_point"]
