"""The verb trace: logs and a declared aircraft in, a typed result and an updated aircraft out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from airtruth import __version__
from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.checks import gate
from airtruth.checks.motions import require
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError, choices
from airtruth.logs import atomic
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.provenance import Provenance, digests_of
from airtruth.logs.sources import Logs, named_logs
from airtruth.physics.motion import LONGITUDINAL, MOTIONS, Motion
from airtruth.tracing.answer import ANSWER
from airtruth.tracing.axial_force import axial_force
from airtruth.tracing.budget import Advance
from airtruth.tracing.conclude import conclude
from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.declared_model import declared_p_value
from airtruth.tracing.kinematic_start import (
    kinematic_check,
    with_contradictions,
    within_kinematics,
)
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.prepare import Case, prepare
from airtruth.tracing.replay import flown_again
from airtruth.tracing.result import TraceResult
from airtruth.tracing.searched import Searched, searched
from airtruth.tracing.stage_errors import Replay
from airtruth.tracing.stages import assess_stages
from airtruth.tracing.update import Revision, revision_of, updated_folder, write_update

Write = Callable[[Revision], str | None]
"""From what one motion changes to the folder of the updated aircraft, None where it is not written."""


def trace(
    logs: Logs,
    aircraft: str | Path | Aircraft,
    options: TraceOptions | None = None,
    out: Path | None = None,
    force: bool = False,
    advance: Advance = lambda step: None,
    runs: Collection[str] | None = None,
    notes: Sequence[str] = (),
) -> TraceResult:
    """Trace the residual of flight logs to the effects that the declared aircraft lacks, in one motion.

    Parameters
    ----------
    logs : logs of one aircraft: files, folders, campaign folders, logs in memory, or a sequence of these.
    aircraft : folder with aircraft.toml, a shipped name, or a loaded aircraft.
    options : choices; None for the defaults.
    out : folder of trace.json, the records and the updated aircraft; None to write nothing.
    force : trace logs that contradict physics all the same; the answer lists the faults.
    advance : receives the step that begins.
    runs : runs to trace; None for all.
    notes : remarks for the answer, sentences without a final period.

    Raises
    ------
    LogError, ConfigurationError, AircraftError, StoreError
        Naming what is wrong, where, and what to do.
    """
    with threadpool_limits(limits=1, user_api="blas"):  # threads for small matrices wait for each other
        own = begun(logs, aircraft, options or TraceOptions(), out, force, advance, runs, notes)
        result = answered(replace(own, search=own.search.finished()))
    if out is not None:
        result.write(out)
    return result


@dataclass(frozen=True)
class Begun:
    """A trace of one motion whose search for named effects is finished.

    Attributes
    ----------
    logs : behind the gate; declared : the aircraft.
    search : of the effects.
    out : folder of trace.json and the records; None to write nothing.
    forced : faults of the logs that the caller overruled; remarks : for the answer, sentences without a final period.
    origin : version, options and digests of the inputs.
    """

    logs: list[FlightLog]
    declared: Aircraft
    search: Searched
    out: Path | None
    forced: list[str]
    remarks: tuple[str, ...]
    origin: Provenance


def begun(
    logs: Logs,
    aircraft: str | Path | Aircraft,
    options: TraceOptions,
    out: Path | None,
    force: bool = False,
    advance: Advance = lambda step: None,
    runs: Collection[str] | None = None,
    notes: Sequence[str] = (),
) -> Begun:
    """Check the logs and search for the effects that the declared aircraft lacks, in one motion; arguments as of `trace`."""
    declared = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    effects = _effects(options)
    motion = MOTIONS[options.motion or LONGITUDINAL.name]
    checked, forced, remarks = _checked(logs, declared, motion, force, runs)
    if out is not None:  # both before the search, which takes minutes
        updated_folder(declared, out)
        atomic.make_folder(out)
    advance("probe the declared aircraft")
    case = prepare(checked, declared, effects, options)
    advance("check the kinematics")
    # a reconstructed angle agrees with rates and accelerations by construction
    kinematics = kinematic_check(checked, declared, _held(case), motion) if case.has_vane else None
    case = replace(case, effects=within_kinematics(case.effects, kinematics))
    search = searched(case, options, advance, kinematics)
    origin = provenance_of(logs, declared, options)
    return Begun(checked, declared, search, out, forced, (*notes, *remarks), origin)


def answered(own: Begun, shared: Collection[str] = (), write: Write | None = None) -> TraceResult:
    """Assess a finished search, state its answer, and write the updated aircraft.

    Parameters
    ----------
    own : the trace; its search is that with learned increments.
    shared : keys of effects that the revision of another motion states.
    write : takes the revision of the aircraft and writes it, None for a trace of one motion.
    """
    case, rounds, out, search = own.search.case, own.search.rounds, own.out, own.search
    options, advance = search.options, search.advance
    advance("assess every stage on fitted and held-out records")
    stages = assess_stages(case, rounds)
    advance("compare ax with the declared axial force")
    axial = axial_force(stages, own.logs, own.declared, rounds[-1].gls) if options.learns else None

    def publish(refined: bool) -> tuple[str | None, Replay | None]:
        if out is None:
            return None, None
        advance("write the updated aircraft")
        atomic.remove_file(out / ANSWER)  # an interrupted trace has no answer, not one of another trace
        refit = refined or declared_p_value(rounds) <= CRITERION.declared
        revision = revision_of(case, rounds, own.declared, refit, axial, shared)
        updated = write_update([revision], own.declared, out) if write is None else write(revision)
        return updated, flown_again(stages, own.declared, updated)

    answer = conclude(stages, rounds, publish, own.forced, axial)
    answer = with_contradictions(answer, search.kinematics, search.longest_period_s)
    answer = replace(answer, notes=(*own.remarks, *answer.notes))
    return TraceResult(answer, rounds, stages, own.origin)


def _held(case: Case) -> set[str]:
    """Names of the held-out records."""
    return set() if case.held is None else {r.signals.run_id for r in case.held.records}


def provenance_of(logs: Logs, aircraft: Aircraft, options: TraceOptions) -> Provenance:
    """Version, options and digests of the inputs of a trace.

    Raises
    ------
    StoreError, ConfigurationError
        If a file cannot be read, or a log does not exist.
    """
    stated = {f.name: getattr(options, f.name) for f in fields(options) if f.name != "threads"}
    stated["effects"] = options.keys  # the number of threads changes nothing
    if options.motion is None:
        del stated["motion"]
    words = {name: "default" if value is None else _words(value) for name, value in stated.items()}
    words["criterion"] = str(CRITERION)
    digests = digests_of(logs, aircraft.folder)
    return Provenance(__version__, aircraft.name, words, digests, str(aircraft.folder.resolve()))


def _words(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _checked(
    logs: Logs, aircraft: Aircraft, motion: Motion, force: bool, runs: Collection[str] | None
) -> tuple[list[FlightLog], list[str], tuple[str, ...]]:
    """The logs behind the gate, the faults that ``force`` overruled, and remarks for the answer."""
    admitted = []
    for name, log in named_logs(logs, run_ids=runs):
        admitted.append(gate.admit(log, aircraft, source=name, force=force))
        require(admitted[-1].log, motion, name)
    forced = [sentence for one in admitted for sentence in one.forced]
    remarks = dict.fromkeys(sentence for one in admitted for sentence in one.remarks("aircraft"))
    return [one.log for one in admitted], forced, tuple(remarks)


def _effects(options: TraceOptions) -> list[Effect]:
    """The requested candidates of the motion, each once; a name without a variant selects all of its variants.

    One that applies to no motion, such as an effect of a user on a channel of his own, is a candidate that cannot be tested.
    """
    motion = options.motion or LONGITUDINAL.name
    library = {key: effect for key, effect in EFFECTS.items() if motion in (effect.motions or (motion,))}
    if options.effects is None:
        return [effect for effect in library.values() if _is_in_filter(effect)]
    found: dict[str, Effect] = {}
    for key in options.effects:
        if isinstance(key, Effect):
            found[key.key] = key
            continue
        matching = {k: e for k, e in library.items() if key in (k, e.name)}
        if not matching:
            known = {*library, *(e.name for e in library.values())}
            raise ConfigurationError(f"effect {key!r}: {choices(key, known)}")
        found |= {k: e for k, e in matching.items() if _is_in_filter(e)}
    return list(found.values())


def _is_in_filter(effect: Effect) -> bool:
    return not effect.in_derivatives or effect.acts_at_rest


__all__ = ["Begun", "Write", "answered", "begun", "provenance_of", "trace"]
