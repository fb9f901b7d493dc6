"""Manoeuvres of a control: commands as functions of time, sampled for the simulator.

The simulator reads the command at its own steps and moves linearly between them. The sample at an edge is the mean of
both sides: the ramp that replaces the edge is centred on it, and the command neither leads nor lags by half a step.
Edges therefore have to lie on the simulator's grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import ELEVATOR

Array = NDArray[np.float64]


LATERAL_CONTROLS: Final = tuple(control.name for control in LATERAL.controls)
"""Controls of the lateral-directional motion."""
CONTROLS: Final = (ELEVATOR, *LATERAL_CONTROLS)
"""Controls that a manoeuvre moves."""
MOST_HARMONICS: Final = 500
"""Harmonics of a multisine [-] (judgement: a band of 0.1 to 5 Hz over 100 s)."""
HIGHEST_HARMONIC: Final = 5000
"""Number of the highest harmonic of a multisine [-] (judgement: 5 Hz over 1000 s); its peak is searched on 400 points
per period of it."""
SEARCHED_HARMONICS: Final = 60
"""Harmonics up to which phases of a lower peak are searched [-]: the time of the search grows with the third power of
their number, and is 10 s here."""
_ROWS: Final = 20_000
"""Samples whose harmonics are in memory at the same time [-] (judgement: 80 MB with the most harmonics)."""


@dataclass(frozen=True)
class Manoeuvre:
    """One manoeuvre of a control about the trim.

    Attributes
    ----------
    kind : key of `KINDS`.
    amplitude_rad : peak of the command [rad], with the sign of the control's channel in `airtruth.channels`; negative
        reverses the manoeuvre.
    start_s : first edge [s].
    step_s : length of one unit step [s] (doublet, 3-2-1-1, 1-2-1, pulse).
    length_s : length of a multisine or sweep [s].
    lowest_hz, highest_hz : band of a multisine or sweep [Hz].
    part : which of ``parts`` interleaved, mutually orthogonal multisines (0, 1, ...).
    segments_s, levels : lengths of the segments of a multistep [s], and its command in each over the amplitude [-].
    rise_s : time in which a multistep moves from one level to the next [s]; the ramp is centred on the edge.
    harmonics, weights, phases_rad : harmonics of 1/``length_s`` of a wave with stated phases: numbers, amplitudes
        relative to each other [-], and phases of the cosines [rad].
    times_s, values_rad : samples of a replayed record, deviation from its trim [s, rad].
    surface : the replay drives the surface itself, past the actuator.
    control : one of `CONTROLS`.
    """

    kind: str
    amplitude_rad: float = 0.0
    start_s: float = 1.0
    step_s: float = 0.5
    length_s: float = 10.0
    lowest_hz: float = 0.2
    highest_hz: float = 3.0
    part: int = 0
    parts: int = 1
    segments_s: tuple[float, ...] = ()
    levels: tuple[float, ...] = ()
    rise_s: float = 0.0
    harmonics: tuple[int, ...] = ()
    weights: tuple[float, ...] = ()
    phases_rad: tuple[float, ...] = ()
    times_s: Array = field(default_factory=lambda: np.zeros(0))
    values_rad: Array = field(default_factory=lambda: np.zeros(0))
    surface: bool = False
    control: str = ELEVATOR


def sample(manoeuvre: Manoeuvre, t_s: Array) -> Array:
    """Command at the simulator's steps, deviation from trim.

    Parameters
    ----------
    manoeuvre : manoeuvre to sample.
    t_s : (samples,) uniform time [s].

    Returns
    -------
    (samples,) command [rad].

    Raises
    ------
    ConfigurationError
        If the kind is unknown, or an edge does not lie on the grid of ``t_s``.
    """
    if manoeuvre.kind not in KINDS:
        raise ConfigurationError(
            f"manoeuvre {manoeuvre.kind!r} is not known; {choices(manoeuvre.kind, KINDS)}"
        )
    return KINDS[manoeuvre.kind](manoeuvre, t_s)


def end_s(manoeuvre: Manoeuvre) -> float:
    """Time at which the command has returned to trim [s]; a step never does and ends where it starts."""
    units = sum(length for length, _ in _STEPS.get(manoeuvre.kind, ()) if np.isfinite(length))
    if manoeuvre.kind == "replay":
        return manoeuvre.start_s + float(manoeuvre.times_s[-1] - manoeuvre.times_s[0])
    if manoeuvre.kind == "multistep":
        return manoeuvre.start_s + sum(manoeuvre.segments_s) + 0.5 * manoeuvre.rise_s
    if manoeuvre.kind in ("multisine", "harmonics", "sweep"):
        return manoeuvre.start_s + manoeuvre.length_s
    return manoeuvre.start_s + units * manoeuvre.step_s


_STEPS: Final[dict[str, tuple[tuple[float, float], ...]]] = {
    "doublet": ((1.0, 1.0), (1.0, -1.0)),
    "3211": ((3.0, 1.0), (2.0, -1.0), (1.0, 1.0), (1.0, -1.0)),
    "121": ((1.0, 1.0), (2.0, -1.0), (1.0, 1.0)),
    "pulse": ((1.0, 1.0),),
    "step": ((0.0, 0.0), (np.inf, 1.0)),
}
"""Lengths in units of step_s, and signs."""


def _steps(m: Manoeuvre, t_s: Array) -> Array:
    dt = t_s[1] - t_s[0]
    if m.step_s < (1.0 - 1e-6) * dt and m.kind != "step":
        raise ConfigurationError(
            f"step_s = {m.step_s:g} s is shorter than a simulation step of {dt * 1e3:g} ms; lengthen it, or raise "
            "simulation_hz"
        )
    command = np.zeros_like(t_s)
    edge = m.start_s
    for length, sign in _STEPS[m.kind]:
        following = edge + (length * m.step_s if length else 0.0)
        command += sign * (_rise(t_s, edge, dt) - _rise(t_s, following, dt))
        edge = following
    return m.amplitude_rad * command


def _rise(t_s: Array, edge: float, dt: float) -> Array:
    """Unit step at an edge, one half at the edge itself."""
    if not np.isfinite(edge):
        return np.zeros_like(t_s)
    index = (edge - t_s[0]) / dt
    if abs(index - round(index)) > 1e-6:
        near = t_s[0] + round(index) * dt
        raise ConfigurationError(
            f"the manoeuvre has an edge at {edge:g} s, which is not on the simulation's grid of {dt * 1e3:g} ms; "
            f"move it to {near:g} s, or change simulation_hz"
        )
    return np.asarray(np.heaviside(np.arange(len(t_s)) - round(index), 0.5))


def _multistep(m: Manoeuvre, t_s: Array) -> Array:
    """Segments of constant level, joined by ramps of equal length that are centred on the edges."""
    dt = float(t_s[1] - t_s[0])
    if not m.segments_s or len(m.segments_s) != len(m.levels):
        raise ConfigurationError(
            f"a multistep needs one level for each segment; it has {len(m.segments_s)} segments_s and "
            f"{len(m.levels)} levels: state as many of each"
        )
    least = max(dt, m.rise_s)
    if min(m.segments_s) < least * (1.0 - 1e-6):
        raise ConfigurationError(
            f"a segment of {min(m.segments_s):g} s is shorter than the least, {least:g} s (a simulation step, and "
            "rise_s); lengthen it, or shorten rise_s"
        )
    edges = m.start_s + np.concatenate([[0.0], np.cumsum(m.segments_s)])
    jumps = np.diff(np.concatenate([[0.0], m.levels, [0.0]]))
    command = np.zeros_like(t_s)
    for edge, jump in zip(edges, jumps, strict=True):
        if m.rise_s > 0.0:
            command += jump * np.clip((t_s - edge) / m.rise_s + 0.5, 0.0, 1.0)
        else:
            command += jump * _rise(t_s, float(edge), dt)
    return m.amplitude_rad * command


def _stated_harmonics(m: Manoeuvre, t_s: Array) -> Array:
    """A wave of stated harmonics of 1/length, scaled to its peak; zero outside its length."""
    if not m.harmonics or not len(m.harmonics) == len(m.weights) == len(m.phases_rad):
        raise ConfigurationError(
            f"kind 'harmonics' needs one weight and one phase for each harmonic; it has {len(m.harmonics)} harmonics, "
            f"{len(m.weights)} weights and {len(m.phases_rad)} phases_rad: state as many of each"
        )
    highest = max(m.harmonics)
    if min(m.harmonics) < 1 or highest > HIGHEST_HARMONIC or len(m.harmonics) > MOST_HARMONICS:
        raise ConfigurationError(
            f"harmonics run from {min(m.harmonics)} to {highest}; allowed are up to {MOST_HARMONICS} numbers from 1 to "
            f"{HIGHEST_HARMONIC}"
        )
    _check_band(replace(m, highest_hz=highest / m.length_s), t_s)
    harmonics, weights = np.array(m.harmonics, dtype=np.float64), np.array(m.weights)
    return _wave(m, t_s, harmonics, np.array(m.phases_rad), weights)


def _wave(m: Manoeuvre, t_s: Array, harmonics: Array, phases: Array, weights: Array | None = None) -> Array:
    """Sum of harmonics over the manoeuvre, its peak equal to the amplitude; zero outside."""
    tau = (t_s - m.start_s) / m.length_s
    inside = (tau > -1e-9) & (tau < 1.0 + 1e-9)
    wave = np.zeros_like(tau)
    wave[inside] = _sum_of_cosines(tau[inside], harmonics, phases, weights)
    grid = np.linspace(0.0, 1.0, 400 * int(harmonics.max()) + 1)
    peak = np.abs(_sum_of_cosines(grid, harmonics, phases, weights)).max()
    if peak == 0.0:
        raise ConfigurationError("kind 'harmonics': all weights are zero; state one that is not")
    return np.asarray(np.where(inside, m.amplitude_rad / peak * wave, 0.0))


def _multisine(m: Manoeuvre, t_s: Array) -> Array:
    """Harmonics of 1/length, equal amplitudes, phases of low peak, shifted to start and end at zero.

    Schroeder's phases, then a search for the lowest peak factor (Morelli, Journal of Aircraft 49(6),
    2012, "Flight maneuver design for efficient aerodynamic modeling"). Parts take every n-th harmonic:
    they share no frequency and so are orthogonal over the length.
    """
    _check_band(m, t_s)
    lowest = max(1.0, np.ceil(m.lowest_hz * m.length_s - 1e-9))
    highest = np.floor(m.highest_hz * m.length_s + 1e-9)
    if (highest - lowest) / m.parts >= MOST_HARMONICS or highest > HIGHEST_HARMONIC:
        raise ConfigurationError(
            f"a multisine of {m.length_s:g} s has {highest:.0f} harmonics up to {m.highest_hz:g} Hz; it may have "
            f"{MOST_HARMONICS} in its band, the highest of them number {HIGHEST_HARMONIC}: shorten it or narrow its band"
        )
    harmonics = np.arange(lowest, highest + 1)[m.part :: m.parts]
    if len(harmonics) == 0:
        raise ConfigurationError(
            f"a multisine of {m.length_s:g} s has no harmonic between {m.lowest_hz:g} and {m.highest_hz:g} Hz; "
            "make it longer or its band wider"
        )
    phases = low_peak_phases(harmonics)
    tau = (t_s - m.start_s) / m.length_s
    inside = (tau > -1e-9) & (tau < 1.0 + 1e-9)
    wave = np.zeros_like(tau)
    wave[inside] = _sum_of_cosines(tau[inside] + zero_crossing(harmonics, phases), harmonics, phases)
    peak = np.abs(
        _sum_of_cosines(np.linspace(0.0, 1.0, 400 * int(harmonics[-1]) + 1), harmonics, phases)
    ).max()
    return np.asarray(np.where(inside, m.amplitude_rad / peak * wave, 0.0))


def _check_band(m: Manoeuvre, t_s: Array) -> None:
    half_rate = 0.5 / float(t_s[1] - t_s[0])
    if m.highest_hz > half_rate * (1.0 + 1e-9):
        raise ConfigurationError(
            f"highest_hz = {m.highest_hz:g} Hz is above half the simulation rate, {half_rate:g} Hz; lower it, or raise "
            "simulation_hz"
        )


def _sum_of_cosines(share: Array, harmonics: Array, phases: Array, weights: Array | None = None) -> Array:
    """The wave at shares of its period, in parts that need little memory; equal weights where none are given."""
    parts = [share[first : first + _ROWS] for first in range(0, len(share), _ROWS)]
    cosines = (np.cos(2.0 * np.pi * np.outer(part, harmonics) + phases) for part in parts)
    waves = [c.sum(axis=1) if weights is None else c @ weights for c in cosines]
    return np.concatenate([np.zeros(0), *waves])


def low_peak_phases(harmonics: Array, weights: Array | None = None) -> Array:
    """Phases [rad] of cosines whose sum has a low peak: Schroeder's, then a search for the lowest peak.

    Sources: M. R. Schroeder, IEEE Trans. Information Theory 16 (1970) 85-89, eq. (11) for weights that are powers'
    roots; Morelli, Journal of Aircraft 49(6) (2012) for the search.

    Parameters
    ----------
    harmonics : (n,) numbers of the harmonics, rising.
    weights : (n,) amplitudes relative to each other; None for equal ones.
    """
    from scipy.optimize import minimize  # slow to import, and only multisines need it

    n = len(harmonics)
    if weights is None:
        start = -np.pi * np.arange(n) * np.arange(1, n + 1) / n
    else:
        power = np.cumsum(weights**2) / np.sum(weights**2)
        start = -2.0 * np.pi * np.concatenate([[0.0], np.cumsum(power[:-1] * np.diff(harmonics))])
    if n > SEARCHED_HARMONICS:
        return start
    grid = np.linspace(0.0, 1.0, 8 * int(harmonics[-1]), endpoint=False)
    angles = 2.0 * np.pi * np.outer(grid, harmonics)

    def peak(phases: Array) -> float:
        wave = np.cos(angles + phases).sum(axis=1)
        return float((wave**8).mean() ** 0.125)  # a smooth stand-in for the largest value

    def weighted_peak(phases: Array) -> tuple[float, Array]:
        wave = np.cos(angles + phases) @ own
        value = float((wave**8).mean() ** 0.125)
        slope = -(wave**7 @ np.sin(angles + phases)) * own / (len(wave) * value**7)
        return value, np.asarray(slope)

    if weights is None:
        return np.asarray(minimize(peak, start, method="BFGS", options={"maxiter": 60}).x)
    own = weights
    return np.asarray(minimize(weighted_peak, start, jac=True, method="BFGS", options={"maxiter": 60}).x)


def zero_crossing(harmonics: Array, phases: Array, weights: Array | None = None) -> float:
    """Shift, as a share of the period, that makes the wave start and end at zero, rising."""
    grid = np.linspace(0.0, 1.0, 64 * int(harmonics[-1]) + 1)
    wave = _sum_of_cosines(grid, harmonics, phases, weights)
    at = int(np.flatnonzero((wave[:-1] <= 0.0) & (wave[1:] > 0.0))[0])
    return float(grid[at] - wave[at] * (grid[at + 1] - grid[at]) / (wave[at + 1] - wave[at]))


def _sweep(m: Manoeuvre, t_s: Array) -> Array:
    """Logarithmic frequency sweep, amplitude faded in and out over half a period of the lowest frequency."""
    _check_band(m, t_s)
    tau = np.clip(t_s - m.start_s, 0.0, m.length_s)
    ratio = np.log(m.highest_hz / m.lowest_hz)
    phase = 2.0 * np.pi * m.lowest_hz * m.length_s / ratio * np.expm1(tau / m.length_s * ratio)
    fade = 0.5 / m.lowest_hz
    window = np.clip(np.minimum(tau, m.length_s - tau) / min(fade, 0.5 * m.length_s), 0.0, 1.0)
    return np.asarray(m.amplitude_rad * np.sin(phase) * np.sin(0.5 * np.pi * window) ** 2)


def _replay(m: Manoeuvre, t_s: Array) -> Array:
    """A measured record, linear between its samples, its first and last value held outside."""
    return np.interp(t_s - m.start_s, m.times_s - m.times_s[0], m.values_rad)


KINDS: Final[dict[str, Callable[[Manoeuvre, Array], Array]]] = {
    **dict.fromkeys(_STEPS, _steps),
    "multistep": _multistep,
    "multisine": _multisine,
    "harmonics": _stated_harmonics,
    "sweep": _sweep,
    "replay": _replay,
}
"""Every kind of manoeuvre."""
