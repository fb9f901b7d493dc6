"""Records with traced effects taken out: what an aircraft without the effects would have logged.

Each kind of effect has its own treatment: the errors of a sensor are undone in its channel; a control is replaced
by the surface that the air sees; the response to increments of the coefficients in measured signals is subtracted
(`airtruth.tracing.increment_response`); mass and inertias change the constants of the identification. The result obeys
the linear model under its controls, whatever the method: the instruments of a regression, an identified servo and a
simulated output remain functions of inputs alone.

The response to increments needs the derivatives that are to be estimated. Their error enters multiplied by the share
of the response in the motion, to first order; the derivatives of the trace are used, and the estimates themselves can
be used again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.neutral import fitted
from airtruth.identification import AircraftConstants
from airtruth.identification.declared_sensors import moved_to_cg
from airtruth.identification.record_constants import stated_value
from airtruth.logs.flight_log import Batch, FlightLog, batches
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.atmosphere import air_density
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.readings import increments_over, reading_increments, state_of
from airtruth.physics.terms import (
    AeroTerm,
    Change,
    ReadingTerm,
    SensorTerm,
    StateTerm,
    SurfaceTerm,
    declared_total,
    measured_of,
)
from airtruth.tracing.increment_response import increments, linear_scale, response
from airtruth.tracing.model.records import head_samples
from airtruth.tracing.model.surface import through
from airtruth.tracing.result import TraceResult

Array = NDArray[np.float64]

_FINE: Final = 8
"""Points between two samples on which the surface moves [-] (judgement: 2.5 ms at 50 Hz, below any traced delay)."""
_CUTOFF_HZ: Final = 5.0
"""Low-pass of a rate before it is differentiated [Hz]; that of the identification methods."""

TreatmentKind = Literal["subtracted", "undone", "replaced", "declared", "kept"]


@dataclass(frozen=True)
class Treatment:
    """The treatment of one traced effect.

    Attributes
    ----------
    effect : key of the effect.
    kind : "subtracted", the response to its increments; "undone", the error of a sensor; "replaced", a control by
        the surface that the air sees; "declared", changed constants of the aircraft; "kept", left in the records.
    sentence : the treatment in words.
    """

    effect: str
    kind: TreatmentKind
    sentence: str


@dataclass(frozen=True)
class RunCondition:
    """Derivatives of the aircraft with the traced effects, at one flight condition.

    Attributes
    ----------
    airspeed_m_s : true airspeed of the condition [m/s].
    derivatives : in the order of the motion [-].
    """

    airspeed_m_s: float
    derivatives: Array


@dataclass(frozen=True)
class Compensation:
    """The traced effects, split by their treatment.

    Attributes
    ----------
    aero, states : increments of the coefficients, and the states that they may take as signals.
    conditions : derivatives of the aircraft per flight condition; a record takes those of the nearest airspeed.
    from_trim : whether alpha counts from the record's own trim, as in a trace with the linear model.
    sensors, readings : errors of sensors, and increments of what they read.
    surface : dynamics between measured surface and air.
    declared : quantity -> error of the declared constant: a factor on mass and inertias, of the product of inertia its increment
        over the root of Ixx Izz [-].
    motion : of the records.
    treatments : what happens to each effect.
    """

    conditions: tuple[RunCondition, ...]
    aero: tuple[AeroTerm, ...] = ()
    states: tuple[StateTerm, ...] = ()
    from_trim: bool = False
    sensors: tuple[SensorTerm, ...] = ()
    readings: tuple[ReadingTerm, ...] = ()
    surface: tuple[SurfaceTerm, ...] = ()
    declared: Mapping[str, float] = field(default_factory=dict)
    motion: Motion = LONGITUDINAL
    treatments: tuple[Treatment, ...] = ()


def compensation_of(result: TraceResult) -> Compensation:
    """The accepted effects of a trace with its refitted derivatives; neutral where no effect was accepted."""
    fit = result.rounds[-1].gls
    total, treatments = Change(), []
    hypothesis, at = fit.hypothesis, 0
    motion = result.case.fitted.layout.motion
    for effect in hypothesis.effects:
        sizes = fit.point.sizes[at : at + len(effect.parameters)]
        at += len(effect.parameters)
        change = replace(hypothesis, effects=(effect,)).added(sizes)
        treatments.append(treatment_of(effect.key, change, motion))
        total = total + change
    aero, states = _measurable(total, motion)
    increment = fit.point.common[fit.point.of.common.derivatives]
    records = result.case.fitted.records
    return Compensation(
        conditions=tuple(
            RunCondition(float(r.signals.airspeed_m_s.mean()), r.plant.derivatives + increment)
            for r in records
        ),
        aero=aero,
        states=states,
        from_trim=result.case.model == "linear",
        sensors=total.sensors,
        readings=total.readings,
        surface=total.surface,
        declared={name: declared_total(total.declared, name) for name in _constants(motion)},
        motion=motion,
        treatments=tuple(treatments),
    )


def _constants(motion: Motion) -> dict[str, str]:
    """Declared quantities of a motion that are constants of the identification, and their fields."""
    fields = {"mass": "mass_kg", "inertia": "inertia_yy_kg_m2"}
    named = [d.name for d in motion.declared if d.name in fields or d.name.startswith("inertia_")]
    return {name: fields.get(name, f"{name}_kg_m2") for name in named}


def _measurable(change: Change, motion: Motion) -> tuple[tuple[AeroTerm, ...], tuple[StateTerm, ...]]:
    """Increments in measured signals, and the states that measured signals drive."""
    measured = measured_of(motion)
    states = tuple(s for s in change.states if s.signal in measured)
    known = {*measured, *(s.name for s in states)}
    return tuple(t for t in change.aero if t.signal in known and t.factor in ("", *known)), states


def treatment_of(key: str, change: Change, motion: Motion = LONGITUDINAL) -> Treatment:
    """The treatment of one effect, by what it changes."""
    if change.sensors or change.readings:
        channels = ", ".join(
            sorted({t.channel for t in change.sensors} | {t.channel for t in change.readings})
        )
        return Treatment(key, "undone", f"{key}: its error is undone in {channels}")
    if change.surface:
        channels = " and ".join(c.channel for c in motion.controls if change.of_surface(c.name))
        verb = "are" if " and " in channels else "is"
        return Treatment(
            key, "replaced", f"{key}: {channels} {verb} replaced by the surface that the air sees"
        )
    if change.declared:
        names = {t.quantity for t in change.declared}
        if names & _constants(motion).keys():
            return Treatment(
                key, "declared", f"{key}: identified with the updated {' and '.join(sorted(names))}"
            )
        return Treatment(key, "kept", f"{key}: kept, because the estimated derivatives contain it")
    if change.aero and all(term.coefficient == "CX" for term in change.aero):
        return Treatment(
            key, "kept", f"{key}: kept, because an axial force moves none of the channels of a regression"
        )
    if change.aero and _measurable(change, motion)[0] == change.aero:
        *most, last = [c.name for c in motion.coefficients]
        named = f"{', '.join(most)} and {last}"
        return Treatment(key, "subtracted", f"{key}: the response to its increments of {named} is subtracted")
    return Treatment(key, "kept", f"{key}: kept, because no channel of a log measures its signal")


def updated_constants(aircraft: Aircraft, taken: Compensation) -> Aircraft:
    """The aircraft with the traced mass and inertias."""
    own = aircraft.constants
    cross = math.sqrt(max(own.inertia_xx_kg_m2 * own.inertia_zz_kg_m2, 0.0))
    neutral, changed = taken.motion.neutral, {}
    for name, field_name in _constants(taken.motion).items():
        total = taken.declared.get(name, neutral[name])
        if total != neutral[name]:
            value = getattr(own, field_name)
            changed[field_name] = value * total if neutral[name] == 1.0 else value + total * cross
    if not changed:
        return aircraft
    return aircraft.model_copy(update={"constants": own.model_copy(update=changed)})


def compensated_log(log: FlightLog, constants: AircraftConstants, taken: Compensation) -> FlightLog:
    """A checked log without the traced effects.

    Parameters
    ----------
    constants : the aircraft's reference lengths, mass and inertia.

    Raises
    ------
    LogError
        If the runs of a batch cannot be stacked.
    """
    channels = {name: values.astype(np.float64) for name, values in log.channels.items()}
    for batch in batches(replace(log, channels=dict(channels))):
        changed = compensated_batch(batch, constants, taken)
        for name, values in changed.channels.items():
            for row, run_id in zip(values, batch.run_ids, strict=True):
                channels[name][log.rows(log.run_ids.index(run_id))] = row
    return replace(log, channels=channels)


def compensated_batch(batch: Batch, constants: AircraftConstants, taken: Compensation) -> Batch:
    """The runs of a batch without the traced effects; increments at the first sample belong to the trim."""
    channels = dict(batch.channels)
    _undo_sensors(channels, taken.sensors, batch.dt_s)
    _undo_readings(channels, batch.dt_s, constants, taken)
    for control in taken.motion.controls:
        terms = tuple(term for term in taken.surface if term.control == control.name)
        if terms:
            channels[control.channel] = np.array(
                [_air_surface(terms, own, batch.dt_s) for own in channels[control.channel]]
            )
    if taken.aero:
        moved = _increment_response(channels, batch.dt_s, constants, taken)
        for name, d in zip(taken.motion.output_channels, moved, strict=True):
            if name in channels:
                channels[name] = channels[name] - d
    return replace(batch, channels=channels)


def _increment_response(
    channels: dict[str, Array], dt_s: float, constants: AircraftConstants, taken: Compensation
) -> Array:
    airspeed = channels["airspeed_m_s"].mean(axis=1)
    signals = _signals(channels, constants, dt_s, taken)
    signals |= {s.name: state_of(s, signals[s.signal], dt_s) for s in taken.states}
    more = increments(taken.aero, signals, taken.motion)
    more -= more[..., : head_samples(dt_s)].mean(axis=2, keepdims=True)
    conditions = np.array([c.airspeed_m_s for c in taken.conditions])
    nearest = np.abs(airspeed[:, None] - conditions).argmin(axis=1)
    derivatives = np.array([c.derivatives for c in taken.conditions])[nearest]
    return response(derivatives, linear_scale(taken.motion, constants, channels), more, dt_s)


def _signals(
    channels: dict[str, Array], constants: AircraftConstants, dt_s: float, taken: Compensation
) -> dict[str, Array]:
    """Measured signals of the motion, as its terms count them."""
    motion = taken.motion
    lengths = {"chord": constants.chord_m, "span": stated_value(constants, "span_m")}
    airspeed = channels["airspeed_m_s"].mean(axis=1)
    found = {}
    for s in (*motion.signals, *motion.known_signals):
        if s.channel in channels:
            rate = 1.0 if s.length is None else (lengths[s.length] / (2.0 * airspeed))[:, None]
            found[s.name] = channels[s.channel] * rate
    if motion is LONGITUDINAL:
        alpha = channels[motion.vane]
        found[motion.flow] = alpha - _origin(alpha, dt_s, taken)
    found["qbar"] = 0.5 * np.asarray(air_density(channels)) * channels["airspeed_m_s"] ** 2
    return found


def _undo_readings(
    channels: dict[str, Array], dt_s: float, constants: AircraftConstants, taken: Compensation
) -> None:
    """Subtract the increments of the readings, in the measured signals, from ``channels``."""
    if not taken.readings:
        return
    if taken.motion is LONGITUDINAL:
        vane = taken.motion.vane
        alpha = channels[vane]
        signals = channels | {vane: alpha - _origin(alpha, dt_s, taken)}
        more = reading_increments(taken.readings, taken.states, signals, constants, dt_s)
    else:
        more = increments_over(taken.readings, taken.states, _signals(channels, constants, dt_s, taken), dt_s)
    for name, increment in more.items():
        channels[name] = channels[name] - increment


def _origin(alpha: Array, dt_s: float, taken: Compensation) -> Array:
    """(runs, 1) angle of attack from which the terms count [rad]."""
    return trim_alpha(alpha, dt_s)[:, None] if taken.from_trim else np.zeros((len(alpha), 1))


def trim_alpha(alpha: Array, dt_s: float) -> Array:
    """(runs,) angle of attack [rad] that a trace with the linear model counts from."""
    return np.asarray(alpha[:, : head_samples(dt_s)].mean(axis=1))


def _undo_sensors(channels: dict[str, Array], terms: Sequence[SensorTerm], dt_s: float) -> None:
    """Undo errors in ``channels``: scale and bias first, then delay and lag, last the arms with the true q."""
    errors = {name: sensor.errors() for name, sensor in fitted({}, terms).items() if name in channels}
    for name, own in errors.items():
        channels[name] = _advanced(own.unscaled(channels[name]), own.lead_s / dt_s)
    if "airspeed_m_s" in errors:
        factor = errors["airspeed_m_s"].slope(channels[LONGITUDINAL.vane])
        channels["airspeed_m_s"] = channels["airspeed_m_s"] / factor
    for name, own in errors.items():
        if (own.x_m, own.y_m, own.z_m) != (0.0, 0.0, 0.0):
            channels[name] = channels[name] + moved_to_cg(name, own, channels, partial(_rate, dt_s=dt_s))


def _advanced(x: Array, samples: float) -> Array:
    """(runs, samples) series so many samples earlier, linear in between, held at its last value."""
    if samples == 0.0:
        return x
    at = np.arange(x.shape[1], dtype=np.float64)
    return np.array([np.interp(at + samples, at, row) for row in x])


def _rate(x: Array, dt_s: float) -> Array:
    """(runs, samples) derivative of a low-passed rate [rad/s2]."""
    smooth = zero_phase(x, butterworth(_CUTOFF_HZ, 2, dt_s))
    return np.asarray(np.gradient(smooth, dt_s, axis=1))


def _air_surface(terms: tuple[SurfaceTerm, ...], surface: Array, dt_s: float) -> Array:
    """(samples,) surface that the air sees [rad]."""
    at = np.arange(len(surface), dtype=np.float64)
    fine = np.interp(np.arange((len(surface) - 1) * _FINE + 1) / _FINE, at, surface)
    return np.asarray(through(terms, fine, dt_s / _FINE)[::_FINE])


__all__ = [
    "Compensation",
    "RunCondition",
    "Treatment",
    "compensated_batch",
    "compensated_log",
    "compensation_of",
    "treatment_of",
    "trim_alpha",
    "updated_constants",
]
