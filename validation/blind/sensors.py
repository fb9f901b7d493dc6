"""What the truth's sensors log: from channels at 1 kHz to samples at 50 Hz."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from validation.blind.figures import ALPHA_TRIM_RAD, BIAS, CHORD_M, DEG, LOG_STEP_S, NOISE, QUANTUM
from validation.blind.surface import lagged, late, played

Array = NDArray[np.float64]

NOISE_KINDS: Final = ("white", "coloured", "quantised")
_COLOUR_S: Final = 0.08  # correlation time of the coloured half of the variance
_THETA_DELAY_S: Final = 0.040
_THETA_QUANTUM_RAD: Final = 0.01 * DEG
MODE_DAMPING: Final = 0.02


@dataclass(frozen=True)
class Fault:
    """What a sensor does beyond its declaration: kind "arm", "cross", "curve", "lag", "delay", "scale", "friction" or "mode".

    ``at`` is the frequency of a mode [Hz]. A cross fault is the share of az in the reading, counted from its start.
    """

    channel: str
    kind: str
    value: float
    at: float = 0.0


def placed(channels: Mapping[str, Array], faults: Sequence[Fault], cg: float) -> dict[str, Array]:
    """Channels where the sensors sit: bolted to the airframe, so that a CG ``cg`` chords aft leaves them ahead of it."""
    result = dict(channels)
    arms = dict.fromkeys(("alpha_rad", "az_m_s2"), cg * CHORD_M)
    for fault in faults:
        if fault.kind == "arm":
            arms[fault.channel] += fault.value
    q = channels["q_rad_s"]
    v, alpha = channels["airspeed_m_s"], channels["alpha_rad"]
    x = arms["alpha_rad"]
    result["alpha_rad"] = np.arctan2(v * np.sin(alpha) - q * x, v * np.cos(alpha))
    result["az_m_s2"] = channels["az_m_s2"] - arms["az_m_s2"] * channels["q_dot_rad_s2"]
    for fault in faults:
        if fault.kind == "cross":
            az = channels["az_m_s2"]
            result[fault.channel] = result[fault.channel] + fault.value * (az - az[0])
    return result


def faulty(values: Array, faults: Sequence[Fault], step_s: float) -> Array:
    """One channel through its faults, in order."""
    for fault in faults:
        if fault.kind == "lag":
            values = lagged(values, fault.value, step_s)
        elif fault.kind == "delay":
            values = late(values, fault.value, step_s)
        elif fault.kind == "scale":
            values = values * fault.value
        elif fault.kind == "curve":
            values = values + fault.value * np.square(values - ALPHA_TRIM_RAD)
        elif fault.kind == "friction":
            values = played(values, fault.value)
        elif fault.kind == "mode":
            values = values + _mode(values, fault.value, fault.at, step_s)
    return values


def _mode(values: Array, gain_s: float, frequency_hz: float, step_s: float) -> Array:
    """Bending rate at a gyro: gain s wn^2 / (s^2 + 2 zeta wn s + wn^2) on the rate itself."""
    wn = 2.0 * np.pi * frequency_hz
    b, a, _ = cont2discrete(
        ([gain_s * wn**2, 0.0], [1.0, 2.0 * MODE_DAMPING * wn, wn**2]), step_s, method="bilinear"
    )
    return np.asarray(lfilter(np.ravel(b), a, values - values[0]))


def measured(
    channels: Mapping[str, Array],
    faults: Sequence[Fault],
    cg: float,
    lead_s: float,
    step_s: float,
    log_step_s: float = LOG_STEP_S,
) -> dict[str, Array]:
    """Noise-free readings at the log's times, declared biases left out."""
    every, first = round(log_step_s / step_s), round(lead_s / step_s)
    result = {}
    for name, values in placed(channels, faults, cg).items():
        if name == "theta_rad":
            values = late(values, _THETA_DELAY_S, step_s)
        values = faulty(values, [f for f in faults if f.channel == name], step_s)
        result[name] = values[first::every]
    return result


def noise(
    name: str, kind: str, count: int, rng: np.random.Generator, log_step_s: float = LOG_STEP_S
) -> Array:
    """Noise of one channel, (count,) of a log; the coloured kind has half its variance correlated over 80 ms."""
    std = NOISE[name]
    white = rng.standard_normal(count)
    if kind != "coloured":
        return std * white
    pole = np.exp(-log_step_s / _COLOUR_S)
    drive = rng.standard_normal(count)
    drive[1:] *= np.sqrt(1.0 - pole**2)
    slow = np.asarray(lfilter([1.0], [1.0, -pole], drive))
    return np.asarray(std * np.sqrt(0.5) * (white + slow))


def quantum(name: str, kind: str) -> float:
    """Step of a channel's readings [its unit], 0 for none."""
    if name == "theta_rad":
        return _THETA_QUANTUM_RAD
    return QUANTUM.get(name, 0.0) if kind == "quantised" else 0.0


def logged(
    clean: Mapping[str, Array], kind: str, rng: np.random.Generator, log_step_s: float = LOG_STEP_S
) -> dict[str, Array]:
    """Readings with bias, noise and, where they have it, steps."""
    result = {}
    for name in NOISE:
        values = clean[name] + BIAS.get(name, 0.0) + noise(name, kind, len(clean[name]), rng, log_step_s)
        step = quantum(name, kind)
        result[name] = step * np.round(values / step) if step else values
    return result
