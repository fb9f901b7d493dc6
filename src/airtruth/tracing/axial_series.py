"""The axial force that a record shows beyond the declared one, as a coefficient.

    y = (m (ax + q^2 x - q_dot z) - X(alpha, elevator, q c/(2V)))/(q_bar S)

X is that of the declared JSBSim model, its engines included; ax is measured at (x, z) from the CG. Errors of sensors and of the
surface that a trace accepted are undone before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.logs.flight_log import FlightLog, batches
from airtruth.numerics.rates import smooth_rate
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.sensor_errors import Kind, SensorErrors
from airtruth.physics.sensors import accelerometer_ax
from airtruth.physics.terms import Change, SensorTerm, declared_total
from airtruth.simulation.disposable import isolated
from airtruth.simulation.probe import forces_over_alpha
from airtruth.tracing.compensate import Compensation, compensated_batch
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.plant import FLOW, Plant, looked_up
from airtruth.tracing.model.records import FINE, TraceRecord
from airtruth.tracing.model.surface import through
from airtruth.units import DEG

Array = NDArray[np.float64]

CHANNEL: Final = "ax_m_s2"
"""The accelerometer along x."""
_UNDONE: Final[tuple[Kind, ...]] = ("scale", "bias", "lag", "delay")
"""Its declared errors that are undone before its position counts."""
_SPEED: Final = "airspeed_m_s"
"""The airspeed, whose accepted errors are undone too."""
_BIASED: Final = tuple(output.channel for output in LONGITUDINAL.outputs if not output.late)
"""Channels whose estimated biases are undone, in the order of the records' own parameters."""
_FINE_RAD: Final = 0.1 * DEG
"""Step of the angle of attack between the points of the tables [rad] (judgement: a tenth of theirs)."""
_RATE_S: Final = 0.1
"""Width of the mean over which rates are taken [s] (judgement: noise of vane, gyro and surface)."""


@dataclass(frozen=True)
class AxialSeries:
    """One record.

    Attributes
    ----------
    y : (samples,) axial force beyond the declared one, over q_bar S [-].
    tolerances : (samples, n) what the uncertainty of the declarations brings into ``y``, each per standard deviation [-].
    signals : name of a signal of an `AeroTerm` -> (samples,), as measured.
    instruments : signal whose noise is in ``y`` -> (samples,) the signal as other channels show it.
    unit_m_s2 : (samples,) ax of a unit of the coefficient [m/s2].
    dt_s : sample period [s].
    """

    y: Array
    tolerances: Array
    signals: Mapping[str, Array]
    instruments: Mapping[str, Array]
    unit_m_s2: Array
    dt_s: float


@dataclass(frozen=True)
class AxialTolerance:
    """Standard deviations of what the tracer does not estimate.

    Attributes
    ----------
    share : of a declared slope of the axial force, relative [-].
    alpha_slope, elevator_slope, rate_slope : least ones of the slopes of CX [1/rad, 1/rad, -].
    bias_rad : of the vane; an estimated bias that is larger has its own size [rad].
    late_s : time by which vane and surface are late [s].
    x_m, z_m : position of the accelerometer [m].
    scale : of the accelerometer [-].
    """

    share: float = 0.1
    alpha_slope: float = 0.02
    elevator_slope: float = 0.01
    rate_slope: float = 1.0
    bias_rad: float = 0.002
    late_s: float = 0.005
    x_m: float = 0.05
    z_m: float = 0.02
    scale: float = 0.01


TOLERANCE: Final = AxialTolerance()
"""Judgement: wind-tunnel slopes of the axial force to 10 %, an estimated bias of the vane to 0.1 deg or to its own size, because
a learned function of the angle of attack and a bias imitate each other, a vane or a surface late by a quarter of a sample at 50
Hz, and an accelerometer that is surveyed to some centimetres."""


def axial_series(
    logs: Sequence[FlightLog],
    records: Sequence[TraceRecord],
    own: Sequence[Array],
    change: Change,
    aircraft: Aircraft,
) -> list[AxialSeries]:
    """The series of records, in their order.

    Parameters
    ----------
    logs : with the channel ax; they hold the records.
    records : of a trace with a JSBSim model.
    own : parameters of each record, see `airtruth.tracing.model.parameters.RecordEntries`; biases of vane and gyro count.
    change : the declared errors of the sensors with the accepted effects.

    Raises
    ------
    AircraftError
        If the declared aircraft cannot be probed between the points of its tables.
    """
    sensor = _accelerometer(aircraft)
    taken = Compensation(
        conditions=(),
        states=tuple(
            s for s in change.states if any(s.name in (t.signal, t.behind) for t in change.readings)
        ),
        sensors=(*change.sensors, *(SensorTerm(CHANNEL, kind, sensor.value(kind)) for kind in _UNDONE)),
        readings=change.readings,
    )
    by_run = {r.signals.run_id: (r, p) for r, p in zip(records, own, strict=True)}
    plants = {id(r.plant): r.plant for r in records}
    between = {key: _between_points(plant) for key, plant in plants.items()}
    found: dict[str, AxialSeries] = {}
    for batch in (b for log in logs for b in batches(log)):
        undone = compensated_batch(batch, aircraft.constants, taken)
        for row, run_id in enumerate(batch.run_ids):
            if run_id in by_run:
                channels = {name: values[row] for name, values in undone.channels.items()}
                record, parameters = by_run[run_id]
                for name, bias in zip(_BIASED, parameters[SHORT_PERIOD.per_record.bias], strict=False):
                    channels[name] = channels[name] - bias
                # the record's own airspeed is low-passed, and lacks the declared errors alone
                ratio = channels[_SPEED] / batch.channels[_SPEED][row]
                bias_rad = float(parameters[SHORT_PERIOD.per_record.bias][0])
                found[run_id] = _series(
                    channels, record, ratio, bias_rad, between[id(record.plant)], change, aircraft
                )
    return [found[r.signals.run_id] for r in records]


def _series(
    channels: Mapping[str, Array],
    record: TraceRecord,
    ratio: Array,
    bias_rad: float,
    between: tuple[Array, Array],
    change: Change,
    aircraft: Aircraft,
) -> AxialSeries:
    """One series.

    Parameters
    ----------
    ratio : (samples,) airspeed without its accepted error over that with it [-].
    bias_rad : estimated bias of the vane, which is undone [rad].
    between : X between the points of the tables, see `_between_points`.
    """
    s, plant, c = record.signals, record.plant, aircraft.constants
    own = _accelerometer(aircraft)
    (control,) = (one.name for one in plant.motion.controls)
    factor = declared_total(change.declared, control)
    neutral = float(plant.neutral_rad[0])
    cells = s.sub * FINE
    surface = through(change.surface_path(), s.elevator_rad, s.dt_s / cells)[::cells]
    surface = neutral + factor * (surface - neutral)
    alpha, q, az = (channels[name] for name in LONGITUDINAL.output_channels)
    speed, density = s.airspeed_m_s[:: s.sub] * ratio, s.density_kg_m3[:: s.sub]
    pressure = 0.5 * density * speed**2
    half = 0.5 * c.chord_m / speed
    q_dot = smooth_rate(q, _RATE_S, s.dt_s)
    ax = channels[CHANNEL] - accelerometer_ax(0.0, q, q_dot, own.x_m, own.z_m)
    mass = plant.trim.mass_kg if plant.trim is not None else c.mass_kg
    mass = mass * declared_total(change.declared, "mass")
    force = pressure * c.wing_area_m2

    def along(alpha_rad: Array) -> Array:
        """X of the declared model (samples,) [N]."""
        x = looked_up(plant, signals | {FLOW: alpha_rad}, pressure)[:, 0]
        return np.asarray(x + pressure * np.interp(alpha_rad, *between))

    signals = {FLOW: alpha, control: surface, "qhat": q * half}
    declared = along(alpha)
    t = TOLERANCE
    shown = _without_noise(alpha, (az, q, surface))
    angles = ((FLOW, shown, t.alpha_slope), (control, surface, t.elevator_slope))
    per = {name: _slope(plant, name) for name in (FLOW, control)}
    off_bias = bias_rad if abs(bias_rad) > t.bias_rad else t.bias_rad
    inertial = mass / force
    tolerances = [
        *(max(t.share * abs(per[name]), least) * (x - plant.trims[name]) for name, x, least in angles),
        t.rate_slope * q * half,
        (along(shown + off_bias) - along(shown)) / force,
        *(t.late_s * per[name] * smooth_rate(x, _RATE_S, s.dt_s) for name, x, _ in angles),
        t.z_m * inertial * q_dot,
        t.x_m * inertial * q**2,
        t.scale * (declared - declared.mean()) / force,  # not of ax itself, whose noise is that of y
    ]
    return AxialSeries(
        y=(mass * ax - declared) / force,
        tolerances=np.stack(tolerances, axis=1),
        instruments={FLOW: shown},
        signals=signals,
        unit_m_s2=force / mass,
        dt_s=s.dt_s,
    )


def _without_noise(alpha: Array, others: Sequence[Array]) -> Array:
    """The angle of attack as other channels show it, by linear regression on them and their squares: an instrument.

    Noise of the vane is in ``y`` too, so that it would show as an axial force over the measured angle of attack.
    """
    columns = [x - x.mean() for x in others]
    columns += [x**2 for x in columns]
    scaled = [x / max(float(np.abs(x).max()), 1e-12) for x in columns]
    design = np.column_stack([np.ones(len(alpha)), *scaled])
    return np.asarray(design @ np.linalg.lstsq(design, alpha, rcond=None)[0])


def _accelerometer(aircraft: Aircraft) -> SensorErrors:
    return aircraft.file.sensors[CHANNEL].errors() if CHANNEL in aircraft.file.sensors else SensorErrors()


def _between_points(plant: Plant) -> tuple[Array, Array]:
    """Angles of attack (points,) [rad], and what X has there beyond the plant's tables, over the dynamic pressure (points,) [m2].

    The points of the tables are those where Z and M break; the breaks of X lie between them.
    """
    at = plant.trim
    if at is None:
        return plant.alpha_rad, np.zeros(len(plant.alpha_rad))
    alpha = np.arange(plant.alpha_rad[0], plant.alpha_rad[-1], _FINE_RAD)
    words = f"the axial force of {plant.aircraft.name}"
    exact = isolated(words, forces_over_alpha, plant.aircraft, at, alpha, np.ones(1))[0, :, 0]
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    still = {name: np.full(len(alpha), value) for name, value in plant.trims.items()}
    tables = looked_up(plant, still | {FLOW: alpha}, np.full(len(alpha), pressure))[:, 0]
    return alpha, (exact - tables) / pressure


def _slope(plant: Plant, signal: str) -> float:
    """Declared slope of CX over a signal at the trim [1/rad]."""
    axis, forces = plant.along(signal)
    slopes = np.gradient(forces[:, 0], axis) / plant.aircraft.constants.wing_area_m2
    return float(np.interp(plant.trims[signal], axis, slopes))


__all__ = ["CHANNEL", "TOLERANCE", "AxialSeries", "AxialTolerance", "axial_series"]
