"""A pitch damper that samples the gyro: its gain and the phase of its steps, and its share of the surface.

The damper adds K q[k] to the command of the servo, from a phase s of the cell after sample k on. The share u of the surface
that this moves is known on any grid but for K and s. What the pilot commands is the command that the rest of the samples
implies, c[k] = (x[k+1] - rho x[k])/(1 - rho) with x = de - K u and rho = exp(-dt/tau). It is smooth, or held between a few
steps: K and s leave the least sum of the absolute fourth differences of c. Squares would let the steps outweigh the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from airtruth.tracing.model.elevator import implied_command, servo_path, step_share

Array = NDArray[np.float64]

_PHASES: Final = np.arange(16) / 16.0
"""Phases that are tried, in sample periods [-] (judgement: 1.25 ms at 50 Hz)."""
_ORDER: Final = 4
"""Order of the differences [-] (judgement): a line of the input at a tenth of the sample rate shrinks to a seventh."""
_SPREAD: Final = 70.0**0.5
"""Standard deviation of a fourth difference of white noise over that of the noise [-]."""
_ROUNDS: Final = 20
"""Rounds of reweighting [-] (judgement)."""
_FLOOR: Final = 1e-3
"""Least distance that is weighted, over the median of the differences [-] (judgement)."""
_EVIDENCE: Final = 15.0
"""Gain in log likelihood, of Laplace's distribution, that shows a damper [-] (measured: at most 8.2 in 1080 records without
one, at least 35 in 720 with one of 0.2 to 0.6 s)."""


@dataclass(frozen=True)
class Damper:
    """A pitch damper.

    Attributes
    ----------
    gain_s : surface per pitch rate [s].
    phase : time from a sample to the step that it causes, in sample periods [-].
    """

    gain_s: float
    phase: float


def find_damper(
    elevator_rad: Array, q_rad_s: Array, dt_s: float, tau_s: float, noise_rad: float
) -> Damper | None:
    """The damper that the samples of a surface show; None if the pitch rate does not explain its command.

    Parameters
    ----------
    elevator_rad, q_rad_s : (samples,) measured surface [rad] and pitch rate [rad/s].
    dt_s, tau_s : sample period and time constant of the servo [s].
    noise_rad : standard deviation of the noise of the surface [rad], below which differences show nothing.
    """
    if len(elevator_rad) < 2 * (_ORDER + 1) or np.ptp(q_rad_s) == 0.0:
        return None
    command = np.diff(implied_command(elevator_rad, dt_s, tau_s), _ORDER)
    rho = float(np.exp(-dt_s / tau_s))
    floor = noise_rad * _SPREAD * np.sqrt(1.0 + rho * rho) / (1.0 - rho)
    alone, best, least = np.hypot(command, floor).sum(), Damper(0.0, 0.0), np.inf
    if not command.any():
        return None
    for phase in _PHASES.tolist():
        unit = damper_surface(Damper(1.0, phase), q_rad_s, dt_s, tau_s)
        fed_back = np.diff(implied_command(unit, dt_s, tau_s), _ORDER)
        gain = _least_absolute(command, fed_back)
        left = np.hypot(command - gain * fed_back, floor).sum()
        if left < least:
            best, least = Damper(gain, phase), left
    return best if command.size * np.log(alone / least) > _EVIDENCE else None


def damper_surface(damper: Damper, q_rad_s: Array, dt_s: float, tau_s: float, cells: int = 1) -> Array:
    """((samples - 1) cells + 1,) share of the surface that a damper moves, from rest at the first pitch rate on [rad].

    Parameters
    ----------
    q_rad_s : (samples,) pitch rate [rad/s].
    dt_s, tau_s : sample period and time constant of the servo [s].
    cells : cells of the grid per sample.
    """
    command = damper.gain_s * (np.append(q_rad_s[:1], q_rad_s[:-1]) - q_rad_s[0])
    rho, late = float(np.exp(-dt_s / tau_s)), step_share(dt_s, tau_s, damper.phase)
    moves = (1.0 - rho - late) * command[:-1] + late * command[1:]
    samples = np.append(0.0, lfilter([1.0], [1.0, -rho], moves))
    return servo_path(samples, command, dt_s, tau_s, cells, damper.phase)


def _least_absolute(y: Array, x: Array) -> float:
    """Factor of ``x`` with the least sum of absolute distances from ``y``, by reweighted least squares."""
    floor, weights, factor = _FLOOR * float(np.median(np.abs(y))) + np.finfo(float).tiny, np.ones(y.size), 0.0
    for _ in range(_ROUNDS):
        factor = float((weights * x) @ y / ((weights * x) @ x))
        weights = 1.0 / np.maximum(np.abs(y - factor * x), floor)
    return factor


__all__ = ["Damper", "damper_surface", "find_damper"]
