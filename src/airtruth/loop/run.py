"""The verb loop: trace, take the traced effects out of the records, identify before and after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.identification import Options, identify
from airtruth.identification.methods import DEFAULT, OF_MOTION
from airtruth.identification.result import IdentificationResult
from airtruth.logs import atomic
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.sources import Logs, named_logs
from airtruth.loop.changes import changes_of
from airtruth.loop.result import OUTPUTS, LoopResult
from airtruth.loop.same_inputs import identifiable, simulated_logs
from airtruth.physics.motion import FOLDERS
from airtruth.tracing import TraceOptions, TraceResult
from airtruth.tracing.budget import Advance
from airtruth.tracing.compensate import Compensation, compensated_log, compensation_of, updated_constants
from airtruth.tracing.motions import MotionTrace, parts_of, traced

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
    parts = parts_of(logs, declared, trace_options or TraceOptions())
    if out is not None:  # of an earlier command that answered more motions
        for name in FOLDERS[1:]:
            atomic.remove_file(out / name / OUTPUTS[2])
    into = [part.into(out) for part in parts]
    folders = [None if folder is None else folder / "trace" for folder in into]
    traces = traced(logs, declared, parts, folders, force, advance)
    first, *others = [
        _closed(logs, declared, part, result, folder, _methods_of(methods, part), options, force, advance)
        for part, result, folder in zip(parts, traces, into, strict=True)
    ]
    return replace(first, others=tuple(others))


def _methods_of(methods: Sequence[str], part: MotionTrace) -> tuple[str, ...]:
    """The estimators that the motion has, where the records choose the motions; all where one is named."""
    every = (methods,) if isinstance(methods, str) else tuple(methods)
    known = OF_MOTION[part.motion.name]
    if not part.folder:
        return every
    return tuple(name for name in every if name in known) or (DEFAULT[part.motion.name],)


def _closed(
    logs: Logs,
    declared: Aircraft,
    part: MotionTrace,
    result: TraceResult,
    out: Path | None,
    methods: Sequence[str],
    options: Options | None,
    force: bool,
    advance: Advance,
) -> LoopResult:
    """The loop of one motion, after its trace."""
    step = part.named(advance)
    read = [log for _, log in named_logs(logs, run_ids=part.runs)]
    given: Logs = logs if part.runs is None else read
    motion = part.motion
    step("identify before")
    before = identify(given, declared, methods, options, force=force, motion=motion)
    taken = compensation_of(result)
    step("identify after")
    after = before
    if taken.treatments:
        after = identify_without_effects(read, declared, methods, taken, options, force)
    step("identify simulated records of the same inputs")
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
    return identify(compensated, updated, methods, options, force=force, motion=taken.motion)


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
        identifiable(simulated_logs(logs, result.histories, model), options or Options(), taken.motion)
        for model in ("declared", corrected)
    )
    found: dict[str, IdentificationResult | None] = {"declared": None, "corrected": None}
    # the gate has admitted the inputs, and a simulation need not agree with the measured airspeed
    if declared_logs:
        found["declared"] = identify(
            declared_logs, aircraft, methods, options, force=True, motion=taken.motion
        )
    if corrected_logs:
        found["corrected"] = identify_without_effects(
            corrected_logs, aircraft, methods, taken, options, force=True
        )
    return found


__all__ = ["METHODS", "close_loop", "identify_without_effects"]
