"""Frequency response of records of one input and one output, with its coherence and random error.

The spectra are averaged over the records and over neighbouring lines. Sources: J. S. Bendat and A. G. Piersol, Random
Data, 4th ed., Wiley, 2010; M. B. Tischler and R. K. Remple, Aircraft and Rotorcraft System
Identification, AIAA, 2nd ed., 2012, chapter 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_COHERENCE: Final = 0.6
"""Coherence from which a response is accurate enough for modelling [-] (Tischler and Remple, chapter 7)."""
LEVEL: Final = 0.05
"""Level of the test that input and output are related at all [-]."""
_TAPER: Final = 0.1
"""Share of a record over which its ends are tapered [-] (Bendat and Piersol)."""
_PER_OCTAVE: Final = 6
"""Bands in an octave [-]; judgement: a short period of damping .3 is half an octave wide."""


@dataclass(frozen=True)
class FrequencyResponse:
    """Response of an output to an input in bands of frequency.

    Attributes
    ----------
    frequency_hz : (bands,) centre of each band [Hz].
    response : (bands,) complex ratio output/input, in their units.
    coherence : (bands,) share of the output's power that the input explains linearly [-].
    error : (bands,) standard error of the magnitude over the magnitude [-], and of the phase [rad].
    averages : (bands,) number of independent spectra behind each band [-].
    """

    frequency_hz: Array
    response: NDArray[np.complex128]
    coherence: Array
    error: Array
    averages: NDArray[np.int64]

    @property
    def permitted(self) -> NDArray[np.bool_]:
        """(bands,) whether the coherence is at least `LEAST_COHERENCE`, and significant at `LEVEL`.

        Without a relation, the coherence of n averages exceeds 1 - LEVEL^(1/(n - 1)) with probability LEVEL (Carter,
        Proc. IEEE 75, 1987, eq. 12).
        """
        n = np.maximum(self.averages, 2)
        bound = 1.0 - LEVEL ** (1.0 / (n - 1))
        return np.asarray((self.averages >= 2) & (self.coherence >= np.maximum(LEAST_COHERENCE, bound)))


def frequency_response(
    inputs: Sequence[Array], outputs: Sequence[Array], dt_s: float, highest_hz: float | None = None
) -> FrequencyResponse:
    """Estimate a frequency response from records that begin and end near the trim.

    The response is H = Sxy/Sxx, the coherence |Sxy|^2/(Sxx Syy), and the relative standard error of |H|
    sqrt(1 - coherence)/sqrt(2 n coherence), with n averages.

    Parameters
    ----------
    inputs, outputs : (samples,) of each record; all are cut to the shortest.
    dt_s : sample period [s].
    highest_hz : end of the bands [Hz]; None for the Nyquist frequency.

    Raises
    ------
    ValueError
        If there is no record, or the shortest has less than 16 samples.
    """
    if not inputs or min(map(len, inputs)) < _LEAST_SAMPLES:
        raise ValueError(f"a frequency response needs records of at least {_LEAST_SAMPLES} samples")
    n = min(map(len, inputs))
    x, y = (np.stack([np.asarray(one[:n], dtype=np.float64) for one in own]) for own in (inputs, outputs))
    f: Array = np.asarray(np.fft.rfftfreq(n, dt_s), dtype=np.float64)
    of_x, of_y = _transformed(x), _transformed(y)
    # every line but those of the mean and of the Nyquist frequency has a negative twin
    sides = np.where((f > 0.0) & (2 * np.arange(len(f)) < n), 2.0, 1.0)
    sxy = sides * of_x.conj() * of_y
    sxx, syy = (sides * np.abs(one) ** 2 for one in (of_x, of_y))
    band = _bands(f, highest_hz)
    count = np.bincount(band[band >= 0])

    def averaged(values: Array) -> Array:
        whole = values.mean(axis=0)[band >= 0]
        return np.bincount(band[band >= 0], weights=whole) / np.maximum(count, 1)

    cross = np.asarray(averaged(sxy.real) + 1j * averaged(sxy.imag), dtype=np.complex128)
    power_x, power_y, centre = averaged(sxx), averaged(syy), averaged(f[None])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        response = np.asarray(cross / power_x, dtype=np.complex128)
        coherence = np.abs(cross) ** 2 / (power_x * power_y)
        averages = count * len(inputs)
        error = np.sqrt(np.maximum(1.0 - coherence, 0.0) / (2.0 * averages * coherence))
    held = count > 0
    return FrequencyResponse(
        centre[held], response[held], coherence[held], error[held], averages[held].astype(np.int64)
    )


_LEAST_SAMPLES: Final = 16
"""Shortest record [samples] (judgement: a few lines of a spectrum)."""


def _transformed(records: Array) -> NDArray[np.complex128]:
    """(records, lines) Fourier transforms, the linear trend removed and the ends tapered by half a period of a cosine.

    That is one segment of `scipy.signal.csd`, whose import would take half a second of every trace.
    """
    n = records.shape[1]
    time = np.linspace(-1.0, 1.0, n)
    level = records.mean(axis=1, keepdims=True)
    trend = (records @ time)[:, None] * time / (time @ time)
    from_end = np.minimum(np.arange(n), n - np.arange(n)) / (0.5 * _TAPER * n)
    taper = 0.5 - 0.5 * np.cos(np.pi * np.minimum(from_end, 1.0))
    return np.fft.rfft((records - level - trend) * taper)


def _bands(f: Array, highest_hz: float | None) -> NDArray[np.int64]:
    """Number of the band of each line, -1 for none: equal in log frequency, and at least one line wide."""
    step = f[1]
    wanted = np.full(len(f), -1, dtype=np.int64)
    inside = (f > 0.5 * step) & (f <= (f[-1] if highest_hz is None else highest_hz))
    wanted[inside] = np.floor(_PER_OCTAVE * np.log2(f[inside] / step) + 0.5).astype(np.int64)
    return wanted


__all__ = ["LEAST_COHERENCE", "LEVEL", "FrequencyResponse", "frequency_response"]
