"""A trace of each motion that the records excite: which ones are answered, from which runs, and into which folder."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.checks.motions import missing_channels
from airtruth.effects.effect import Effect
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError
from airtruth.identification.excited import excited_motions, excited_runs
from airtruth.identification.record_constants import values_of
from airtruth.logs import atomic
from airtruth.logs.sources import Logs, named_logs
from airtruth.physics.motion import FOLDERS, LONGITUDINAL, MOTIONS, Motion
from airtruth.tracing.answer import ANSWER, TraceAnswer
from airtruth.tracing.budget import Advance
from airtruth.tracing.joint import SharedCause, jointly, sentences
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.result import TraceResult
from airtruth.tracing.run import answered, begun
from airtruth.tracing.update import Revision, write_update

Draw = Callable[[Mapping[Path, TraceResult]], None]
"""Draws each result into its folder."""


@dataclass(frozen=True)
class MotionTrace:
    """The trace of one motion.

    Attributes
    ----------
    motion : the motion.
    options : of the trace, the motion among them.
    folder : of its files within the folder of the command; empty for that folder itself.
    runs : runs that excite the motion, which alone are traced; None for all.
    notes : sentences on a motion that is not answered, without a final period.
    """

    motion: Motion
    options: TraceOptions
    folder: str = ""
    runs: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()

    def into(self, out: Path | None) -> Path | None:
        """Its folder; None where nothing is written."""
        return out if out is None or not self.folder else out / self.folder

    def named(self, advance: Advance) -> Advance:
        """Steps of a motion with a folder of its own, with its name."""
        return (lambda step: advance(f"{self.motion.name}: {step}")) if self.folder else advance


def parts_of(logs: Logs, aircraft: Aircraft, options: TraceOptions) -> tuple[MotionTrace, ...]:
    """The motions to answer, in the order of the answers.

    Of two motions each is traced from the runs that excite it. A motion whose constants the aircraft lacks, or on which no
    candidate acts, is left out where another one is answered.

    Parameters
    ----------
    logs, aircraft : as of `airtruth.tracing.trace`.
    options : choices; ``motion`` names one motion, or leaves the choice to the records.

    Raises
    ------
    StoreError, LogError, ConfigurationError
        If a log cannot be read, or the aircraft lacks a constant of the only motion.
    """
    if options.motion is not None:
        values_of(aircraft, MOTIONS[options.motion])
        return (MotionTrace(MOTIONS[options.motion], options),)
    found = excited_motions(logs)
    if found == (LONGITUDINAL,):
        return (MotionTrace(LONGITUDINAL, options),)
    kept, notes = [], []
    for motion in found:
        try:
            values_of(aircraft, motion)
        except ConfigurationError as error:
            if len(found) == 1:
                raise
            notes.append(
                f"the records excite the {motion.name} motion as well, which is not answered: {error}"
            )
            continue
        kept.append(motion)
    names = {m.name: _runs(logs, m) for m in kept}
    if len(kept) > 1:
        kept = [m for m in kept if names[m.name]] or kept[:1]
    asked = {m.name: _effects_of(m, options.effects) for m in kept}
    for motion in kept if any(asked.values()) else ():
        if asked[motion.name] == ():
            notes.append(
                f"the records excite the {motion.name} motion as well, which is not traced: no effect asked for acts on it"
            )
    kept = [m for m in kept if asked[m.name] != ()] or kept
    return tuple(
        MotionTrace(
            motion,
            replace(
                options,
                motion=motion.name,
                hold_out=_held(options.hold_out, names, names[motion.name]),
                effects=asked[motion.name] or options.effects,
            ),
            motion.name if number else "",
            names[motion.name] or None,
            tuple(notes),
        )
        for number, motion in enumerate(kept)
    )


def _effects_of(motion: Motion, effects: tuple[str | Effect, ...] | None) -> tuple[str | Effect, ...] | None:
    """The candidates that act on a motion; None for the library, and each name that no motion has, which a trace refuses."""
    if effects is None:
        return None

    def acts(effect: str | Effect) -> bool:
        every = (
            [effect]
            if isinstance(effect, Effect)
            else [e for e in EFFECTS.values() if effect in (e.key, e.name)]
        )
        return not every or any(motion.name in (e.motions or (motion.name,)) for e in every)

    return tuple(effect for effect in effects if acts(effect))


def _runs(logs: Logs, motion: Motion) -> tuple[str, ...]:
    """Runs that excite a motion and have its channels."""
    return tuple(
        run_id
        for _, log in named_logs(logs)
        if not missing_channels(log, motion)
        for run_id in excited_runs(log, motion)
    )


def _held(
    stated: tuple[str, ...] | None, every: dict[str, tuple[str, ...]], own: Collection[str]
) -> tuple[str, ...] | None:
    """The held-out runs that a motion has; a name that no motion has stays, to be refused."""
    if stated is None:
        return None
    known = {run for runs in every.values() for run in runs}
    return tuple(run for run in stated if run in own or run not in known)


def trace(
    logs: Logs,
    aircraft: str | Path | Aircraft,
    options: TraceOptions | None = None,
    out: Path | None = None,
    force: bool = False,
    advance: Advance = lambda step: None,
    draw: Draw = lambda results: None,
) -> TraceResult:
    """Trace the residual of flight logs to the effects that the declared aircraft lacks, for each motion that they excite.

    Parameters
    ----------
    logs, aircraft, options, force : as of `airtruth.tracing.run.trace`.
    out : folder of trace.json, the records and the updated aircraft; None to write nothing. Where both motions are answered,
        those of the lateral one are in the folder "lateral" within.
    advance : receives the step that begins; of a second motion with its name.
    draw : draws what is written, before trace.json makes the folder complete.

    Raises
    ------
    LogError, ConfigurationError, AircraftError, StoreError
        Naming what is wrong, where, and what to do.

    Examples
    --------
    >>> result = trace("data/undeclared/d.parquet", "gtm")  # doctest: +SKIP
    >>> result.answer.verdict  # doctest: +SKIP
    'one_of'
    """
    declared = aircraft if isinstance(aircraft, Aircraft) else planes.load(aircraft)
    parts = parts_of(logs, declared, options or TraceOptions())
    if out is not None:  # of an earlier command that answered more motions
        for stale in (out / name / ANSWER for name in FOLDERS[1:]):
            if stale.exists():
                atomic.remove_file(stale)
    folders = [part.into(out) for part in parts]
    first, *others = traced(logs, declared, parts, folders, force, advance, draw)
    return replace(first, others=tuple(others))


def traced(
    logs: Logs,
    aircraft: Aircraft,
    parts: Sequence[MotionTrace],
    folders: Sequence[Path | None],
    force: bool = False,
    advance: Advance = lambda step: None,
    draw: Draw = lambda results: None,
) -> tuple[TraceResult, ...]:
    """Trace each motion, with one size of each cause that acts in several, and write one updated aircraft.

    Parameters
    ----------
    parts : the motions, see `parts_of`; folders : of the files of each, None to write nothing. The updated aircraft is in the
        first.

    Raises
    ------
    LogError, ConfigurationError, AircraftError, StoreError
        As `trace`.
    """
    with threadpool_limits(limits=1, user_api="blas"):  # threads for small matrices wait for each other
        started = [
            begun(logs, aircraft, p.options, folder, force, p.named(advance), p.runs, p.notes)
            for p, folder in zip(parts, folders, strict=True)
        ]
        searches, causes = jointly([own.search for own in started])
        first, *others = (
            replace(own, search=search.finished()) for own, search in zip(started, searches, strict=True)
        )
        stated = {e.key for e in first.search.rounds[-1].null.hypothesis.effects}
        revisions: list[Revision] = []

        def collect(revision: Revision) -> None:
            revisions.append(revision)

        def write(revision: Revision) -> str | None:
            return None if folders[0] is None else write_update([revision, *revisions], aircraft, folders[0])

        rest = [answered(own, stated, collect) for own in others]
        results = [answered(first, (), write), *rest]
    told = [_with_causes(result, results[0].answer, causes) for result in results]
    written = {folder: result for result, folder in zip(told, folders, strict=True) if folder is not None}
    draw(written)
    for folder, result in written.items():
        result.write(folder)
    return tuple(told)


def _with_causes(result: TraceResult, first: TraceAnswer, causes: Sequence[SharedCause]) -> TraceResult:
    """A result with the one updated aircraft and the one size of each cause of both motions.

    It is provisional where their sizes contradict each other.

    Parameters
    ----------
    first : answer of the first motion, whose size of a cause is that by the records of both.
    """
    answer = result.answer
    common = {cause.effect.key for cause in causes if not cause.refused}
    sizes = {e.key: e.parameters for e in first.effects if e.key in common}
    effects = tuple(replace(e, parameters=sizes.get(e.key, e.parameters)) for e in answer.effects)
    told = replace(
        answer,
        effects=effects,
        provisional=answer.provisional or any(cause.refused for cause in causes),
        notes=(*sentences(causes), *answer.notes),
        updated_aircraft=first.updated_aircraft,
    )
    return replace(result, answer=told)


__all__ = ["MotionTrace", "parts_of", "trace", "traced"]
