"""Aerodynamic slopes of a log near its trim: CLalpha, Cmde and the change of ax with alpha against usual values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.checks.relation import ATMOSPHERE_M, Relation, finite, informed_everywhere
from airtruth.checks.spectra import Factors, regress
from airtruth.checks.together import Runs
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.units import DEG, G0

Array = NDArray[np.float64]
Channels = Mapping[str, Array]

VANE, GYRO, NORMAL = LONGITUDINAL.output_channels
SURFACE = LONGITUDINAL.surfaces[0]
LIFT_SLOPE, *_, CONTROL_POWER = LONGITUDINAL.parameters
CAUSES: Final = (VANE, SURFACE, GYRO)
"""Channels of the motion in pitch."""
AXIAL_SLOPE: Final = (1.0, 0.4)
"""Slope of ax on alpha and its tolerance, as shares of gravity [-].

Lift tilts with alpha: ax changes by the weight times alpha, less the change of drag. The clean logs have 0.1
(f16) to 1.4 (T38).
"""
AXIAL_SHARE: Final = 0.7
"""Squared multiple correlation below which that slope is not tested: noise in alpha flattens it."""
LIFT_STD: Final = (0.35, 0.7)
"""Tolerance of the logarithm of CLalpha [-] where the aircraft declares it, and about `TYPICAL` where not."""
MOMENT_STD: Final = (0.6, 1.2)
"""The same for Cmde."""
NEAR_TRIM: Final = (0.2, 10.0 * DEG)
"""Range of airspeed over its mean [-] and range of alpha [rad] within which an aircraft keeps to one trim (judgement).

A damaged aircraft that leaves its trim stalls, and no derivative describes it. In 2625 records of the blind modes
`composite` and `derivative` within these ranges four of the distances below exceed 4, in 87 records beyond them
18.
"""
RATIOS: Final = np.linspace(-6.0, 6.0, 121)
"""Logarithms of the ratio of a true derivative to the declared one that are compared with an estimate [-] (judgement)."""
TYPICAL: Final = {LIFT_SLOPE: 4.5, CONTROL_POWER: -1.2}
"""Derivatives of conventional aircraft [1/rad], for those that declare none (shipped aircraft: 3 to 6, -0.5 to -2)."""


def slopes_near_trim(runs: Runs, aircraft: Aircraft | None) -> list[Relation]:
    """Tests of aerodynamic slopes in the runs that keep to one trim; the other runs have no distance.

    A run that yaws more than it pitches is none of them: sideslip and roll then move alpha and the pitching moment.
    """

    def keeps(c: Channels, dt_s: float) -> Array:
        speed, alpha = c["airspeed_m_s"], c[VANE]
        most_speed, most_alpha = NEAR_TRIM
        slow = np.ptp(speed, axis=1) < most_speed * np.abs(speed.mean(axis=1))
        pitch, yaw = (np.ptp(c.get(name, c[GYRO]), axis=1) for name in (GYRO, LATERAL.gyros[-1]))
        return np.asarray(slow & (np.ptp(alpha, axis=1) < most_alpha) & (yaw <= pitch))

    near = runs.each(keeps).astype(np.bool_)
    rows = np.flatnonzero(near) if near.any() else np.arange(len(near))
    chosen = runs.some(rows)
    result = [] if aircraft is None else _aerodynamic_tests(chosen, aircraft)
    if "ax_m_s2" in runs.channels:
        axial = chosen.spectra_of("ax_m_s2")[:, 0]
        result.append(_axial_test(regress(axial, chosen.spectra_of(*CAUSES), lines=chosen.lines())))
    return [_spread(test, rows, near) for test in result]


def _spread(test: Relation, rows: NDArray[np.intp], near: NDArray[np.bool_]) -> Relation:
    """A test of some runs as one of all runs; without any run near a trim it tells nothing."""
    at = np.append(rows, len(near))
    distance = np.zeros(len(near) + 1)
    figures = np.zeros((len(near) + 1, test.figures.shape[1]))
    distance[at] = test.distance * near.any()
    figures[at] = test.figures
    informed = np.append(near, near.any())
    informed[at] &= test.informed
    return replace(test, distance=distance, figures=figures, informed=informed)


def _axial_test(factors: Factors) -> Relation:
    """Slope of ax on alpha against that of the tilting lift."""
    value, std = factors.value[:, 0] / G0, np.sqrt(factors.covariance[:, 0, 0]) / G0
    usual, tolerance = AXIAL_SLOPE
    distance = (value - usual) ** 2 / (std**2 + tolerance**2) * (factors.share > AXIAL_SHARE)
    figures = np.stack([value, std, factors.share], axis=1)
    distance = finite(distance)
    channels = ("ax_m_s2", *CAUSES)
    return Relation("ax_slope", channels, distance, figures, informed_everywhere(distance))


def _aerodynamic_tests(runs: Runs, aircraft: Aircraft) -> list[Relation]:
    """CLalpha and Cmde from the slopes of az on alpha and of q' on the elevator, against the declared ones."""
    if not {"density_kg_m3", "altitude_m"} & set(runs.channels):
        return []

    def dynamic(c: Channels, dt_s: float) -> Array:
        density = c.get("density_kg_m3")
        if density is None:
            density = density_kg_m3(np.clip(c["altitude_m"], *ATMOSPHERE_M))
        return np.asarray(0.5 * (density * c["airspeed_m_s"] ** 2).mean(axis=1))

    pressure, lines = runs.each(dynamic), runs.lines()
    pressure = np.append(pressure, pressure.mean())
    area = aircraft.wing_area_m2
    declared = aircraft.file.derivatives
    result = []
    for name, factors, scale, tolerance, channels in (
        (
            LIFT_SLOPE,
            regress(runs.spectra_of(NORMAL)[:, 0], runs.spectra_of(*CAUSES), lines=lines),
            -aircraft.mass_kg / (pressure * area),
            LIFT_STD,
            ("airspeed_m_s", "density_kg_m3", VANE, NORMAL, SURFACE, GYRO),
        ),
        (
            CONTROL_POWER,
            regress(runs.spectra_of(GYRO)[:, 0], runs.integrals_of(SURFACE, VANE, GYRO), lines=lines),
            aircraft.inertia_yy_kg_m2 / (pressure * area * aircraft.chord_m),
            MOMENT_STD,
            (SURFACE, "airspeed_m_s", "density_kg_m3", VANE, GYRO),
        ),
    ):
        known = name in declared
        reference = declared[name].value if known else TYPICAL[name]
        value = factors.value[:, 0] * scale
        std = np.sqrt(factors.covariance[:, 0, 0]) * np.abs(scale)
        distance = _ratio_distance(value / reference, std / abs(reference), tolerance[0 if known else 1])
        figures = np.stack([value, std, np.full_like(value, reference)], axis=1)
        result.append(Relation(name, channels, distance, figures, informed_everywhere(distance)))
    return result


def _ratio_distance(ratio: Array, std: Array, tolerance: float) -> Array:
    """Squared distance of estimated ratios (runs + 1,), normal errors, from true ones of lognormal tolerance.

    The least sum of both squared distances over the true ratio, which may be the estimate itself.
    """
    own = np.log(np.maximum(ratio, np.exp(RATIOS[0])))
    tried = np.concatenate([np.repeat(RATIOS[:, None], len(ratio), axis=1), own[None]])
    apart = (tried / tolerance) ** 2 + ((ratio - np.exp(tried)) / np.maximum(std, 1e-9)) ** 2
    return finite(np.min(apart, axis=0))


__all__ = ["CONTROL_POWER", "TYPICAL", "slopes_near_trim"]
