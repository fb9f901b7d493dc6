"""A trace or a loop as a task: it writes a folder, and the worker of a cluster can do it in place of this process."""

from __future__ import annotations

import pickle
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from airtruth.api.writing import trace_outputs
from airtruth.cluster import Cluster, LostWorkError
from airtruth.errors import AirtruthError, StoreError
from airtruth.isolation.interpreter import environment, module_command

if TYPE_CHECKING:
    from airtruth.aircraft import Aircraft
    from airtruth.tracing import TraceOptions


@dataclass(frozen=True)
class TraceTask:
    """A set of records to trace, and how.

    Attributes
    ----------
    logs : files and folders.
    aircraft : the declared aircraft.
    options : choices of the trace.
    out : folder of the outputs.
    force : continue although a log contradicts physics, and replace files of others.
    methods : estimators of a loop; None for a trace.
    """

    logs: tuple[Path, ...]
    aircraft: Aircraft
    options: TraceOptions
    out: Path
    force: bool = False
    methods: tuple[str, ...] | None = None

    @property
    def command(self) -> str:
        """Name of the command that the task performs."""
        return "trace" if self.methods is None else "loop"

    @property
    def answer(self) -> Path:
        """File of the result: trace.json or loop.json."""
        return self.out / f"{self.command}.json"

    @property
    def folders(self) -> tuple[str, ...]:
        """Folder of the answer of each motion within that of the task; empty for the task's own."""
        from airtruth.tracing.motions import parts_of

        return tuple(part.folder for part in parts_of(self.logs, self.aircraft, self.options))

    @property
    def answers(self) -> tuple[Path, ...]:
        """Files of the result that are there, that of a second motion in the folder of its name."""
        from airtruth.physics.motion import FOLDERS

        each = (self.answer, *(self.out / name / self.answer.name for name in FOLDERS[1:]))
        return tuple(path for path in each if path.is_file())


def perform(task: TraceTask, advance: Callable[[str], None] = lambda step: None) -> str:
    """Trace, or close the loop, into the folder of the task, and return the summary; the result depends on the task alone.

    Raises
    ------
    LogError, ConfigurationError, AircraftError, StoreError
        As `airtruth.tracing.trace` and `airtruth.loop.close_loop`.
    """
    with trace_outputs(task.command, task.logs, task.aircraft, task.out, force=task.force) as declared:
        if task.methods is None:
            from airtruth.reporting import draw_traces
            from airtruth.tracing import trace

            result = trace(task.logs, declared, task.options, task.out, task.force, advance, draw=draw_traces)
            return result.summary()
        from airtruth.loop import close_loop

        return close_loop(
            task.logs,
            declared,
            task.out,
            task.methods,
            trace_options=task.options,
            force=task.force,
            advance=advance,
        ).summary()


@dataclass(frozen=True)
class Ended:
    """How a task ended: with the summary of its result, or with an error."""

    summary: str
    error: AirtruthError | None = None


def attempt(task: TraceTask) -> Ended:
    """`perform`, which returns an error."""
    try:
        return Ended(perform(task))
    except AirtruthError as error:
        return Ended("", error)


@dataclass(frozen=True)
class Errand:
    """A task for a worker, and the folder in which the command was given."""

    folder: Path
    task: TraceTask


def attempted_on(cluster: Cluster, tasks: Iterable[TraceTask]) -> Iterator[tuple[TraceTask, Ended]]:
    """`attempt` each task on the workers of a cluster, which see the files under the same names.

    Every task has a process of its own in the folder of the command, so that its files are those of the same command
    without a cluster. Tasks come in the order of completion.

    Raises
    ------
    StoreError
        If the scheduler is lost.
    """
    here = Path.cwd()
    for errand, ended in cluster.completed(_in_child, (Errand(here, task) for task in tasks)):
        task = errand.task
        if isinstance(ended, LostWorkError):
            yield task, _lost(task)
        elif ended.error is None and not task.answer.is_file():
            yield (
                task,
                Ended(
                    "",
                    StoreError(
                        f"{task.answer}: a worker of the cluster has written this file, which does not appear here; use a folder "
                        "that all machines share under the same name"
                    ),
                ),
            )
        else:
            yield task, ended


def _lost(task: TraceTask) -> Ended:
    return Ended(
        "",
        StoreError(
            f"{task.out}: the processes of the cluster that did this {task.command} ended each time; give them more memory, or "
            "repeat the command without --cluster"
        ),
    )


def _in_child(errand: Errand) -> Ended:
    """`attempt` in a new process, which never imports a module from the folder of the command."""
    try:
        done = subprocess.run(
            module_command("airtruth.api.trace_child"),
            input=pickle.dumps(errand.task),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=errand.folder,
            env=environment(),
            check=False,
        )
    except FileNotFoundError:
        return Ended(
            "",
            StoreError(
                f"{errand.folder}: a worker of the cluster does not see this folder; use one that all machines share under the "
                "same name"
            ),
        )
    if done.returncode != 0:
        return _lost(errand.task)
    ended: Ended = pickle.loads(done.stdout)
    return ended


__all__ = ["Ended", "TraceTask", "attempt", "attempted_on", "perform"]
