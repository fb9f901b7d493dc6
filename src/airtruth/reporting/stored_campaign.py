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
from airtruth.reporting.campaign import (
    ESTIMATE_KINDS,
    ESTIMATES,
    FAILED,
    FLOWN,
    TRUTH,
    TRUTH_KINDS,
    Campaign,
    Parted,
    describe,
    estimates_of,
    read_campaign,
    writers,
)
from airtruth.reporting.columns import Kind, column_parts, numbers
from airtruth.reporting.paper.published import ESTIMATED

Array = NDArray[np.float64]

RUNS_PER_PART: Final = 1024
"""Runs of a part [-] (judgement: 0.5 MB for each method)."""


class _OtherOrderError(Exception):
    """The files are not in the order in which `airtruth fly` and `airtruth identify` write them, or are faulty."""


@dataclass(frozen=True)
class StoredCampaign:
    """A flown and identified campaign in its folder.

    The truth ascends by run_id, and the estimates follow its runs, each with the same methods.

    Attributes
    ----------
    folder, name, title, gust : as in `airtruth.reporting.campaign.Campaign`.
    methods : methods of each run.
    runs : number of planned runs.
    """

    folder: Path
    name: str
    title: str
    gust: str
    methods: tuple[str, ...]
    runs: int

    def parts(self) -> Iterator[Campaign]:
        """Read the runs, `RUNS_PER_PART` at a time.

        Raises
        ------
        StoreError, LogError
            If a file cannot be read.
        """
        fly, identify = writers(self.folder)
        rows = _Rows(self.folder / ESTIMATES, identify, len(self.methods))
        for table in column_parts(self.folder / TRUTH, TRUTH_KINDS, fly, rows=RUNS_PER_PART):
            run_ids = table.column("run_id").combine_chunks()
            flown = np.asarray(
                table.column("status").combine_chunks().to_numpy(zero_copy_only=False) == FLOWN
            )
            own = rows.take(int(flown.sum()) * len(self.methods))
            at = np.flatnonzero(flown)
            yield Campaign(
                folder=self.folder,
                name=self.name,
                title=self.title,
                gust=self.gust,
                run_ids=tuple(run_ids.to_pylist()),
                flown=flown,
                truth=np.where(flown[:, None], numbers(table, ESTIMATED), np.nan),
                estimates={
                    method: estimates_of(own, np.arange(i, own.num_rows, len(self.methods)), at, len(flown))
                    for i, method in enumerate(self.methods)
                },
            )


def open_campaign(folder: Path) -> Parted:
    """Open the campaign of a folder, whose runs are read part by part.

    A file in another order, such as estimates that another program wrote, is read as a whole instead.

    Raises
    ------
    StoreError, LogError
        As `airtruth.reporting.campaign.read_campaign`.
    """
    try:
        return _checked(folder)
    except (_OtherOrderError, AirtruthError):
        return read_campaign(folder)  # it states what is wrong with the whole campaign


def _checked(folder: Path) -> StoredCampaign:
    """Read the keys of both files once, and refuse any other order."""
    fly, identify = writers(folder)
    keys = {name: ESTIMATE_KINDS[name] for name in ("run_id", "method")}
    methods = _first_methods(folder / ESTIMATES, identify)
    rows = _Rows(folder / ESTIMATES, identify, len(methods), keys)
    runs, flying, last = 0, 0, ""
    for table in column_parts(folder / TRUTH, TRUTH_KINDS, fly, rows=RUNS_PER_PART):
        run_ids = _texts(table, "run_id")
        status = _texts(table, "status")
        _require((run_ids[1:] > run_ids[:-1]).all() and run_ids[0] > last)
        _require(np.isin(status, (FLOWN, FAILED)).all())
        flown = status == FLOWN
        _require(np.isfinite(numbers(table, ESTIMATED)[flown]).all())
        own = rows.take(int(flown.sum()) * len(methods))
        _require(np.array_equal(_texts(own, "run_id"), np.repeat(run_ids[flown], len(methods))))
        _require(np.array_equal(_texts(own, "method"), np.tile(methods, int(flown.sum()))))
        runs, flying, last = runs + len(run_ids), flying + int(flown.sum()), run_ids[-1]
    described = describe(folder)
    _require(rows.exhausted and flying > 0 and described.runs in (None, runs))
    return StoredCampaign(folder, described.name, described.title, described.gust, tuple(methods), runs)


def _require(met: bool | np.bool_) -> None:
    if not met:
        raise _OtherOrderError


def _texts(table: pa.Table, name: str) -> NDArray[np.object_]:
    return np.asarray(table.column(name).to_numpy(), dtype=object)


def _first_methods(path: Path, writer: str) -> NDArray[np.object_]:
    """Methods of the first run."""
    keys = {name: ESTIMATE_KINDS[name] for name in ("run_id", "method")}
    first = next(column_parts(path, keys, writer, rows=RUNS_PER_PART), None)
    if first is None:
        raise _OtherOrderError
    run_ids = _texts(first, "run_id")
    return np.asarray(_texts(first, "method")[run_ids == run_ids[0]])


class _Rows:
    """Takes rows of a file of estimates one after another, any number at a time."""

    def __init__(self, path: Path, writer: str, methods: int, kinds: dict[str, Kind] | None = None) -> None:
        self._parts = column_parts(
            path, kinds or ESTIMATE_KINDS, writer, ("status",), rows=RUNS_PER_PART * methods
        )
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


__all__ = ["RUNS_PER_PART", "StoredCampaign", "open_campaign"]
