"""Public functions of flight logs: read, import and check them."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from airtruth.api.campaigns import load_aircraft

if TYPE_CHECKING:
    from airtruth.api.arguments import AircraftSource, FilePath
    from airtruth.checks.result import CheckResult
    from airtruth.importers import Imported, ManoeuvreResult
    from airtruth.logs.flight_log import FlightLog
    from airtruth.logs.sources import Logs


def read_log(
    logs: Logs, *, channels: Sequence[str] | None = None, run_ids: Collection[str] | None = None
) -> FlightLog:
    """Read flight logs into one log in memory; their values are checked by the function that uses them.

    Parameters
    ----------
    logs : files, folders or logs; several are joined.
    channels : channels to read, a string is one of them; None for all.
    run_ids : runs to read, a string is one of them; None for all.

    Returns
    -------
    FlightLog
        Channels (rows,) in SI; the run with index k has the rows ``log.rows(k)``.

    Raises
    ------
    StoreError
        If a file does not exist, cannot be read or is damaged.
    LogError
        If a file is not a flight log, lacks a channel or run, or a run occurs twice.

    Examples
    --------
    >>> at.read_log("out/light", channels=["alpha_rad", "q_rad_s"])
    FlightLog(6 runs of 5 s at 50 Hz, 2 channels: alpha_rad, q_rad_s)
    """
    from airtruth.logs.flight_log import FlightLog
    from airtruth.logs.sources import named_logs

    return FlightLog.concat([log for _, log in named_logs(logs, channels, run_ids)])


def import_log(
    file: FilePath | Sequence[FilePath],
    mapping: FilePath | Sequence[FilePath],
    *,
    manoeuvres: FilePath | None = None,
    force: bool = False,
) -> Imported:
    """Convert measured logs of other formats: .csv, .txt, .dat, .asc, .mat, .parquet, .ulg, .bin, .mf4, .mdf, .h5, .hdf5, .hdf.

    Parameters
    ----------
    file : measured log, or several.
    mapping : mapping file that names a column, unit and sign per channel, see docs/measured.md. One for several files
        makes a run of each; one for each file merges recorders of one flight.
    manoeuvres : table of start and stop times, as ``airtruth import --find-manoeuvres`` writes it.
    force : keep a log that contradicts physics.

    Returns
    -------
    Imported
        Its ``log`` is what `write_log` stores; its ``faults`` are what the checks found in it.

    Raises
    ------
    StoreError
        If a file cannot be read.
    ConfigurationError
        If the mapping cannot be used as written.
    LogError
        If a column is missing or not numeric, times do not increase, clocks cannot be aligned, or the log contradicts
        physics.

    Examples
    --------
    >>> imported = at.import_log("flight.csv", "flight.toml")
    >>> imported.log.run_ids
    ('flight',)
    >>> at.write_log("flight.parquet", imported.log, dtype="float64")
    """
    from airtruth import importers
    from airtruth.arguments import as_path

    table = None if manoeuvres is None else as_path("manoeuvres", manoeuvres)
    files, mappings = _paths("file", file), _paths("mapping", mapping)
    return importers.import_log(files, mappings, manoeuvres=table, force=force)


def find_manoeuvres(
    file: FilePath | Sequence[FilePath],
    mapping: FilePath | Sequence[FilePath],
    *,
    out: FilePath | None = None,
    force: bool = False,
) -> ManoeuvreResult:
    """Find the manoeuvres in the measured log of a whole flight, for a person to accept or edit.

    Parameters
    ----------
    file : measured log, or the recorders of one flight.
    mapping : mapping file of each, see docs/measured.md; elevator and pitch rate have to be mapped.
    out : table to write, with the suffix .csv; its picture has the suffix .png. None to write nothing. `import_log`
        takes the table as ``manoeuvres``.
    force : replace files that this function did not write.

    Returns
    -------
    ManoeuvreResult
        The candidates with times [s], size of the input [deg] and the reasons of those that are not accepted.

    Raises
    ------
    StoreError
        If a file cannot be read or may not be written.
    ConfigurationError
        If the mapping cannot be used as written, or ``out`` has another suffix.
    LogError
        If elevator or pitch rate is missing, or the record is shorter than a manoeuvre.

    Examples
    --------
    >>> found = at.find_manoeuvres("flight.csv", "flight.toml", out="manoeuvres.csv")
    >>> imported = at.import_log("flight.csv", "flight.toml", manoeuvres="manoeuvres.csv")
    """
    from airtruth import importers
    from airtruth.arguments import as_path
    from airtruth.errors import ConfigurationError
    from airtruth.logs.outputs import writing

    files, mappings = _paths("file", file), _paths("mapping", mapping)
    if out is None:
        return importers.find_manoeuvres(files, mappings)
    table = as_path("out", out)
    if table.suffix.lower() != ".csv":
        raise ConfigurationError(f"{table}: --find-manoeuvres writes a table; name it with the suffix .csv")
    with writing("import", [*files, *mappings], force=force) as outputs:
        outputs.require(table, table.with_suffix(".png"))
        found = importers.find_manoeuvres(files, mappings)
        found.write(table)
    return found


def _paths(argument: str, files: FilePath | Sequence[FilePath]) -> list[Path]:
    """One path, or several, as a list; ``argument`` is the name in an error."""
    from airtruth.arguments import as_path

    if isinstance(files, str | bytes | os.PathLike) or not isinstance(files, Iterable):
        return [as_path(argument, files)]
    return [as_path(argument, one) for one in files]


def check(
    logs: Logs,
    aircraft: AircraftSource | None = None,
    *,
    run_ids: Collection[str] | None = None,
    motion: str = "longitudinal",
    force: bool = False,
) -> CheckResult:
    """Check the channels of logs against each other: biases, scales, arms, lags, with their uncertainty.

    Parameters
    ----------
    logs : logs of one instrumentation; all their runs are assessed together, with noise of their own.
    aircraft : aircraft whose declared sensor errors are taken as known; None assumes ideal sensors.
    run_ids : runs to use, a string is one of them; None for all.
    motion : "longitudinal" or "lateral".
    force : continue although a log contradicts physics; the result lists the faults.

    Raises
    ------
    LogError
        If a log breaks the contract or contradicts physics, lacks a channel of the motion, or no run is long enough and has a
        control surface that moves.
    AircraftError, StoreError
        If the aircraft or a log cannot be read.

    Examples
    --------
    >>> checked = at.check("out/light", "gtm")
    """
    from airtruth.checks.motions import check_motions
    from airtruth.logs.sources import named_logs

    declared = None if aircraft is None else load_aircraft(aircraft)
    named = list(named_logs(logs, run_ids=run_ids))
    return check_motions(named, declared, motion=motion, force=force)[motion]
