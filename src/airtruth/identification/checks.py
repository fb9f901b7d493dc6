"""Checks of a log before an identification: channels of the methods, length, excitation, trim window.

`airtruth.checks.gate` checks the log contract and physical plausibility first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import ATTITUDE
from airtruth.checks.sentences import left_out
from airtruth.errors import ConfigurationError, LogError
from airtruth.identification.methods import METHODS, Method
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch, FlightLog, batches
from airtruth.numerics.prefilter import butterworth, edge_samples, zero_phase
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

EDGES: Final = 4
"""Least length of a record over the extension of the zero-phase filter [-]; judgement."""
STILL: Final = 1.0
"""Low-passed motion of a surface over its remainder, below which there is no excitation [-]; judgement: white
noise alone gives about one half."""
EARLY: Final = 0.2
"""Largest share of a surface's range inside the trim window [-]; judgement."""
AIRSPEED_FACTOR: Final = 1.5
"""Largest ratio of --airspeed-m-s to the mean measured airspeed, either way [-]; judgement: the dynamic pressure
then differs by a factor of 2.3."""

_SLOW: Final = ("airspeed_m_s",)
"""Channels that a manoeuvre may leave constant."""
_SHOWN: Final = 3
"""Runs that a message names [-]; judgement."""


def check_channels(log: FlightLog, methods: Sequence[Method], motion: Motion = LONGITUDINAL) -> None:
    """Check that the log has the channels of the motion and of the methods.

    Raises
    ------
    LogError
        Naming the channel that is lacking.
    """
    for name in motion.required:
        if name not in log.channels:
            raise LogError(
                f"the {motion.name} motion needs the channel {name}, which the log lacks; map it on import, or use --motion "
                f"{LONGITUDINAL.name if motion is LATERAL else LATERAL.name}"
            )
    if motion is LATERAL and not {LATERAL.vane, *ATTITUDE[1:]} & set(log.channels):
        raise LogError(
            f"the lateral motion needs {LATERAL.vane}, or {' or '.join(ATTITUDE[1:])} to reconstruct it, and the log has none of "
            "them; map one on import"
        )
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


@dataclass(frozen=True)
class Unfit:
    """Runs that cannot be identified.

    Attributes
    ----------
    run_ids : names of the runs.
    sentence : the reason, with the runs.
    cure : what to do about it.
    """

    run_ids: tuple[str, ...]
    sentence: str
    cure: str = "leave these runs out"


def fit_runs(
    log: FlightLog, options: Options, motion: Motion = LONGITUDINAL
) -> tuple[FlightLog, tuple[str, ...]]:
    """Return the runs that can be identified, and a sentence for each reason for which a minority was left out.

    The rule is that of `airtruth.checks.gate.admit`.

    Raises
    ------
    ConfigurationError
        If the low-pass does not fit the sample rate or the trim window the record.
    LogError
        If half of the runs or more are too short, constant or not excited, naming runs and channels.
    """
    found = [one for batch in batches(log) for one in unfit(batch, options, motion)]
    bad = {run_id for one in found for run_id in one.run_ids}
    if not bad:
        return log, ()
    if 2 * len(bad) >= len(log):
        raise LogError(f"{found[0].sentence}; {found[0].cure}")
    rest = log.select([run_id for run_id in log.run_ids if run_id not in bad])
    return rest, tuple(left_out(one.run_ids, len(log), len(rest), one.sentence) for one in found)


def unfit(batch: Batch, options: Options, motion: Motion = LONGITUDINAL) -> list[Unfit]:
    """Return runs of one length and rate that cannot be identified: too short, constant, or not excited.

    Raises
    ------
    ConfigurationError
        As `fit_runs`.
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
    if samples < shortest:
        everyone = np.ones(len(batch.run_ids), dtype=np.bool_)
        sentence = (
            f"too short to identify: {_named(batch, everyone)} of {samples} samples "
            f"({samples * batch.dt_s:.3g} s); the low-pass of order {options.order} needs at least {shortest}"
        )
        return [Unfit(batch.run_ids, sentence)]
    channels, result = batch.channels, []

    def note(which: Bools, sentence: str, cure: str = Unfit.cure) -> None:
        if which.any():
            ids = tuple(batch.run_ids[i] for i in np.flatnonzero(which))
            result.append(Unfit(ids, sentence.replace("{runs}", _named(batch, which)), cure))

    for name in motion.required:
        if name in _SLOW:
            continue
        constant = np.ptp(channels[name], axis=1) == 0.0
        note(constant, f"{name} is constant in {{runs}}: the sensor was not recorded, or nothing moved")
    for control in motion.controls:
        surface = channels[control.channel]
        smooth = zero_phase(surface, sos)
        note(
            (smooth.std(axis=1) < STILL * (surface - smooth).std(axis=1)) & (np.ptp(surface, axis=1) > 0.0),
            f"{control.channel}: no excitation in {{runs}}: the surface moves less than its own noise; identification needs a "
            "manoeuvre",
        )
        if options.trim == "mean" or options.condition == "window":
            early = _early(batch, options, smooth)
            sentence = f"the {control.name} already moves within the trim window of {options.trim_window_s:g} s in {{runs}}"
            note(early, sentence, "shorten trim_window_s, or use trim = 'intercept'")
    return result


def _early(batch: Batch, options: Options, surface: Array) -> Bools:
    """Runs whose surface (runs, samples) moves within the trim window."""
    samples = round(options.trim_window_s / batch.dt_s)
    if not 1 <= samples < batch.t_s.shape[1]:
        raise ConfigurationError(
            f"option trim_window_s = {options.trim_window_s:g}: the runs last "
            f"{batch.t_s.shape[1] * batch.dt_s:.3g} s at {1.0 / batch.dt_s:.4g} Hz; "
            "it must hold a sample and end inside the record"
        )
    return np.asarray(np.ptp(surface[:, :samples], axis=1) > EARLY * np.ptp(surface, axis=1))


def _named(batch: Batch, which: Bools) -> str:
    names = [repr(batch.run_ids[i]) for i in np.flatnonzero(which)]
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"{len(names)} run{'s' * (len(names) != 1)} ({', '.join(names[:_SHOWN])}{more})"
