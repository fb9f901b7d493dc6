"""Increments of readings, and the states that drive increments, in sampled signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.atmosphere import air_density
from airtruth.physics.motion import MOTIONS
from airtruth.physics.motion_parts import reference_length_m
from airtruth.physics.terms import QBAR, ReadingTerm, StateTerm, shape_of

Array = NDArray[np.float64]


def state_of(term: StateTerm, signal: Array, dt_s: float) -> Array:
    """A lag, a mode or a play of a signal (runs, samples), from equilibrium, exact for a signal linear between samples.

    Sources: G. F. Franklin, J. D. Powell and M. Workman, Digital Control of Dynamic Systems, 3rd ed., 1998, 6.3.2
    (triangle hold); play, A. Visintin, Differential Models of Hysteresis, 1994, section III.2.
    """
    if term.kind == "play":
        return _played(signal, term.half_width)
    from scipy.signal import (
        cont2discrete,
        lfilter,
        lfilter_zi,
    )  # slow to import, and few aircraft have states

    time = term.time_s
    poles = [time, 1.0] if term.kind == "lag" else [time**2, 2.0 * term.damping * time, 1.0]
    b, a, _ = cont2discrete(([1.0], poles), dt_s, method="foh")
    b = b.ravel()
    start = lfilter_zi(b, a)[None, :] * signal[:, :1]
    return np.asarray(lfilter(b, a, signal, axis=1, zi=start)[0])


def _played(signal: Array, half_width: float) -> Array:
    out = np.empty_like(signal)
    out[:, 0] = signal[:, 0]
    for k in range(1, signal.shape[1]):
        out[:, k] = np.clip(out[:, k - 1], signal[:, k] - half_width, signal[:, k] + half_width)
    return out


def reading_increments(
    terms: Sequence[ReadingTerm],
    states: Sequence[StateTerm],
    truth: Mapping[str, Array],
    constants: object,
    dt_s: float,
) -> dict[str, Array]:
    """Increments of readings by channel; a channel without terms is left out.

    Parameters
    ----------
    terms, states : of the sensors; states that no term names do not matter.
    truth : airspeed_m_s and the channels of the signals that the terms name, (runs, samples) each, at the CG [SI]; with
        density_kg_m3 or altitude_m where a term names the dynamic pressure.
    constants : of the aircraft, with the reference lengths l of the rates, x l/(2V).
    dt_s : sample period [s].

    Returns
    -------
    Channel -> (runs, samples) [unit of the channel].
    """
    if not terms:
        return {}
    named = {name for term in terms for name in (term.signal, term.behind)}
    named |= {state.signal for state in states if state.name in named}
    signals = {}
    for signal in (s for m in MOTIONS.values() for s in (*m.signals, *m.known_signals) if s.name in named):
        x = truth[signal.channel]
        if signal.length is not None:
            x = x * (0.5 * reference_length_m(constants, signal.length)) / truth["airspeed_m_s"]
        signals[signal.name] = x
    if QBAR in named:
        signals[QBAR] = 0.5 * np.asarray(air_density(truth)) * truth["airspeed_m_s"] ** 2
    return increments_over(terms, states, signals, dt_s)


def increments_over(
    terms: Sequence[ReadingTerm], states: Sequence[StateTerm], signals: Mapping[str, Array], dt_s: float
) -> dict[str, Array]:
    """Increments of readings by channel, in signals of any motion.

    Parameters
    ----------
    terms, states : as of `reading_increments`.
    signals : name -> values (runs, samples) of each signal that a term or a state of a term names.
    dt_s : sample period [s].
    """
    named = {name for term in terms for name in (term.signal, term.behind)}
    drivers = {s.name: s.signal for s in states}
    signals = dict(signals)
    signals |= {s.name: state_of(s, signals[s.signal], dt_s) for s in states if s.name in named}
    total: dict[str, Array] = {}
    for term in terms:
        more = term.amplitude * shape_of(term, signals[term.signal])
        if term.behind:
            more = more * (signals[term.behind] - signals[drivers[term.behind]])
        total[term.channel] = total.get(term.channel, 0.0) + more
    return total


__all__ = ["increments_over", "reading_increments", "state_of"]
