"""The verb loop: trace, take the traced effects out of the records, identify before and after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.errors import LogError
from airtruth.identification import Options, identify
from airtruth.identification.result import IdentificationResult
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.sources import Logs, named_logs
from airtruth.loop.changes import changes_of
from airtruth.loop.result import LoopResult
from airtruth.loop.same_inputs import simulated_logs
from airtruth.tracing import TraceOptions, TraceResult, trace
from airtruth.tracing.compensate import Compensation, compensated_log, compensation_of, updated_constants

METHODS: Final = ("ls", "iv-f1")
"""Methods of a loop by default: least squares, and the default method of `airtruth identify`."""


def close_loop(
    logs: Logs,
    aircraft: str | Path | Aircraft,
    out: Path | None = None,
    methods: Sequence[str] = METHODS,
    *,
    trace_options: TraceOptions | None = None,
    options: Options | None = None,
    force: bool = False,
    advance: Callable[[str], None] = lambda step: None,
) -> LoopResult:
    """Trace, take the accepted effects out of the records, and identify before and after.

    Each effect is treated by its kind (`airtruth.tracing.compensate`): increments of CL and Cm are subtracted, errors
    of sensors are undone, the elevator is replaced by the surface that the air sees, and a traced mass or inertia
    changes the constants. The result states the treatment of each effect.

    Parameters
    ----------
    logs : logs of one aircraft, as of `airtruth.tracing.trace`.
    aircraft : folder with aircraft.toml, a shipped name, or a loaded aircraft.
    out : folder of trace/, the estimates, loop.json and the table; None to write nothing.
    methods : names of estimators, see docs/methods.md.
    trace_options, options : choices of the trace and of the estimators; None for the defaults.
    force : use logs that contradict physics; the answer lists the faults.
    advance : receives the step that begins.

    Raises
    ------
    LogError, ConfigurationError, AircraftError, StoreError
        As `airtruth.tracing.trace` and `airtruth.identification.identify`.
    """
    declared = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    advance("identify before")
    before = identify(logs, declared, methods, options, force=force)
    folder = None if out is None else out / "trace"
    result = trace(logs, declared, trace_options, folder, force, advance)
    taken = compensation_of(result)
    advance("identify after")
    after = before
    read = [log for _, log in named_logs(logs)]
    if taken.treatments:
        after = identify_without_effects(read, declared, methods, taken, options, force)
    advance("identify simulated records of the same inputs")
    simulated = _identified_simulations(read, declared, methods, result, taken, options)
    loop = LoopResult(
        trace=result,
        treatments=taken.treatments,
        before=before,
        after=after,
        changes=changes_of(before, after, result.answer.derivatives.declared, simulated),
    )
    if out is not None:
        loop.write(out)
    return loop


def identify_without_effects(
    logs: Sequence[FlightLog],
    aircraft: Aircraft,
    methods: Sequence[str],
    taken: Compensation,
    options: Options | None = None,
    force: bool = False,
) -> IdentificationResult:
    """Identify with the traced effects taken out of the records.

    The intervals are those of the method: they count the effects as known.

    Parameters
    ----------
    logs : checked logs.
    taken : the traced effects; the other arguments are those of `airtruth.identification.identify`.

    Raises
    ------
    LogError, ConfigurationError
        As `airtruth.identification.identify`.
    """
    updated = updated_constants(aircraft, taken)
    compensated = [compensated_log(log, updated, taken) for log in logs]
    return identify(compensated, updated, methods, options, force=force)


def _identified_simulations(
    logs: Sequence[FlightLog],
    aircraft: Aircraft,
    methods: Sequence[str],
    result: TraceResult,
    taken: Compensation,
    options: Options | None,
) -> dict[str, IdentificationResult | None]:
    """Estimates of the declared and of the corrected model through the measured inputs; None where none can be identified."""
    corrected = [model for model in result.histories.models if model != "declared"][-1]
    declared_logs, corrected_logs = (
        simulated_logs(logs, result.histories, model) for model in ("declared", corrected)
    )
    found: dict[str, IdentificationResult | None] = {"declared": None, "corrected": None}
    # the gate has admitted the inputs, and a simulation need not agree with the measured airspeed
    try:
        if declared_logs:
            found["declared"] = identify(declared_logs, aircraft, methods, options, force=True)
        if corrected_logs:
            found["corrected"] = identify_without_effects(
                corrected_logs, aircraft, methods, taken, options, force=True
            )
    except LogError:  # a model that does not move, for example
        return {"declared": None, "corrected": None}
    return found


__all__ = ["METHODS", "close_loop", "identify_without_effects"]
