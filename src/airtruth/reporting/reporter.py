"""The report of a result: one HTML page with its tables as CSV and LaTeX, or its charts as figures for papers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Final

from airtruth.errors import ConfigurationError, StoreError
from airtruth.logs.atomic import write_text
from airtruth.logs.names import ESTIMATES as FILES
from airtruth.logs.parquet import SUFFIX, is_parquet
from airtruth.logs.remote import location
from airtruth.logs.sources import Logs
from airtruth.physics.motion import FOLDERS, LONGITUDINAL, motion_of
from airtruth.reporting.campaign import TRUTH, FlownCampaign, Parted
from airtruth.reporting.columns import columns_of
from airtruth.reporting.stored_campaign import open_campaigns
from airtruth.result import Result

if TYPE_CHECKING:
    from airtruth.aircraft import Aircraft
    from airtruth.reporting.pages.page import Report
    from airtruth.tracing.result import TraceResult

Source = Path | str | FlownCampaign | Result
"""A folder of a trace, a loop or a campaign, a file of estimates, or a result in memory."""
TRACE_PAGE: Final = "trace.html"
"""File of the page that a trace writes into its folder."""


def report(
    source: Source,
    out: Path | str,
    kind: str | None = None,
    logs: Logs | None = None,
    aircraft: Aircraft | None = None,
    announce: Callable[[tuple[Path, ...]], None] = lambda paths: None,
) -> tuple[Path, ...]:
    """Write one HTML page about a result with its tables as CSV and LaTeX, or its charts as figures.

    Parameters
    ----------
    source : folder that `airtruth trace`, `airtruth loop`, or `airtruth fly` and `airtruth identify` wrote; trace.json or
        loop.json of one; file of estimates; or a result in memory.
    out : the page, .html, beside which the tables have the suffixes .csv and .tex; or the stem of the figures, which
        are the files STEM-NAME.
    kind : "html", "png", "svg" or "pdf"; None for what the suffix of ``out`` states.
    logs : logs of a file of estimates that does not have them beside it.
    aircraft : the declared aircraft, another model of the records of an identification.
    announce : receives the files before any of them is written.

    Returns
    -------
    The files, the page first.

    Raises
    ------
    StoreError, LogError
        If there is nothing to report, or a file cannot be read or written.
    ConfigurationError
        If logs or an aircraft are given for something other than estimates.
    AircraftError, TrimError
        If the aircraft cannot be trimmed at the condition of the records.
    """
    from airtruth.reporting.pages.page import files_of, format_of, write_files

    page = location(out)
    chosen = format_of(page, kind)
    made = _report(source, logs, aircraft)
    announce(files_of(made, page, chosen))
    return write_files(made, page, chosen)


def draw_traces(results: Mapping[Path, TraceResult]) -> None:
    """Write the page of each trace into its folder; the first one has links to the others.

    Parameters
    ----------
    results : folder -> result of one motion.

    Raises
    ------
    StoreError
        If a page cannot be written.
    """
    from airtruth.reporting.pages.page import linked
    from airtruth.reporting.pages.trace_page import trace_report

    links = {result.motion: f"{folder.name}/{TRACE_PAGE}" for folder, result in [*results.items()][1:]}
    for number, (folder, result) in enumerate(results.items()):
        page = trace_report(result.answer, result.histories).page
        write_text(folder / TRACE_PAGE, page if number else linked(page, links))


# The pages are imported where they are needed: the tracer takes seconds, and `airtruth tables`, which imports this module as
# well, does not need it.


def _report(source: Source, logs: Logs | None, aircraft: Aircraft | None) -> Report:
    if isinstance(source, FlownCampaign):
        return _of_campaign((source,), logs, aircraft)
    if isinstance(source, Path | str):
        return _of_path(location(source), logs, aircraft)
    return _of_result(source, logs, aircraft)


def _of_result(result: Result, logs: Logs | None, aircraft: Aircraft | None) -> Report:
    from airtruth.identification.result import IdentificationResult
    from airtruth.loop import LoopResult
    from airtruth.reporting.pages.estimates_page import identification_report
    from airtruth.reporting.pages.loop_page import loop_report
    from airtruth.reporting.pages.result_page import result_report
    from airtruth.reporting.pages.trace_page import trace_report
    from airtruth.tracing.result import TraceResult

    if isinstance(result, IdentificationResult):
        return identification_report(result, aircraft)
    _refuse(logs, aircraft)
    if isinstance(result, TraceResult):
        return _together(
            {name: trace_report(one.answer, one.histories) for name, one in result.motions.items()}
        )
    if isinstance(result, LoopResult):
        return _together({name: loop_report(one) for name, one in result.motions.items()})
    return result_report(result)


def _of_path(path: Path, logs: Logs | None, aircraft: Aircraft | None) -> Report:
    if path.name in ("loop.json", "trace.json") and path.is_file():
        path = path.parent
    if (path / "loop.json").is_file():
        from airtruth.reporting.pages.loop_page import stored_loop_report

        _refuse(logs, aircraft)
        return _together({name: stored_loop_report(own) for name, own in _folders(path, "loop.json").items()})
    if (path / "trace.json").is_file():
        from airtruth.reporting.pages.trace_page import read_trace, trace_report

        _refuse(logs, aircraft)
        folders = _folders(path, "trace.json")
        return _together({name: trace_report(*read_trace(own)) for name, own in folders.items()})
    if (path / TRUTH).is_file():
        return _of_campaign(open_campaigns(path), logs, aircraft)
    if path.is_file() and path.suffix != SUFFIX and not is_parquet(path):
        raise StoreError(
            f"{path}: holds no result; allowed: the folder of a trace, a loop or an identified campaign, its trace.json or "
            "loop.json, or the Parquet file of estimates that `airtruth identify` writes"
        )
    files = [path] if path.is_file() else [path / name for name in FILES.values() if (path / name).is_file()]
    if files:
        return _of_estimates(files, logs, aircraft)
    shown, own = quote(str(path)), FILES[LONGITUDINAL.name]
    raise StoreError(
        f"{path}: nothing to report; expected trace.json (`airtruth trace ... --out {shown}`) or {own} "
        f"(`airtruth identify {shown} --aircraft A --out {quote(str(path / own))}`)"
    )


def _of_estimates(files: Sequence[Path], logs: Logs | None, aircraft: Aircraft | None) -> Report:
    """The report of files of estimates, each of one motion; the aircraft serves the one that is compared with it."""
    from airtruth.reporting.campaign import read_estimates
    from airtruth.reporting.pages.estimates_page import estimates_report
    from airtruth.reporting.pages.identified import compares, read_identified

    made = []
    for file in files:
        motion = motion_of(columns_of(file))
        read_estimates(file, "`airtruth identify`", motion)
        own = aircraft if len(files) == 1 or compares(motion) else None
        made.append(read_identified(file, logs, own))
    name = next((record["aircraft"] for record in made[0].records.values()), "")
    return estimates_report(f"Identification of {name}" if name else files[0].stem, made)


def _folders(path: Path, file: str) -> dict[str, Path]:
    """Folder of the answer, and of that of each other motion by its name, for which it has a folder."""
    others = {name: path / name for name in FOLDERS[1:] if (path / name / file).is_file()}
    return {"": path, **others}


def _together(reports: dict[str, Report]) -> Report:
    """The report of the first motion with those of the others beside it."""
    (_, first), *others = reports.items()
    return replace(first, beside=dict(others))


def _of_campaign(campaigns: Sequence[Parted], logs: Logs | None, aircraft: Aircraft | None) -> Report:
    from airtruth.reporting.pages.campaign_page import campaign_report

    return campaign_report(campaigns, logs, aircraft)


def _refuse(logs: Logs | None, aircraft: Aircraft | None) -> None:
    """Refuse what only a page of estimates shows."""
    for option, value in (("--log", logs), ("--aircraft", aircraft)):
        if value is not None:
            raise ConfigurationError(
                f"{option} is for estimates; a trace and a loop hold their records and their aircraft, so leave it out"
            )
