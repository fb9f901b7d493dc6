"""Identify: logs in, estimates of the six derivatives out.

`identify` checks logs and streams files; `identify_batch` and `identify_joint` estimate from arrays.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from airtruth import __version__
from airtruth import aircraft as planes
from airtruth.aircraft import Aircraft
from airtruth.checks import gate
from airtruth.cluster import Cluster, LostWorkError
from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.identification.checks import airspeed_fault, check_batch, check_channels
from airtruth.identification.condition import AircraftConstants, OneOrEach
from airtruth.identification.doubts import doubts
from airtruth.identification.estimates import Estimates, concatenated
from airtruth.identification.loading import at_one_cg, mean_cg
from airtruth.identification.methods import Method, method, regression
from airtruth.identification.options import Options
from airtruth.identification.reconstructed import with_reconstruction
from airtruth.identification.record_constants import Part, by_loading, differing, with_constants
from airtruth.identification.regression.solve import regress_batch, regress_joint
from airtruth.identification.result import IdentificationResult, Source, settings_of
from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.logs.sources import IN_MEMORY, Logs, sources
from airtruth.logs.store import read_log

Progress = Callable[[int, int, int], None]
"""Called with the number of logs done, of all logs, and of runs without a converged estimate."""


def identify_batch(
    batch: Batch, constants: AircraftConstants, name: str, options: Options | None = None
) -> Estimates:
    """Estimate the six derivatives of each run; nothing is checked.

    A result does not depend on the other runs of the batch.

    Parameters
    ----------
    batch : runs of one length and sample period, as `airtruth.logs.flight_log.batches` makes them.
    constants : aircraft, any object with wing_area_m2, chord_m, mass_kg, inertia_yy_kg_m2.
    name : method, a key of `airtruth.identification.METHODS`.
    options : choices; None for the defaults.

    Raises
    ------
    ConfigurationError
        If the method does not exist.
    """
    chosen = method(name)

    def estimate(parts: Sequence[Batch], options: Options) -> Estimates:
        if chosen.estimate is not None:
            return chosen.estimate(parts[0], constants, options)
        pose = regression(chosen) if chosen.iterates else None
        return regress_batch(parts[0], constants, name, pose, options)

    return with_reconstruction(estimate, [batch], options or Options())


def identify_joint(
    parts: Sequence[Batch], constants: OneOrEach, name: str, options: Options | None = None
) -> Estimates:
    """One estimate for all runs together; nothing is checked.

    The normal equations of all runs are summed. Trim, flight condition and filters remain each run's own.
    All runs are held in memory.

    Parameters
    ----------
    parts : batches; lengths and rates may differ.
    constants : of all batches, or one entry for each: mass and inertia may differ.
    name, options : as in `identify_batch`.

    Raises
    ------
    ConfigurationError
        If the method does not exist.
    """
    chosen = method(name)

    def estimate(parts: Sequence[Batch], options: Options) -> Estimates:
        if chosen.estimate_joint is not None:
            return chosen.estimate_joint(parts, constants, options)
        pose = regression(chosen) if chosen.iterates else None
        return regress_joint(parts, constants, name, pose, options)

    return with_reconstruction(estimate, parts, options or Options())


def identify(
    logs: Logs,
    aircraft: str | Path | AircraftConstants,
    methods: Sequence[str] = ("iv-f1",),
    options: Options | None = None,
    *,
    joint: bool = False,
    force: bool = False,
    advance: Progress = lambda done, total, failed: None,
    cluster: Cluster | None = None,
) -> IdentificationResult:
    """Check logs and estimate the six derivatives: one row per run and method, or per method if joint.

    Files are read one at a time, so that the memory holds one log and the estimates; a joint estimate holds
    all runs. Mass, inertia and reference lengths that a log states for a run (``record_constants``) replace
    those of the aircraft. In a joint estimate they may differ; centres of gravity too (``cg_mac``), and the
    derivatives then refer to their mean (`airtruth.identification.loading`).

    Parameters
    ----------
    logs : a file, a folder, a log in memory, or several of these; runs may differ in length and rate.
    aircraft : folder or file of an aircraft, the name of a shipped one, or any object with wing_area_m2,
        chord_m, mass_kg, inertia_yy_kg_m2.
    methods : names of methods, keys of `airtruth.identification.METHODS`.
    options : choices; None for the defaults.
    joint : whether all runs share one estimate.
    force : continue although a log contradicts physics; the result records the faults in ``forced``.
    advance : called after each method of each log with the number of those that are done, of all of them, and of the
        runs that did not converge.
    cluster : whose workers identify the logs, in place of this process; they see the files under the same names.

    Raises
    ------
    StoreError
        If a file or folder cannot be read.
    LogError
        Naming the log, run and channel that cannot be identified, or a run that is given twice.
    ConfigurationError
        If a method does not exist, an option does not fit the log, or runs of a joint estimate state
        different reference lengths.

    Examples
    --------
    >>> from airtruth.identification import identify
    >>> result = identify("data/undeclared/a.parquet", "gtm", ["ls"])
    >>> result.to_frame().loc[0, ["run_id", "method", "converged"]].tolist()
    ['r1', 'ls', True]
    """
    options = options or Options()
    chosen = [method(name) for name in dict.fromkeys(methods)]
    if not chosen:
        raise ConfigurationError("identify needs at least one method")
    plane = planes.load(aircraft) if isinstance(aircraft, str | Path) else aircraft
    entries = sources(logs)
    steps, total = count(1), len(chosen) * (1 if joint else len(entries))
    work = _Work(chosen, options, lambda failed: advance(next(steps), total, failed))
    tasks = (_Task(Path.cwd(), entry, chosen, options, plane, force, joint) for entry in entries)
    for log, found in _found(tasks, work, cluster):
        work.add(log, found)
    estimates = tuple(work.finished(joint))
    return IdentificationResult(
        estimates=estimates,
        settings=settings_of(plane, options, joint),
        notes=(*work.notes, *_stated(work.stated), *doubts(estimates)),
        forced=tuple(work.forced),
        version=__version__,
        sources=tuple(work.sources),
        logs=logs,
    )


@dataclass(frozen=True)
class _Task:
    """One log to identify, and how; a file is relative to ``folder``, since a worker has another working folder."""

    folder: Path
    entry: Path | FlightLog
    methods: Sequence[Method]
    options: Options
    plane: AircraftConstants
    force: bool
    joint: bool

    @property
    def source(self) -> str:
        """Where the log is from, for messages."""
        return str(self.entry) if isinstance(self.entry, Path) else IN_MEMORY


@dataclass
class _FromLog:
    """What one log gives: its runs and notes, the estimates of each method, or the parts of a joint estimate."""

    run_ids: tuple[str, ...]
    origin: Source | None = None
    parts: list[Part] = field(default_factory=list)
    estimates: dict[str, Estimates] = field(default_factory=dict)
    stated: dict[str, list[tuple[str, float, float]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    forced: list[str] = field(default_factory=list)


def _found(tasks: Iterable[_Task], work: _Work, cluster: Cluster | None) -> Iterator[tuple[_Task, _FromLog]]:
    """Each task with what its log gives, in the order of the tasks."""
    if cluster is None:
        for task in tasks:
            yield task, _from_log(task, work.estimated)
        return
    early: dict[str, _FromLog] = {}
    order: deque[_Task] = deque()

    def noted() -> Iterator[_Task]:
        for task in tasks:
            order.append(task)
            yield task

    for task, found in cluster.completed(_from_log, noted()):
        if isinstance(found, LostWorkError):
            raise StoreError(
                f"{task.source}: the workers of the cluster that identified this log ended each time; give them more memory, "
                "or identify it without --cluster"
            )
        for made in found.estimates.values():
            work.estimated(made)
        early[task.source] = found
        while order and order[0].source in early:
            following = order.popleft()
            yield following, early.pop(following.source)


def _from_log(task: _Task, estimated: Callable[[Estimates], None] = lambda made: None) -> _FromLog:
    """Read and check one log, and estimate from it unless the estimate is joint.

    ``estimated`` receives the estimates of each method.
    """
    entry = task.entry
    log = read_log(task.folder / entry) if isinstance(entry, Path) else entry
    found = _FromLog(tuple(log.run_ids))
    _check(log, task, found)
    try:
        for run_id, name, own, declared in differing(log.metadata, log.run_ids, task.plane):
            found.stated.setdefault(name, []).append((run_id, own, declared))
        parts = list(with_constants(log, task.plane))
        for part in parts:
            check_batch(part.batch, task.options)
    except LogError as error:
        raise LogError(f"{task.source}: {error}" if isinstance(entry, Path) else str(error)) from None
    if isinstance(entry, Path):
        with (task.folder / entry).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        found.origin = Source(entry.name, digest, len(log.run_ids))
    if task.joint:
        found.parts = parts
        return found
    for chosen in task.methods:
        made = [identify_batch(p.batch, p.constants, chosen.name, task.options) for p in parts]
        found.estimates[chosen.name] = concatenated(made, log.run_ids)
        estimated(found.estimates[chosen.name])
    return found


def _check(log: FlightLog, task: _Task, found: _FromLog) -> None:
    source = task.source if isinstance(task.entry, Path) else ""
    known = task.plane if isinstance(task.plane, Aircraft) else None
    for fault in gate.require(log, known, source=source, force=task.force):
        (found.forced if fault.certain else found.notes).append(fault.sentence)
    prefix = f"{source}: " if source else ""
    try:
        check_channels(log, task.methods)
    except LogError as error:
        raise LogError(f"{prefix}{error}") from None
    sentence = airspeed_fault(log, task.options)
    if sentence is not None:
        if not task.force:
            raise ConfigurationError(f"{prefix}{sentence}")
        found.forced.append(f"{prefix}{sentence}")


@dataclass
class _Work:
    """Accumulates what the logs give."""

    methods: Sequence[Method]
    options: Options
    step: Callable[[int], None]
    runs: dict[str, str] = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)
    estimates: dict[str, list[Estimates]] = field(default_factory=dict)
    stated: dict[str, list[tuple[str, float, float]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    forced: list[str] = field(default_factory=list)
    sources: list[Source] = field(default_factory=list)
    failed: int = 0

    def estimated(self, made: Estimates) -> None:
        """Count the estimates of a method from one log."""
        self.failed += int((~made.converged).sum())
        self.step(self.failed)

    def add(self, task: _Task, found: _FromLog) -> None:
        """Take over what one log gives.

        Raises
        ------
        LogError
            If a run was given before.
        """
        for run_id in found.run_ids:
            if run_id in self.runs:
                raise LogError(
                    f"run {run_id!r} is in {self.runs[run_id]} and in {task.source}; give each run once, or rename one"
                )
        self.runs |= dict.fromkeys(found.run_ids, task.source)
        for name, records in found.stated.items():
            self.stated.setdefault(name, []).extend(records)
        for name, made in found.estimates.items():
            self.estimates.setdefault(name, []).append(made)
        self.parts += found.parts
        self.notes += found.notes
        self.forced += found.forced
        if found.origin is not None:
            self.sources.append(found.origin)

    def finished(self, joint: bool) -> Iterator[Estimates]:
        """Estimates of each method over all logs."""
        if joint:
            groups = by_loading(self.parts)
            reference = mean_cg(groups)
            if reference is not None and len(groups) > 1:
                self.notes.append(
                    f"the records have {len(groups)} centres of gravity: derivatives refer to cg_mac {reference:.4f}"
                )
            for chosen in self.methods:
                each = {
                    cg: identify_joint(
                        [p.batch for p in parts], [p.constants for p in parts], chosen.name, self.options
                    )
                    for cg, parts in groups.items()
                }
                yield at_one_cg(each, reference)
                self.step(self.failed)
            return
        run_ids = tuple(self.runs)
        while self.estimates:  # the parts of a method go before those of the next are joined
            yield concatenated(self.estimates.pop(next(iter(self.estimates))), run_ids)


def _stated(stated: dict[str, list[tuple[str, float, float]]]) -> Iterator[str]:
    """One sentence for each constant that records state differently from the aircraft."""
    for name, records in stated.items():
        run_id, own, declared = records[0]
        more = f" and {len(records) - 1} more" if len(records) > 1 else ""
        yield f"{name} of run {run_id!r}{more} as the log states it: {own:.6g}, not the aircraft's {declared:.6g}"


__all__ = ["Progress", "identify", "identify_batch", "identify_joint"]
