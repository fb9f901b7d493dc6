"""A campaign that is read from its files part by part, so that the memory does not depend on the number of runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from airtruth.errors import AirtruthError
from airtruth.logs.names import ESTIMATES as FILES
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.reporting.campaign import (
    FAILED,
    FLOWN,
    TRUTH,
    FlownCampaign,
    Parted,
    estimate_kinds,
    estimates_of,
    motions_of,
    read_campaign,
    truth_kinds,
    writers,
)
from airtruth.reporting.columns import Kind, column_parts, numbers
from airtruth.reporting.description import describe

Array = NDArray[np.float64]

RUNS_PER_PART: Final = 1024
"""Runs of a part [-] (judgement: 0.5 to 1 MB for each method)."""

_KEYS: Final[dict[str, Kind]] = {"run_id": "text", "method": "text"}
"""Columns that identify an estimate."""


class _OtherOrderError(Exception):
    """The files are not in the order in which `airtruth fly` and `airtruth identify` write them, or are faulty."""


@dataclass(frozen=True)
class StoredCampaign:
    """A flown and identified campaign in its folder.

    The truth ascends by run_id, and the estimates follow its runs, each with the same methods.

    Attributes
    ----------
    folder, name, title, gust, motion : as in `airtruth.reporting.campaign.FlownCampaign`.
    methods : methods of each run.
    runs : number of planned runs.
    """

    folder: Path
    name: str
    title: str
    gust: str
    methods: tuple[str, ...]
    runs: int
    motion: Motion = LONGITUDINAL

    def parts(self) -> Iterator[FlownCampaign]:
        """Read the runs, `RUNS_PER_PART` at a time.

        Raises
        ------
        StoreError, LogError
            If a file cannot be read.
        """
        motion = self.motion
        fly, identify = writers(self.folder, motion)
        estimates = self.folder / FILES[motion.name]
        rows = _Rows(estimates, identify, len(self.methods), estimate_kinds(motion))
        for table in column_parts(self.folder / TRUTH, truth_kinds(motion), fly, rows=RUNS_PER_PART):
            run_ids = table.column("run_id").combine_chunks()
            flown = np.asarray(
                table.column("status").combine_chunks().to_numpy(zero_copy_only=False) == FLOWN
            )
            own = rows.take(int(flown.sum()) * len(self.methods))
            at = np.flatnonzero(flown)
            yield FlownCampaign(
                folder=self.folder,
                name=self.name,
                title=self.title,
                gust=self.gust,
                run_ids=tuple(run_ids.to_pylist()),
                flown=flown,
                truth=np.where(flown[:, None], numbers(table, motion.estimated), np.nan),
                estimates={
                    method: estimates_of(
                        own, np.arange(i, own.num_rows, len(self.methods)), at, len(flown), motion
                    )
                    for i, method in enumerate(self.methods)
                },
                motion=motion,
            )


def open_campaigns(folder: Path) -> tuple[Parted, ...]:
    """Open the campaign of a folder, once for each motion of which it holds estimates; see `open_campaign`."""
    return tuple(open_campaign(folder, motion) for motion in motions_of(folder))


def open_campaign(folder: Path, motion: Motion = LONGITUDINAL) -> Parted:
    """Open the campaign of a folder with the estimates of a motion, whose runs are read part by part.

    A file in another order, such as estimates that another program wrote, is read as a whole instead.

    Raises
    ------
    StoreError, LogError
        As `airtruth.reporting.campaign.read_campaign`.
    """
    try:
        return _checked(folder, motion)
    except (_OtherOrderError, AirtruthError):
        return read_campaign(folder, motion)  # it states what is wrong with the whole campaign


def _checked(folder: Path, motion: Motion) -> StoredCampaign:
    """Read the keys of both files once, and refuse any other order."""
    fly, identify = writers(folder, motion)
    estimates = folder / FILES[motion.name]
    methods = _first_methods(estimates, identify)
    rows = _Rows(estimates, identify, len(methods), _KEYS)
    runs, flying, last = 0, 0, ""
    for table in column_parts(folder / TRUTH, truth_kinds(motion), fly, rows=RUNS_PER_PART):
        run_ids = _texts(table, "run_id")
        status = _texts(table, "status")
        _require((run_ids[1:] > run_ids[:-1]).all() and run_ids[0] > last)
        _require(np.isin(status, (FLOWN, FAILED)).all())
        flown = status == FLOWN
        _require(np.isfinite(numbers(table, motion.estimated)[flown]).all())
        own = rows.take(int(flown.sum()) * len(methods))
        _require(np.array_equal(_texts(own, "run_id"), np.repeat(run_ids[flown], len(methods))))
        _require(np.array_equal(_texts(own, "method"), np.tile(methods, int(flown.sum()))))
        runs, flying, last = runs + len(run_ids), flying + int(flown.sum()), run_ids[-1]
    described = describe(folder)
    _require(rows.exhausted and flying > 0 and described.runs in (None, runs))
    return StoredCampaign(
        folder, described.name, described.title, described.gust, tuple(methods), runs, motion
    )


def _require(met: bool | np.bool_) -> None:
    if not met:
        raise _OtherOrderError


def _texts(table: pa.Table, name: str) -> NDArray[np.object_]:
    return np.asarray(table.column(name).to_numpy(), dtype=object)


def _first_methods(path: Path, writer: str) -> NDArray[np.object_]:
    """Methods of the first run."""
    first = next(column_parts(path, _KEYS, writer, rows=RUNS_PER_PART), None)
    if first is None:
        raise _OtherOrderError
    run_ids = _texts(first, "run_id")
    return np.asarray(_texts(first, "method")[run_ids == run_ids[0]])


class _Rows:
    """Takes rows of a file of estimates one after another, any number at a time."""

    def __init__(self, path: Path, writer: str, methods: int, kinds: dict[str, Kind]) -> None:
        self._parts = column_parts(path, kinds, writer, ("status",), rows=RUNS_PER_PART * methods)
        self._waiting = next(self._parts)

    def take(self, count: int) -> pa.Table:
        """The next ``count`` rows."""
        while self._waiting.num_rows < count:
            following = next(self._parts, None)
            _require(following is not None)
            self._waiting = pa.concat_tables([self._waiting, following])
        taken, self._waiting = self._waiting.slice(0, count), self._waiting.slice(count)
        return taken.combine_chunks()

    @property
    def exhausted(self) -> bool:
        """Whether no row is left."""
        return self._waiting.num_rows == 0 and next(self._parts, None) is None


__all__ = ["RUNS_PER_PART", "StoredCampaign", "open_campaign", "open_campaigns"]
