"""Identification of one log: the unit of work, in this process or on a cluster."""

from __future__ import annotations

import hashlib
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.checks import gate, poor
from airtruth.checks.airspeed import is_noisy, speeds
from airtruth.cluster import Cluster, LostWorkError
from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.identification.batch import identify_batch
from airtruth.identification.checks import airspeed_fault, check_channels, fit_runs
from airtruth.identification.condition import AircraftConstants, pressure_range
from airtruth.identification.declared_sensors import as_ideal, taken_out
from airtruth.identification.doubts import CHANGES
from airtruth.identification.estimates import Estimates, concatenated
from airtruth.identification.excited import excited_runs
from airtruth.identification.lateral.methods import curvature_of
from airtruth.identification.lateral.observation import assumed
from airtruth.identification.lateral_inputs import ROLLS, beside_lateral
from airtruth.identification.methods import Method
from airtruth.identification.options import Options
from airtruth.identification.record_constants import EqualRuns, differing, with_constants
from airtruth.identification.result import LogSource
from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.logs.sources import IN_MEMORY
from airtruth.logs.store import read_log
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion


@dataclass(frozen=True)
class LogTask:
    """One log to identify, and how; a file is relative to ``folder``, since a worker has another working folder.

    With ``excited`` the runs that do not excite the motion are left alone.
    """

    folder: Path
    entry: Path | FlightLog
    methods: Sequence[Method]
    options: Options
    plane: AircraftConstants
    force: bool
    joint: bool
    motion: Motion = LONGITUDINAL
    excited: bool = False

    @property
    def source(self) -> str:
        """Where the log is from, for messages."""
        return str(self.entry) if isinstance(self.entry, Path) else IN_MEMORY


@dataclass
class FromLog:
    """Result of one log: its runs and notes, the estimates of each method, or the parts of a joint estimate.

    ``dt_s`` is its longest sample period [s]; ``noisy`` are the runs whose airspeed is smoothed; ``changes`` are the runs whose
    `pressure_range` exceeds `CHANGES`, with it. ``curved`` counts the runs that show a nonlinear term of a coefficient;
    ``measures`` are those of `airtruth.checks.poor`.
    """

    run_ids: tuple[str, ...]
    dt_s: float = 0.0
    noisy: list[str] = field(default_factory=list)
    changes: list[tuple[str, float]] = field(default_factory=list)
    measures: list[poor.RunMeasures] = field(default_factory=list)
    origin: LogSource | None = None
    parts: list[EqualRuns] = field(default_factory=list)
    estimates: dict[str, Estimates] = field(default_factory=dict)
    stated: dict[str, list[tuple[str, float, float]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    forced: list[str] = field(default_factory=list)
    curved: Counter[tuple[str, str]] = field(default_factory=Counter)


def results_of(
    tasks: Iterable[LogTask], estimated: Callable[[Estimates], None], cluster: Cluster | None
) -> Iterator[tuple[LogTask, FromLog]]:
    """Return each task with what its log gives, in the order of the tasks.

    Parameters
    ----------
    tasks : the logs.
    estimated : called with the estimates of each method from each log.
    cluster : whose workers identify the logs; None for this process.

    Raises
    ------
    StoreError
        If the workers of a log end each time, or a file cannot be read.
    LogError, ConfigurationError
        If a log cannot be identified.
    """
    if cluster is None:
        for task in tasks:
            yield task, from_log(task, estimated)
        return
    early: dict[str, FromLog] = {}
    order: deque[LogTask] = deque()

    def noted() -> Iterator[LogTask]:
        for task in tasks:
            order.append(task)
            yield task

    for task, found in cluster.completed(from_log, noted()):
        if isinstance(found, LostWorkError):
            raise StoreError(
                f"{task.source}: the workers of the cluster that identified this log ended each time; give them more memory, "
                "or identify it without --cluster"
            )
        for made in found.estimates.values():
            estimated(made)
        early[task.source] = found
        while order and order[0].source in early:
            following = order.popleft()
            yield following, early.pop(following.source)


def from_log(task: LogTask, estimated: Callable[[Estimates], None] = lambda made: None) -> FromLog:
    """Read and check one log, and estimate from it unless the estimate is joint.

    ``estimated`` receives the estimates of each method.
    """
    entry = task.entry
    log = read_log(task.folder / entry) if isinstance(entry, Path) else entry
    if task.excited:
        log = log.select(excited_runs(log, task.motion))
    found = FromLog(tuple(log.run_ids))
    if not found.run_ids:
        return found
    log = _checked(log, task, found)
    quiet = _quiet if task.motion is LONGITUDINAL else _as_measured
    try:
        log, left_out = fit_runs(log, task.options, task.motion)
        found.notes += left_out
        found.run_ids = tuple(log.run_ids)
        for run_id, name, own, declared in differing(log.metadata, log.run_ids, task.plane):
            found.stated.setdefault(name, []).append((run_id, own, declared))
        servo_s = task.plane.servo_time_s if isinstance(task.plane, Aircraft) else 0.0
        taken = taken_out(task.plane, task.motion)
        if task.motion is LATERAL:
            found.notes += assumed(log.channels)
        parts = [
            replace(p, batch=replace(as_ideal(quiet(p.batch, found), taken), servo_s=servo_s))
            for p in with_constants(log, task.plane, task.motion)
        ]
        if task.motion is LATERAL:
            found.curved = curvature_of(parts, task.options)
        else:
            parts = [replace(p, batch=beside_lateral(p.batch, p.constants, task.options)) for p in parts]
            if any(p.batch.known_rates is not None for p in parts):
                found.notes.append(ROLLS)
        for part in parts:
            found.dt_s = max(found.dt_s, part.batch.dt_s)
            if task.motion is LONGITUDINAL and len(found.measures) < poor.MOST_RUNS:
                found.measures += poor.measured(part.batch)
            ranges = zip(part.batch.run_ids, pressure_range(part.batch).tolist(), strict=True)
            found.changes += [(run_id, changed) for run_id, changed in ranges if changed > CHANGES]
    except LogError as error:
        raise LogError(f"{task.source}: {error}" if isinstance(entry, Path) else str(error)) from None
    if isinstance(entry, Path):
        with (task.folder / entry).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        found.origin = LogSource(entry.name, digest, len(log.run_ids))
    if task.joint:
        found.parts = parts
        return found
    for chosen in task.methods:
        made = [identify_batch(p.batch, p.constants, chosen, task.options, task.motion) for p in parts]
        found.estimates[chosen.name] = concatenated(made, log.run_ids)
        estimated(found.estimates[chosen.name])
    return found


def _as_measured(batch: Batch, found: FromLog) -> Batch:
    """The runs as they are: the lateral estimators low-pass the airspeed."""
    return batch


def _quiet(batch: Batch, found: FromLog) -> Batch:
    """The runs with smoothed airspeeds where their noise would move the dynamic pressure."""
    airspeed = batch.channels["airspeed_m_s"]
    noisy = np.flatnonzero(is_noisy(airspeed, batch.dt_s)).tolist()
    if not noisy:
        return batch
    airspeed = airspeed.copy()
    for run in noisy:
        own = {name: values[run] for name, values in batch.channels.items()}
        airspeed[run] = speeds(own, batch.dt_s).quiet.speed_m_s
    found.noisy += [batch.run_ids[run] for run in noisy]
    return replace(batch, channels={**batch.channels, "airspeed_m_s": airspeed})


def _checked(log: FlightLog, task: LogTask, found: FromLog) -> FlightLog:
    """The log behind the gate and the checks of the methods, without odd runs."""
    source = task.source if isinstance(task.entry, Path) else ""
    known = task.plane if isinstance(task.plane, Aircraft) else None
    admitted = gate.admit(log, known, source=source, force=task.force)
    log = admitted.log
    found.notes += admitted.left_out
    for fault in admitted.faults:
        (found.forced if fault.certain else found.notes).append(fault.sentence)
    prefix = f"{source}: " if source else ""
    try:
        check_channels(log, task.methods, task.motion)
    except LogError as error:
        raise LogError(f"{prefix}{error}") from None
    sentence = airspeed_fault(log, task.options)
    if sentence is not None:
        if not task.force:
            raise ConfigurationError(f"{prefix}{sentence}")
        found.forced.append(f"{prefix}{sentence}")
    return log


__all__ = ["FromLog", "LogTask", "from_log", "results_of"]
