"""Records flown again in JSBSim, by the declared and by the updated aircraft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft, Sensor
from airtruth.errors import FlightError, TrimError
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.disposable import isolated, isolated_flight
from airtruth.simulation.replay import replay
from airtruth.simulation.simulator import Condition
from airtruth.simulation.tracks import Track, substeps
from airtruth.simulation.trim import Trim, trim
from airtruth.tracing.inference.assess import noise_floor
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.records import FINE, TraceRecord
from airtruth.tracing.stage_errors import MOST_RECORDS, PerChannel, Replay
from airtruth.tracing.stages import Stages

Array = NDArray[np.float64]

_APART: Final = 0.25
"""Logarithm of the ratio of two errors of one free run, in JSBSim and in the filter, from which they disagree [-]
(judgement: they agree within 0.05 for the shipped aircraft)."""
_WORSE: Final = 1.05
"""Ratio of two errors in JSBSim from which the updated aircraft is worse [-] (judgement: derivatives within their uncertainty
change an error by a few per cent)."""


def flown_again(stages: Stages, aircraft: Aircraft, updated: str | Path | None) -> Replay:
    """Free runs of the held-out records (of the fitted ones where none is held out) in JSBSim itself.

    Parameters
    ----------
    stages : the assessed stages of a trace.
    aircraft : the declared aircraft; updated : folder of the updated one, None where there is none.

    Returns
    -------
    Errors of both aircraft; an empty `Replay` for an aircraft without JSBSim, for a trace with the linear model, for records
    whose lateral motion moves the pitch plane, because this flight has level wings, and where the motion leaves the range of
    the simulation.

    Raises
    ------
    AircraftError
        If the updated aircraft cannot be read.
    """
    if aircraft.file.jsbsim is None or stages.case.model != "aircraft":
        return Replay()
    problem = stages.reported[0]
    if any(r.signals.coupling.size for r in problem.records):
        return Replay()
    new = None if updated is None else planes.load(updated)
    weights = _weights(stages)
    try:
        return Replay(
            declared=_errors(problem, aircraft, weights),
            updated=None if new is None else _errors(problem, new, weights),
        )
    except (FlightError, TrimError):
        return Replay()


def disagreement(replay: Replay, stages: Stages) -> list[str]:
    """A sentence where JSBSim and the filter disagree on the motion of the declared aircraft.

    The filter is built from forces at rest, so it lacks the servos, lags and alpha-dot terms of a JSBSim model. Lateral
    records are not compared: the offsets of their surfaces have a prior in the filter and none in JSBSim, and bank drifts with
    them.

    Parameters
    ----------
    replay : errors in JSBSim; stages : the assessed stages, with the errors of the filter on the same records.
    """
    if replay.declared is None or stages.case.fitted.layout.motion is not LONGITUDINAL:
        return []
    channels = stages.case.fitted.layout.motion.output_channels
    same = np.stack([a.free_run for a in stages.reported[1]["declared"][:MOST_RECORDS]])
    filtered = dict(zip(channels, np.sqrt(np.mean(same**2, axis=0)).tolist(), strict=True))
    ratios = {c: rms / max(filtered[c], 1e-12) for c, rms in replay.declared.items()}
    apart = [f"{channel} {ratio:.2f}" for channel, ratio in ratios.items() if abs(np.log(ratio)) > _APART]
    if not apart:
        return []
    return [
        "JSBSim and the filter disagree on the motion of the declared aircraft (error in JSBSim over error of the "
        f"filter: {', '.join(apart)}): the JSBSim model has dynamics that forces at rest do not show, and the traced "
        "effect may be these dynamics; declare them under [dynamics] in aircraft.toml (docs/aircraft.md)"
    ]


def worsened(replay: Replay | None) -> list[str]:
    """A sentence where the updated aircraft flies the records worse than the declared one."""
    if replay is None or replay.declared is None or replay.updated is None:
        return []
    worse = [
        f"{channel} {replay.updated[channel] / max(rms, 1e-12):.2f}"
        for channel, rms in replay.declared.items()
        if replay.updated[channel] > _WORSE * rms
    ]
    if not worse:
        return []
    return [
        "in JSBSim the updated aircraft flies the records worse than the declared one (error of the updated over error of the "
        f"declared: {', '.join(worse)}), so the answer is provisional; do not use the updated aircraft before another flight "
        "confirms it"
    ]


def _weights(stages: Stages) -> list[Array]:
    """(3,) of each record: standard deviations of its free run that gusts and sensor noise explain."""
    problem, assessed = stages.reported
    model = stages.models["before"]
    compiled = model.hypothesis.compiled(model.sizes)
    pairs = zip(problem.records[:MOST_RECORDS], assessed["before"], strict=False)
    return [
        noise_floor(record, problem.settings, compiled, model.common, own.per_record) for record, own in pairs
    ]


def _errors(problem: TraceProblem, aircraft: Aircraft, weights: list[Array]) -> PerChannel:
    """Root mean squares of the measured channels."""
    channels = problem.layout.motion.output_channels
    trims: dict[Condition, Trim] = {}
    squares = []
    for record, weight in zip(problem.records, weights, strict=False):
        declared = record.plant.trim
        assert declared is not None
        before = declared.airspeed_m_s
        ratio = float(_corrected("airspeed_m_s", np.array(before), record.plant.aircraft, aircraft)) / before
        at = replace(declared.condition, eas_m_s=declared.condition.eas_m_s * ratio)
        if at not in trims:
            trims[at] = isolated(f"the trim of {aircraft.name}", trim, aircraft, at)
        measured = track(record, aircraft, weight)
        flown = isolated_flight(
            measured.airspeed_m_s.size,
            f"the replay of {aircraft.name}",
            replay,
            aircraft,
            trims[at],
            measured,
        )
        residual = record.signals.y - np.stack([flown[c] for c in channels], axis=1)
        squares.append((residual**2).mean(axis=0))
    roots = np.sqrt(np.mean(squares, axis=0)).tolist()
    return {
        c: root for c, root, known in zip(channels, roots, problem.settings.measured, strict=True) if known
    }


def _corrected(channel: str, x: Array, declared: Aircraft, aircraft: Aircraft) -> Array:
    """An input corrected for the declared aircraft's sensor, corrected for the sensor of ``aircraft`` instead."""
    old, new = (plane.file.sensors.get(channel, Sensor()) for plane in (declared, aircraft))
    return new.errors().unscaled(old.errors().scaled(x))


def _lead_s(channel: str, declared: Aircraft, aircraft: Aircraft) -> float:
    """Difference in delay and lag [s] of an input's sensor, ``aircraft`` less ``declared``."""
    old, new = (plane.file.sensors.get(channel, Sensor()) for plane in (declared, aircraft))
    return new.errors().lead_s - old.errors().lead_s


def track(record: TraceRecord, aircraft: Aircraft, weight: Array) -> Track:
    """A record on the simulation's grid, with the errors of the aircraft's sensors undone in its inputs.

    Parameters
    ----------
    record : its inputs are corrected for the sensors of its plant's aircraft.
    weight : (outputs,) standard deviations that weight the residuals of the outputs.
    """
    s = record.signals
    steps = substeps(s.dt_s)
    samples = s.y.shape[0]
    grid = np.arange((samples - 1) * steps + 1) / steps

    def true(channel: str, fine: Array, cells: int) -> Array:
        late = _lead_s(channel, record.plant.aircraft, aircraft) / s.dt_s
        values = np.interp(grid + late, np.arange(len(fine)) / cells, fine)
        values = _corrected(channel, values, record.plant.aircraft, aircraft)
        old, new = (
            plane.file.sensors.get(channel, Sensor()).errors() for plane in (record.plant.aircraft, aircraft)
        )
        if old.alpha_slope_per_rad == new.alpha_slope_per_rad:
            return values
        alpha = np.interp(grid, np.arange(samples), s.attack_rad[:: s.sub])
        return values * old.slope(alpha) / new.slope(alpha)

    outputs: Mapping[str, Array] = {c: s.y[:, i] for i, c in enumerate(s.motion.output_channels)}
    known = dict(zip(s.motion.output_channels, weight.tolist(), strict=True))
    moved = zip(s.motion.controls, s.controls_rad, strict=True)
    surfaces = {control.name: true(control.channel, own, s.sub * FINE) for control, own in moved}
    airspeed = true("airspeed_m_s", s.airspeed_m_s, s.sub)
    return Track(s.dt_s, steps, outputs, known, surfaces, airspeed)


__all__ = ["disagreement", "flown_again", "track", "worsened"]
