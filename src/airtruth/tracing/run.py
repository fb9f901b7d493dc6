"""The verb trace: logs and a declared aircraft in, a typed result and an updated aircraft out."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from airtruth import __version__
from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.checks import gate
from airtruth.checks.result import CheckResult
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError, LogError, choices
from airtruth.logs import atomic
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.provenance import Provenance, digests_of
from airtruth.logs.sources import Logs, named_logs
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing.answer import ANSWER, DECLARED_LEVEL
from airtruth.tracing.axial_force import axial_force
from airtruth.tracing.calibration.calibrated import calibrated
from airtruth.tracing.calibration.noise_colour import beside, later_level
from airtruth.tracing.conclude import conclude
from airtruth.tracing.declared_model import declared_p_value
from airtruth.tracing.kinematic_start import (
    kinematic_check,
    names_a_sensor,
    sets_of,
    starts_of,
    with_contradictions,
    within_kinematics,
)
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.prepare import Case, prepare
from airtruth.tracing.replay import flown_again
from airtruth.tracing.result import TraceResult
from airtruth.tracing.selection.budget import Advance, Budget, may_begin
from airtruth.tracing.selection.learn import with_increments
from airtruth.tracing.selection.look_alikes import with_look_alikes
from airtruth.tracing.selection.outcome import total_cost
from airtruth.tracing.selection.pruning import pruned
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.tracing.selection.search import search
from airtruth.tracing.selection.set_table import SetTable
from airtruth.tracing.selection.significance import LEVEL
from airtruth.tracing.selection.weights import with_rival
from airtruth.tracing.stage_errors import Replay
from airtruth.tracing.stages import assess_stages
from airtruth.tracing.update import updated_folder, write_update


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
    out : folder of trace.json, the figures and the updated aircraft; None to write nothing.
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
        return _traced(logs, aircraft, options or TraceOptions(), out, force, advance, runs, notes)


def _traced(
    logs: Logs,
    aircraft: str | Path | Aircraft,
    options: TraceOptions,
    out: Path | None,
    force: bool,
    advance: Advance,
    runs: Collection[str] | None,
    notes: Sequence[str],
) -> TraceResult:
    declared = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    effects = _effects(options)
    checked, forced, remarks = _checked(logs, declared, force, runs)
    if out is not None:  # both before the search, which takes minutes
        updated_folder(declared, out)
        atomic.make_folder(out)
    advance("probe the declared aircraft")
    case = prepare(checked, declared, effects, options)
    motion = case.fitted.layout.motion
    advance("check the kinematics")
    held = set() if case.held is None else {r.signals.run_id for r in case.held.records}
    # a reconstructed angle agrees with rates and accelerations by construction
    kinematics = None if not case.has_vane else kinematic_check(checked, declared, held, motion)
    case = replace(case, effects=within_kinematics(case.effects, kinematics))
    case, rounds = _search(case, options, advance, kinematics)
    advance("assess every stage on fitted and held-out records")
    stages = assess_stages(case, rounds)
    advance("compare ax with the declared axial force")
    axial = axial_force(stages, checked, declared, rounds[-1].gls) if options.learns else None
    origin = provenance_of(logs, declared, options)

    def publish(refined: bool) -> tuple[str | None, Replay | None]:
        if out is None:
            return None, None
        advance("write the updated aircraft")
        atomic.remove_file(out / ANSWER)  # an interrupted trace has no answer, not one of another trace
        refit = refined or declared_p_value(rounds) <= DECLARED_LEVEL
        updated = write_update(case, rounds, declared, out, refit, axial)
        return updated, flown_again(stages, declared, updated)

    answer = conclude(stages, rounds, publish, forced, axial)
    whole = kinematics
    if held and kinematics is not None and names_a_sensor(answer):
        whole = kinematic_check(checked, declared, (), motion)
    answer = with_contradictions(answer, kinematics, _longest_period_s(case), whole)
    answer = replace(answer, notes=(*notes, *remarks, *answer.notes))
    result = TraceResult(answer, rounds, stages, origin)
    if out is not None:
        result.write(out)
    return result


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
    digests = digests_of(logs, aircraft.folder)
    return Provenance(__version__, aircraft.name, words, digests, str(aircraft.folder.resolve()))


def _words(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _checked(
    logs: Logs, aircraft: Aircraft, force: bool, runs: Collection[str] | None
) -> tuple[list[FlightLog], list[str], tuple[str, ...]]:
    """The logs behind the gate, the faults that ``force`` overruled, and remarks for the answer."""
    read = named_logs(logs, run_ids=runs)
    admitted = [gate.admit(log, aircraft, source=name, force=force) for name, log in read]
    forced = [sentence for one in admitted for sentence in one.forced]
    remarks = dict.fromkeys(sentence for one in admitted for sentence in one.remarks("aircraft"))
    return [one.log for one in admitted], forced, tuple(remarks)


def _search(
    case: Case, options: TraceOptions, advance: Advance, kinematics: CheckResult | None
) -> tuple[Case, tuple[SearchRound, ...]]:
    """The case with the correlated noise and the corners that its records show, and the rounds of the search."""
    advance("refit the declared aircraft")
    limited = None if options.time_budget_s is None else Budget(options.time_budget_s, advance)
    steps = advance if limited is None else limited
    case, start = calibrated(case)
    sets = SetTable(case.fitted)
    rounds = _pruned_search(case, sets, start, options, steps, kinematics)
    if rounds and rounds[-1].null.hypothesis.effects and not case.fitted.settings.coloured:
        case, sets, rounds = _with_later_colour(case, sets, rounds, options, steps, kinematics)
    if options.learns:
        rounds = with_increments(sets, rounds, case.effects, options.seed, steps, case.declared)
    if rounds:
        rounds = with_look_alikes(sets, rounds, case.effects, steps)
    else:
        raise LogError(
            f"the declared aircraft {case.fitted.records[0].plant.aircraft.name} does not fly like these records: its "
            "motion diverges; check units and signs with `airtruth check`, and that it is the right aircraft"
        )
    return (case if limited is None else replace(case, left_out=limited.left_out)), rounds


def _pruned_search(
    case: Case,
    sets: SetTable,
    start: Parameters,
    options: TraceOptions,
    advance: Advance,
    kinematics: CheckResult | None,
    other: Sequence[Effect] = (),
) -> tuple[SearchRound, ...]:
    """The rounds of a search without the names that later ones make unnecessary."""
    rounds = search(
        sets,
        case.hypothesis,
        start,
        case.effects,
        options.seed,
        advance,
        case.declared,
        starts_of(kinematics),
        other,
        sets_of(kinematics, _longest_period_s(case)),
    )
    return rounds and pruned(sets, rounds, case.effects, options.seed, LEVEL, advance)


def _longest_period_s(case: Case) -> float:
    """Longest sample period of the fitted records [s]."""
    return max(r.signals.dt_s for r in case.fitted.records)


def _with_later_colour(
    case: Case,
    sets: SetTable,
    rounds: tuple[SearchRound, ...],
    options: TraceOptions,
    advance: Advance,
    kinematics: CheckResult | None,
) -> tuple[Case, SetTable, tuple[SearchRound, ...]]:
    """The search again with correlated noise that shows beside what it explained, where that explains more.

    At the declared aircraft a strong effect drives correlated noise to its limits, and it does not enter. Correlated noise can
    imitate a share of an effect too, so that the effects of the first search are tried beside it.
    """
    level = later_level(sum(r.samples for r in case.fitted.records), len(case.fitted.settings.noise))
    coloured, point = beside(case, rounds[-1].null, level)
    phrase = "search with correlated noise"
    if not coloured.fitted.settings.coloured or not may_begin(advance, phrase):
        return case, sets, rounds
    slow = SetTable(coloured.fitted)
    start = replace(point, sizes=np.empty(0))
    accepted = rounds[-1].null.hypothesis.effects
    again = _pruned_search(coloured, slow, start, options, advance, kinematics, accepted)
    if not again:
        return case, sets, rounds
    if total_cost(again[-1]) < total_cost(rounds[-1]):
        return coloured, slow, with_rival(again, rounds)
    return case, sets, with_rival(rounds, again)


def _effects(options: TraceOptions) -> list[Effect]:
    """The requested candidates of the motion, each once; a name without a variant selects all of its variants.

    One that applies to no motion, such as an effect of a user on a channel of his own, is a candidate that cannot be tested.
    """
    motion = options.motion or LONGITUDINAL.name
    library = {key: effect for key, effect in EFFECTS.items() if motion in (effect.motions or (motion,))}
    if options.effects is None:
        return [effect for effect in library.values() if not effect.in_derivatives]
    found: dict[str, Effect] = {}
    for key in options.effects:
        if isinstance(key, Effect):
            found[key.key] = key
            continue
        matching = {k: e for k, e in library.items() if key in (k, e.name)}
        if not matching:
            known = {*library, *(e.name for e in library.values())}
            raise ConfigurationError(f"effect {key!r}: {choices(key, known)}")
        found |= {k: e for k, e in matching.items() if not e.in_derivatives}
    return list(found.values())


__all__ = ["provenance_of", "trace"]
