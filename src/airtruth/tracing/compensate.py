"""Records with traced effects taken out: what an aircraft without the effects would have logged.

Each kind of effect has its own treatment: the errors of a sensor are undone in its channel; the elevator is replaced
by the surface that the air sees; the response to increments of CL and Cm in measured signals is subtracted
(`airtruth.tracing.increment_response`); mass and inertia change the constants of the identification. The result obeys
the linear model under the elevator, whatever the method: the instruments of a regression, an identified servo and a
simulated output remain functions of inputs alone.

The response to increments needs the derivatives that are to be estimated. Their error enters multiplied by the share
of the response in the motion, to first order; the derivatives of the trace are used, and the estimates themselves can
be used again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.aircraft.neutral import fitted
from airtruth.identification import AircraftConstants
from airtruth.logs.flight_log import Batch, FlightLog, batches
from airtruth.numerics.prefilter import butterworth
from airtruth.physics import short_period
from airtruth.physics.atmosphere import air_density
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.readings import reading_increments, state_of
from airtruth.physics.sensor_errors import SensorErrors
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
from airtruth.tracing.increment_response import increments, response
from airtruth.tracing.model.records import head_samples
from airtruth.tracing.model.surface import through
from airtruth.tracing.result import TraceResult

Array = NDArray[np.float64]

OUTPUTS: Final = LONGITUDINAL.output_channels
"""Channels that the response to increments changes."""
_FINE: Final = 8
"""Points between two samples on which the surface moves [-] (judgement: 2.5 ms at 50 Hz, below any traced delay)."""
_CUTOFF_HZ: Final = 5.0
"""Low-pass of the pitch rate before it is differentiated [Hz]; that of the identification methods."""

TreatmentKind = Literal["subtracted", "undone", "replaced", "declared", "kept"]


@dataclass(frozen=True)
class Treatment:
    """The treatment of one traced effect.

    Attributes
    ----------
    effect : key of the effect.
    kind : "subtracted", the response to its increments; "undone", the error of a sensor; "replaced", the elevator by
        the surface that the air sees; "declared", changed constants of the aircraft; "kept", left in the records.
    sentence : the treatment in words.
    """

    effect: str
    kind: TreatmentKind
    sentence: str


@dataclass(frozen=True)
class Condition:
    """Derivatives of the aircraft with the traced effects, at one flight condition.

    Attributes
    ----------
    airspeed_m_s : true airspeed of the condition [m/s].
    derivatives : (6,) in the order of `short_period.PARAMETERS` [-].
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
    mass_factor, inertia_factor : factors on the declared constants [-].
    treatments : what happens to each effect.
    """

    conditions: tuple[Condition, ...]
    aero: tuple[AeroTerm, ...] = ()
    states: tuple[StateTerm, ...] = ()
    from_trim: bool = False
    sensors: tuple[SensorTerm, ...] = ()
    readings: tuple[ReadingTerm, ...] = ()
    surface: tuple[SurfaceTerm, ...] = ()
    mass_factor: float = 1.0
    inertia_factor: float = 1.0
    treatments: tuple[Treatment, ...] = ()


def compensation_of(result: TraceResult) -> Compensation:
    """The accepted effects of a trace with its refitted derivatives; neutral where no effect was accepted."""
    fit = result.rounds[-1].gls
    total, treatments = Change(), []
    hypothesis, at = fit.hypothesis, 0
    for effect in hypothesis.effects:
        sizes = fit.point.sizes[at : at + len(effect.parameters)]
        at += len(effect.parameters)
        change = replace(hypothesis, effects=(effect,)).added(sizes)
        treatments.append(treatment_of(effect.key, change))
        total = total + change
    aero, states = _measurable(total)
    increment = fit.point.common[fit.point.of.common.derivatives]
    records = result.case.fitted.records
    return Compensation(
        conditions=tuple(
            Condition(float(r.signals.airspeed_m_s.mean()), r.plant.derivatives + increment) for r in records
        ),
        aero=aero,
        states=states,
        from_trim=result.case.model == "linear",
        sensors=total.sensors,
        readings=total.readings,
        surface=total.surface,
        mass_factor=declared_total(total.declared, "mass"),
        inertia_factor=declared_total(total.declared, "inertia"),
        treatments=tuple(treatments),
    )


def _measurable(change: Change) -> tuple[tuple[AeroTerm, ...], tuple[StateTerm, ...]]:
    """Increments in measured signals, and the states that measured signals drive."""
    measured = measured_of(LONGITUDINAL)
    states = tuple(s for s in change.states if s.signal in measured)
    known = {*measured, *(s.name for s in states)}
    return tuple(t for t in change.aero if t.signal in known and t.factor in ("", *known)), states


def treatment_of(key: str, change: Change) -> Treatment:
    """The treatment of one effect, by what it changes."""
    if change.sensors or change.readings:
        channels = ", ".join(
            sorted({t.channel for t in change.sensors} | {t.channel for t in change.readings})
        )
        return Treatment(key, "undone", f"{key}: its error is undone in {channels}")
    if change.surface:
        return Treatment(key, "replaced", f"{key}: elevator_rad is replaced by the surface that the air sees")
    if change.declared:
        names = {t.quantity for t in change.declared}
        if names & {"mass", "inertia"}:
            return Treatment(
                key, "declared", f"{key}: identified with the updated {' and '.join(sorted(names))}"
            )
        return Treatment(key, "kept", f"{key}: kept, because the estimated derivatives contain it")
    if change.aero and all(term.coefficient == "CX" for term in change.aero):
        return Treatment(
            key, "kept", f"{key}: kept, because an axial force moves none of the channels of a regression"
        )
    if change.aero and _measurable(change)[0] == change.aero:
        return Treatment(
            key, "subtracted", f"{key}: the response to its increments of CL and Cm is subtracted"
        )
    return Treatment(key, "kept", f"{key}: kept, because no channel of a log measures its signal")


def updated_constants(aircraft: Aircraft, taken: Compensation) -> Aircraft:
    """The aircraft with the traced mass and inertia."""
    if taken.mass_factor == 1.0 and taken.inertia_factor == 1.0:
        return aircraft
    constants = aircraft.constants.model_copy(
        update={
            "mass_kg": aircraft.mass_kg * taken.mass_factor,
            "inertia_yy_kg_m2": aircraft.inertia_yy_kg_m2 * taken.inertia_factor,
        }
    )
    return aircraft.model_copy(update={"constants": constants})


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
    if taken.surface:
        elevator = channels["elevator_rad"]
        channels["elevator_rad"] = np.array([_air_surface(taken.surface, de, batch.dt_s) for de in elevator])
    if taken.aero:
        moved = _increment_response(channels, batch.dt_s, constants, taken)
        for name, d in zip(OUTPUTS, moved, strict=True):
            channels[name] = channels[name] - d
    return replace(batch, channels=channels)


def _increment_response(
    channels: dict[str, Array], dt_s: float, constants: AircraftConstants, taken: Compensation
) -> Array:
    alpha, airspeed = channels["alpha_rad"], channels["airspeed_m_s"].mean(axis=1)
    scale = short_period.scale(
        constants.wing_area_m2,
        constants.chord_m,
        constants.mass_kg,
        constants.inertia_yy_kg_m2,
        airspeed,
        np.asarray(air_density(channels)).mean(axis=1),
    )
    signals = {
        "alpha": alpha - _origin(alpha, dt_s, taken),
        "elevator": channels["elevator_rad"],
        "qhat": channels["q_rad_s"] * scale.half_chord_time[:, None],
        "qbar": 0.5 * np.asarray(air_density(channels)) * channels["airspeed_m_s"] ** 2,
    }
    signals |= {s.name: state_of(s, signals[s.signal], dt_s) for s in taken.states}
    more = increments(taken.aero, signals)
    more -= more[..., : head_samples(dt_s)].mean(axis=2, keepdims=True)
    conditions = np.array([c.airspeed_m_s for c in taken.conditions])
    nearest = np.abs(airspeed[:, None] - conditions).argmin(axis=1)
    derivatives = np.array([c.derivatives for c in taken.conditions])[nearest]
    return response(derivatives, scale, more[0], more[1], dt_s)


def _undo_readings(
    channels: dict[str, Array], dt_s: float, constants: AircraftConstants, taken: Compensation
) -> None:
    """Subtract the increments of the readings, in the measured signals, from ``channels``."""
    alpha = channels["alpha_rad"]
    signals = channels | {"alpha_rad": alpha - _origin(alpha, dt_s, taken)}
    more = reading_increments(taken.readings, taken.states, signals, constants.chord_m, dt_s)
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
        channels["airspeed_m_s"] = channels["airspeed_m_s"] / errors["airspeed_m_s"].slope(
            channels["alpha_rad"]
        )
    for name, own in errors.items():
        if own.x_m != 0.0:
            channels[name] = channels[name] + _arm(name, own, channels, dt_s)


def _advanced(x: Array, samples: float) -> Array:
    """(runs, samples) series so many samples earlier, linear in between, held at its last value."""
    if samples == 0.0:
        return x
    at = np.arange(x.shape[1], dtype=np.float64)
    return np.array([np.interp(at + samples, at, row) for row in x])


def _arm(name: str, own: SensorErrors, channels: dict[str, Array], dt_s: float) -> Array:
    """Value at the CG less the reading, by `airtruth.physics.sensors.vane_alpha` and `accelerometer_az`."""
    q = channels["q_rad_s"]
    if name == "alpha_rad":
        return np.asarray(q * own.x_m / channels["airspeed_m_s"])
    from scipy.signal import sosfiltfilt

    smooth = sosfiltfilt(butterworth(_CUTOFF_HZ, 2, dt_s).copy(), q, axis=1)
    return np.asarray(own.x_m * np.gradient(smooth, dt_s, axis=1))


def _air_surface(terms: tuple[SurfaceTerm, ...], elevator: Array, dt_s: float) -> Array:
    """(samples,) surface that the air sees [rad]."""
    at = np.arange(len(elevator), dtype=np.float64)
    fine = np.interp(np.arange((len(elevator) - 1) * _FINE + 1) / _FINE, at, elevator)
    return np.asarray(through(terms, fine, dt_s / _FINE)[::_FINE])


__all__ = [
    "Compensation",
    "Condition",
    "Treatment",
    "compensated_batch",
    "compensated_log",
    "compensation_of",
    "treatment_of",
    "trim_alpha",
    "updated_constants",
]
