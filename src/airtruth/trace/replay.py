"""Records flown again in JSBSim, by the declared aircraft and by the updated one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft, Sensor
from airtruth.errors import FlightError, TrimError
from airtruth.fly.engine import Condition
from airtruth.fly.replay import Track, replay, substeps
from airtruth.fly.trim import Trim, trim
from airtruth.trace.answer import Outcome
from airtruth.trace.holdout import floor
from airtruth.trace.lower import CHANNELS, lower
from airtruth.trace.prepare import Case
from airtruth.trace.records import FINE, Record, lead_s, undone

Array = NDArray[np.float64]

MOST_RECORDS: Final = 6
"""Records that are flown again, the first of those held out."""
_APART: Final = 0.25
"""Logarithm of two errors of one free run, the filter's and JSBSim's, that differ; they agree to 0.05 as a rule."""


def flown_again(
    case: Case, outcome: Outcome, aircraft: Aircraft, updated: str | Path | None
) -> dict[str, dict[str, float]]:
    """Free runs of the records held out (fitted ones where none is) in JSBSim itself.

    Parameters
    ----------
    case, outcome : what was traced, and its stages.
    aircraft : the declared one; updated : folder of the updated one, None without.

    Returns
    -------
    "declared" and, with an update, "updated" -> channel -> root mean square error [unit of the channel];
    empty for an aircraft without a JSBSim model, or where the motion leaves the simulation's range.

    Raises
    ------
    AircraftError
        If the updated aircraft cannot be read.
    """
    if aircraft.file.jsbsim is None or case.model != "aircraft":
        return {}
    flying = {"declared": aircraft}
    if updated is not None:
        flying["updated"] = planes.load(updated)
    levels = _levels(case, outcome)
    try:
        return {name: _errors(case, plane, levels) for name, plane in flying.items()}
    except (FlightError, TrimError):
        return {}


def disagreement(answer: Mapping[str, Any]) -> list[str]:
    """A sentence where JSBSim flies the declared aircraft otherwise than the filter does: of what it has in motion
    (servos, lags, terms in the rate of the angle of attack) forces at rest show nothing.

    Parameters
    ----------
    answer : with ``error`` and ``replay``.
    """
    flown = answer["replay"].get("declared")
    stage = answer["error"]["declared"]
    told = stage.get("held_out", stage["fit"])["free_run"]
    if flown is None:
        return []
    ratios = {channel: flown[channel] / max(told[channel], 1e-12) for channel in flown}
    apart = [f"{channel} {ratio:.2f}" for channel, ratio in ratios.items() if abs(np.log(ratio)) > _APART]
    if not apart:
        return []
    return [
        f"JSBSim flies the declared aircraft otherwise than the filter (error over the filter's: {', '.join(apart)}): "
        "its model has dynamics that forces at rest do not show, and they may be what is traced; declare them under "
        "[dynamics] in aircraft.toml (docs/aircraft.md)"
    ]


def _levels(case: Case, outcome: Outcome) -> list[Array]:
    """(3,) of each record: what gusts and sensors explain of its free run."""
    problem = case.held or case.fitted
    model = outcome.models["before"]
    low = lower(model.hypothesis.change(model.sizes))
    judged = (outcome.held if case.held else outcome.fitted)["before"]
    pairs = zip(problem.records[:MOST_RECORDS], judged, strict=False)
    return [floor(record, problem, low, model.shared, own.local) for record, own in pairs]


def _errors(case: Case, aircraft: Aircraft, levels: list[Array]) -> dict[str, float]:
    trims: dict[Condition, Trim] = {}
    squares = []
    for record, level in zip((case.held or case.fitted).records, levels, strict=False):
        declared = record.plant.trim
        assert declared is not None
        before = declared.airspeed_m_s
        ratio = float(_corrected("airspeed_m_s", np.array(before), record.plant.aircraft, aircraft)) / before
        at = replace(declared.condition, eas_m_s=declared.condition.eas_m_s * ratio)
        if at not in trims:
            trims[at] = trim(aircraft, at)
        flown = replay(aircraft, trims[at], track(record, aircraft, level))
        residual = record.signals.y - np.stack([flown[c] for c in CHANNELS], axis=1)
        squares.append((residual**2).mean(axis=0))
    return dict(zip(CHANNELS, np.sqrt(np.mean(squares, axis=0)).tolist(), strict=True))


def _corrected(channel: str, x: Array, declared: Aircraft, aircraft: Aircraft) -> Array:
    """An input that was corrected for one aircraft's sensor, corrected for another's instead."""
    old, new = (plane.file.sensors.get(channel, Sensor()) for plane in (declared, aircraft))
    return undone(x * old.scale.value + old.bias.value, new)


def _lead_s(channel: str, declared: Aircraft, aircraft: Aircraft) -> float:
    """By how much more an input has to be advanced for one aircraft's sensor than for another's."""
    old, new = (plane.file.sensors.get(channel, Sensor()) for plane in (declared, aircraft))
    return lead_s(new) - lead_s(old)


def track(record: Record, aircraft: Aircraft, weight: Array) -> Track:
    """A record on the simulation's grid, its inputs as they were before the aircraft's sensors.

    Parameters
    ----------
    record : its inputs are corrected for the sensors of the aircraft that its plant is of.
    weight : (3,) standard deviations by which the residuals of `CHANNELS` count.
    """
    s = record.signals
    steps = substeps(s.dt_s)
    samples = s.y.shape[0]
    grid = np.arange((samples - 1) * steps + 1) / steps

    def true(channel: str, fine: Array, cells: int) -> Array:
        late = _lead_s(channel, record.plant.aircraft, aircraft) / s.dt_s
        values = np.interp(grid + late, np.arange(len(fine)) / cells, fine)
        return _corrected(channel, values, record.plant.aircraft, aircraft)

    outputs: Mapping[str, Array] = {c: s.y[:, i] for i, c in enumerate(CHANNELS)}
    return Track(
        dt_s=s.dt_s,
        substeps=steps,
        outputs=outputs,
        weight=dict(zip(CHANNELS, weight.tolist(), strict=True)),
        elevator_rad=true("elevator_rad", s.elevator_rad, s.sub * FINE),
        airspeed_m_s=true("airspeed_m_s", s.airspeed_m_s, s.sub),
    )


__all__ = ["MOST_RECORDS", "disagreement", "flown_again", "track"]
