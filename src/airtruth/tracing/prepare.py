"""Records and declared aircraft of a trace: what the search fits, what is held out, which effects can be tested."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft, Sensor
from airtruth.aircraft.tail import tail_geometry
from airtruth.checks.excitation import LEAST_ELEVATOR_RAD
from airtruth.effects.effect import Effect
from airtruth.errors import ConfigurationError, LogError, choices
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.composition import directions
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import is_reconstructed
from airtruth.physics.short_period import PARAMETERS
from airtruth.tracing.conditions import condition_notes, records_of
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.reading import measured_controls, read
from airtruth.tracing.model.records import FINE, Signals, TraceRecord, fine
from airtruth.tracing.model.settings import VANE, declared_change, resolved, settings_of
from airtruth.tracing.model.surface_noise import with_surface_noise
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.selection.explanation import DERIVATIVES, causes_of
from airtruth.tracing.selection.release import DeclaredCauses
from airtruth.units import DEG

Array = NDArray[np.float64]

_LEAST_SAMPLES: Final = 40
"""Least number of samples of a record [-] (judgement: fewer do not show a short period at 20 to 50 Hz)."""
_THRUST_STD: Final = 0.05
"""Prior standard deviation of the thrust over its trimmed value, throttle logged [-] (judgement)."""
_THRUST_UNKNOWN_STD: Final = 0.25
"""The same without a logged throttle [-] (judgement)."""
_LEAD_S: Final = 3.0
"""Time before the second half of a record from which the filter runs [s] (judgement: several short periods, and time
constants of slow sensors)."""
_AIR: Final = "each record has its own gust level, and the measured airspeed contains the horizontal gusts"
"""Why an effect of the air is not tested."""
_NO_VANE: Final = (
    "alpha was reconstructed, because no vane measured it: the filter takes q and az as outputs and alpha as a state, and "
    "no effect of a vane can be tested"
)
"""Note of a trace of records without a vane."""


@dataclass(frozen=True)
class Case:
    """The records and the declared aircraft of a trace.

    Attributes
    ----------
    fitted, held : problems of the fitted and of the held-out records; ``held`` is None where there are none.
    hypothesis : the declared aircraft.
    effects : candidates that can be tested.
    untestable : the other candidates, each with the reason.
    model : "aircraft" or "linear".
    notes : sentences for the report, without a final period.
    declared : candidates that explain a contradiction of the declared derivatives.
    left_out : steps of the search that a time budget left out.
    """

    fitted: TraceProblem
    held: TraceProblem | None
    hypothesis: Hypothesis
    effects: tuple[Effect, ...]
    untestable: tuple[tuple[Effect, str], ...]
    model: str
    notes: tuple[str, ...]
    declared: DeclaredCauses
    left_out: tuple[str, ...] = ()

    @property
    def has_vane(self) -> bool:
        """Whether alpha was measured in every record."""
        return bool(self.fitted.settings.measured.all())


def prepare(
    logs: Sequence[FlightLog], aircraft: Aircraft, effects: Sequence[Effect], options: TraceOptions
) -> Case:
    """Check the records, build the declared plant of each flight condition, and split off the held-out records.

    Parameters
    ----------
    logs : logs that passed the gate.
    effects : requested candidates.

    Raises
    ------
    LogError, ConfigurationError, AircraftError
        Naming what is wrong, where, and what to do.
    """
    _one_aircraft(logs, aircraft)
    controls = measured_controls(aircraft, LONGITUDINAL)
    signals = [undo_input_sensors(s, aircraft) for log in logs for s in read(log, LONGITUDINAL, controls)]
    signals.sort(key=lambda s: s.run_id)  # the answer does not depend on the order of the logs
    chosen = _hold_out([s.run_id for s in signals], options)
    _check(signals, chosen, logs)
    model = options.model if aircraft.file.jsbsim is not None else "linear"
    notes = []
    if model != options.model:
        notes.append("the aircraft has no JSBSim model: it is traced with the linear short-period model")
    records = records_of(signals, aircraft, model, chosen)
    fitted = tuple(r for r in records if r.signals.run_id not in chosen)
    has_throttle = all(r.signals.throttle is not None for r in fitted)
    has_vane = not any(is_reconstructed(log.channels) for log in logs)
    thrust_std = _THRUST_STD if has_throttle else _THRUST_UNKNOWN_STD
    settings = settings_of(aircraft, thrust_std, has_vane=has_vane)
    settings = resolved(settings, fitted)
    fitted = tuple(with_surface_noise(r, settings) for r in fitted)
    held = tuple(with_surface_noise(r, settings) for r in records if r.signals.run_id in chosen)
    if len(fitted) == 1:
        notes.append("one record is fitted: each of its halves is left out in turn")
        fitted = _halves(fitted[0])
    notes.extend(condition_notes(records))
    if not held:
        notes.append("nothing is held out: the verdict is provisional")
    if not has_vane:
        notes.append(_NO_VANE)
    slopes = dict(
        zip(PARAMETERS, np.mean([r.plant.derivatives for r in fitted], axis=0).tolist(), strict=True)
    )
    effects = [effect.for_aircraft(slopes) for effect in effects]
    columns = set.intersection(*(set(log.channels) for log in logs))
    reasons = {effect.key: _why_not(effect, columns, has_vane) for effect in effects}
    first = fitted[0].plant.trim_alpha_rad
    trim_alpha_rad = first + fmean(r.plant.trim_alpha_rad - first for r in fitted)
    return Case(
        fitted=TraceProblem(fitted, settings, options.threads),
        held=TraceProblem(held, settings, options.threads) if held else None,
        hypothesis=Hypothesis(declared_change(aircraft, has_vane=has_vane), trim_flow_rad=trim_alpha_rad),
        effects=tuple(e for e in effects if not reasons[e.key]),
        untestable=tuple((e, reasons[e.key]) for e in effects if reasons[e.key]),
        model=model,
        notes=tuple(notes),
        declared=_declared_causes(fitted, aircraft, effects, options),
    )


def _declared_causes(
    fitted: Sequence[TraceRecord], aircraft: Aircraft, effects: Sequence[Effect], options: TraceOptions
) -> DeclaredCauses:
    """Causes that move several derivatives, and wrong declarations, as far as they are requested."""
    mean = np.mean([r.plant.derivatives for r in fitted], axis=0)
    keys = options.keys
    causes = causes_of(directions(mean, tail_geometry(aircraft)))
    return DeclaredCauses(
        tuple(c for c in causes if keys is None or c.key in keys),
        keys is None or DERIVATIVES in keys,
        tuple(e for e in effects if e.key in {c.key for c in causes}),
    )


def _why_not(effect: Effect, columns: Collection[str], has_vane: bool) -> str:
    """Why an effect cannot be tested; empty if it can."""
    missing = [channel for channel in effect.channels if channel not in columns]
    if missing:
        return f"the log lacks {', '.join(missing)}"
    if not has_vane and VANE in effect.channels:
        return "alpha was reconstructed: no vane measured it"
    return _AIR if effect.where == "air" else ""


def _one_aircraft(logs: Sequence[FlightLog], aircraft: Aircraft) -> None:
    names = sorted({str(log.metadata["aircraft"]) for log in logs if log.metadata.get("aircraft")})
    if len(names) > 1:
        raise LogError(
            f"the records are of several aircraft ({', '.join(names)}): trace the records of one aircraft at a time"
        )


def undo_input_sensors(s: Signals, aircraft: Aircraft) -> Signals:
    """A run with the declared errors of the elevator's and the airspeed's sensors undone."""

    def true(channel: str, x: Array, cells: int) -> Array:
        errors = aircraft.file.sensors.get(channel, Sensor()).errors()
        late = errors.lead_s / s.dt_s * cells
        if late > 0.0:
            at = np.arange(len(x))
            x = np.interp(at + late, at, x)
        return errors.unscaled(x)

    airspeed = true("airspeed_m_s", s.airspeed_m_s, s.sub)
    declared = aircraft.file.sensors.get("airspeed_m_s", Sensor()).errors()
    if declared.alpha_slope_per_rad != 0.0:
        airspeed = airspeed / declared.slope(fine(s.y[:, 0], s.sub))
    return replace(
        s,
        controls_rad=np.stack(
            [
                true(control.channel, x, s.sub * FINE)
                for control, x in zip(s.motion.controls, s.controls_rad, strict=True)
            ]
        ),
        airspeed_m_s=airspeed,
        ground_m_s=true("airspeed_m_s", s.ground_m_s, s.sub),
    )


def _check(signals: Sequence[Signals], held: Sequence[str], logs: Sequence[FlightLog]) -> None:
    for s in signals:
        if s.y.shape[0] < _LEAST_SAMPLES:
            raise LogError(
                f"run {s.run_id}: {s.y.shape[0]} samples; a record needs at least {_LEAST_SAMPLES} to be traced"
            )
    moved = max(float(np.ptp(s.elevator_rad)) for s in signals if s.run_id not in held)
    if moved < LEAST_ELEVATOR_RAD:
        which = "record that is not held out" if held else "record"
        raise LogError(
            f"no {which} moves the elevator by {LEAST_ELEVATOR_RAD / DEG:g} deg: {_range_of(logs, held, moved)}; without an "
            "input no effect can be separated from another; fly doublets or 3-2-1-1 of at least 1 deg"
        )


def _range_of(logs: Sequence[FlightLog], held: Sequence[str], moved_rad: float) -> str:
    """The range of the elevator's column in words, and the part of it that is no noise."""
    runs = ((log, i) for log in logs for i, run_id in enumerate(log.run_ids) if run_id not in held)
    raw = max(float(np.ptp(log.channels["elevator_rad"][log.rows(i)])) for log, i in runs)
    column = f"elevator_rad has a range of {raw / DEG:.2g} deg"
    if moved_rad >= raw:
        return column
    rest = "all of it" if moved_rad == 0.0 else f"all but {moved_rad / DEG:.2g} deg of it"
    return f"{column}, {rest} noise of its sensor"


def _hold_out(runs: Sequence[str], options: TraceOptions) -> tuple[str, ...]:
    if options.hold_out is None:
        return tuple(runs[2::3]) if len(runs) >= 3 else ()
    for run in options.hold_out:
        if run not in runs:
            raise ConfigurationError(f"--hold-out {run!r}: no such run; {choices(run, runs)}")
    if len(set(options.hold_out)) == len(runs):
        raise ConfigurationError("--hold-out names every run: leave at least one to fit")
    return tuple(options.hold_out)


def _halves(record: TraceRecord) -> tuple[TraceRecord, TraceRecord]:
    """The record cut where the elevator has made half of its travel, so that both parts are excited.

    The second part begins in motion: surfaces, sensors and effects that act late still show what came before.
    """
    s = record.signals
    travel = np.cumsum(np.abs(np.diff(s.elevator_rad[:: s.sub * FINE])))
    half = int(np.searchsorted(travel, 0.5 * travel[-1]))
    middle = min(max(half, _LEAST_SAMPLES // 2), s.y.shape[0] - _LEAST_SAMPLES // 2)
    start = max(middle - math.ceil(_LEAD_S / s.dt_s), 0)
    halves = []
    for name, lead, first, last in (
        ("first half", 0, 0, middle),
        ("second half", start, middle, s.y.shape[0]),
    ):
        points = slice(lead * s.sub, (last - 1) * s.sub + 1)
        beyond = None if record.remainder is None else np.ascontiguousarray(record.remainder[:, points])
        halves.append(replace(record, signals=s.part(name, lead, first, last), remainder=beyond))
    return halves[0], halves[1]


__all__ = ["Case", "prepare", "undo_input_sensors"]
