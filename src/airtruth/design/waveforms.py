"""Families of inputs: doublets, 1-2-1, 3-2-1-1 and their repetitions, free multisteps, and multisines of free spectrum.

All inputs have unit amplitude, start at `START_S`, end within a length, and have edges on the simulation's grid.

Sources: V. Klein and E. A. Morelli, Aircraft System Identification (2006), section 9.2 (multisteps, multisines);
J. A. Grauer and E. A. Morelli, Journal of Aircraft 52 (2015) (multisines of optimised phases).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.simulation.manoeuvres import Manoeuvre, low_peak_phases, zero_crossing

Array = NDArray[np.float64]

START_S: Final = 1.0
"""Start of every input [s] (judgement: the record shows the trim before)."""
PATTERNS: Final[dict[str, tuple[float, ...]]] = {
    "doublet": (1.0, 1.0),
    "1-2-1": (1.0, 2.0, 1.0),
    "3-2-1-1": (3.0, 2.0, 1.0, 1.0),
}
"""Name of a multistep -> lengths of its segments, of alternating sign [units]."""
BANDS: Final = 5
"""Bands of a multisine's spectrum, equal on a logarithmic axis [-] (judgement: a peak and its neighbours)."""
MOST_HARMONICS: Final = 60
"""Harmonics of a multisine [-] (judgement: phases are searched for so many)."""
_LEAST_WEIGHT: Final = 0.02
"""Weight below which a harmonic is left out, over the largest [-] (judgement)."""
_DIGITS: Final = 4
"""Decimals of weights and phases in a campaign file [-] (judgement: 1e-4 of the amplitude)."""


def multistep(
    units: tuple[float, ...], unit_s: float, rise_s: float, dt_s: float, sign: float = 1.0
) -> Manoeuvre:
    """Segments of alternating sign.

    Parameters
    ----------
    units, unit_s : lengths of the segments in units, and the unit [s].
    rise_s : time from one level to the next [s].
    dt_s : simulation step, on whose grid the edges lie [s].
    sign : of the first segment.
    """
    edges = np.round(np.cumsum(np.array([0.0, *units])) * unit_s / dt_s)
    steps = np.maximum(np.diff(edges), max(1.0, math.ceil(rise_s / dt_s - 1e-9)))
    return Manoeuvre(
        "multistep",
        amplitude_rad=1.0,
        start_s=START_S,
        segments_s=tuple(float(round(n * dt_s, 9)) for n in steps),
        levels=tuple(sign * (-1.0) ** k for k in range(len(units))),
        rise_s=rise_s,
    )


def repeated(name: str, times: int) -> tuple[float, ...]:
    """Segments of a pattern that is repeated; a segment that follows one of its own sign continues it.

    Examples
    --------
    >>> repeated("doublet", 2)
    (1.0, 1.0, 1.0, 1.0)
    >>> repeated("1-2-1", 2)
    (1.0, 2.0, 2.0, 2.0, 1.0)
    """
    joined: list[float] = []
    for _ in range(times):
        for k, length in enumerate(PATTERNS[name]):
            if k == 0 and len(joined) % 2 == 1:  # the last segment has the sign of this one
                joined[-1] += length
            else:
                joined.append(length)
    return tuple(joined)


def patterns(
    length_s: float, shortest_s: float, rise_s: float, dt_s: float, count: int
) -> Iterator[tuple[str, Manoeuvre]]:
    """Each pattern once and repeated to the length, over units from the shortest to the length; none that is longer.

    Parameters
    ----------
    length_s : length of the input [s].
    shortest_s : shortest unit [s].
    rise_s, dt_s : as in `multistep`.
    count : units per pattern.
    """
    least = max(shortest_s, rise_s)
    for name, units in PATTERNS.items():
        if (longest := length_s / sum(units)) < least:
            continue
        for unit in np.geomspace(least, longest, count):
            times = int((length_s + 1e-9) / (sum(units) * unit))
            yield name, multistep(units, float(unit), rise_s, dt_s)
            if times > 1:
                yield f"repeated {name}", multistep(repeated(name, times), float(unit), rise_s, dt_s)


def mirrored(manoeuvre: Manoeuvre) -> Manoeuvre:
    """The input with the other sign."""
    levels = tuple(-level for level in manoeuvre.levels)
    phases = tuple(round(math.remainder(p + math.pi, math.tau), _DIGITS) for p in manoeuvre.phases_rad)
    return replace(manoeuvre, levels=levels, phases_rad=phases)


def perturbed(
    manoeuvre: Manoeuvre,
    spread: float,
    length_s: float,
    shortest_s: float,
    dt_s: float,
    rng: np.random.Generator,
) -> Manoeuvre:
    """A multistep with other lengths of its segments; now and then one is split or two neighbours are joined.

    Parameters
    ----------
    spread : standard deviation of the logarithm of a segment's length [-].
    length_s : longest sum of the segments [s]; shortest_s : shortest segment [s].
    dt_s : simulation step [s].
    """
    lengths = np.array(manoeuvre.segments_s) * np.exp(spread * rng.standard_normal(len(manoeuvre.segments_s)))
    least = max(manoeuvre.rise_s, shortest_s)
    choice = rng.random()
    if choice < 0.15 and len(lengths) > 2:
        k = int(rng.integers(1, len(lengths) - 1))
        lengths = np.concatenate([lengths[: k - 1], [lengths[k - 1 : k + 2].sum()], lengths[k + 2 :]])
    elif choice < 0.3:
        k = int(rng.integers(0, len(lengths)))
        lengths = np.concatenate([lengths[:k], np.full(3, lengths[k] / 3.0), lengths[k + 1 :]])
    elif choice < 0.4:
        lengths = np.append(lengths, rng.uniform(least, max(2.0 * least, 0.2 * length_s)))
    lengths = np.maximum(lengths, least)
    total = float(lengths.sum())
    if total > length_s:
        lengths = np.maximum(lengths * length_s / total, least)
    while lengths.sum() > length_s + 1e-9 and len(lengths) > 1:
        lengths = lengths[:-1]
    return multistep(tuple(lengths.tolist()), 1.0, manoeuvre.rise_s, dt_s, manoeuvre.levels[0])


def spectrum(log_weights: Array, harmonics: Array, length_s: float, band: tuple[float, float]) -> Array:
    """Weights of harmonics: linear between the nodes of the bands on a logarithmic axis.

    Parameters
    ----------
    log_weights : (nodes,) logarithms of the weights at nodes equally spaced over the band.
    harmonics : (n,) numbers of the harmonics.
    length_s : period [s]; band : lowest and highest frequency [Hz].
    """
    nodes = np.linspace(math.log(band[0]), math.log(band[1]), len(log_weights))
    return np.asarray(np.exp(np.interp(np.log(harmonics / length_s), nodes, log_weights)))


def harmonics_between(band: tuple[float, float], length_s: float) -> Array:
    """Numbers of the harmonics of 1/length within a band [Hz], thinned to `MOST_HARMONICS`."""
    lowest = max(1, math.ceil(band[0] * length_s - 1e-9))
    every = np.arange(lowest, max(lowest, math.floor(band[1] * length_s + 1e-9)) + 1, dtype=np.float64)
    if len(every) <= MOST_HARMONICS:
        return every
    return np.unique(np.round(np.geomspace(every[0], every[-1], MOST_HARMONICS)))


def multisine(log_weights: Array, length_s: float, band: tuple[float, float]) -> Manoeuvre:
    """A multisine of a spectrum, its phases optimised for a low peak, shifted to start and end at zero.

    Parameters
    ----------
    log_weights, band : see `spectrum`.
    length_s : length [s].
    """
    every = harmonics_between(band, length_s)
    weights = spectrum(log_weights, every, length_s, band)
    weights = weights / weights.max()
    kept = weights > _LEAST_WEIGHT
    every, weights = every[kept], weights[kept]
    phases = low_peak_phases(every, weights)
    shift = zero_crossing(every, phases, weights)
    turned = [math.remainder(p, math.tau) for p in (phases + 2.0 * np.pi * every * shift).tolist()]
    return Manoeuvre(
        "harmonics",
        amplitude_rad=1.0,
        start_s=START_S,
        length_s=length_s,
        harmonics=tuple(int(h) for h in every),
        weights=tuple(round(float(w), _DIGITS) for w in weights),
        phases_rad=tuple(round(p, _DIGITS) for p in turned),
    )


__all__ = [
    "BANDS",
    "PATTERNS",
    "START_S",
    "mirrored",
    "multisine",
    "multistep",
    "patterns",
    "perturbed",
    "repeated",
    "spectrum",
]
