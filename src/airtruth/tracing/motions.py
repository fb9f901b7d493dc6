"""A trace of each motion that the records excite: which ones are answered, from which runs, and into which folder."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.checks.motions import missing_channels
from airtruth.errors import ConfigurationError
from airtruth.identification.excited import excited_motions, excited_runs
from airtruth.identification.record_constants import values_of
from airtruth.logs import atomic
from airtruth.logs.sources import Logs, named_logs
from airtruth.physics.motion import FOLDERS, LONGITUDINAL, MOTIONS, Motion
from airtruth.tracing.answer import ANSWER
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.result import TraceResult
from airtruth.tracing.run import trace as trace_one
from airtruth.tracing.selection.budget import Advance


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

    Of two motions each is traced from the runs that excite it. A motion whose constants the aircraft lacks is left out where
    another one is answered.

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
    return tuple(
        MotionTrace(
            motion,
            replace(options, motion=motion.name, hold_out=_held(options.hold_out, names, names[motion.name])),
            motion.name if number else "",
            names[motion.name] or None,
            tuple(notes),
        )
        for number, motion in enumerate(kept)
    )


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
) -> TraceResult:
    """Trace the residual of flight logs to the effects that the declared aircraft lacks, for each motion that they excite.

    Parameters
    ----------
    logs, aircraft, options, force : as of `airtruth.tracing.run.trace`.
    out : folder of trace.json, the figures and the updated aircraft; None to write nothing. Where both motions are answered,
        those of the lateral one are in the folder "lateral" within.
    advance : receives the step that begins; of a second motion with its name.

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
    first, *others = [
        trace_one(
            logs,
            declared,
            part.options,
            part.into(out),
            force,
            part.named(advance),
            part.runs,
            part.notes,
        )
        for part in parts
    ]
    return replace(first, others=tuple(others))


__all__ = ["MotionTrace", "parts_of", "trace"]
