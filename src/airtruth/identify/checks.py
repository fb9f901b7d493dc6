"""What an identification refuses, before it computes a number that means nothing.

The log contract itself is checked by `airtruth.logs.validate`; here is what identification asks besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, LogError
from airtruth.identify.methods import METHODS, Method
from airtruth.identify.options import Options
from airtruth.identify.prefilter import butterworth, edge_samples, zero_phase
from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.logs.validate import validate
from airtruth.units import DEG, G0

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

EDGES: Final = 4
"""A record must be this many times longer than the extension of the zero-phase filter."""
STILL: Final = 1.0
"""Low-passed motion of the elevator over the rest of it: white noise alone gives about one half."""
EARLY: Final = 0.2
"""Share of the elevator's range that may lie inside the trim window."""

LIGHT: Final = 0.2
"""Mean normal acceleration below this many g is no flight."""
LARGEST_ELEVATOR_RAD: Final = 45.0 * DEG
FACTOR: Final = 0.1
"""alpha_dot - az/V over q, one by kinematics, is wrong by a unit if below this or above its inverse."""
LIKE: Final = 0.5
"""Correlation of both that makes the slope worth a judgement."""

_MOVING: Final = ("alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad")
_SHOWN: Final = 3


def check_log(log: FlightLog, methods: Sequence[Method], options: Options) -> None:
    """Check the log's contract and the channels of the methods.

    Raises
    ------
    LogError
        Listing everything that breaks the contract, or naming the channel that a method lacks.
    """
    validate(log)
    for chosen in methods:
        for name in chosen.channels:
            if name not in log.channels:
                others = ", ".join(m.name for m in METHODS.values() if not m.channels)
                raise LogError(
                    f"method {chosen.name} needs the channel {name}, which the log lacks; "
                    f"map it on import, or use a method that does without: {others}"
                )


def check_batch(batch: Batch, options: Options) -> None:
    """Check that runs of one length and rate can be identified at all.

    Raises
    ------
    ConfigurationError
        If the low-pass does not fit the sample rate or the trim window the record.
    LogError
        Naming runs and channels: too short, constant, not excited, or in a wrong unit.
    """
    rate_hz = 1.0 / batch.dt_s
    if options.cutoff_hz >= 0.5 * rate_hz:
        raise ConfigurationError(
            f"option cutoff_hz = {options.cutoff_hz:g}: the log has {rate_hz:.4g} Hz, "
            f"so that it must lie below {0.5 * rate_hz:.4g} Hz"
        )
    sos = butterworth(options.cutoff_hz, options.order, batch.dt_s)
    samples = batch.t_s.shape[1]
    shortest = EDGES * edge_samples(sos)
    everyone = np.ones(len(batch.run_ids), dtype=np.bool_)
    if samples < shortest:
        raise LogError(
            f"too short to identify: {_named(batch, everyone)} of {samples} samples "
            f"({samples * batch.dt_s:.3g} s); the low-pass of order {options.order} needs at least {shortest}"
        )
    channels = batch.channels
    for name in _MOVING:
        constant = np.ptp(channels[name], axis=1) == 0.0
        if constant.any():
            raise LogError(
                f"{name} is constant in {_named(batch, constant)}: "
                "the sensor was not recorded, or nothing moved; leave these runs out"
            )
    elevator = zero_phase(channels["elevator_rad"], sos)
    still = elevator.std(axis=1) < STILL * (channels["elevator_rad"] - elevator).std(axis=1)
    if still.any():
        raise LogError(
            f"elevator_rad: no excitation in {_named(batch, still)}: the surface moves less than its own "
            "noise; identification needs a manoeuvre, leave these runs out"
        )
    _check_units(batch, sos)
    if options.trim == "mean" or options.condition == "window":
        _check_window(batch, options, elevator)


def _check_units(batch: Batch, sos: Array) -> None:
    """Units that are wrong by a factor, by gravity, and by the slope of alpha_dot - az/V against q (1)."""
    channels = batch.channels
    in_g = np.abs(channels["az_m_s2"].mean(axis=1)) < LIGHT * G0
    if in_g.any():
        raise LogError(
            f"az_m_s2 averages {channels['az_m_s2'][in_g][0].mean():.3g} m/s2 in {_named(batch, in_g)}, "
            f"where level flight has about {-G0:.1f}: it looks like g in place of m/s2, or gravity was "
            "taken out; state unit and sign in the import mapping"
        )
    large = np.abs(channels["elevator_rad"]).max(axis=1) > LARGEST_ELEVATOR_RAD
    if large.any():
        raise LogError(
            f"elevator_rad reaches {np.abs(channels['elevator_rad'][large][0]).max():.3g} rad in "
            f"{_named(batch, large)}, more than any elevator: it looks like deg in place of rad; "
            "state the unit deg in the import mapping"
        )
    alpha, q, az = (zero_phase(channels[name], sos) for name in ("alpha_rad", "q_rad_s", "az_m_s2"))
    airspeed = channels["airspeed_m_s"].mean(axis=1, keepdims=True)
    left = (alpha[:, 2:] - alpha[:, :-2]) / (2.0 * batch.dt_s) - (az / airspeed)[:, 1:-1]
    left -= left.mean(axis=1, keepdims=True)
    right = q[:, 1:-1] - q[:, 1:-1].mean(axis=1, keepdims=True)
    product, square = np.einsum("rn,rn->r", left, right), np.einsum("rn,rn->r", right, right)
    alike = product > LIKE * np.sqrt(np.einsum("rn,rn->r", left, left) * square)
    for wrong, name, unit in (
        (alike & (product > square / FACTOR), "alpha_rad", "rad"),
        (alike & (product < square * FACTOR), "q_rad_s", "rad/s"),
    ):
        if wrong.any():
            degrees = unit.replace("rad", "deg")
            raise LogError(
                f"{name} in {_named(batch, wrong)}: alpha_dot = q + (az - az_trim)/V is off by a factor of "
                f"{(product / square)[wrong][0]:.3g}: it looks like {degrees} in place of {unit}; "
                f"state the unit {degrees} in the import mapping"
            )


def _check_window(batch: Batch, options: Options, elevator: Array) -> None:
    samples = round(options.trim_window_s / batch.dt_s)
    if not 1 <= samples < batch.t_s.shape[1]:
        raise ConfigurationError(
            f"option trim_window_s = {options.trim_window_s:g}: the runs last "
            f"{batch.t_s.shape[1] * batch.dt_s:.3g} s at {1.0 / batch.dt_s:.4g} Hz; "
            "it must hold a sample and end inside the record"
        )
    early = np.ptp(elevator[:, :samples], axis=1) > EARLY * np.ptp(elevator, axis=1)
    if early.any():
        raise LogError(
            f"the elevator already moves within the trim window of {options.trim_window_s:g} s in "
            f"{_named(batch, early)}; shorten trim_window_s, or use trim = 'intercept'"
        )


def _named(batch: Batch, which: Bools) -> str:
    names = [repr(batch.run_ids[i]) for i in np.flatnonzero(which)]
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"{len(names)} run{'s' * (len(names) != 1)} ({', '.join(names[:_SHOWN])}{more})"
