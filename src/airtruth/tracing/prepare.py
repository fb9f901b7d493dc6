"""Records and declared aircraft of a trace: what the search fits, what is held out, which effects can be tested."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft, Sensor
from airtruth.aircraft.tail import tail_geometry
from airtruth.checks.excitation import LEAST_ELEVATOR_RAD
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError, LogError, choices
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.composition import directions
from airtruth.physics.motion import LONGITUDINAL, MOTIONS, Motion
from airtruth.physics.reconstruction import is_reconstructed
from airtruth.physics.resolution import LinearPoint
from airtruth.tracing.conditions import condition_notes, records_of, with_mean_derivatives
from airtruth.tracing.inference.causes import DERIVATIVES, DeclaredCauses, causes_of
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.probed import flies
from airtruth.tracing.model.reading import measured_controls, read
from airtruth.tracing.model.records import FINE, Signals, TraceRecord, fine
from airtruth.tracing.model.settings import (
    VANE,
    declared_change,
    declared_derivatives_of,
    resolved,
    settings_of,
)
from airtruth.tracing.model.surface_noise import with_surface_noise
from airtruth.tracing.options import TraceOptions
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
_OF_INPUTS: Final = ("bias", "scale", "arm_right")
"""Errors of the sensor of a known input that the filter takes."""
_RECONSTRUCTED: Final = "alpha was reconstructed: no vane measured it"
"""Why an effect of a vane is not tested."""
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
        """Whether a vane measured the flow angle in every record."""
        outputs = self.fitted.layout.motion.outputs
        vanes = [y.instrument == "vane" for y in outputs]
        return bool(self.fitted.settings.measured[vanes].all())


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
    motion = LONGITUDINAL if options.motion is None else MOTIONS[options.motion]
    controls = measured_controls(aircraft, motion)
    signals = [
        undo_input_sensors(s, aircraft)
        for log in logs
        for s in read(log, motion, controls, aircraft.constants)
    ]
    signals.sort(key=lambda s: s.run_id)  # the answer does not depend on the order of the logs
    chosen = _hold_out([s.run_id for s in signals], options)
    _check(signals, chosen, logs)
    model, notes = _model_of(aircraft, motion, options)
    notes.extend(_steady_notes(signals))
    records = with_mean_derivatives(records_of(signals, aircraft, model, chosen), chosen)
    fitted = tuple(r for r in records if r.signals.run_id not in chosen)
    has_throttle = all(r.signals.throttle is not None for r in fitted)
    absent = _absent(logs, motion)
    thrust_std = _THRUST_STD if has_throttle else _THRUST_UNKNOWN_STD
    settings = settings_of(aircraft, thrust_std, motion, absent=absent)
    settings = resolved(settings, fitted)
    fitted = tuple(with_surface_noise(r, settings) for r in fitted)
    held = tuple(with_surface_noise(r, settings) for r in records if r.signals.run_id in chosen)
    if len(fitted) == 1:
        notes.append("one record is fitted: each of its halves is left out in turn")
        fitted = _halves(fitted[0])
    notes.extend(condition_notes(records))
    if not held:
        notes.append("nothing is held out: the verdict is provisional")
    notes.extend(_NO_VANE if channel == VANE else _unmeasured(channel, motion) for channel in absent)
    mean = declared_derivatives_of(fitted)
    slopes = dict(zip(motion.parameters, mean.tolist(), strict=True))
    foreign = [e for e in effects if not e.applies_to(motion) or _delays_input(e, motion)]
    point = LinearPoint(mean, fitted[0].plant.trims, tail_geometry(aircraft), motion)
    effects = [e.for_aircraft(slopes).at_point(point) for e in effects if e not in foreign]
    columns = set.intersection(*(set(log.channels) for log in logs))
    reasons = {effect.key: _why_not(effect, columns, absent) for effect in effects}
    untestable = [(e, reasons[e.key]) for e in effects if reasons[e.key]]
    if options.effects is not None:  # those of the library were not asked for
        elsewhere = f"it does not act on the {motion.name} motion"
        untestable += [(e, _why_not(e, columns, absent) or elsewhere) for e in foreign]
    trims = [float(r.plant.trim_signals[0]) for r in fitted]
    trim_flow_rad = trims[0] + fmean(trim - trims[0] for trim in trims)
    return Case(
        fitted=TraceProblem(fitted, settings, options.threads),
        held=TraceProblem(held, settings, options.threads) if held else None,
        hypothesis=Hypothesis(
            declared_change(aircraft, motion, absent=absent), trim_flow_rad=trim_flow_rad, motion=motion
        ),
        effects=tuple(e for e in effects if not reasons[e.key]),
        untestable=tuple(untestable),
        model=model,
        notes=tuple(notes),
        declared=_declared_causes(point, options, {e.key for e in effects}),
    )


def _model_of(aircraft: Aircraft, motion: Motion, options: TraceOptions) -> tuple[str, list[str]]:
    """The model of the declared aircraft, and a note where it is not the one that the options name."""
    if flies(aircraft, motion) or options.model == "linear":
        return options.model, []
    why = "the aircraft has no JSBSim model"
    if aircraft.file.jsbsim is not None:
        needed = " and ".join(f"jsbsim.{control.name}" for control in motion.controls)
        why = f"the JSBSim model has no {needed} in aircraft.toml"
    name = "short-period" if motion is LONGITUDINAL else motion.name
    return "linear", [f"{why}: it is traced with the linear {name} model"]


def _steady_notes(signals: Sequence[Signals]) -> list[str]:
    """A note on the known inputs that the logs lack."""
    lacking = sorted({name for s in signals for name in s.assumed})
    if not lacking:
        return []
    return [f"the logs lack {', '.join(lacking)}: those of a steady flight at the trim stand for them"]


def _absent(logs: Sequence[FlightLog], motion: Motion) -> tuple[str, ...]:
    """Outputs that no instrument measured in some log."""
    if motion is LONGITUDINAL:
        return (VANE,) if any(is_reconstructed(log.channels) for log in logs) else ()
    return tuple(c for c in motion.output_channels if any(c not in log.channels for log in logs))


def _unmeasured(channel: str, motion: Motion) -> str:
    others = ", ".join(c for c in motion.output_channels if c != channel)
    return (
        f"{channel} was not measured: the filter takes {others} as far as they are measured as outputs and {channel} as a state, "
        "and no effect of its sensor can be tested"
    )


def _declared_causes(point: LinearPoint, options: TraceOptions, in_filter: Collection[str]) -> DeclaredCauses:
    """Causes that move several derivatives, and wrong declarations, as far as they are requested.

    What acts at rest too is an effect of the filter.
    """
    keys = options.keys
    causes = causes_of(directions(point.derivatives, point.geometry, point.motion))
    own = (c for c in causes if not (c.key in in_filter and EFFECTS[c.key].acts_at_rest))
    return DeclaredCauses(
        tuple(c for c in own if keys is None or c.key in keys),
        keys is None or DERIVATIVES in keys,
    )


def _delays_input(effect: Effect, motion: Motion) -> bool:
    """Whether it delays a known input, or moves its sensor in the plane of symmetry, which the motion does not show."""
    change = effect.change({p.name: p.value(p.step) for p in effect.parameters})
    known = set(motion.known) - {"airspeed_m_s"}
    return any(t.channel in known and t.kind not in _OF_INPUTS for t in change.sensors)


def _why_not(effect: Effect, columns: Collection[str], absent: Collection[str]) -> str:
    """Why an effect cannot be tested; empty if it can."""
    missing = [channel for channel in effect.channels if channel not in columns]
    if missing:
        return f"the log lacks {', '.join(missing)}"
    reconstructed = [channel for channel in absent if channel in effect.channels]
    if reconstructed:
        return _RECONSTRUCTED if reconstructed == [VANE] else f"{reconstructed[0]} was not measured"
    return _AIR if effect.where == "air" else ""


def _one_aircraft(logs: Sequence[FlightLog], aircraft: Aircraft) -> None:
    names = sorted({str(log.metadata["aircraft"]) for log in logs if log.metadata.get("aircraft")})
    if len(names) > 1:
        raise LogError(
            f"the records are of several aircraft ({', '.join(names)}): trace the records of one aircraft at a time"
        )


def undo_input_sensors(s: Signals, aircraft: Aircraft) -> Signals:
    """A run with the declared errors of the sensors of its controls and known inputs undone."""

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
        airspeed = airspeed / declared.slope(s.attack_rad)
    known: dict[str, Any] = {}
    if s.motion is not LONGITUDINAL:
        vane, (gyro,) = LONGITUDINAL.vane, LONGITUDINAL.gyros
        beside = set(s.motion.known) - {"airspeed_m_s", "density_kg_m3"}
        known = {n: true(n, getattr(s, n), s.sub) for n in beside}
        own = aircraft.file.sensors.get(vane, Sensor()).errors()
        p = fine(s.y[:, s.motion.output_channels.index(s.motion.gyros[0])], s.sub)
        known[vane] = known[vane] + (own.x_m * known[gyro] - own.y_m * p) / airspeed
    return replace(
        s,
        **known,
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
    motion = signals[0].motion
    fitted = [s for s in signals if s.run_id not in held]
    moved = np.max([np.ptp(s.controls_rad, axis=1) for s in fitted], axis=0)
    if moved.max() < LEAST_ELEVATOR_RAD:
        which = "record that is not held out" if held else "record"
        controls = " or the ".join(control.name for control in motion.controls)
        ranges = " and ".join(
            _range_of(logs, held, control.channel, float(own))
            for control, own in zip(motion.controls, moved, strict=True)
        )
        raise LogError(
            f"no {which} moves the {controls} by {LEAST_ELEVATOR_RAD / DEG:g} deg: {ranges}; without an "
            "input no effect can be separated from another; fly doublets or 3-2-1-1 of at least 1 deg"
        )


def _range_of(logs: Sequence[FlightLog], held: Sequence[str], channel: str, moved_rad: float) -> str:
    """The range of a control's column in words, and the part of it that is no noise."""
    runs = ((log, i) for log in logs for i, run_id in enumerate(log.run_ids) if run_id not in held)
    raw = max(float(np.ptp(log.channels[channel][log.rows(i)])) for log, i in runs)
    column = f"{channel} has a range of {raw / DEG:.2g} deg"
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
    """The record cut where the controls have made half of their travel, so that both parts are excited.

    The second part begins in motion: surfaces, sensors and effects that act late still show what came before.
    """
    s = record.signals
    travel = np.cumsum(np.abs(np.diff(s.sampled_controls_rad, axis=1)).sum(axis=0))
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
