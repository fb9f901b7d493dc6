"""Identify logs as they lie on disk, one file at a time, so that memory does not grow with their number."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from airtruth.errors import LogError
from airtruth.identify.checks import check_batch, check_log
from airtruth.identify.condition import AircraftConstants
from airtruth.identify.estimate import identify_joint, identify_log
from airtruth.identify.methods import method
from airtruth.identify.of_record import common, note, with_constants
from airtruth.identify.options import Options
from airtruth.identify.results import estimates_table
from airtruth.identify.summary import Cell, Table
from airtruth.logs.store import log_paths, read_log
from airtruth.physics.short_period import MODAL, PARAMETERS

Progress = Callable[[int, int, int], None]
"""Called with files done, files in all, runs not converged."""
Say = Callable[[str], None]
"""Called with a sentence that a reader of the estimates should know."""


def identify_files(
    places: Sequence[Path],
    constants: AircraftConstants,
    methods: Sequence[str],
    options: Options | None = None,
    joint: bool = False,
    progress: Progress = lambda done, total, failed: None,
    say: Say = lambda sentence: None,
) -> pd.DataFrame:
    """Check and identify every run of several logs or campaign folders.

    Parameters
    ----------
    places : files, or folders as `airtruth.logs.store.log_paths` reads them.
    constants, methods, options, joint : as in `airtruth.identify.identify_log`; a joint estimate holds
        all runs in memory.
    progress : called after each file.
    say : told, once for each constant, where records state another value than the aircraft.

    Returns
    -------
    DataFrame
        estimates.parquet of contract 2.

    Raises
    ------
    StoreError, LogError, ConfigurationError
        Naming the file, and the run and channel, that cannot be identified.
    """
    options = options or Options()
    paths = [path for place in places for path in log_paths(place)]
    tables, parts, owner, failed = [], [], dict[str, Path](), 0
    other: dict[str, list[tuple[str, float, float]]] = {}
    for number, path in enumerate(paths, start=1):
        log = read_log(path)
        for run_id in log.run_ids:
            if run_id in owner:
                raise LogError(
                    f"run {run_id!r} is in {owner[run_id]} and in {path}; give each run once, or rename one"
                )
            owner[run_id] = path
        try:
            for run_id, name, own, declared in note(log.metadata, log.run_ids, constants):
                other.setdefault(name, []).append((run_id, own, declared))
            if joint:
                check_log(log, [method(name) for name in methods], options)
                added = list(with_constants(log, constants))
                for batch, _ in added:
                    check_batch(batch, options)
                parts += added
            else:
                tables.append(identify_log(log, constants, methods, options))
                failed += int((~tables[-1]["converged"]).sum())
        except LogError as error:
            raise LogError(f"{path}: {error}") from None
        progress(number, len(paths), failed)
    if joint:
        one, together = common(parts), [batch for batch, _ in parts]
        tables = [estimates_table(identify_joint(together, one, name, options)) for name in methods]
    for name, found in other.items():
        run_id, own, declared = found[0]
        more = f" and {len(found) - 1} more" if len(found) > 1 else ""
        say(
            f"{name} of run {run_id!r}{more} as the log states it: {own:.6g}, not the aircraft's {declared:.6g}"
        )
    return pd.concat(tables, ignore_index=True)


def overview(estimates: pd.DataFrame) -> Table:
    """Estimates of contract 2 as a table for people: one run with its intervals, or the spread over runs."""
    names = [*PARAMETERS, *MODAL]
    rows: list[tuple[Cell, ...]] = []
    for name, table in estimates.groupby("method", sort=False):
        good = table[table["converged"]]
        if len(table) == 1:
            row = table.iloc[0]
            cells = [f"{row[n]:.4g} [{row[n + '_lower']:.4g}, {row[n + '_upper']:.4g}]" for n in names]
        else:
            cells = [f"{good[n].mean():.4g} ({good[n].std():.2g})" for n in names]
        rows.append((str(name), len(table), len(table) - len(good), *cells))
    one = estimates.groupby("method").size().max() == 1
    return Table(
        title="Estimates with 95 % intervals" if one else "Mean (standard deviation) over the converged runs",
        columns=("method", "runs", "not converged", *names),
        rows=tuple(rows),
    )
