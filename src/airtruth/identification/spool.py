"""Estimates of many logs in a temporary file, so that the memory holds those of a few."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final

from airtruth.errors import StoreError
from airtruth.identification.estimates import Estimates, concatenated
from airtruth.logs.atomic import next_step

RUNS_PER_PART: Final = 1000
"""Least number of runs of a part [-] (judgement: 0.5 MB for each method; a frame of pandas costs 5 ms whatever it holds)."""


class Spool:
    """Takes the estimates of logs, and returns them in parts as often as they are needed.

    The file has no name, so that the system removes it however the process ends. It needs 0.4 kB for each run and method.

    Parameters
    ----------
    folder : local folder of the file; None for the folder of temporary files.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._waiting: list[Sequence[Estimates]] = []
        try:
            self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  # closed by __exit__
        except OSError as error:
            raise self._error(error) from None

    def __enter__(self) -> Spool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def add(self, estimates: Sequence[Estimates]) -> None:
        """Take over the estimates of one log, one for each method.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        self._waiting.append(estimates)
        if sum(len(one[0].run_ids) for one in self._waiting) >= RUNS_PER_PART:
            self._flush()

    def parts(self) -> Iterator[tuple[Estimates, ...]]:
        """Return the estimates in the order in which they were added, those of several logs in a part."""
        self._flush()
        end = self._file.tell()
        position = 0
        while position < end:
            self._file.seek(position)
            part = pickle.load(self._file)
            position = self._file.tell()
            self._file.seek(end)
            yield part

    def _flush(self) -> None:
        if not self._waiting:
            return
        run_ids = [run_id for one in self._waiting for run_id in one[0].run_ids]
        joined = tuple(concatenated(of_method, run_ids) for of_method in zip(*self._waiting, strict=True))
        self._waiting = []
        try:
            pickle.dump(joined, self._file, protocol=pickle.HIGHEST_PROTOCOL)
            self._file.flush()
        except OSError as error:
            raise self._error(error) from None

    def _error(self, error: OSError) -> StoreError:
        where = self._folder or tempfile.gettempdir()
        return StoreError(f"{where}: a temporary file of the estimates is not written; {next_step(error)}")


__all__ = ["RUNS_PER_PART", "Spool"]
