"""Flight logs as records for the filter: outputs at the samples, controls between them, known inputs without noise."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import BANK
from airtruth.checks.airspeed import attitude, low_passed, speeds
from airtruth.checks.rotation import alpha_gravity
from airtruth.errors import LogError
from airtruth.identification.lateral.observation import known_inputs
from airtruth.identification.lateral_inputs import lateral_rates
from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.numerics.whiteness import is_white, noise_at_rest
from airtruth.physics.atmosphere import air_density, altitude_of_density_m
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.physics.motion_parts import Control
from airtruth.tracing.model.damper import damper_surface, find_damper
from airtruth.tracing.model.records import FINE, OF_OTHER_MOTION, Signals, fine
from airtruth.tracing.model.surface_path import LONGEST_STEP_S, Between, read_between
from airtruth.units import G0

Array = NDArray[np.float64]

_QUIET_S: Final = 0.2
"""Width of the median that replaces a control at rest [s] (judgement)."""
_REST_S: Final = 1.0
"""Window that shows the noise of a control at rest [s] (judgement: half of the rest before a manoeuvre)."""
_LEAST_REST: Final = 8
"""Samples of such a window at least [-] (judgement)."""
_SHORT_REST_S: Final = 0.5
"""Length of a rest of a control up to which the error of its mean counts as noise [s] (judgement: half of a short period)."""
_QUIET_STD: Final = 3.0
"""Distance from that median up to which the control is at rest, in standard deviations of its noise [-] (convention)."""


class MeasuredControl(NamedTuple):
    """Declared sensor and servo of a control.

    Attributes
    ----------
    noise_rad : standard deviation of the noise of the measured surface [rad]; None where none is declared.
    servo_s : time constant of the servo [s]; 0 for none.
    rate_rad_s : its rate limit [rad/s].
    """

    noise_rad: float | None = None
    servo_s: float = 0.0
    rate_rad_s: float = math.inf


def measured_controls(aircraft: Aircraft, motion: Motion) -> tuple[MeasuredControl, ...]:
    """Controls of a motion as aircraft.toml declares them."""
    found = []
    for control in motion.controls:
        sensor = aircraft.file.sensors.get(control.channel)
        servo = getattr(aircraft.file, control.actuator)
        found.append(
            MeasuredControl(
                (sensor.noise_std.value or None) if sensor else None,
                0.0 if servo is None else 1.0 / (2.0 * math.pi * servo.bandwidth.value),
                math.inf if servo is None else servo.rate_limit.value,
            )
        )
    return tuple(found)


def read(
    log: FlightLog,
    motion: Motion = LONGITUDINAL,
    controls: Sequence[MeasuredControl] | None = None,
    constants: object = None,
) -> list[Signals]:
    """The runs of a validated log.

    The noise of a control without a declared sensor is that of its samples at rest (`airtruth.numerics.whiteness.noise_at_rest`).
    Where a control is at rest but for this noise it is smoothed, because the noise moves the model's aircraft,
    and backlash and rate limits would take each new extreme for motion.
    A control between samples has the area of the cubic through the four nearest samples and the
    corners of a first-order servo where the record shows one (`airtruth.numerics.intersample`); in a coarse log it is
    that of the declared servo, or a spline (`airtruth.tracing.model.servo_surface`). What a damper moves follows from the
    angular rate that it feeds back (`airtruth.tracing.model.damper`). Airspeed
    and density are inputs, and their noise is not motion: the density is low-passed forward and backward at 5 Hz, and the
    airspeed where its noise exceeds its gusts, or smoothed (`without_noise`). The other known inputs are low-passed likewise.
    Attitude is measured, or the integral of the pitch rate from alpha at the start, level flight. In the lateral-directional
    motion an output without an instrument is reconstructed, and the flight is steady where a known input is absent
    (`airtruth.identification.lateral.observation.known_inputs`).

    Parameters
    ----------
    log : the log.
    motion : whose outputs and controls are read.
    controls : of each control of the motion; None where nothing is declared.
    constants : the aircraft, whose inertias couple the motions; without them the pitch plane is one of level wings.
    """
    declared = controls or (MeasuredControl(),) * len(motion.controls)
    is_pitch = motion is LONGITUDINAL
    found = []
    for run, run_id in enumerate(log.run_ids):
        rows = log.rows(run)
        t = log.t_s[rows]
        dt = float((t[-1] - t[0]) / (len(t) - 1))
        logged = {name: values[rows] for name, values in log.channels.items()}
        channels = logged if is_pitch else _completed(logged, t, dt)
        sub = 2 * math.ceil(dt / LONGEST_STEP_S - 1e-9)
        y = np.stack([channels[name] for name in motion.output_channels], axis=1)
        density = air_density(channels)
        altitude = channels.get("altitude_m")
        if altitude is None:
            altitude = np.full(len(t), _altitude(float(density.mean())))
        coupling = _coupling(channels, t, dt, sub, constants) if is_pitch else np.zeros((0, 0))
        speed = speeds(channels, dt, banked=not is_pitch or coupling.size > 0)
        surfaces = [
            _surface(channels, control, dt, sub * FINE, own)
            for control, own in zip(motion.controls, declared, strict=True)
        ]
        known: dict[str, Any] = {n: _known(channels, n, motion, dt, sub) for n in OF_OTHER_MOTION}
        found.append(
            Signals(
                run_id=run_id,
                dt_s=dt,
                sub=sub,
                y=np.ascontiguousarray(y, dtype=np.float64),
                controls_rad=np.stack([s.between.surface_rad for s in surfaces]),
                airspeed_m_s=fine(speed.quiet.speed_m_s, sub),
                ground_m_s=fine(speed.ground_m_s, sub),
                density_kg_m3=fine(low_passed(density, dt), sub),
                theta_rad=fine(speed.theta_rad, sub),
                altitude_m=float(np.mean(altitude)),
                throttle=float(channels["throttle"].mean()) if "throttle" in channels else None,
                motion=motion,
                **known,
                coupling=coupling,
                control_std_rad=np.array([s.noise_std_rad for s in surfaces]),
                corner_rad2=_together([s.between.corner_rad2 for s in surfaces], len(t)),
                surface_noise_rad2=_together([s.noise_rad2 for s in surfaces], len(t)),
                airspeed_walk=speed.quiet.walk,
                assumed=() if is_pitch else tuple(name for name in motion.known if name not in logged),
            )
        )
    return found


def _completed(logged: Mapping[str, Array], t_s: Array, dt_s: float) -> dict[str, Array]:
    """The channels of a run with those that the lateral-directional motion replaces or reconstructs."""
    known = known_inputs(_alone(logged, t_s, dt_s))
    made = {
        LONGITUDINAL.vane: known.alpha,
        "theta_rad": known.theta,
        LONGITUDINAL.gyros[0]: known.q,
        "ax_m_s2": G0 * np.sin(known.theta),
        LONGITUDINAL.outputs[-1].channel: -logged["airspeed_m_s"] * known.q
        - G0 * np.cos(known.theta) * np.cos(known.phi),
        LATERAL.vane: known.beta,
        BANK: known.phi,
    }
    return {name: x[0] for name, x in made.items()} | dict(logged)


def _alone(channels: Mapping[str, Array], t_s: Array, dt_s: float) -> Batch:
    """One run as a batch."""
    return Batch(("",), dt_s, t_s[None], {name: np.asarray(x)[None] for name, x in channels.items()})


def _coupling(channels: Mapping[str, Array], t_s: Array, dt_s: float, sub: int, constants: object) -> Array:
    """(2 + signals, points) see `Signals`; (0, 0) where the lateral motion is negligible."""
    (turn,), (pitch,) = lateral_rates(_alone(channels, t_s, dt_s), constants)
    if not turn.any():
        return np.zeros((0, 0))
    if BANK in channels:
        alpha, theta = channels[LONGITUDINAL.vane], attitude(channels, dt_s)
        turn = turn + alpha_gravity(alpha, theta, channels[BANK]) / channels["airspeed_m_s"]
    signals = [channels.get(one.channel, np.zeros_like(turn)) for one in LATERAL.signals]
    return np.stack([fine(low_passed(x, dt_s), sub) for x in (turn, pitch, *signals)])


def _known(channels: Mapping[str, Array], name: str, motion: Motion, dt_s: float, sub: int) -> Array:
    """A known input on the filter's grid without the noise of its sensor; empty where it is an output of the motion."""
    if name not in motion.known:
        return np.zeros(0)
    return fine(low_passed(channels[name], dt_s), sub)


def _together(rows: Sequence[Array], samples: int) -> Array:
    """(controls, samples) of rows of which some may be empty; (controls, 0) where all are."""
    if not any(row.size for row in rows):
        return np.zeros((len(rows), 0))
    return np.stack([row if row.size else np.zeros(samples) for row in rows])


class _Surface(NamedTuple):
    """A smoothed control between its samples, the damper's share included, and the noise that remains in it; see `Signals`."""

    between: Between
    noise_std_rad: float
    noise_rad2: Array


def _surface(
    channels: Mapping[str, Array], control: Control, dt_s: float, cells: int, declared: MeasuredControl
) -> _Surface:
    noise_rad, servo_s, rate_rad_s = declared
    raw = np.asarray(channels[control.channel], dtype=np.float64)
    std_rad = noise_at_rest(raw, _rest_samples(dt_s)) if noise_rad is None else noise_rad
    rate = np.asarray(channels[control.damped], dtype=np.float64)
    is_fast = servo_s > 0.0 and dt_s <= LONGEST_STEP_S
    damper = find_damper(raw, rate, dt_s, servo_s, std_rad) if is_fast else None
    if damper is None:
        quiet = _quiet(raw, dt_s, std_rad)
        moving = quiet == raw
        between = read_between(quiet, dt_s, cells, std_rad, servo_s, rate_rad_s)
        return _Surface(between, std_rad * float(np.sqrt(moving.mean())), _remaining(moving, dt_s, std_rad))
    own = damper_surface(damper, rate, dt_s, servo_s, cells)
    rest = _quiet(raw - own[::cells], dt_s, std_rad)
    pilot = read_between(rest, dt_s, cells, std_rad, servo_s, rate_rad_s)
    return _Surface(pilot._replace(surface_rad=pilot.surface_rad + own), 0.0, np.zeros(0))


def _rest_samples(dt_s: float) -> int:
    """Samples of a window that shows the noise of a control at rest."""
    return max(_LEAST_REST, round(_REST_S / dt_s))


def _remaining(moving: NDArray[np.bool_], dt_s: float, std_rad: float) -> Array:
    """Variance of the noise that remains in a control (samples,) [rad2]; empty without noise.

    A mean over n samples at rest has an error that is sqrt(n) smaller, and acts for n samples in the same direction. Over a
    short rest its impulse has the variance of n independent errors. Over a longer one the motion and the record's trim absorb it.
    """
    if std_rad <= 0.0:
        return np.zeros(0)
    noisy = moving.copy()
    ends = np.flatnonzero(np.diff(moving)) + 1
    for start, end in itertools.pairwise([0, *ends.tolist(), len(moving)]):
        if start > 0 and end - start < _SHORT_REST_S / dt_s:
            noisy[start:end] = True
    return np.where(noisy, std_rad**2, 0.0)


def _quiet(surface_rad: Array, dt_s: float, std: float) -> Array:
    """A control without the noise of its sensor where it is at rest.

    It is at rest where it stays within three standard deviations of its median over 0.2 s and has settled (`_settled`). Of a
    stretch that shows nothing but white noise the mean is taken, else the median: correlated noise of a median moves an aircraft
    as well as that of the samples.
    """
    from scipy.ndimage import median_filter

    raw = np.asarray(surface_rad, dtype=np.float64)
    if std <= 0.0:
        return raw
    width = 2 * round(0.5 * _QUIET_S / dt_s) + 1
    middle = median_filter(raw, size=width, mode="nearest")
    at_rest = np.abs(raw - middle) <= _QUIET_STD * std
    between = np.abs(middle[2:] - middle[:-2]) <= std
    at_rest[1:-1] |= at_rest[:-2] & at_rest[2:] & between  # a single outlier of the noise
    jumps = np.abs(np.diff(middle)) > _QUIET_STD * std
    at_rest &= _settled(jumps)
    quiet = np.where(at_rest, middle, raw)
    ends = np.flatnonzero(np.diff(at_rest) | jumps) + 1
    for start, end in itertools.pairwise([0, *ends.tolist(), len(raw)]):
        if at_rest[start] and end - start >= width and is_white(raw[start:end]):
            quiet[start:end] = raw[start:end].mean()
    return quiet


def _settled(jumps: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples before a motion, and from as long after it as it lasted.

    The end of a servo's motion hides in the noise. If a first-order servo took T from a step A to the edge e of the noise,
    e^2/A of the step is left T later. A mean over the hidden end would distort the surface by several e.

    Parameters
    ----------
    jumps : (samples - 1,) whether the surface moves from a sample to the next by more than noise.
    """
    settled = np.ones(jumps.size + 1, dtype=np.bool_)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], jumps, [False]])))
    for start, end in edges.reshape(-1, 2).tolist():
        settled[start : 2 * end - start + 1] = False
    return settled


def _altitude(density: float) -> float:
    """Altitude [m] of the standard atmosphere with that density [kg/m3].

    Raises
    ------
    LogError
        If no altitude in the range has it.
    """
    altitude = float(altitude_of_density_m(density))
    if not np.isfinite(altitude):
        raise LogError(
            f"density_kg_m3 is {density:.4g} kg/m3 on average, which no altitude of the standard atmosphere has; "
            "state its unit in the import mapping, or give altitude_m"
        )
    return altitude


__all__ = ["MeasuredControl", "measured_controls", "read"]
