"""Elevator: command, declared servo, and what lies between the measured surface and the air.

In open loop a record's surface is computed beforehand on a grid of 8 kHz; for a damper see `blind.damper`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import lfilter

from validation.blind.figures import DEG, LOG_STEP_S, STEP_S

Array = NDArray[np.float64]

FINE: Final = 8
FINE_S: Final = STEP_S / FINE
_SERVO_RAD_S: Final = 2.0 * np.pi * 5.0
_SERVO_RATE_RAD_S: Final = 300.0 * DEG
COMMAND_DELAY_S: Final = 0.015
SERVO_POLE: Final = float(np.exp(-_SERVO_RAD_S * FINE_S))
"""Of the declared servo over a fine step [-]."""


@dataclass(frozen=True)
class Manoeuvre:
    """One elevator input, and how its record is flown.

    Attributes
    ----------
    kind : "doublet", "3211", "multisine" or "sampled"; amplitude [rad], start [s], unit step [s].
    phases : of the multisine's lines [rad]; lines above ``highest_hz`` are left out.
    swing : largest change of the airspeed by a phugoid over the record, relative to that of the trim [-].
    shear : change of the airspeed by wind along the path over the record, likewise.
    damper_s : gain of a pitch damper [s].
    log_step_s : period of the log [s].
    measured : measured surface at 8 kHz from the lead on, deviation from trim [rad], in place of the input.
    samples_rad : command of the kind "sampled" at 1 kHz from the start of the record, deviation from trim [rad]; linear
        between samples, zero before the first.
    """

    kind: str
    amplitude_rad: float
    start_s: float
    unit_s: float
    phases: tuple[float, ...] = ()
    highest_hz: float = np.inf
    swing: float = 0.0
    shear: float = 0.0
    damper_s: float = 0.0
    log_step_s: float = LOG_STEP_S
    measured: Array | None = field(default=None, compare=False)
    samples_rad: Array | None = field(default=None, compare=False)


_SEQUENCES: Final = {"doublet": (1, -1), "3211": (1, 1, 1, -1, -1, 1, -1)}
MULTISINE_HZ: Final = (0.4, 0.8, 1.2, 1.6, 2.0, 2.6, 3.2, 4.0, 5.0)


def command(manoeuvre: Manoeuvre, time_s: Array) -> Array:
    """Deviation of the command from trim [rad] at any times [s]."""
    if manoeuvre.samples_rad is not None:
        samples = manoeuvre.samples_rad
        return np.interp(time_s, np.arange(len(samples)) * STEP_S, samples, left=0.0)
    t = time_s - manoeuvre.start_s
    if manoeuvre.kind == "multisine":
        lines = zip(MULTISINE_HZ, manoeuvre.phases, strict=True)
        waves = [np.sin(2.0 * np.pi * f * t + p) for f, p in lines if f <= manoeuvre.highest_hz]
        ramp = np.clip(t / 0.2, 0.0, 1.0)
        return np.asarray(manoeuvre.amplitude_rad * ramp * np.sum(waves, axis=0) / len(waves) ** 0.5)
    signs = np.array([0, *_SEQUENCES[manoeuvre.kind], 0], dtype=float)
    slot = np.clip(np.floor(t / manoeuvre.unit_s) + 1, 0, len(signs) - 1).astype(int)
    return np.asarray(manoeuvre.amplitude_rad * signs[slot])


def late(values: Array, delay_s: float, step_s: float) -> Array:
    """A signal ``delay_s`` later, linear between its samples; its first value before it begins."""
    index = np.arange(len(values)) - delay_s / step_s
    return np.asarray(np.interp(index, np.arange(len(values)), values))


def lagged(values: Array, tau_s: float, step_s: float) -> Array:
    """First-order lag, exact for a signal that is linear between its samples; starts in equilibrium."""
    if tau_s <= 0.0:
        return values
    x = step_s / tau_s
    pole = np.exp(-x)
    share = (1.0 - pole) / x  # y+ = pole y + (share - pole) u + (1 - share) u+
    b, a = np.array([1.0 - share, share - pole]), np.array([1.0, -pole])
    y, _ = lfilter(b, a, values, zi=np.array([values[0] * share]))
    return np.asarray(y)


def rate_limited(values: Array, rate_rad_s: float, step_s: float) -> Array:
    """The signal followed at no more than a rate."""
    return np.asarray(_rate_limited(np.ascontiguousarray(values), rate_rad_s * step_s))


def played(values: Array, width_rad: float) -> Array:
    """Play of full width ``width_rad``: moves only when pushed; starts in the middle."""
    return np.asarray(_played(np.ascontiguousarray(values), width_rad / 2.0))


@njit
def _rate_limited(values: Array, reach: float) -> Array:
    out = np.empty_like(values)
    y = values[0]
    for k, x in enumerate(values):
        y += min(max(x - y, -reach), reach)
        out[k] = y
    return out


@njit
def _played(values: Array, half: float) -> Array:
    out = np.empty_like(values)
    y = values[0]
    for k, x in enumerate(values):
        y = min(max(y, x - half), x + half)
        out[k] = y
    return out


def actuate(
    manoeuvre: Manoeuvre, duration_s: float, lead_s: float, chain: Sequence[tuple[str, float]]
) -> tuple[Array, Array, Array]:
    """Surface deviations from trim, with a lead before the record begins.

    Returns
    -------
    (samples,) command and (samples,) measured surface at the log's times, and (steps + 1,) the surface that
    the air sees at the simulation's times from -lead_s on [rad].
    """
    count = round((lead_s + duration_s) / FINE_S) + 1
    time = np.asarray(np.arange(count) * FINE_S - lead_s, dtype=np.float64)
    ordered = command(manoeuvre, time)
    if manoeuvre.measured is None:
        demand = command(manoeuvre, time - COMMAND_DELAY_S)
        measured = np.asarray(
            lfilter([0.0, 1.0 - SERVO_POLE], [1.0, -SERVO_POLE], demand)
        )  # exact: it is held
    else:
        measured = manoeuvre.measured[-count:]
    if np.max(np.abs(np.diff(measured))) > _SERVO_RATE_RAD_S * FINE_S:
        raise ValueError("the manoeuvre asks for more than the declared servo's 300 deg/s")
    seen = measured
    for kind, value in chain:
        seen = _CHAIN[kind](seen, value)
    every = round(manoeuvre.log_step_s / FINE_S)
    first = round(lead_s / FINE_S)
    return ordered[first::every], measured[first::every], seen[::FINE]


_CHAIN: Final = {
    "delay": lambda x, value: late(x, value, FINE_S),
    "lag": lambda x, value: lagged(x, value, FINE_S),
    "rate_limit": lambda x, value: rate_limited(x, value, FINE_S),
    "backlash": played,
}
