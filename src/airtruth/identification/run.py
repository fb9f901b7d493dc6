"""Identify: logs in, estimates of the derivatives of a motion out.

`identify` checks logs and streams files; `identify_batch` and `identify_joint` estimate from arrays.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from airtruth import __version__
from airtruth import aircraft as planes
from airtruth.checks import poor
from airtruth.cluster import Cluster
from airtruth.errors import ConfigurationError
from airtruth.identification.batch import identify_batch, identify_joint
from airtruth.identification.condition import AircraftConstants, takes_constant
from airtruth.identification.declared_sensors import declared_words, taken_out
from airtruth.identification.doubts import changing_pressure, curvature, doubts, smoothed_airspeed
from airtruth.identification.estimates import Estimates, concatenated
from airtruth.identification.from_log import FromLog, LogTask, results_of
from airtruth.identification.lateral.methods import LINEAR
from airtruth.identification.loading import at_one_cg, mean_cg
from airtruth.identification.methods import Method, chosen_methods
from airtruth.identification.options import Options
from airtruth.identification.record_constants import EqualRuns, by_loading
from airtruth.identification.result import (
    IdentificationResult,
    IdentificationSettings,
    LogSource,
    SpooledResult,
    settings_of,
)
from airtruth.identification.spool import Spool
from airtruth.logs.owners import Owners
from airtruth.logs.sources import Logs, sources
from airtruth.physics.motion import LONGITUDINAL, Motion

Progress = Callable[[int, int, int], None]
"""Called with the number of logs done, of all logs, and of runs without a converged estimate."""


def identify(
    logs: Logs,
    aircraft: str | Path | AircraftConstants,
    methods: Sequence[str | Method] = ("iv-f1",),
    options: Options | None = None,
    *,
    joint: bool = False,
    force: bool = False,
    advance: Progress = lambda done, total, failed: None,
    cluster: Cluster | None = None,
    motion: Motion = LONGITUDINAL,
    excited: bool = False,
) -> IdentificationResult:
    """Check logs and estimate the derivatives of a motion: one row per run and method, or per method if joint.

    Files are read one at a time, so that the memory holds one log and the estimates; a joint estimate holds
    all runs. Mass, inertia and reference lengths that a log states for a run (``record_constants``) replace
    those of the aircraft. In a joint estimate they may differ; centres of gravity too (``cg_mac``), and the
    derivatives then refer to their mean (`airtruth.identification.loading`).

    Parameters
    ----------
    logs : a file, a folder, a log in memory, or several of these; runs may differ in length and rate.
    aircraft : folder or file of an aircraft, the name of a shipped one, or any object with wing_area_m2,
        chord_m, mass_kg, inertia_yy_kg_m2.
    methods : names of methods, keys of `airtruth.identification.METHODS`, or `Method` objects; one or a sequence.
    options : choices; None for the defaults.
    joint : whether all runs share one estimate.
    force : continue although a log contradicts physics; the result records the faults in ``forced``.
    advance : called after each method of each log with the number of those that are done, of all of them, and of the
        runs that did not converge.
    cluster : whose workers identify the logs, in place of this process; they see the files under the same names.
    motion : whose derivatives are estimated.
    excited : leave runs alone that do not excite the motion (`airtruth.identification.excited`).

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
    chosen = chosen_methods(methods, motion)
    made: list[Sequence[Estimates]] = []
    request = _Request(logs, aircraft, chosen, options or Options(), joint, force, motion, excited)
    work = _worked(made.append, request, advance, cluster)
    if joint:
        estimates = tuple(work.joint())
    else:
        run_ids = [run_id for one in made for run_id in one[0].run_ids]
        by_method = [list(parts) for parts in zip(*made, strict=True)]
        made.clear()
        # the parts of a method go before those of the next are joined
        estimates = tuple(concatenated(by_method.pop(0), run_ids) for _ in chosen)
    return IdentificationResult(
        estimates=estimates,
        settings=work.settings,
        notes=(*work.noted, *doubts(lambda: [estimates], work.dt_s)),
        forced=tuple(work.forced),
        version=__version__,
        sources=tuple(work.sources),
        logs=logs,
    )


@contextmanager
def identified(
    logs: Logs,
    aircraft: str | Path | AircraftConstants,
    methods: Sequence[str | Method] = ("iv-f1",),
    options: Options | None = None,
    *,
    joint: bool = False,
    force: bool = False,
    advance: Progress = lambda done, total, failed: None,
    cluster: Cluster | None = None,
    folder: Path | None = None,
    motion: Motion = LONGITUDINAL,
    excited: bool = False,
) -> Iterator[IdentificationResult | SpooledResult]:
    """Identify logs as `identify` does, with the estimates of single runs in a temporary file and not in memory.

    Parameters
    ----------
    logs, aircraft, methods, options, joint, force, advance, cluster, motion, excited : as in `identify`.
    folder : local folder of the temporary file; None for the system's.

    Yields
    ------
    IdentificationResult or SpooledResult
        The latter, of estimates run by run, is usable until the block ends.

    Raises
    ------
    StoreError, LogError, ConfigurationError
        As `identify`; or the temporary file cannot be written.
    """
    if joint:
        yield identify(
            logs,
            aircraft,
            methods,
            options,
            joint=True,
            force=force,
            advance=advance,
            cluster=cluster,
            motion=motion,
            excited=excited,
        )
        return
    chosen = chosen_methods(methods, motion)
    with Spool(folder) as spool:
        request = _Request(logs, aircraft, chosen, options or Options(), False, force, motion, excited)
        work = _worked(spool.add, request, advance, cluster)
        yield SpooledResult(
            parts=spool.parts,
            methods=tuple(one.name for one in chosen),
            settings=work.settings,
            notes=(*work.noted, *doubts(spool.parts, work.dt_s)),
            forced=tuple(work.forced),
            version=__version__,
            sources=tuple(work.sources),
        )


@dataclass(frozen=True)
class _Request:
    """A request for an identification: logs, aircraft and methods."""

    logs: Logs
    aircraft: str | Path | AircraftConstants
    methods: Sequence[Method]
    options: Options
    joint: bool
    force: bool
    motion: Motion
    excited: bool


def _worked(
    keep: Callable[[Sequence[Estimates]], None], asked: _Request, advance: Progress, cluster: Cluster | None
) -> _Work:
    """Identify each log, and pass its estimates to ``keep``."""
    if not asked.methods:
        raise ConfigurationError("identify needs at least one method, such as iv-f1")
    plane = planes.load(asked.aircraft) if isinstance(asked.aircraft, str | Path) else asked.aircraft
    entries = sources(asked.logs)
    steps, total = count(1), len(asked.methods) * (1 if asked.joint else len(entries))
    work = _Work(
        asked.methods,
        asked.options,
        settings_of(plane, asked.options, asked.joint, asked.motion),
        lambda failed: advance(next(steps), total, failed),
        keep,
        notes=declared_words(taken_out(plane, asked.motion)),
    )
    tasks = (
        LogTask(
            Path.cwd(),
            entry,
            asked.methods,
            asked.options,
            plane,
            asked.force,
            asked.joint,
            asked.motion,
            asked.excited,
        )
        for entry in entries
    )
    for log, found in results_of(tasks, work.estimated, cluster):
        work.add(log, found)
    return work


@dataclass
class _Work:
    """Accumulates what the logs give."""

    methods: Sequence[Method]
    options: Options
    settings: IdentificationSettings
    step: Callable[[int], None]
    keep: Callable[[Sequence[Estimates]], None]
    owners: Owners = field(default_factory=Owners)
    parts: list[EqualRuns] = field(default_factory=list)
    stated: dict[str, list[tuple[str, float, float]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    forced: list[str] = field(default_factory=list)
    sources: list[LogSource] = field(default_factory=list)
    noisy: list[str] = field(default_factory=list)
    changes: list[tuple[str, float]] = field(default_factory=list)
    curved: Counter[tuple[str, str]] = field(default_factory=Counter)
    measures: list[poor.RunMeasures] = field(default_factory=list)
    runs: int = 0
    failed: int = 0
    dt_s: float = 0.0

    def estimated(self, made: Estimates) -> None:
        """Count the estimates of a method from one log."""
        self.failed += int((~made.converged).sum())
        self.step(self.failed)

    def add(self, task: LogTask, found: FromLog) -> None:
        """Take over what one log gives.

        Raises
        ------
        LogError
            If a run was given before.
        """
        self.owners.add(task.entry, found.run_ids)
        for name, records in found.stated.items():
            self.stated.setdefault(name, []).extend(records)
        if found.estimates:
            self.keep([found.estimates[chosen.name] for chosen in self.methods])
        self.parts += found.parts
        self.notes += [note for note in found.notes if note not in self.notes]
        self.forced += found.forced
        self.dt_s = max(self.dt_s, found.dt_s)
        self.noisy += found.noisy
        self.changes += found.changes
        self.curved += found.curved
        self.measures += found.measures
        self.runs += len(found.run_ids)
        if found.origin is not None:
            self.sources.append(found.origin)

    @property
    def noted(self) -> tuple[str, ...]:
        """Doubts about the records, notes of the logs, differing constants, and sentences on airspeed and pressure."""
        constant = [m.name for m in self.methods if takes_constant(self.options, m.pose is not None)]
        return (
            *poor.words(self.measures),
            *self.notes,
            *_stated(self.stated),
            *smoothed_airspeed(self.noisy, self.runs),
            *changing_pressure(constant, self.changes, self.runs),
            *curvature([m.name for m in self.methods if m.name in LINEAR], self.curved, self.runs),
        )

    def joint(self) -> Iterator[Estimates]:
        """One estimate of each method from all logs."""
        groups = by_loading(self.parts)
        reference = mean_cg(groups)
        if reference is not None and len(groups) > 1:
            self.notes.append(
                f"the records have {len(groups)} centres of gravity: derivatives refer to cg_mac {reference:.4f}"
            )
        for chosen in self.methods:
            each = {
                cg: identify_joint(
                    [p.batch for p in parts],
                    [p.constants for p in parts],
                    chosen,
                    self.options,
                    self.settings.motion,
                )
                for cg, parts in groups.items()
            }
            yield at_one_cg(each, reference)
            self.step(self.failed)


def _stated(stated: dict[str, list[tuple[str, float, float]]]) -> Iterator[str]:
    """One sentence for each constant that records state differently from the aircraft."""
    for name, records in stated.items():
        run_id, own, declared = records[0]
        more = f" and {len(records) - 1} more" if len(records) > 1 else ""
        yield f"{name} of run {run_id!r}{more} as the log states it: {own:.6g}, not the aircraft's {declared:.6g}"


__all__ = ["Progress", "identified", "identify", "identify_batch", "identify_joint"]
