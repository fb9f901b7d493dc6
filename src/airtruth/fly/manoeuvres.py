"""Elevator manoeuvres: commands as functions of time, sampled for the simulator.

Input hold: the simulator reads the command at its own steps and moves linearly between them. At the
edge of a step the sample holds the mean of both sides; so the ramp that replaces the edge is centred
on it, and nothing leads or lags by half a step. Edges therefore have to lie on the simulator's grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Manoeuvre:
    """One elevator manoeuvre about the trim.

    Attributes
    ----------
    kind : key of `KINDS`.
    amplitude_rad : peak of the command, trailing edge down positive [rad]; negative turns it over.
    start_s : first edge [s].
    step_s : length of one unit step [s] (doublet, 3-2-1-1, pulse).
    length_s : length of a multisine or sweep [s].
    lowest_hz, highest_hz : band of a multisine or sweep [Hz].
    part : which of ``parts`` interleaved, mutually orthogonal multisines (0, 1, ...).
    times_s, values_rad : samples of a replayed record, deviation from its trim [s, rad].
    surface : the replay drives the surface itself, past the actuator.
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
    times_s: Array = field(default_factory=lambda: np.zeros(0))
    values_rad: Array = field(default_factory=lambda: np.zeros(0))
    surface: bool = False


def sample(manoeuvre: Manoeuvre, t_s: Array) -> Array:
    """Command at the simulator's steps, deviation from trim.

    Parameters
    ----------
    manoeuvre : what to fly.
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
    units = sum(length for length, _ in _STEPS.get(manoeuvre.kind, ()))
    if manoeuvre.kind == "replay":
        return manoeuvre.start_s + float(manoeuvre.times_s[-1] - manoeuvre.times_s[0])
    if manoeuvre.kind in ("multisine", "sweep"):
        return manoeuvre.start_s + manoeuvre.length_s
    return manoeuvre.start_s + units * manoeuvre.step_s


_STEPS: Final[dict[str, tuple[tuple[float, float], ...]]] = {
    "doublet": ((1.0, 1.0), (1.0, -1.0)),
    "3211": ((3.0, 1.0), (2.0, -1.0), (1.0, 1.0), (1.0, -1.0)),
    "pulse": ((1.0, 1.0),),
    "step": ((0.0, 0.0), (np.inf, 1.0)),
}
"""Lengths in units of step_s, and signs."""


def _steps(m: Manoeuvre, t_s: Array) -> Array:
    dt = t_s[1] - t_s[0]
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


def _multisine(m: Manoeuvre, t_s: Array) -> Array:
    """Harmonics of 1/length, equal amplitudes, phases of low peak, shifted to start and end at zero.

    Schroeder's phases, then a search for the lowest peak factor (Morelli, Journal of Aircraft 49(6),
    2012, "Flight maneuver design for efficient aerodynamic modeling"). Parts take every n-th harmonic:
    they share no frequency and so are orthogonal over the length.
    """
    harmonics = np.arange(
        np.ceil(m.lowest_hz * m.length_s - 1e-9), np.floor(m.highest_hz * m.length_s + 1e-9) + 1
    )
    harmonics = harmonics[harmonics > 0][m.part :: m.parts]
    if len(harmonics) == 0:
        raise ConfigurationError(
            f"a multisine of {m.length_s:g} s has no harmonic between {m.lowest_hz:g} and {m.highest_hz:g} Hz; "
            "make it longer or its band wider"
        )
    phases = _low_peak_phases(harmonics)
    tau = (t_s - m.start_s) / m.length_s
    inside = (tau > -1e-9) & (tau < 1.0 + 1e-9)
    wave = np.cos(2.0 * np.pi * np.outer(tau + _zero_crossing(harmonics, phases), harmonics) + phases).sum(
        axis=1
    )
    grid = np.linspace(0.0, 1.0, 400 * int(harmonics[-1]) + 1)
    peak = np.abs(np.cos(2.0 * np.pi * np.outer(grid, harmonics) + phases).sum(axis=1)).max()
    return np.asarray(np.where(inside, m.amplitude_rad / peak * wave, 0.0))


def _low_peak_phases(harmonics: Array) -> Array:
    from scipy.optimize import minimize  # slow to import, and only multisines need it

    n = len(harmonics)
    start = -np.pi * np.arange(n) * np.arange(1, n + 1) / n
    grid = np.linspace(0.0, 1.0, 8 * int(harmonics[-1]), endpoint=False)
    angles = 2.0 * np.pi * np.outer(grid, harmonics)

    def peak(phases: Array) -> float:
        wave = np.cos(angles + phases).sum(axis=1)
        return float((wave**8).mean() ** 0.125)  # a smooth stand-in for the largest value

    found = minimize(peak, start, method="BFGS", options={"maxiter": 60})
    return np.asarray(found.x)


def _zero_crossing(harmonics: Array, phases: Array) -> float:
    """Shift, as a share of the period, that makes the wave start and end at zero, rising."""
    grid = np.linspace(0.0, 1.0, 64 * int(harmonics[-1]) + 1)
    wave = np.cos(2.0 * np.pi * np.outer(grid, harmonics) + phases).sum(axis=1)
    at = int(np.flatnonzero((wave[:-1] <= 0.0) & (wave[1:] > 0.0))[0])
    return float(grid[at] - wave[at] * (grid[at + 1] - grid[at]) / (wave[at + 1] - wave[at]))


def _sweep(m: Manoeuvre, t_s: Array) -> Array:
    """Logarithmic frequency sweep, amplitude faded in and out over half a period of the lowest frequency."""
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
    "multisine": _multisine,
    "sweep": _sweep,
    "replay": _replay,
}
"""Every kind of manoeuvre."""
