"""One weight for all causes: the lines of the cosine transform, their noise, and the motion of the control surfaces.

The difference between a measured channel and its reconstruction is noise, moving air and the motion that an error
leaves. Gusts move alpha and airspeed but no inertial quantity, and the aircraft answers them, so that least squares
is biased. The elevator of an open loop has no part in gusts and noise. The statistic of every cause is therefore the
energy of the whitened difference in the span of motions that the elevator causes (two-stage least squares, generalised
method of moments with one weight).

The lines of the cosine transform of stationary and of integrated noise are nearly uncorrelated (K. R. Rao and P. Yip,
*Discrete Cosine Transform*, 1990, chapter 3), so that the noise is one smooth spectrum. It is estimated for each
record and equation from the part of the difference outside the elevator's span, by P. Whittle's likelihood (*Arkiv
foer Matematik* 2, 1953) with the leverage of that span taken into account.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from airtruth.checks.kinematics_model import LONGITUDINAL
from airtruth.checks.kinematics_record import Kinematics, Samples

Array = NDArray[np.float64]

LOW_HZ: Final = 0.12
"""Lowest line [Hz]: judgement; below it drifts of instruments and slow changes of the air dominate."""
HIGH_HZ: Final = 5.0
"""Highest line [Hz]: judgement; the motion of a pitching aircraft lies below."""
HIGH_RATE: Final = 0.35
"""Highest line as a share of the sample rate [-]: judgement; a cubic through samples fails above."""
LINES_PER_DEGREE: Final = 9.0
"""Lines for each degree of freedom of the noise near the motion [-]. With this figure 4.7 % of 300 flights without an
error exceed the 95 % point of the absolute test (`studies.check_study --calibrate`): the motion occupies the lowest
lines, where it leaves little evidence of noise."""
FLOOR: Final = 1e-3
"""Accuracy of a reconstruction from samples as a share of the motion [-]: judgement; test_kinematics measures it."""
WHITTLE_STEPS: Final = 60
"""Multiplicative steps for a spectrum [-]: judgement; more change it by less than its uncertainty."""


@dataclass(frozen=True)
class Lines:
    """Motions of the elevator of one record, in lines.

    Attributes
    ----------
    keep : (lines,) numbers of the lines that are used.
    hz : (lines,) their frequencies [Hz].
    basis : (k, lines) motions that the control surfaces cause.
    trends : (trends, lines) lines of a ramp, and of higher powers of time.
    """

    keep: NDArray[np.int64]
    hz: Array
    basis: Array
    trends: Array

    def of(self, x: Array) -> Array:
        """Lines of (..., samples)."""
        return np.asarray(dct(x, axis=-1, norm="ortho")[..., self.keep])

    def samples_of(self, lines: Array, length: int) -> Array:
        """(..., samples) whose product with samples is that of ``lines`` (..., lines) with the lines of the samples."""
        every = np.zeros((*lines.shape[:-1], length))
        every[..., self.keep] = lines
        return np.asarray(idct(every, axis=-1, norm="ortho"))


@dataclass(frozen=True)
class Weight:
    """The common weight: whitened motions of the elevator of all records.

    Attributes
    ----------
    std : for each record, equation -> (lines,) standard deviation of the noise.
    span : (rows, m) orthonormal columns over the lines of all records and equations: the pooled instruments.
    own : for each record and equation, (lines, k) orthonormal columns.
    trends : for each record and equation, (trends + offsets, lines) the whitened trends and effects of the offsets, orthonormal.
    degrees : degrees of freedom of the noise of one equation near the motion [-].
    """

    std: tuple[dict[str, Array], ...]
    span: Array
    own: tuple[tuple[Array, ...], ...]
    trends: tuple[tuple[Array, ...], ...]
    degrees: float


def lines_of(record: Samples, kinematics: Kinematics = LONGITUDINAL) -> Lines:
    """Lines of a record and the motions that its control surfaces cause."""
    samples, dt = record.length, record.dt_s
    hz = np.arange(samples) / (2.0 * samples * dt)
    keep = np.flatnonzero((hz >= LOW_HZ) & (hz <= min(HIGH_HZ, HIGH_RATE / dt)))
    rows = dct(kinematics.motions(record), axis=-1, norm="ortho")[:, keep]
    base = np.linspace(-1.0, 1.0, samples)
    trends = [dct(base**power, norm="ortho")[keep] for power in range(1, kinematics.trends + 1)]
    return Lines(keep, hz[keep], np.asarray(rows), np.array(trends))


@dataclass(frozen=True)
class NoiseLines:
    """Lines of a difference that are evidence of a noise.

    Attributes
    ----------
    y, hz : (lines,) lines and their frequencies [Hz].
    outside : (k, lines) rows whose span is no evidence of noise.
    floor : smallest standard deviation of a line.
    """

    y: Array
    hz: Array
    outside: Array
    floor: float

    def rest(self, variance: Array) -> tuple[Array, Array]:
        """(lines,) squares of the lines less the span of ``outside``, and the share of each line that is free of it."""
        std = np.sqrt(variance)
        span = np.linalg.qr((self.outside / std).T)[0]
        white = self.y / std
        rest = ((white - span @ (span.T @ white)) * std) ** 2
        return rest, 1.0 - np.minimum(np.einsum("nk,nk->n", span, span), 1.0)


@dataclass(frozen=True)
class Noise:
    """One noise of several parts.

    Attributes
    ----------
    std : of each part, (lines,) standard deviation of its lines.
    deviance : -2 log of the restricted likelihood, but for a constant.
    sizes : number of its sizes.
    """

    std: tuple[Array, ...]
    deviance: float
    sizes: int


def noise_spectrum(parts: Sequence[NoiseLines]) -> Noise:
    """The noise that all parts have.

    A sum of white noise, integrated noise (which is also the upper part of a gust's spectrum) and differentiated
    noise, none of them negative, by the multiplicative steps of the restricted likelihood. More shapes make the
    lowest lines, where the elevator's motions leave little evidence of noise, too uncertain for a test.
    """
    hz, y = (np.concatenate([getattr(part, n) for part in parts]) for n in ("hz", "y"))
    floor = np.concatenate([np.full(len(part.hz), max(part.floor, 1e-150) ** 2) for part in parts])
    ends = np.cumsum([len(part.hz) for part in parts])[:-1]
    shape = np.array([np.ones_like(hz), (hz.min() / hz) ** 2, (hz / hz.max()) ** 2])
    size = np.full(len(shape), max(float(np.mean(y**2)), float(floor.max())) / len(shape))
    for step in range(WHITTLE_STEPS):
        variance = size @ shape + floor
        if step % 10 == 0:
            own = zip(parts, np.split(variance, ends), strict=True)
            rest, free = (np.concatenate(x) for x in zip(*(part.rest(v) for part, v in own), strict=True))
        size = size * np.sqrt((shape @ (rest / variance**2)) / (shape @ (free / variance)))
    variance = size @ shape + floor
    deviance = float(np.sum(free * np.log(variance) + rest / variance))
    return Noise(tuple(np.split(np.sqrt(variance), ends)), deviance, len(size))


def _noise_of(parts: Sequence[NoiseLines]) -> list[Array]:
    """(lines,) standard deviation of the lines of each part, of a noise of its own or of one that all share.

    The motion of a record leaves little evidence of noise in its lowest lines. The noise is common unless that of each part has a
    deviance less by more than two for each further size (H. Akaike, *IEEE Trans. Automatic Control* 19, 1974).
    """
    own = [noise_spectrum([part]) for part in parts]
    if len(own) > 1:
        shared = noise_spectrum(parts)
        further = sum(noise.sizes for noise in own) - shared.sizes
        if shared.deviance - sum(noise.deviance for noise in own) < 2.0 * further:
            return list(shared.std)
    return [noise.std[0] for noise in own]


def weigh(
    records: Sequence[Samples],
    lines: Sequence[Lines],
    differences: Sequence[Mapping[str, Array]],
    slopes: Sequence[Mapping[str, Array]],
    equations: Sequence[str],
    kinematics: Kinematics = LONGITUDINAL,
    enlarged: Mapping[str, float] | None = None,
) -> Weight:
    """Estimate the noise of each record and equation, and whiten the motions of the control surfaces.

    Parameters
    ----------
    records, lines : of each record.
    differences : of each record, equation -> (samples,) difference at the errors where the noise is judged.
    slopes : of each record, equation -> (offsets, samples) derivatives of the difference by the offsets of the record.
    equations : equations that are used.
    kinematics : of the motion.
    enlarged : equation -> factor on the noise for motion that no error explains; 1 without an entry.
    """
    stds: list[dict[str, Array]] = [{} for _ in records]
    freed = []
    for line, slope in zip(lines, slopes, strict=True):
        freed.append({e: np.vstack([line.trends, line.of(x)]) for e, x in slope.items()})
    for equation in equations:
        alike: dict[object, list[int]] = {}
        for i, record in enumerate(records):
            alike.setdefault(record.dt_s if kinematics.common else i, []).append(i)
        for numbers in alike.values():
            parts = [
                NoiseLines(
                    lines[i].of(differences[i][equation]),
                    lines[i].hz,
                    np.vstack([lines[i].basis, _moving(freed[i][equation])]),
                    _floor(records[i], lines[i], kinematics, equation),
                )
                for i in numbers
            ]
            for i, s in zip(numbers, _noise_of(parts), strict=True):
                stds[i][equation] = (enlarged or {}).get(equation, 1.0) * s
    own, trends, blocks = [], [], []
    count = lines[0].basis.shape[0]
    for line, std, free in zip(lines, stds, freed, strict=True):
        mine, rising, block = [], [], []
        for place, (equation, s) in enumerate(std.items()):
            steps = _orthonormal_rows(free[equation] / s)
            white = line.basis / s
            for step in steps:
                white = white - np.outer(white @ step, step)
            mine.append(_orthonormal(white))
            rising.append(steps)
            part = np.zeros((len(s), count * len(std)))
            part[:, place * count : (place + 1) * count] = _padded(white, count).T
            block.append(part)
        own.append(tuple(mine))
        trends.append(tuple(rising))
        blocks.append(np.concatenate(block))
    span = _orthonormal(np.concatenate(blocks).T)
    degrees = sum(len(line.keep) - count - len(line.trends) for line in lines) / LINES_PER_DEGREE
    return Weight(tuple(stds), span, tuple(own), tuple(trends), max(degrees, 3.0))


def _moving(rows: Array) -> Array:
    """Rows that are not zero."""
    return np.asarray(rows[np.abs(rows).max(axis=1) > 0.0])


def without(rows: Array, directions: Array) -> Array:
    """Rows (..., n) less their components along orthonormal directions (..., k, n)."""
    for k in range(directions.shape[-2]):
        direction = directions[..., k, :]
        along = np.einsum("...n,...n->...", rows, direction)
        rows = rows - along[..., None] * direction
    return rows


def _orthonormal_rows(rows: Array) -> Array:
    """(k, n) rows orthonormal in their order (Gram and Schmidt); a row of zeros stays."""
    result: list[Array] = []
    for row in rows:
        rest = without(row, np.array(result)) if result else row
        size = np.linalg.norm(rest)
        result.append(rest / size if size > 0.0 else rest)
    return np.array(result)


def _padded(rows: Array, count: int) -> Array:
    return np.concatenate([rows, np.zeros((count - len(rows), rows.shape[1]))])[:count]


def _floor(record: Samples, line: Lines, kinematics: Kinematics, equation: str) -> float:
    """Smallest standard deviation of a line: the accuracy of the reconstruction."""
    channel = record.channel(kinematics.fields[kinematics.channels[equation]])
    assert channel is not None
    return FLOOR * max(float(np.std(line.of(channel))), 1e-12)


def _orthonormal(rows: Array) -> Array:
    """(n, m) orthonormal columns of the span of rows, all but dependent ones left out."""
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    left, singular, right = np.linalg.svd(rows / np.maximum(size, 1e-300), full_matrices=False)
    del left
    return np.asarray(right[singular > 1e-5 * singular[0]].T)


__all__ = ["Lines", "Weight", "lines_of", "noise_spectrum", "weigh", "without"]
