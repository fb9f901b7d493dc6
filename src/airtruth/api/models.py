"""Public functions of flight models: identify, trace, close the loop, report."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from airtruth.api.campaigns import load_aircraft

if TYPE_CHECKING:
    from airtruth.api.arguments import AircraftSource, FilePath
    from airtruth.identification import IdentificationResult, Method
    from airtruth.identification.options import Options
    from airtruth.logs.sources import Logs
    from airtruth.loop import LoopResult
    from airtruth.result import Result
    from airtruth.tracing import TraceOptions, TraceResult


def identify(
    logs: Logs,
    aircraft: AircraftSource,
    methods: Sequence[str | Method] | None = None,
    options: Options | None = None,
    *,
    motion: str | None = None,
    joint: bool = False,
    force: bool = False,
) -> IdentificationResult:
    """Estimate the derivatives of every run: of the short period, of the lateral-directional motion, or both.

    Parameters
    ----------
    logs : logs of one aircraft.
    aircraft : aircraft, for its mass, inertia and reference lengths.
    methods : names of estimators or `airtruth.identification.Method` objects, one or a sequence; see docs/methods.md. None
        takes iv-f1, and iv-lowpass for the lateral motion.
    options : choices of the estimators; None for the defaults.
    motion : "longitudinal" or "lateral"; None for each that the records excite and have the channels for.
    joint : whether all runs share one estimate per method.
    force : continue although a log contradicts physics; the result records the faults.

    Returns
    -------
    IdentificationResult
        Its ``to_frame()`` has one row per run and method (per method if ``joint``): run_id, method, converged,
        iterations, for each derivative [1/rad, rates as q c/(2V)], wn_rad_s [rad/s] and zeta [-] the value, NAME_std,
        NAME_lower and NAME_upper, and status. Where both motions are answered it is that of the longitudinal one, and
        ``motions`` has both by name.

    Raises
    ------
    ConfigurationError
        If a method does not exist, or an option does not fit the logs.
    LogError
        If a log breaks the contract, contradicts physics or lacks a channel.
    AircraftError, StoreError
        If the aircraft or a log cannot be read.

    Examples
    --------
    >>> estimates = at.identify("out/light", "gtm", ["ls", "iv-f1"])
    >>> table = estimates.to_frame()
    >>> len(table), bool(table["converged"].all())
    (12, True)
    """
    from airtruth.arguments import require_type
    from airtruth.identification import answers, identify
    from airtruth.identification.options import Options

    require_type("options", options, Options, "IdentificationOptions")
    declared = load_aircraft(aircraft)
    asked, notes = answers(logs, declared, methods, motion)
    first, *others = [
        identify(
            logs,
            declared,
            one.methods,
            options,
            joint=joint,
            force=force,
            motion=one.motion,
            excited=one.excited,
        )
        for one in asked
    ]
    return replace(first, notes=(*first.notes, *notes), others=tuple(others))


def trace(
    logs: Logs,
    aircraft: AircraftSource,
    options: TraceOptions | None = None,
    *,
    out: FilePath | None = None,
    force: bool = False,
) -> TraceResult:
    """Name the physical effect that a declared aircraft lacks, and estimate its size.

    Parameters
    ----------
    logs : logs of one aircraft.
    aircraft : the declared aircraft.
    options : choices; None for the defaults.
    out : folder of trace.json, its page and the updated aircraft; None to write nothing.
    force : trace logs that contradict physics; the answer lists the faults. Replace files that this command did not
        write or that changed since.

    Returns
    -------
    TraceResult
        ``result.answer`` holds verdict, effects with parameters [SI], candidates and errors, as in trace.json.

    Raises
    ------
    LogError
        If a log breaks the contract or contradicts physics.
    ConfigurationError, AircraftError, StoreError
        If an option, the aircraft or a file cannot be used.

    Examples
    --------
    >>> options = at.TraceOptions(model="linear", effects=("elevator_delay",))
    >>> result = at.trace("out/light", "gtm", options)
    >>> [candidate.name for candidate in result.answer.candidates]
    ['elevator_delay']
    """
    from airtruth.api.writing import trace_outputs
    from airtruth.arguments import as_path, require_type
    from airtruth.reporting import draw_traces
    from airtruth.tracing import TraceOptions, trace

    require_type("options", options, TraceOptions, "TraceOptions")
    folder = None if out is None else as_path("out", out)
    with trace_outputs("trace", logs, aircraft, folder, force=force) as declared:
        return trace(logs, declared, options, folder, force, draw=draw_traces)


def close_loop(
    logs: Logs,
    aircraft: AircraftSource,
    methods: Sequence[str] = ("ls", "iv-f1"),
    options: TraceOptions | None = None,
    *,
    out: FilePath | None = None,
    force: bool = False,
) -> LoopResult:
    """Trace, remove the traced effects from the logs, and identify before and after.

    Parameters
    ----------
    logs : logs of one aircraft.
    aircraft : the declared aircraft.
    methods : names of estimators, a string is one of them; see docs/methods.md.
    options : choices of the trace; None for the defaults.
    out : folder of the trace, the estimates, loop.json and the table; None to write nothing.
    force : use logs that contradict physics; the result lists the faults.

    Returns
    -------
    LoopResult
        Its ``to_frame()`` has one row per method and derivative [1/rad, rates as q c/(2V)]: declared value, mean
        and standard error before and after, and the same method on simulated records of the same inputs.

    Raises
    ------
    LogError
        If a log breaks the contract or contradicts physics.
    ConfigurationError, AircraftError, StoreError
        If a method, an option, the aircraft or a file cannot be used.

    Examples
    --------
    >>> options = at.TraceOptions(model="linear", effects=("elevator_delay",))
    >>> loop = at.close_loop("out/light", "gtm", ["ls"], options)
    >>> loop.to_frame()["derivative"].tolist()
    ['CLalpha', 'CLq', 'CLde', 'Cmalpha', 'Cmq', 'Cmde']
    """
    from airtruth.api.writing import trace_outputs
    from airtruth.arguments import as_path, require_type
    from airtruth.logs.sources import sources
    from airtruth.loop import close_loop
    from airtruth.tracing import TraceOptions

    require_type("options", options, TraceOptions, "TraceOptions")
    folder = None if out is None else as_path("out", out)
    with trace_outputs("loop", logs, aircraft, folder, force=force) as declared:
        return close_loop(sources(logs), declared, folder, methods, trace_options=options, force=force)


def report(
    result: FilePath | Result,
    out: FilePath,
    *,
    format: str | None = None,
    logs: Logs | None = None,
    aircraft: AircraftSource | None = None,
    force: bool = False,
) -> tuple[Path, ...]:
    """Write one self-contained HTML page of a result with its tables as CSV and LaTeX, or its figures for papers.

    Parameters
    ----------
    result : a result in memory, the folder of a trace, of a loop or of an identified campaign, or a file of estimates.
    out : the page, .html, whose tables have the suffixes .csv and .tex; or, with the suffix .png, .svg or .pdf, the
        stem of the figures, which are the files STEM-NAME.
    format : "html", "png", "svg" or "pdf"; None for what the suffix of ``out`` states.
    logs : logs of a file of estimates that does not have them beside it.
    aircraft : the declared aircraft, which a page of estimates shows beside them; None for none.
    force : replace files that no report wrote or that changed since.

    Returns
    -------
    tuple of Path
        The files, the page first.

    Raises
    ------
    StoreError, LogError
        If there is nothing to report, or a file cannot be read or written.
    ConfigurationError, AircraftError, TrimError
        If logs or an aircraft are given for something other than estimates, or the aircraft cannot be used.

    Examples
    --------
    >>> [path.name for path in at.report("out/light", "out/light.html")]
    ['light.html', 'light.csv', 'light.tex']
    >>> [path.name for path in at.report("out/light", "out/light.svg")]
    ['light-intervals.svg', 'light-runs.svg']
    """
    from airtruth import reporting
    from airtruth.arguments import as_path
    from airtruth.errors import ConfigurationError
    from airtruth.logs.outputs import writing
    from airtruth.logs.sources import log_files
    from airtruth.result import Result

    if not isinstance(result, str | os.PathLike | Result):
        raise ConfigurationError(
            f"report: {type(result).__name__} is not a result; give the result of a function, a folder or a file of estimates"
        )
    source = Path(result) if isinstance(result, str | os.PathLike) else result
    inputs = [source] if isinstance(source, Path) else []
    inputs += [] if logs is None else log_files(logs)
    declared = None if aircraft is None else load_aircraft(aircraft)
    with writing("report", inputs, force=force) as outputs:
        return reporting.report(
            source, as_path("out", out), format, logs, declared, lambda paths: outputs.require(*paths)
        )
