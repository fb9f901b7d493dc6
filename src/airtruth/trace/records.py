"""Measured records as the filter reads them: outputs at the samples, inputs on a fine grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Sensor
from airtruth.identify.intersample import servo_bend
from airtruth.identify.prefilter import butterworth
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.trace.lower import CHANNELS
from airtruth.trace.plant import Plant
from airtruth.trace.plausible import HIGHEST_M, LOWEST_M, check_density
from airtruth.units import G0

Array = NDArray[np.float64]

_STEP_S: Final = 0.0201
FINE: Final = 8
"""Cells of the surface's own grid per cell of the filter's."""
_CUTOFF_HZ: Final = 5.0


@dataclass(frozen=True)
class Signals:
    """One run of a log, before any model.

    Attributes
    ----------
    run_id : its name.
    dt_s : sample period [s].
    sub : cells of the filter's grid per sample, two per step of integration.
    y : (samples, 3) alpha [rad], q [rad/s], az [m/s2].
    elevator_rad : (fine points,) `FINE` cells to a cell of the filter's grid.
    airspeed_m_s, ground_m_s, density_kg_m3, theta_rad : (points,) on the filter's grid; ground: speed without the gust.
    altitude_m : mean pressure altitude [m].
    elevator_std_rad : noise that is left in the elevator after smoothing, all samples alike [rad].
    throttle : its mean where it is logged, None elsewhere [0..1].
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


@dataclass(frozen=True)
class Record:
    """A run and the plant of its flight condition."""

    signals: Signals
    plant: Plant

    @property
    def samples(self) -> int:
        """Samples of the run."""
        return int(self.signals.y.shape[0])


def read(log: FlightLog, elevator_std_rad: float = 0.0) -> list[Signals]:
    """The runs of a validated log.

    Where the elevator stands still but for the noise of its sensor it is smoothed: backlash and rate
    limits would take each new extreme of the noise for motion.
    The elevator between samples has the area of the cubic through the four nearest samples and the
    corners of a first-order servo where the record shows one (`airtruth.identify.intersample`). Airspeed
    and density are low-passed forward and backward (5 Hz): they are inputs, and their noise is not motion.
    Attitude is measured, or the integral of the pitch rate from alpha at the start, level flight.

    Parameters
    ----------
    log : the log.
    elevator_std_rad : declared noise of the measured surface.
    """
    found = []
    for run, run_id in enumerate(log.run_ids):
        rows = log.rows(run)
        channels = {name: values[rows] for name, values in log.channels.items()}
        t = log.t_s[rows]
        dt = float((t[-1] - t[0]) / (len(t) - 1))
        sub = 2 * math.ceil(dt / _STEP_S - 1e-9)
        y = np.stack([channels[name] for name in CHANNELS], axis=1)
        density = (
            channels["density_kg_m3"]
            if "density_kg_m3" in channels
            else density_kg_m3(channels["altitude_m"])
        )
        altitude = channels.get("altitude_m")
        if altitude is None:
            altitude = np.full(len(t), _altitude(float(density.mean())))
        theta = channels.get("theta_rad")
        if theta is None:
            q = channels["q_rad_s"]
            theta = channels["alpha_rad"][0] + np.concatenate([[0.0], np.cumsum(0.5 * dt * (q[1:] + q[:-1]))])
        quiet = _quiet(channels["elevator_rad"], dt, elevator_std_rad)
        found.append(
            Signals(
                run_id=run_id,
                dt_s=dt,
                sub=sub,
                y=np.ascontiguousarray(y, dtype=np.float64),
                elevator_rad=_elevator(quiet, sub * FINE),
                airspeed_m_s=fine(_smooth(channels["airspeed_m_s"], dt), sub),
                ground_m_s=fine(_ground(channels, theta, dt), sub),
                density_kg_m3=fine(_smooth(density, dt), sub),
                theta_rad=fine(theta, sub),
                altitude_m=float(np.mean(altitude)),
                elevator_std_rad=elevator_std_rad
                * float(np.sqrt((quiet == channels["elevator_rad"]).mean())),
                throttle=float(channels["throttle"].mean()) if "throttle" in channels else None,
            )
        )
    return found


def _ground(channels: dict[str, Array], theta: Array, dt_s: float) -> Array:
    """Speed as inertia has it: the integral of the acceleration along the path, plus the line that fits the airspeed.

    The line takes up the accelerometer's bias and the steady wind; without ax, thrust less drag too.
    """
    alpha, v = channels["alpha_rad"], np.asarray(channels["airspeed_m_s"], dtype=np.float64)
    along = -G0 * np.sin(theta - alpha)
    if "ax_m_s2" in channels:
        along = along + channels["ax_m_s2"] * np.cos(alpha) + channels["az_m_s2"] * np.sin(alpha)
    speed = np.concatenate([[0.0], np.cumsum(0.5 * dt_s * (along[1:] + along[:-1]))])
    line = np.vander(np.linspace(-1.0, 1.0, len(v)), 2)
    return np.asarray(speed + line @ np.linalg.lstsq(line, v - speed, rcond=None)[0])


def _quiet(elevator: Array, dt_s: float, std: float) -> Array:
    """The median over 0.2 s where that changes less than three standard deviations, as measured elsewhere."""
    from scipy.ndimage import median_filter

    raw = np.asarray(elevator, dtype=np.float64)
    if std <= 0.0:
        return raw
    middle = median_filter(raw, size=2 * round(0.1 / dt_s) + 1, mode="nearest")
    return np.where(np.abs(raw - middle) <= 3.0 * std, middle, raw)


def _elevator(elevator: Array, sub: int) -> Array:
    relative = (elevator - elevator[0])[None, :]
    bend = servo_bend(relative)[0]
    edge = np.concatenate([relative[0, :1], relative[0], relative[0, -1:]])
    bend[1:] += (edge[1:-2] + edge[2:-1] - edge[:-3] - edge[3:]) / 24.0
    share = np.arange(sub) / sub
    cells = elevator[:-1, None] + (elevator[1:] - elevator[:-1])[:, None] * share
    cells += 6.0 * bend[1:, None] * share * (1.0 - share)
    return np.append(cells.ravel(), elevator[-1])


def fine(x: Array, sub: int) -> Array:
    """Samples on the filter's grid, linear in between."""
    return np.interp(np.arange((len(x) - 1) * sub + 1) / sub, np.arange(len(x)), x)


def _smooth(x: Array, dt_s: float) -> Array:
    from scipy.signal import sosfiltfilt

    x = np.asarray(x, dtype=np.float64)
    if 0.45 / dt_s <= _CUTOFF_HZ or len(x) < 40:
        return x
    return np.asarray(sosfiltfilt(butterworth(_CUTOFF_HZ, 2, dt_s).copy(), x))


def undone(x: Array, sensor: Sensor) -> Array:
    """A series as it was before the bias and scale of its sensor."""
    return np.asarray((x - sensor.bias.value) / sensor.scale.value)


def lead_s(sensor: Sensor) -> float:
    """By how much a series has to be advanced for the delay and lag of its sensor [s]."""
    return sensor.delay.value + sensor.lag.value


def _altitude(density: float) -> float:
    """Altitude [m] of the standard atmosphere with that density [kg/m3].

    Raises
    ------
    LogError
        If no altitude in the range has it.
    """
    from scipy.optimize import brentq

    check_density(density)
    return float(brentq(lambda h: float(density_kg_m3(np.array(h))) - density, LOWEST_M, HIGHEST_M))


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
