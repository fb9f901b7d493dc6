"""Breaks of the declared lift curve within the flown range, which the filter's uncertainty in gusts does not hold.

The filter has one steady gain for each record, that of the trim. Beyond a break of the lift curve the response to gusts
is another one; the innovations in gusts are then larger than the filter expects, and whatever describes part of that
excess gains likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.parameters import Parameters, PerRecord
from airtruth.units import DEG

Array = NDArray[np.float64]

_BREAK: Final = 0.25
"""Change of slope at a break, over the steepest slope [-] (judgement: the GTM's lift curve changes by at most 0.23 over a
degree; the aircraft of docs/foreign_aircraft.md that are answered wrongly in gusts have 0.35 and more)."""
_FLOWN: Final = (0.01, 0.99)
"""Quantiles of the measured angle of attack between which a break counts [-] (judgement)."""
_GUST_RAD: Final = 0.25 * DEG
"""Standard deviation of the gusts' angle of attack from which a break counts [rad] (judgement: in calmer air the
predicted angle is known to a small part of the distance between breaks)."""


def crossed_breaks(problem: TraceProblem, point: Parameters) -> tuple[float, ...]:
    """Angles at which the declared lift curve breaks and which records in gusts cross, increasing [rad].

    Parameters
    ----------
    point : fitted parameters, which hold the gusts of each record.
    """
    crossed: set[float] = set()
    for record, own in zip(problem.records, point.per_record, strict=True):
        gust_rad = np.exp(own[PerRecord.log_gust]) / np.mean(record.signals.airspeed_m_s)
        if gust_rad < _GUST_RAD:
            continue
        plant = record.plant
        x, z, _ = plant.over_alpha.T
        lift = x * np.sin(plant.alpha_rad) - z * np.cos(plant.alpha_rad)
        low, high = np.quantile(record.signals.y[:, 0] - plant.alpha_shift_rad, _FLOWN)
        crossed |= {angle for angle in breaks_of(plant.alpha_rad, lift) if low < angle < high}
    return tuple(sorted(crossed))


def breaks_of(alpha_rad: Array, lift: Array) -> tuple[float, ...]:
    """Angles at which the slope of a lift curve changes by a quarter of its largest.

    Parameters
    ----------
    alpha_rad : (points,) increasing angles of attack [rad].
    lift : (points,) lift or its coefficient, in any unit.
    """
    slope = np.diff(lift) / np.diff(alpha_rad)
    changed = np.abs(np.diff(slope)) > _BREAK * np.max(np.abs(slope))
    return tuple(float(a) for a in alpha_rad[1:-1][changed])


def break_note(crossed: Sequence[float]) -> str:
    """Consequence of breaks [rad] for an answer, as a note."""
    angles = ", ".join(f"{a / DEG:.1f}" for a in crossed)
    return (
        f"the lift curve of the declared aircraft breaks at an angle of attack of {angles} deg, which the records cross in "
        "gusts; the tracer's uncertainty in gusts is that of a smooth curve. The answer is therefore provisional; trace "
        "records in calm air to confirm it"
    )


__all__ = ["break_note", "breaks_of", "crossed_breaks"]
