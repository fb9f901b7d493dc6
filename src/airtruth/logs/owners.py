"""Which log holds a run: a run that two logs hold is refused without the names of all runs in memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.sources import IN_MEMORY
from airtruth.logs.store import read_log


class Owners:
    """Keeps the first and the last name of the runs of each log, in the order of text.

    Only logs whose ranges of names overlap can share a run; the names of such a log are read again.
    """

    def __init__(self) -> None:
        self._ranges: list[tuple[str, str, Path | FlightLog]] = []
        self._highest = ""

    def add(self, log: Path | FlightLog, run_ids: Sequence[str]) -> None:
        """Take over a log with its runs.

        Raises
        ------
        LogError
            If an earlier log holds one of the runs.
        """
        low, high = min(run_ids), max(run_ids)
        if low <= self._highest:
            self._compare(log, run_ids, (low, high))
        self._ranges.append((low, high, log))
        self._highest = max(self._highest, high)

    def _compare(self, log: Path | FlightLog, run_ids: Sequence[str], ends: tuple[str, str]) -> None:
        owner: dict[str, Path | FlightLog] = {}
        for low, high, earlier in self._ranges:
            if low <= ends[1] and ends[0] <= high:
                owner |= dict.fromkeys(_run_ids(earlier), earlier)
        for run_id in run_ids:
            if run_id in owner:
                raise LogError(
                    f"run {run_id!r} is in {_name(owner[run_id])} and in {_name(log)}; give each run once, or rename one"
                )


def _run_ids(log: Path | FlightLog) -> tuple[str, ...]:
    return log.run_ids if isinstance(log, FlightLog) else read_log(log, columns=[]).run_ids


def _name(log: Path | FlightLog) -> str:
    return IN_MEMORY if isinstance(log, FlightLog) else str(log)


__all__ = ["Owners"]
