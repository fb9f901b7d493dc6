"""A flight log in memory: columns of many runs, one after another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FlightLog:
    """Runs of a flight test, columnar.

    Attributes
    ----------
    metadata : file-level facts (aircraft, sample_rate_hz, ...); never anything of the truth.
    run_ids : one name per run, all different.
    offsets : (runs + 1,) first row of each run, and the number of rows.
    t_s : (rows,) time from the start of each run [s].
    channels : column name -> (rows,) values in SI, names of `airtruth.signals`.
    """

    metadata: Mapping[str, object]
    run_ids: tuple[str, ...]
    offsets: NDArray[np.int64]
    t_s: Array
    channels: Mapping[str, Array]

    def rows(self, run: int) -> slice:
        """Rows of one run."""
        return slice(int(self.offsets[run]), int(self.offsets[run + 1]))


@dataclass(frozen=True)
class Batch:
    """Runs of one length and one sample period, stacked.

    Attributes
    ----------
    run_ids : names of the runs.
    dt_s : sample period [s].
    t_s : (runs, samples) time [s].
    channels : column name -> (runs, samples) values in SI, C-contiguous.
    """

    run_ids: tuple[str, ...]
    dt_s: float
    t_s: Array
    channels: Mapping[str, Array]


def batches(log: FlightLog) -> Iterator[Batch]:
    """Group the runs of a validated log by length and sample period, in order of first appearance."""
    groups: dict[tuple[int, float], list[int]] = {}
    for run in range(len(log.run_ids)):
        rows = log.rows(run)
        n = rows.stop - rows.start
        dt = (log.t_s[rows.stop - 1] - log.t_s[rows.start]) / (n - 1)
        groups.setdefault((n, round(float(dt), 9)), []).append(run)
    for (n, dt), runs in groups.items():
        index = (log.offsets[runs][:, None] + np.arange(n)[None, :]).astype(np.int64)
        yield Batch(
            run_ids=tuple(log.run_ids[r] for r in runs),
            dt_s=dt,
            t_s=log.t_s[index],
            channels={name: np.ascontiguousarray(values[index]) for name, values in log.channels.items()},
        )
