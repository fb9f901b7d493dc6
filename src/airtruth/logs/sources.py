"""Logs as a user gives them: files, folders, logs in memory, or a sequence of these."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

from airtruth.arguments import names
from airtruth.errors import ConfigurationError, LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import log_paths, read_log

LogSource: TypeAlias = str | os.PathLike[str] | FlightLog
"""A log file, a campaign folder, a folder of logs, or a log in memory."""
Logs: TypeAlias = LogSource | Sequence[LogSource]
"""One source of logs or several."""

IN_MEMORY = "log in memory"
"""Name of a log without a file in messages."""


def sources(logs: Logs) -> tuple[Path | FlightLog, ...]:
    """Resolve folders to their log files; nothing is read.

    Parameters
    ----------
    logs : files, folders as `airtruth.logs.store.log_paths` reads them, logs in memory, or several of these.

    Returns
    -------
    tuple of Path or FlightLog
        One entry per file or log in memory, in the order given.

    Raises
    ------
    ConfigurationError
        If nothing is given, or an item is neither a path nor a log.
    StoreError
        If a path does not exist or a folder holds no log.
    """
    items = [logs] if isinstance(logs, str | os.PathLike | FlightLog) else logs
    resolved: list[Path | FlightLog] = []
    for item in items if isinstance(items, Sequence) else [items]:
        if isinstance(item, FlightLog):
            resolved.append(item)
        elif isinstance(item, str | os.PathLike):
            resolved += log_paths(item)
        else:
            step = ""
            if hasattr(item, "to_parquet"):
                step = "; write the frame with its method to_parquet and give the file"
            raise ConfigurationError(
                f"logs: {type(item).__name__} is not a log; give a file, a folder of logs, a FlightLog, "
                f"or a sequence of these{step}"
            )
    if not resolved:
        raise ConfigurationError("logs: none is given; give a file, a folder of logs or a FlightLog")
    return tuple(resolved)


def log_files(logs: Logs) -> list[Path]:
    """Return the files among logs; see `sources`."""
    return [source for source in sources(logs) if isinstance(source, Path)]


def named_logs(
    logs: Logs, columns: Sequence[str] | None = None, run_ids: Collection[str] | None = None
) -> Iterator[tuple[str, FlightLog]]:
    """Read logs one file at a time, each with its name for messages: the file, or `IN_MEMORY`.

    Parameters
    ----------
    logs : as in `sources`.
    columns : channels to read; None for all.
    run_ids : runs to read; None for all. Logs without any of them are left out.

    Raises
    ------
    ConfigurationError, StoreError, LogError
        As `sources` and `airtruth.logs.store.read_log`; or a run occurs in two logs, or in none.
    """
    columns = None if columns is None else names("channels", columns, "alpha_rad")
    run_ids = None if run_ids is None else names("run_ids", run_ids, "light-00001")
    owner: dict[str, str] = {}
    remaining = None if run_ids is None else set(run_ids)
    for source in sources(logs):
        name = IN_MEMORY if isinstance(source, FlightLog) else str(source)
        wanted = None
        if run_ids is not None:
            present = source if isinstance(source, FlightLog) else read_log(source, columns=[])
            wanted = set(run_ids) & set(present.run_ids)
            if not wanted:
                continue
        if not isinstance(source, FlightLog):
            log = read_log(source, columns, wanted)
        else:
            log = source if columns is None else source.select(channels=columns)
            log = log if wanted is None else log.select(run_ids=wanted)
        for run_id in log.run_ids:
            if run_id in owner:
                raise LogError(
                    f"run {run_id!r} is in {owner[run_id]} and in {name}; give each run once, or rename one"
                )
            owner[run_id] = name
        if remaining is not None:
            remaining -= set(log.run_ids)
        yield name, log
    if remaining:
        raise LogError(f"no run {min(remaining)!r} in the logs given")


__all__ = ["IN_MEMORY", "LogSource", "Logs", "log_files", "named_logs", "sources"]
