"""A pitch damper that samples the gyro: its gain and the phase of its steps, and its share of the surface.

The damper adds K q[k] to the command of the servo, from a phase s of the cell after sample k on. The share u of the surface
that this moves is known on any grid but for K and s. What the pilot commands is the command that the rest of the samples
implies, c[k] = (x[k+1] - rho x[k])/(1 - rho) with x = de - K u and rho = exp(-dt/tau). It is smooth, or held between a few
steps: K and s leave the least sum of the absolute fourth differences of c. Squares would let the steps outweigh the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.recursion import recursion
from airtruth.tracing.model.servo_surface import implied_command, servo_path, step_share

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
_OTHERS: Final = 0.5
"""Gains of the samples before and after, over that of the damper, up to which it is one [-] (judgement)."""
_MOST_S: Final = 1.0
"""Largest gain of a damper [s] (judgement): 1 deg of surface for 1 deg/s."""
_TINY: Final = 1e-12
"""Least share of the differences that is left [-]: rounding."""
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
    surface_rad: Array, rate_rad_s: Array, dt_s: float, tau_s: float, noise_rad: float
) -> Damper | None:
    """The damper that the samples of a surface show; None if the pitch rate does not explain its command.

    Parameters
    ----------
    surface_rad, rate_rad_s : (samples,) measured surface [rad] and rate that it damps [rad/s].
    dt_s, tau_s : sample period and time constant of the servo [s].
    noise_rad : standard deviation of the noise of the surface [rad], below which differences show nothing.
    """
    if len(surface_rad) < 2 * (_ORDER + 1):
        return None
    command = np.diff(implied_command(surface_rad, dt_s, tau_s), _ORDER)
    if not command.any():
        return None
    rho = float(np.exp(-dt_s / tau_s))
    floor = noise_rad * _SPREAD * np.sqrt(1.0 + rho * rho) / (1.0 - rho)
    alone, best, least = np.hypot(command, floor).sum(), Damper(0.0, 0.0), np.inf
    for phase in _PHASES.tolist():
        fed_back = _fed_back(rate_rad_s, phase, dt_s, tau_s)
        if not fed_back.any():
            return None
        (gain,) = _least_absolute(command, fed_back[:, None])
        left = np.hypot(command - gain * fed_back, floor).sum()
        if left < least:
            best, least = Damper(float(gain), phase), left
    if (
        not 0.0 < best.gain_s < _MOST_S
        or command.size * math.log(alone / max(least, _TINY * alone)) < _EVIDENCE
    ):
        return None
    return best if _is_causal(command, rate_rad_s, best.phase, dt_s, tau_s) else None


def _fed_back(rate_rad_s: Array, phase: float, dt_s: float, tau_s: float) -> Array:
    """Fourth differences of the command of a damper of unit gain, as its surface implies it."""
    unit = damper_surface(Damper(1.0, phase), rate_rad_s, dt_s, tau_s)
    return np.diff(implied_command(unit, dt_s, tau_s), _ORDER)


def _is_causal(command: Array, rate_rad_s: Array, phase: float, dt_s: float, tau_s: float) -> bool:
    """Whether each sample of the pitch rate moves the command, and not the samples before and after it.

    Without noise of the gyro the pitch rate is a smooth response to the surface. The command is then nearly a combination of
    several of its samples, later ones included.
    """
    before, after = np.append(rate_rad_s[:1], rate_rad_s[:-1]), np.append(rate_rad_s[1:], rate_rad_s[-1:])
    taps = np.column_stack([_fed_back(q, phase, dt_s, tau_s) for q in (rate_rad_s, before, after)])
    gain, *others = _least_absolute(command, taps).tolist()
    return bool(gain > 0.0 and sum(map(abs, others)) < _OTHERS * gain)


def damper_surface(damper: Damper, rate_rad_s: Array, dt_s: float, tau_s: float, cells: int = 1) -> Array:
    """((samples - 1) cells + 1,) share of the surface that a damper moves, from rest at the first pitch rate on [rad].

    Parameters
    ----------
    rate_rad_s : (samples,) rate that it damps [rad/s].
    dt_s, tau_s : sample period and time constant of the servo [s].
    cells : cells of the grid per sample.
    """
    command = damper.gain_s * (np.append(rate_rad_s[:1], rate_rad_s[:-1]) - rate_rad_s[0])
    rho, late = float(np.exp(-dt_s / tau_s)), step_share(dt_s, tau_s, damper.phase)
    moves = (1.0 - rho - late) * command[:-1] + late * command[1:]
    samples = np.append(0.0, recursion(rho, moves))
    return servo_path(samples, command, dt_s, tau_s, cells, damper.phase)


def _least_absolute(y: Array, x: Array) -> Array:
    """(columns,) factors of ``x`` with the least sum of absolute distances from ``y``, by reweighted least squares."""
    floor = _FLOOR * float(np.median(np.abs(y))) + np.finfo(float).tiny
    factors: Array = np.zeros(x.shape[1])
    roots: Array = np.ones((y.size, 1))
    for _ in range(_ROUNDS):
        factors = np.asarray(np.linalg.lstsq(roots * x, roots[:, 0] * y, rcond=None)[0])
        roots = np.sqrt(1.0 / np.maximum(np.abs(y - x @ factors), floor))[:, None]
    return factors


__all__ = ["Damper", "damper_surface", "find_damper"]
