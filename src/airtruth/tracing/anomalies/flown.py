"""Measured signals of a record, by the names that the terms of effects use."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.numerics.rates import smooth_rate
from airtruth.physics.motion_parts import Reference, Signal
from airtruth.tracing.model.records import TraceRecord

Array = NDArray[np.float64]

_RATE_S: Final = 0.1
"""Width of the mean over which the rate of the flow angle is taken [s] (judgement: noise of the vane)."""


def flown(record: TraceRecord, signal: str) -> Array:
    """(samples,) measured values of a signal of a term: of the motion, the rate of its flow angle, qbar, or a known input.

    Parameters
    ----------
    signal : see `airtruth.physics.terms.SIGNALS`.
    """
    s = record.signals
    motion = s.motion
    if signal == "qbar":
        return np.asarray(0.5 * s.density_kg_m3 * s.airspeed_m_s**2)[:: s.sub]
    if signal == motion.flow_rate:
        lengths = (other.length for other in motion.signals)
        reference = next(length for length in lengths if length is not None)
        return smooth_rate(flown(record, motion.flow), _RATE_S, s.dt_s) * _half_time(record, reference)
    own = next((x for x in motion.signals if x.name == signal), None)
    if own is None:
        return known(record, signal)
    for control, surface in zip(motion.controls, s.sampled_controls_rad, strict=True):
        if control.name == signal:
            return np.asarray(surface)
    return _output(record, own)


def known(record: TraceRecord, signal: str) -> Array:
    """(samples,) a known input of the motion that is a signal of terms: the angle of attack of the lateral motion [rad]."""
    s = record.signals
    return np.asarray(getattr(s, f"{signal}_rad")[:: s.sub])


def _output(record: TraceRecord, signal: Signal) -> Array:
    s = record.signals
    y = s.y[:, s.motion.output_channels.index(signal.channel)]
    if signal.name == s.motion.flow:
        return np.asarray(y - record.plant.alpha_shift_rad)
    return y if signal.length is None else np.asarray(y * _half_time(record, signal.length))


def _half_time(record: TraceRecord, reference: Reference) -> Array:
    """(samples,) half of the reference length over the airspeed [s]."""
    s, constants = record.signals, record.plant.aircraft.constants
    return np.asarray(0.5 * float(getattr(constants, f"{reference}_m")) / s.airspeed_m_s[:: s.sub])


__all__ = ["flown", "known"]
