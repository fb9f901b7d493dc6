"""Innovations and their covariance from a record, a change of the aircraft and a vector of parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.kept import Kept
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.terms import Change, SurfaceTerm
from airtruth.tracing.model import filter as record_filter
from airtruth.tracing.model.by_motion import coefficients_of, equations_of_grid
from airtruth.tracing.model.compile import CompiledChange, compile_change
from airtruth.tracing.model.kernel_input import (
    AnyGrid,
    AnyPoint,
    FilterModel,
    GustModel,
    KernelInput,
    SensorArrays,
)
from airtruth.tracing.model.lateral.packing import PACKING as LATERAL_PACKING
from airtruth.tracing.model.longitudinal.packing import PACKING as LONGITUDINAL_PACKING
from airtruth.tracing.model.packing import AirPath, Packing
from airtruth.tracing.model.parameters import COLOUR_TIME_S, SHORT_PERIOD, CommonEntries
from airtruth.tracing.model.records import FINE, Signals, TraceRecord, nodes
from airtruth.tracing.model.schedule import Schedule, schedule
from airtruth.tracing.model.settings import Settings
from airtruth.tracing.model.steady import SteadyFilter, steady_filter
from airtruth.tracing.model.surface import through

Array = NDArray[np.float64]

LOST: Final = 1e9
"""Residual of a sample that a lost motion does not reach [unit of the output] (judgement: beyond any that counts)."""
_PACKINGS: Final[dict[str, Packing]] = {
    LONGITUDINAL.name: LONGITUDINAL_PACKING,
    LATERAL.name: LATERAL_PACKING,
}
"""Motion -> how its records are packed for the filter."""
_MOST_SLOW: Final = 0.99
"""Largest share of correlated noise [-]: beyond the search's bound, where the differences need a slope."""


@dataclass(frozen=True)
class Response:
    """Innovations of one record.

    Attributes
    ----------
    e : (samples, outputs) innovations, or residuals of a free run [units of the outputs]; `LOST` from where the motion is lost.
    white, covariance : (outputs, outputs) whitener W with W S W' = I, and S.
    logdet : mean of log|S| over the samples; nan where the motion is lost.
    more_logdet : sum over the samples of log|S| beyond that of ``covariance``, by an uncertain surface.
    steady : the filter that made the innovations; None for a free run, and where there is none.
    """

    e: Array
    white: Array
    covariance: Array
    logdet: float
    more_logdet: float = 0.0
    steady: SteadyFilter | None = None


def register_packing(motion: Motion, packing: Packing) -> None:
    """State how records of a further motion are packed."""
    _PACKINGS[motion.name] = packing


@dataclass(frozen=True)
class _Inputs:
    """Input of the filter, with neither the record nor the change: what is kept of a record may not refer to it.

    Attributes
    ----------
    y : (lead + samples, 3) outputs, those before a part of a run first.
    lead : number of samples before the part.
    grid : inputs on the filter's grid, the errors of their sensors undone.
    corner_rad2 : see `KernelInput`; 0 in the lead, whose innovations do not count.
    reference_flow_rad, reference : means of the record; along : flight conditions at which the gain is made.
    """

    y: Array
    lead: int
    grid: AnyGrid
    corner_rad2: Array
    reference_flow_rad: float
    reference: AnyPoint
    along: Schedule


@dataclass(frozen=True)
class FilterInputs(_Inputs):
    """Input of the filter from a record and a change, independent of the parameters; further attributes as of its base.

    Attributes
    ----------
    record, compiled : the record and the change.
    """

    record: TraceRecord
    compiled: CompiledChange


def filter_inputs(record: TraceRecord, change: Change | CompiledChange) -> FilterInputs:
    """Undo what a change says of the inputs' sensors, and put what it says of the surface behind the elevator."""
    compiled = change if isinstance(change, CompiledChange) else compile_change(change, record.signals.motion)
    if any(compiled.surface) or compiled.inputs:
        return FilterInputs(**vars(_inputs(record, compiled)), record=record, compiled=compiled)
    made = _AS_MEASURED.of(record) or _AS_MEASURED.keep(record, _inputs(record, compiled))
    return FilterInputs(**vars(made), record=record, compiled=compiled)


_AS_MEASURED: Final = Kept[_Inputs]()
"""Record -> inputs that no change of sensors or surface affects."""


def _inputs(record: TraceRecord, compiled: CompiledChange) -> _Inputs:
    s, shift = record.signals.with_lead, record.plant.alpha_shift_rad
    y, theta = s.y, s.theta_rad
    if shift != 0.0:
        y = y - shift * np.eye(1, y.shape[1])
        theta = theta - shift
    controls = [nodes(fine) for fine in _surfaces(s, compiled)]
    v, ground = _airspeed(compiled, s), compiled.undone("airspeed_m_s", s.ground_m_s)
    qbar, force = 0.5 * s.density_kg_m3 * v * v, _remainder(record, compiled, v.size)
    packing = _PACKINGS[s.motion.name]
    known = packing.known(s, compiled, AirPath(v, ground, qbar, theta))
    grid: AnyGrid = packing.grid._make([*controls, *known, *force])
    speed = float(v.mean())
    steady = {"airspeed_m_s": speed, "ground_m_s": speed} | dict.fromkeys(coefficients_of(grid), 0.0)
    steady["qbar_pa"] = 0.5 * float(s.density_kg_m3.mean()) * speed * speed
    means = {name: steady.get(name, float(x.mean())) for name, x in grid._asdict().items()}
    corner = _corners(s, compiled)
    lead = len(y) - record.samples
    if lead and corner.size:
        corner = np.concatenate([np.zeros((len(corner), lead)), corner[:, lead:]], axis=1)
    reference = equations_of_grid(grid).point(**means)
    along = schedule(y[:, 0], grid, s.sub)
    return _Inputs(y, lead, grid, corner, float(y[:, 0].mean()), reference, along)


def _surfaces(s: Signals, compiled: CompiledChange) -> Iterator[Array]:
    """(fine points,) each control as the air sees it [rad]."""
    step_s = s.dt_s / (s.sub * FINE)
    for number, control in enumerate(s.motion.controls):
        fine = compiled.undone(control.channel, s.controls_rad[number])
        yield through(compiled.surface[number], fine, step_s, float(s.control_std_rad[number]))


def _corners(s: Signals, compiled: CompiledChange) -> Array:
    """(controls, samples) variance of the surfaces that the air sees; a delay or lag of a surface carries it to later cells."""
    known = [own for own in (s.corner_rad2, s.surface_noise_rad2) if own.size]
    total = np.asarray(sum(known[1:], known[0])) if known else s.corner_rad2
    if total.size == 0:
        return total
    return np.stack([_late(row, path, s) for row, path in zip(total, compiled.surface, strict=True)])


def _late(variance: Array, path: Sequence[SurfaceTerm], s: Signals) -> Array:
    """(samples,) variance of a surface behind its delays and lags."""
    late = tuple(term for term in path if term.kind in ("delay", "lag"))
    if not late:
        return variance
    cells = s.sub * FINE
    fine = np.append(np.repeat(variance[1:], cells), 0.0)
    moved = through(late, fine, s.dt_s / cells)
    return np.append(0.0, moved[:-1].reshape(-1, cells).mean(axis=1))


def _remainder(record: TraceRecord, compiled: CompiledChange, points: int) -> Array:
    """(coefficients, points) of what the JSBSim model has beyond the tables, later with the surface where a change is
    linear in it and there is no other surface."""
    if record.remainder is None:
        return np.zeros((len(record.signals.motion.coefficients), points))
    path, *others = compiled.surface
    late = [] if others else [term for term in path if term.kind in ("delay", "lag")]
    step = record.signals.dt_s / record.signals.sub
    return np.stack([through(late, row, step) for row in record.remainder])


def _airspeed(compiled: CompiledChange, s: Signals) -> Array:
    """Airspeed without its errors; the speed over ground has no slope over alpha, because accelerations give its changes."""
    errors = compiled.inputs.get("airspeed_m_s")
    if errors is None:
        return s.airspeed_m_s
    return errors.unscaled(s.airspeed_m_s) / errors.slope(s.attack_rad)


def respond(
    record: TraceRecord,
    settings: Settings,
    change: Change | CompiledChange,
    common: Array,
    per_record: Array,
    *,
    free_run: bool = False,
) -> Response:
    """Innovations, or with ``free_run`` the residuals of a simulation, of one record.

    Parameters
    ----------
    common, per_record : see `CommonEntries` and `RecordEntries`.
    """
    given = filter_inputs(record, change)
    return respond_to(given, settings, common, per_record, free_run=free_run)


def respond_to(
    given: FilterInputs,
    settings: Settings,
    common: Array,
    per_record: Array,
    *,
    free_run: bool = False,
    steady: SteadyFilter | None = None,
) -> Response:
    """`respond` where the same inputs serve many parameters.

    Parameters
    ----------
    steady : filter of parameters that differ in initial state, biases and trim alone; None makes it.
    """
    e = np.full_like(given.y, LOST)
    kernel = kernel_input(given, settings, common, per_record)
    none = np.eye(given.y.shape[1])
    if free_run:
        sound = record_filter.free_run(kernel, e)
        return Response(e[given.lead :], none, none, 0.0 if sound else math.nan)
    used = steady or steady_filter(kernel, given.along)
    if used is None:
        return Response(e[given.lead :], none, none, math.nan)
    sound, more = record_filter.innovations(kernel, used, e)
    e = e[given.lead :]
    logdet = used.logdet + more / len(e) if sound else math.nan
    return Response(e, used.white, used.covariance, logdet, more, used)


def kernel_input(given: FilterInputs, settings: Settings, common: Array, per_record: Array) -> KernelInput:
    """Input of the compiled filter."""
    trim = per_record[settings.layout.per_record.trim]
    named = zip(coefficients_of(given.grid), trim, strict=True)
    force = {name: getattr(given.grid, name) + own for name, own in named}
    gust, path = per_record[settings.layout.per_record.mean_gust], {}
    if gust.size:
        upwash, tailwind = gust
        path = {
            "ground_attack_rad": given.grid.ground_attack_rad + upwash,
            "ground_m_s": given.grid.ground_m_s * (1.0 + tailwind),
        }
    signals = given.record.signals
    return KernelInput(
        y=given.y,
        more=np.zeros_like(given.y),
        grid=given.grid._replace(**force, **path),
        corner_rad2=given.corner_rad2,
        dt_s=signals.dt_s,
        sub=signals.sub,
        start=per_record[settings.layout.per_record.start],
        reference_flow_rad=given.reference_flow_rad,
        reference=given.reference,
        model=filter_model(given, settings, common, per_record),
    )


def filter_model(given: FilterInputs, settings: Settings, common: Array, per_record: Array) -> FilterModel:
    """Aircraft, gusts, effects and sensors at a vector of parameters."""
    record, compiled = given.record, given.compiled
    constants, entries = record.plant.aircraft.constants, settings.layout.common
    sensors = pack_sensors(compiled, settings, common, per_record, constants.chord_m)
    gusts = GustModel(
        level_m_s=float(np.exp(per_record[settings.layout.per_record.log_gust])),
        length_m=record.gust_length_m,
        rolloff=0.5 + float(common[entries.rolloff]),
        rotary=0.5 + float(common[entries.rotary]),
        rotary_time_s=4.0 * constants.span_m / (np.pi * given.reference.airspeed_m_s),
    )
    packing = _PACKINGS[record.signals.motion.name]
    return FilterModel(
        aircraft=packing.aircraft(record.plant, compiled, common, entries),
        gusts=packing.gusts(gusts, constants.span_m),
        effects=compiled.effects,
        sensors=sensors,
        states=compiled.states(bool((sensors.slow_std > 0.0).any())),
    )


def moved_past_sensors_m(
    common: Array, shift: float, chord_m: float, entries: CommonEntries = SHORT_PERIOD.common
) -> float:
    """Distance by which a CG that lies ``shift`` chords aft has moved past the sensors [m]; see `CommonEntries.mounting`."""
    return (0.5 + float(common[entries.mounting])) * shift * chord_m


def pack_sensors(
    compiled: CompiledChange, settings: Settings, common: Array, per_record: Array, chord_m: float
) -> SensorArrays:
    """Errors and noise of the outputs' sensors."""
    entries = settings.layout.common
    noise = (settings.noise * np.exp(common[entries.log_noise])) ** 2
    share = np.clip(common[entries.colour_shares], 0.0, _MOST_SLOW)
    return SensorArrays(
        bias=per_record[settings.layout.per_record.bias] + compiled.bias,
        scale=compiled.scale,
        arm_m=compiled.arm_m + moved_past_sensors_m(common, compiled.declared["cg"], chord_m, entries),
        lag_s=compiled.lag_s,
        delay_s=compiled.delay_s,
        variance=noise * (1.0 - share) + settings.resolution**2,
        slow_std=np.sqrt(noise * share),
        slow_time_s=COLOUR_TIME_S * float(np.exp(common[entries.log_colour_time])),
        down_m=compiled.down_m,
    )


__all__ = [
    "LOST",
    "FilterInputs",
    "Response",
    "filter_inputs",
    "filter_model",
    "kernel_input",
    "moved_past_sensors_m",
    "pack_sensors",
    "register_packing",
    "respond",
    "respond_to",
]
