"""Measured records for the filter: outputs at the samples, inputs on a fine grid."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.airspeed import WalkInNoise, low_passed, speeds
from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.numerics.whiteness import is_white
from airtruth.physics.atmosphere import air_density, altitude_of_density_m
from airtruth.tracing.model.compile import CHANNELS
from airtruth.tracing.model.damper import damper_surface, find_damper
from airtruth.tracing.model.elevator_path import LONGEST_STEP_S, Between, read_between
from airtruth.tracing.model.plant import Plant

Array = NDArray[np.float64]

FINE: Final = 8
"""Cells of the surface's own grid per cell of the filter's."""
_HEAD_S: Final = 0.1
"""Start of a record whose mean is its trim with the linear model [s] (judgement: before the manoeuvre moves it)."""
_HEAD_SAMPLES: Final = 3
"""Least number of samples of that start [-] (judgement)."""
_QUIET_S: Final = 0.2
"""Width of the median that replaces an elevator at rest [s] (judgement)."""
_SHORT_REST_S: Final = 0.5
"""Length of a rest of the elevator up to which the error of its mean counts as noise [s] (judgement: half of a short period)."""
_QUIET_STD: Final = 3.0
"""Distance from that median up to which the elevator is at rest, in standard deviations of its noise [-] (convention)."""

_SERIES: Final = (
    "y",
    "elevator_rad",
    "airspeed_m_s",
    "ground_m_s",
    "density_kg_m3",
    "theta_rad",
    "corner_rad2",
    "surface_noise_rad2",
)
"""Attributes of `Signals` that are series in time."""


def head_samples(dt_s: float) -> int:
    """Samples at the start of a record whose mean is its trim with the linear model; ``dt_s`` is the sample period [s]."""
    return max(_HEAD_SAMPLES, int(_HEAD_S / dt_s))


@dataclass(frozen=True)
class Signals:
    """One run of a log, before any model.

    Attributes
    ----------
    run_id : name of the run.
    dt_s : sample period [s].
    sub : cells of the filter's grid per sample, two per step of integration.
    y : (samples, 3) alpha [rad], q [rad/s], az [m/s2].
    elevator_rad : (fine points,) `FINE` cells to a cell of the filter's grid.
    airspeed_m_s, ground_m_s, density_kg_m3, theta_rad : (points,) on the filter's grid; ground: speed without the gust.
    altitude_m : mean pressure altitude [m].
    elevator_std_rad : standard deviation of the noise that remains in the smoothed elevator [rad]; 0 behind a damper,
        which turns the surface throughout, so that a play does not rest at the extremes of the noise.
    throttle : its mean where it is logged, None elsewhere [0..1].
    corner_rad2 : (samples,) variance of the elevator's mean over the cell that ends at each sample, about that of
        ``elevator_rad``; empty where the samples show its motion.
    surface_noise_rad2 : (samples,) variance of the noise that remains in the elevator (`_remaining`); empty for none.
    airspeed_walk : statistics of an airspeed that is smoothed; None where a low-pass is enough.
    lead : what comes before a part of a run; None for a whole run. The filter starts there.
    part_of : name of the run of which it is a part; empty for a whole run.
    """

    run_id: str
    dt_s: float
    sub: int
    y: Array
    elevator_rad: Array
    airspeed_m_s: Array
    ground_m_s: Array
    density_kg_m3: Array
    theta_rad: Array
    altitude_m: float
    throttle: float | None
    elevator_std_rad: float = 0.0
    corner_rad2: Array = field(default_factory=lambda: np.zeros(0))
    surface_noise_rad2: Array = field(default_factory=lambda: np.zeros(0))
    airspeed_walk: WalkInNoise | None = None
    lead: Signals | None = None
    part_of: str = ""

    @property
    def sampled_elevator_rad(self) -> Array:
        """(samples,) elevator at the samples [rad]."""
        return self.elevator_rad[:: self.sub * FINE]

    @property
    def with_lead(self) -> Signals:
        """The part of a run and what comes before it, as one."""
        if self.lead is None:
            return self
        both: dict[str, Any] = {
            name: np.concatenate([getattr(self.lead, name), getattr(self, name)]) for name in _SERIES
        }
        return replace(self, lead=None, **both)

    def with_airspeed(self, airspeed_m_s: Array) -> Signals:
        """The run, or part of one with what comes before it, with another airspeed (points of `with_lead`,) [m/s]."""
        if self.lead is None:
            return replace(self, airspeed_m_s=airspeed_m_s)
        first = len(self.lead.airspeed_m_s)
        lead = replace(self.lead, airspeed_m_s=airspeed_m_s[:first])
        return replace(self, lead=lead, airspeed_m_s=airspeed_m_s[first:])

    def part(self, name: str, start: int, first: int, last: int) -> Signals:
        """Samples ``first`` to before ``last``, with those from ``start`` on before them."""
        fine, end = self.sub * FINE, last - 1
        lead = None
        if start < first:
            points, cells = slice(start * self.sub, first * self.sub), slice(start * fine, first * fine)
            lead = self._cut(slice(start, first), points, cells)
        points, cells = slice(first * self.sub, end * self.sub + 1), slice(first * fine, end * fine + 1)
        own = self._cut(slice(first, last), points, cells)
        return replace(own, run_id=f"{self.run_id}, {name}", part_of=self.record, lead=lead)

    @property
    def record(self) -> str:
        """Name of the record, also of a part of one."""
        return self.part_of or self.run_id

    def _cut(self, samples: slice, points: slice, fine: slice) -> Signals:
        return replace(
            self,
            y=np.ascontiguousarray(self.y[samples]),
            elevator_rad=self.elevator_rad[fine],
            airspeed_m_s=self.airspeed_m_s[points],
            ground_m_s=self.ground_m_s[points],
            density_kg_m3=self.density_kg_m3[points],
            theta_rad=self.theta_rad[points],
            corner_rad2=self.corner_rad2[samples],
            surface_noise_rad2=self.surface_noise_rad2[samples],
            lead=None,
        )


@dataclass(frozen=True)
class TraceRecord:
    """A run and what is declared at its flight condition.

    Attributes
    ----------
    signals : the run.
    plant : the declared aircraft there.
    gust_length_m : scale length of the vertical gust there [m].
    remainder : (2, points) of CL and Cm on the filter's grid, which the declared JSBSim model has along this record
        beyond the plant's tables (`airtruth.tracing.model.remainder`), from the lead on; None for none.
    kept : what was computed from the record alone, by name; no part of its value.
    """

    signals: Signals
    plant: Plant
    gust_length_m: float
    remainder: Array | None = None
    kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def samples(self) -> int:
        """Samples of the run."""
        return int(self.signals.y.shape[0])


def read(
    log: FlightLog, elevator_std_rad: float = 0.0, servo_s: float = 0.0, rate_rad_s: float = math.inf
) -> list[Signals]:
    """The runs of a validated log.

    Where the elevator is at rest but for the noise of its sensor it is smoothed, because the noise moves the model's aircraft,
    and backlash and rate limits would take each new extreme for motion.
    The elevator between samples has the area of the cubic through the four nearest samples and the
    corners of a first-order servo where the record shows one (`airtruth.numerics.intersample`); in a coarse log it is
    that of the declared servo, or a spline (`airtruth.tracing.model.elevator`). What a pitch damper moves follows from the
    pitch rate (`airtruth.tracing.model.damper`). Airspeed
    and density are inputs, and their noise is not motion: the density is low-passed forward and backward at 5 Hz, and the
    airspeed where its noise exceeds its gusts, or smoothed (`without_noise`).
    Attitude is measured, or the integral of the pitch rate from alpha at the start, level flight.

    Parameters
    ----------
    log : the log.
    elevator_std_rad : declared noise of the measured surface.
    servo_s : declared time constant of the elevator's servo [s]; 0 for none.
    rate_rad_s : its declared rate limit [rad/s].
    """
    found = []
    for run, run_id in enumerate(log.run_ids):
        rows = log.rows(run)
        channels = {name: values[rows] for name, values in log.channels.items()}
        t = log.t_s[rows]
        dt = float((t[-1] - t[0]) / (len(t) - 1))
        sub = 2 * math.ceil(dt / LONGEST_STEP_S - 1e-9)
        y = np.stack([channels[name] for name in CHANNELS], axis=1)
        density = air_density(channels)
        altitude = channels.get("altitude_m")
        if altitude is None:
            altitude = np.full(len(t), _altitude(float(density.mean())))
        speed = speeds(channels, dt)
        surface = _surface(channels, dt, sub * FINE, elevator_std_rad, servo_s, rate_rad_s)
        found.append(
            Signals(
                run_id=run_id,
                dt_s=dt,
                sub=sub,
                y=np.ascontiguousarray(y, dtype=np.float64),
                elevator_rad=surface.between.surface_rad,
                airspeed_m_s=fine(speed.quiet.speed_m_s, sub),
                ground_m_s=fine(speed.ground_m_s, sub),
                density_kg_m3=fine(low_passed(density, dt), sub),
                theta_rad=fine(speed.theta_rad, sub),
                altitude_m=float(np.mean(altitude)),
                elevator_std_rad=surface.noise_std_rad,
                throttle=float(channels["throttle"].mean()) if "throttle" in channels else None,
                corner_rad2=surface.between.corner_rad2,
                surface_noise_rad2=surface.noise_rad2,
                airspeed_walk=speed.quiet.walk,
            )
        )
    return found


class _Surface(NamedTuple):
    """The smoothed elevator between its samples, the damper's share included, and the noise that remains in it; see `Signals`."""

    between: Between
    noise_std_rad: float
    noise_rad2: Array


def _surface(
    channels: Mapping[str, Array], dt_s: float, cells: int, std_rad: float, servo_s: float, rate_rad_s: float
) -> _Surface:
    raw = np.asarray(channels["elevator_rad"], dtype=np.float64)
    q = np.asarray(channels["q_rad_s"], dtype=np.float64)
    is_fast = servo_s > 0.0 and dt_s <= LONGEST_STEP_S
    damper = find_damper(raw, q, dt_s, servo_s, std_rad) if is_fast else None
    if damper is None:
        quiet = _quiet(raw, dt_s, std_rad)
        moving = quiet == raw
        between = read_between(quiet, dt_s, cells, std_rad, servo_s, rate_rad_s)
        return _Surface(between, std_rad * float(np.sqrt(moving.mean())), _remaining(moving, dt_s, std_rad))
    own = damper_surface(damper, q, dt_s, servo_s, cells)
    rest = _quiet(raw - own[::cells], dt_s, std_rad)
    pilot = read_between(rest, dt_s, cells, std_rad, servo_s, rate_rad_s)
    return _Surface(pilot._replace(surface_rad=pilot.surface_rad + own), 0.0, np.zeros(0))


def _remaining(moving: NDArray[np.bool_], dt_s: float, std_rad: float) -> Array:
    """Variance of the noise that remains in the elevator (samples,) [rad2]; empty without noise.

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


def _quiet(elevator: Array, dt_s: float, std: float) -> Array:
    """The elevator without the noise of its sensor where it is at rest.

    It is at rest where it stays within three standard deviations of its median over 0.2 s and has settled (`_settled`). Of a
    stretch that shows nothing but white noise the mean is taken, else the median: correlated noise of a median moves an aircraft
    as well as that of the samples.
    """
    from scipy.ndimage import median_filter

    raw = np.asarray(elevator, dtype=np.float64)
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


def fine(x: Array, sub: int) -> Array:
    """Samples on the filter's grid, linear in between."""
    return np.interp(np.arange((len(x) - 1) * sub + 1) / sub, np.arange(len(x)), x)


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


def nodes(fine: Array) -> Array:
    """Values on the filter's grid: ends of steps as they are, middles such that Simpson's rule has the area."""
    cells = 2 * FINE
    steps = fine[:-1].reshape(-1, cells)
    ends = np.append(fine[::cells][1:-1], fine[-1]) if fine.size > cells + 1 else fine[-1:]
    start = steps[:, 0]
    area = (steps.sum(axis=1) + 0.5 * (ends - start)) / cells
    out = np.empty(2 * len(steps) + 1)
    out[:-1:2] = start
    out[-1] = fine[-1]
    out[1::2] = (6.0 * area - start - ends) / 4.0
    return out
