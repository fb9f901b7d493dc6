"""Records flown again in JSBSim, by the declared aircraft and by the updated one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft, Sensor
from airtruth.errors import FlightError, TrimError
from airtruth.fly.replay import Track, replay, substeps
from airtruth.fly.trim import Trim, trim
from airtruth.trace.holdout import floor
from airtruth.trace.lower import CHANNELS, lower
from airtruth.trace.prepare import Case
from airtruth.trace.records import FINE, Record
from airtruth.trace.search import Stage

Array = NDArray[np.float64]

MOST_RECORDS: Final = 6
"""Records that are flown again, the first of those held out."""


def flown_again(
    case: Case, stages: tuple[Stage, ...], aircraft: Aircraft, updated: str | Path | None
) -> dict[str, dict[str, float]]:
    """Free runs of the records held out (fitted ones where none is) in JSBSim itself.

    Parameters
    ----------
    case, stages : what was traced, and the rounds of the search.
    aircraft : the declared one; updated : folder of the updated one, None without.

    Returns
    -------
    "declared" and, with an update, "updated" -> channel -> root mean square error [unit of the channel];
    empty for an aircraft without a JSBSim model, or where the motion leaves the simulation's range.
    """
    if aircraft.file.jsbsim is None or case.model != "aircraft":
        return {}
    problem = case.held or case.fitted
    flying = {"declared": aircraft}
    if updated is not None:
        flying["updated"] = planes.load(updated)
    null = stages[0].null
    low = lower(null.hypothesis.change(null.point.sizes))
    result = {}
    for name, plane in flying.items():
        trims: dict[object, Trim] = {}
        squares = []
        for i, record in enumerate(problem.records[:MOST_RECORDS]):
            own = null.point.local[min(i, len(null.point.local) - 1)]
            level = floor(record, problem, low, null.point.shared, own)
            declared = record.plant.trim
            assert declared is not None
            try:
                if declared.condition not in trims:
                    trims[declared.condition] = declared if name == "declared" else trim(plane, declared.condition)
                flown = replay(plane, trims[declared.condition], track(record, plane, level))
            except (FlightError, TrimError):
                return {}
            residual = record.signals.y - np.stack([flown[c] for c in CHANNELS], axis=1)
            squares.append((residual**2).mean(axis=0))
        result[name] = dict(zip(CHANNELS, np.sqrt(np.mean(squares, axis=0)).tolist(), strict=True))
    return result


def track(record: Record, aircraft: Aircraft, weight: Array) -> Track:
    """A record on the simulation's grid, its inputs as they were before the aircraft's sensors.

    Parameters
    ----------
    weight : (3,) standard deviations by which the residuals of `CHANNELS` count.
    """
    s = record.signals
    steps = substeps(s.dt_s)
    samples = s.y.shape[0]
    grid = np.arange((samples - 1) * steps + 1) / steps

    def true(channel: str, fine: Array, cells: int) -> Array:
        sensor = aircraft.file.sensors.get(channel, Sensor())
        late = (sensor.delay.value + sensor.lag.value) / s.dt_s
        values = np.interp(grid + late, np.arange(len(fine)) / cells, fine)
        return np.asarray((values - sensor.bias.value) / sensor.scale.value)

    outputs: Mapping[str, Array] = {c: s.y[:, i] for i, c in enumerate(CHANNELS)}
    return Track(
        dt_s=s.dt_s,
        substeps=steps,
        outputs=outputs,
        weight=dict(zip(CHANNELS, weight.tolist(), strict=True)),
        elevator_rad=true("elevator_rad", s.elevator_rad, s.sub * FINE),
        airspeed_m_s=true("airspeed_m_s", s.airspeed_m_s, s.sub),
    )


__all__ = ["MOST_RECORDS", "flown_again", "track"]
