"""Checks of a log before an identification: channels of the methods, length, excitation, trim window.

`airtruth.checks.gate` checks the log contract and physical plausibility first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, LogError
from airtruth.identification.methods import METHODS, Method
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.numerics.prefilter import butterworth, edge_samples, zero_phase

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

EDGES: Final = 4
"""Least length of a record over the extension of the zero-phase filter [-]; judgement."""
STILL: Final = 1.0
"""Low-passed motion of the elevator over its remainder, below which there is no excitation [-]; judgement: white
noise alone gives about one half."""
EARLY: Final = 0.2
"""Largest share of the elevator's range inside the trim window [-]; judgement."""
AIRSPEED_FACTOR: Final = 1.5
"""Largest ratio of --airspeed-m-s to the mean measured airspeed, either way [-]; judgement: the dynamic pressure
then differs by a factor of 2.3."""

_MOVING: Final = ("alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad")
"""Channels that change in every manoeuvre."""
_SHOWN: Final = 3
"""Runs that a message names [-]; judgement."""


def check_channels(log: FlightLog, methods: Sequence[Method]) -> None:
    """Check that the log has the channels of the methods.

    Raises
    ------
    LogError
        Naming the channel that a method lacks.
    """
    for chosen in methods:
        for name in chosen.channels:
            if name not in log.channels:
                others = ", ".join(m.name for m in METHODS.values() if not m.channels)
                raise LogError(
                    f"method {chosen.name} needs the channel {name}, which the log lacks; "
                    f"map it on import, or use a method that does not need it: {others}"
                )


def airspeed_fault(log: FlightLog, options: Options) -> str | None:
    """A sentence if ``options.airspeed_m_s`` is far from the measured airspeed (`AIRSPEED_FACTOR`), or None."""
    if options.airspeed_m_s is None:
        return None
    mean = float(log.channels["airspeed_m_s"].mean())
    if 1.0 / AIRSPEED_FACTOR <= options.airspeed_m_s / mean <= AIRSPEED_FACTOR:
        return None
    return (
        f"option airspeed_m_s = {options.airspeed_m_s:g}: the measured airspeed averages {mean:.4g} m/s, and a "
        f"ratio above {AIRSPEED_FACTOR:g} scales every derivative wrongly; correct --airspeed-m-s, leave it out "
        "to use the measured airspeed, or continue with --force"
    )


def check_batch(batch: Batch, options: Options) -> None:
    """Check that runs of one length and rate can be identified.

    Raises
    ------
    ConfigurationError
        If the low-pass does not fit the sample rate or the trim window the record.
    LogError
        Naming runs and channels: too short, constant, or not excited.
    """
    rate_hz = 1.0 / batch.dt_s
    cutoff_hz = options.cutoff_of(batch.dt_s)
    if cutoff_hz >= 0.5 * rate_hz:
        raise ConfigurationError(
            f"option cutoff_hz = {cutoff_hz:g}: the log has {rate_hz:.4g} Hz, "
            f"so that it must be below {0.5 * rate_hz:.4g} Hz; leave it out for the automatic one"
        )
    sos = butterworth(cutoff_hz, options.order, batch.dt_s)
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
    if options.trim == "mean" or options.condition == "window":
        _check_window(batch, options, elevator)


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
