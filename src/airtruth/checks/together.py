"""The runs of a log side by side, also where they differ in length or sample period."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.spectra import integral, spectrum
from airtruth.logs.flight_log import Batch

Array = NDArray[np.float64]
Channels = Mapping[str, Array]


@dataclass(frozen=True)
class Runs:
    """Runs of one log, those of one length and period in one batch.

    Attributes
    ----------
    parts : batches of the runs; the runs of the first part are counted first.
    """

    parts: tuple[Batch, ...]

    @property
    def run_ids(self) -> tuple[str, ...]:
        """Names of the runs, in the order of the rows of every result."""
        return tuple(run_id for part in self.parts for run_id in part.run_ids)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, which all parts have."""
        return tuple(self.parts[0].channels) if self.parts else ()

    def __len__(self) -> int:
        """Return the number of runs."""
        return sum(len(part.run_ids) for part in self.parts)

    def each(self, figure: Callable[[Channels, float], Array]) -> Array:
        """Stack a figure of every run.

        Parameters
        ----------
        figure : from channels (runs, samples) and the sample period [s] to (runs, ...).
        """
        return np.concatenate([figure(part.channels, part.dt_s) for part in self.parts])

    def spectra(self, signal: Callable[[Channels, float], Array]) -> Array:
        """Spectra (runs, ..., lines) of a signal (runs, ..., samples); a short run has zeros behind its last line."""
        return _padded([spectrum(signal(part.channels, part.dt_s), part.dt_s) for part in self.parts])

    def spectra_of(self, *names: str) -> Array:
        """Spectra (runs, names, lines) of channels."""
        return np.stack([self.spectra(lambda c, dt_s, n=name: c[n]) for name in names], axis=1)  # type: ignore[misc]

    def integrals_of(self, *names: str) -> Array:
        """Spectra (runs, names, lines) of the integrals of channels."""
        of = [self.spectra(lambda c, dt_s, n=name: integral(c[n], dt_s)) for name in names]  # type: ignore[misc]
        return np.stack(of, axis=1)

    def padded(self, lines: Callable[[Channels, float], Array]) -> Array:
        """Stack spectra (runs, ..., lines) that are computed already, padded as those of `spectra`."""
        return _padded([lines(part.channels, part.dt_s) for part in self.parts])

    def lines(self) -> NDArray[np.int64]:
        """(runs,) numbers that the spectrum of each run has of its own."""
        counts = [spectrum(part.t_s[:1], part.dt_s).shape[-1] for part in self.parts]
        return np.repeat(counts, [len(part.run_ids) for part in self.parts])

    def changed(self, change: Callable[[Channels, float], Channels]) -> Runs:
        """Return the runs with some channels replaced, from the channels and the sample period [s]."""
        return Runs(
            tuple(
                replace(part, channels={**part.channels, **change(part.channels, part.dt_s)})
                for part in self.parts
            )
        )

    def without(self, *names: str) -> Runs:
        """Return the runs without some channels."""
        return Runs(
            tuple(
                replace(part, channels={n: v for n, v in part.channels.items() if n not in names})
                for part in self.parts
            )
        )

    def some(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Runs:
        """Return the runs of a mask (runs,) or of indices."""
        mask = np.zeros(len(self), dtype=np.bool_)
        mask[which] = True
        parts, first = [], 0
        for part in self.parts:
            own = np.flatnonzero(mask[first : first + len(part.run_ids)])
            first += len(part.run_ids)
            if own.size:
                parts.append(
                    replace(
                        part,
                        run_ids=tuple(part.run_ids[i] for i in own),
                        t_s=part.t_s[own],
                        channels={n: v[own] for n, v in part.channels.items()},
                    )
                )
        return Runs(tuple(parts))


def _padded(parts: Sequence[Array]) -> Array:
    """Real and imaginary halves, each padded with zeros to the longest."""
    if len(parts) == 1:
        return parts[0]
    longest = max(part.shape[-1] for part in parts) // 2
    result = np.zeros((sum(map(len, parts)), *parts[0].shape[1:-1], 2 * longest))
    first = 0
    for part in parts:
        rows, half = slice(first, first + len(part)), part.shape[-1] // 2
        result[rows, ..., :half] = part[..., :half]
        result[rows, ..., longest : longest + half] = part[..., half:]
        first += len(part)
    return result


__all__ = ["Runs"]
