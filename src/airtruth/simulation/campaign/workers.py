"""Fly chunks in child processes, and tell a run that kills its process from a process that was killed.

A run during which the process dies twice by a fault (a segmentation fault, an abort, an exit, whatever its code) or reaches
the limit of memory that it imposed on itself has failed, and so has a run that exceeds the computing time of any run. A
process that was killed from outside, or that lacks memory, says nothing about its runs: its chunk is flown again, and after
`ATTEMPTS` deaths it is left to the next command.
"""

from __future__ import annotations

import json
import os
import pickle
import selectors
import signal
import subprocess
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

from airtruth import errors
from airtruth.errors import StoreError
from airtruth.isolation.interpreter import environment, module_command
from airtruth.logs.atomic import write_error
from airtruth.simulation.campaign.chunk import INTERRUPTED, ChunkOrder, FlownChunk, Outcome
from airtruth.simulation.campaign.plan import Plan, chunk_runs
from airtruth.simulation.campaign.worker import encoded
from airtruth.simulation.disposable import limits_of

ATTEMPTS: Final = 3
"""Times that a chunk is flown whose process is killed from outside (judgement: one for a kill, more for a lack of
memory that passes)."""
CRASHES: Final = 2
"""Times that a run ends its process before it counts as failed (judgement: the second time it is the run alone)."""
QUEUED: Final = 2
"""Chunks that a worker holds (judgement: the next one, so that it does not wait while the parent writes)."""
_READ_BYTES: Final = 1 << 16
"""Bytes that are read from a worker at once [-] (the size of a pipe)."""
FAULTS: Final = frozenset(
    number
    for name in ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE", "SIGILL", "SIGTRAP", "SIGSYS", "SIGXCPU")
    if (number := getattr(signal, name, None)) is not None
)
"""Signals that a process causes itself; the others come from outside."""
_ENDLESS: Final = getattr(signal, "SIGPROF", None)
"""Signal of a process whose run exceeds its computing time; a second flight would do the same."""
ONE_THREAD: Final = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Environment of a worker: the runs are what is parallel, and each thread of a library reserves memory."""


@dataclass
class _Task:
    """A chunk to fly: deaths of its process by fault of no run, and deaths by each run."""

    order: ChunkOrder
    deaths: int = 0
    crashes: dict[str, int] = field(default_factory=dict)
    crashed: dict[str, str] = field(default_factory=dict)


@dataclass
class _Worker:
    """A child process, its chunks in order, the run that it flies, and the unfinished line that it wrote."""

    process: subprocess.Popen[bytes]
    tasks: deque[_Task] = field(default_factory=deque)
    run_id: str | None = None
    rest: bytes = b""
    memory: Literal["", "system", "own"] = ""

    @property
    def output(self) -> int:
        """File descriptor of its answers."""
        assert self.process.stdout is not None
        return self.process.stdout.fileno()

    def send(self, content: bytes) -> None:
        """Write to the worker; a dead one is noticed when its output ends."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(content)
            self.process.stdin.flush()
        except BrokenPipeError:
            return

    def close(self) -> int:
        """End the process and return its exit code."""
        self.process.kill() if self.process.poll() is None else None
        for stream in (self.process.stdin, self.process.stdout):
            assert stream is not None
            try:
                stream.close()
            except BrokenPipeError:
                continue
        return self.process.wait()


def fly_chunks(
    plan: Plan, chunks: list[int], logs: Path, truths: Path, jobs: int
) -> Generator[FlownChunk, None, None]:
    """Fly chunks in ``jobs`` processes; yield each once its files are complete, in the order in which they end.

    Parameters
    ----------
    plan : the campaign.
    chunks : numbers of the chunks.
    logs, truths : folders of their files.
    jobs : number of processes.

    Raises
    ------
    StoreError
        If a file cannot be written or a process cannot be started.
    """
    crew = _Crew(plan, (logs.absolute(), truths.absolute()), orders_of(plan, chunks))
    try:
        crew.start(min(jobs, len(chunks)))
        while crew.workers:
            yield from crew.ended()
    finally:
        crew.close()


def orders_of(plan: Plan, chunks: Iterable[int]) -> Iterator[ChunkOrder]:
    """The chunks with their runs, one at a time: the memory does not hold all runs of a campaign twice."""
    return (ChunkOrder(chunk, tuple(chunk_runs(plan, chunk))) for chunk in chunks)


def without_table(plan: Plan) -> Plan:
    """The plan without its runs: all that a process needs beside the orders."""
    return replace(plan, table=plan.table.iloc[:0])


class ResidentProcess:
    """A child process that flies one chunk after another; a run that ends it is one failed run.

    Parameters
    ----------
    plan : the campaign, whose table is not read; logs, truths : absolute folders of the files.
    """

    def __init__(self, plan: Plan, logs: Path, truths: Path) -> None:
        self._crew = _Crew(plan, (logs, truths), iter(()), resident=True)

    def fly(self, order: ChunkOrder) -> FlownChunk:
        """Fly one chunk.

        Raises
        ------
        StoreError
            If a file cannot be written or a process cannot be started.
        """
        self._crew.resume(order)
        while True:
            for flown in self._crew.ended():
                return flown

    def close(self) -> None:
        """End the process."""
        self._crew.close()


class _Crew:
    """The workers of one campaign and the chunks that wait for them; resident ones wait for further chunks."""

    def __init__(
        self,
        plan: Plan,
        folders: tuple[Path, Path],
        orders: Iterator[ChunkOrder],
        resident: bool = False,
    ) -> None:
        self.start_message = pickle.dumps((without_table(plan), *folders))
        self.allowed_s = limits_of(plan.samples).seconds
        self.orders = orders
        self.again: deque[_Task] = deque()
        self.resident = resident
        self.workers: list[_Worker] = []
        self.selector = selectors.DefaultSelector()

    def start(self, count: int) -> None:
        """Start processes, then send each its first chunks: they load their modules side by side."""
        new = [self._process() for _ in range(count)]
        for worker in new:
            worker.send(self.start_message)
            self._feed(worker)

    def resume(self, order: ChunkOrder) -> None:
        """Send a further order to the first process, or start one."""
        self.again.append(_Task(order))
        if self.workers:
            self._feed(self.workers[0])
        else:
            self.start(1)

    def ended(self) -> Generator[FlownChunk, None, None]:
        """Wait for answers; yield the chunks that ended."""
        for key, _ in self.selector.select():
            worker: _Worker = key.data
            content = os.read(worker.output, _READ_BYTES)
            if not content:
                yield from self._died(worker)
                continue
            *lines, worker.rest = (worker.rest + content).split(b"\n")
            for line in lines:
                yield from self._heard(worker, json.loads(line))

    def close(self) -> None:
        """End all processes."""
        for worker in self.workers:
            worker.close()
        self.workers.clear()
        self.selector.close()

    def _process(self) -> _Worker:
        command = module_command("airtruth.simulation.campaign.worker")
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=environment(**ONE_THREAD),
            )
        except OSError as error:
            step = str(write_error(Path("process"), error)).partition("; ")[2]
            raise StoreError(
                f"a process that flies the runs cannot be started: {step}, or use fewer --jobs"
            ) from None
        worker = _Worker(process)
        self.workers.append(worker)
        self.selector.register(worker.output, selectors.EVENT_READ, worker)
        return worker

    def _feed(self, worker: _Worker) -> None:
        while len(worker.tasks) < QUEUED:
            task = self._next_task()
            if task is None:
                break
            worker.tasks.append(task)
            worker.send(encoded(task.order, task.crashed))
        if not worker.tasks and not self.resident:
            self._dismiss(worker)

    def _next_task(self) -> _Task | None:
        """A chunk whose process died, else the next that was never flown; None where nothing is left."""
        if self.again:
            return self.again.popleft()
        order = next(self.orders, None)
        return None if order is None else _Task(order)

    def _dismiss(self, worker: _Worker) -> int:
        self.selector.unregister(worker.output)
        self.workers.remove(worker)
        return worker.close()

    def _heard(self, worker: _Worker, event: dict[str, Any]) -> Generator[FlownChunk, None, None]:
        kind = event.pop("event")
        if kind == "starts":
            worker.run_id = event["run_id"]
        elif kind == "ended":
            worker.run_id = None
            worker.tasks.popleft()
            unflown = tuple(Outcome(**outcome) for outcome in event.pop("unflown"))
            yield FlownChunk(unflown=unflown, **event)
            self._feed(worker)
        elif kind == "memory":
            worker.memory = "own" if event["own"] else "system"
        elif kind == "error":
            raise getattr(errors, event["kind"], StoreError)(event["message"])
        else:
            raise RuntimeError(f"a process that flies runs failed:\n{event['message']}")

    def _died(self, worker: _Worker) -> Generator[FlownChunk, None, None]:
        """Queue the chunks of a dead process again, or give the first of them up."""
        code = self._dismiss(worker)
        task = worker.tasks[0]
        how = _how(code) if not worker.memory else "ran out of memory"
        by_run = worker.memory == "own" if worker.memory else code >= 0 or -code in FAULTS
        if worker.run_id is not None and -code == _ENDLESS:
            task.crashed[worker.run_id] = (
                f"the flight does not end within {self.allowed_s:.0f} s of computing time"
            )
        elif worker.run_id is not None and by_run:
            count = task.crashes[worker.run_id] = task.crashes.get(worker.run_id, 0) + 1
            if count >= CRASHES:
                task.crashed[worker.run_id] = f"the flight ends its process each time ({how})"
        else:
            task.deaths += 1
        if task.deaths >= ATTEMPTS:
            worker.tasks.popleft()
            yield self._given_up(task, how)
        self.again.extendleft(reversed(worker.tasks))
        if self.again:
            self.start(1)

    def _given_up(self, task: _Task, how: str) -> FlownChunk:
        reason = (
            f"the process that flew this chunk of runs ended {ATTEMPTS} times (last: {how}); the same command flies "
            "it again, with fewer --jobs if memory is short"
        )
        return interrupted(task.order, reason)


def interrupted(order: ChunkOrder, reason: str) -> FlownChunk:
    """A chunk that no process could fly, for a reason that says nothing about its runs."""
    unflown = tuple(Outcome(run.run_id, INTERRUPTED, reason) for run in order.runs)
    return FlownChunk(order.chunk, len(unflown), unflown, None, None)


def _how(code: int) -> str:
    """The end of a process in words."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
