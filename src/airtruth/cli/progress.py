"""Progress of a command on stderr, with the time that remains."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.progress import Progress, Task
    from rich.text import Text

LOGGER: Final = logging.getLogger("airtruth")
"""Logger of the package."""
TRACE_STEPS: Final = (
    ("probe", 0.1),
    ("check the kinematics", 0.9),
    ("refit the declared aircraft", 0.5),
    ("refit", 4.0),
    ("score the effects", 2.0),
    ("learn", 2.0),
    ("refit increment", 4.0),
    ("assess", 0.7),
    ("compare", 0.8),
    ("write", 2.0),
)
"""Steps of a trace in their order, by their first words, and the time of each [s] (judgement: rounded times of a trace of
data/undeclared/h, which accepts two effects). Only the ratios matter. A search that accepts none ends earlier than they state."""
LOOP_STEPS: Final = (
    ("identify before", 1.0),
    *TRACE_STEPS,
    ("identify after", 0.5),
    ("identify simulated", 1.0),
)
"""The same of a loop."""


def steps_of(steps: Sequence[tuple[str, float]], folders: Sequence[str]) -> tuple[tuple[str, float], ...]:
    """The steps of a command that answers several motions: those of a motion with a folder begin with its name."""
    return tuple(
        (f"{folder}: {first}" if folder else first, seconds) for folder in folders for first, seconds in steps
    )


AT_ONCE_S: Final = 0.5
"""Time within which work that is reported was done by an earlier command [s] (judgement)."""
LEAST_DONE: Final = 0.04
"""Share of the typical time after which the time that remains is stated [-] (judgement: shorter steps scatter by more than their
time)."""
EVERY_S: Final = 10.0
"""Least time between two lines of progress where stderr is no terminal [s] (judgement: a log stays readable)."""


class Remaining:
    """Time that remains, from the typical shares of the steps.

    Parameters
    ----------
    steps : first words of each step in order, and its typical time in any unit.
    clock : time [s]; monotonic.
    """

    def __init__(
        self, steps: Sequence[tuple[str, float]], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._steps = steps
        self._clock = clock
        self._started = clock()
        self._index: int | None = None
        self._first = 0
        self._entered = self._started

    def enter(self, what: str) -> None:
        """Begin a step; one that is not known, or whose step is over, belongs to the present step.

        Parameters
        ----------
        what : text of the step; of several first words that it has, the longest decide.
        """
        start = self._index or 0
        known = [i for i in range(start, len(self._steps)) if what.startswith(self._steps[i][0])]
        if not known:
            return
        index = max(known, key=lambda i: len(self._steps[i][0]))
        if self._index is None:
            self._first = index
        if index != self._index:
            self._entered = self._clock()
        self._index = index

    @property
    def elapsed_s(self) -> float:
        """Time since the start [s]."""
        return self._clock() - self._started

    @property
    def left_s(self) -> float | None:
        """Estimate of the time that remains [s]; None before the first steps have ended, see `LEAST_DONE`."""
        if self._index is None:
            return None
        done = sum(weight for _, weight in self._steps[self._first : self._index])
        taken = self._entered - self._started
        left = sum(weight for _, weight in self._steps[self._index :])
        if done < LEAST_DONE * (done + left) or taken <= 0.0:
            return None
        within = self._clock() - self._entered
        later = sum(weight for _, weight in self._steps[self._index + 1 :])
        return max(left * taken / done - within, later * taken / done)

    def text(self) -> str:
        """Elapsed and remaining time in words."""
        left = self.left_s
        return f"{self.elapsed_s:.0f} s" + ("" if left is None else f", about {left:.0f} s left")


def _is_terminal() -> bool:
    """Whether stderr is a terminal on which a line can change; those of notebooks and editors are dumb."""
    return sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


@contextmanager
def status(
    verb: str, quiet: bool, steps: Sequence[tuple[str, float]] = ()
) -> Iterator[Callable[[str], None]]:
    """Show the current step on stderr: one changing line on a terminal, a line per step elsewhere.

    Parameters
    ----------
    verb : name of the command.
    quiet : show nothing.
    steps : steps of the command and their typical times, for the time that remains.
    """
    remaining = Remaining(steps)

    def enter(what: str) -> None:
        remaining.enter(what)
        LOGGER.info("%s (%s)", what, remaining.text())

    if quiet:
        yield enter
        return
    if not _is_terminal():

        def line(what: str) -> None:
            enter(what)
            print(f"airtruth {verb}: {what} ({remaining.text()})", file=sys.stderr, flush=True)

        yield line
        return
    with _spinner(remaining) as bar:
        task = bar.add_task(verb, total=None)

        def show(what: str) -> None:
            enter(what)
            bar.update(task, description=f"{verb}: {what}")

        yield show


def _spinner(remaining: Remaining) -> Progress:
    """One line with the step, the time since the start and the time that remains."""
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn, SpinnerColumn, TextColumn
    from rich.text import Text

    class Times(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"({remaining.text()})")

    columns = (SpinnerColumn(), TextColumn("{task.description}"), Times())
    return Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=False)


@contextmanager
def loading(verb: str, quiet: bool) -> Iterator[None]:
    """Show one line on a terminal while a command imports its libraries, which takes seconds; it goes when the block ends.

    Parameters
    ----------
    verb : name of the command.
    quiet : show nothing.
    """
    if quiet or not _is_terminal():
        yield
        return
    print(f"airtruth {verb}: loading", end="", file=sys.stderr, flush=True)
    try:
        yield
    finally:
        print("\r\x1b[2K", end="", file=sys.stderr, flush=True)  # ECMA-48: erase the line


@contextmanager
def working(verb: str, quiet: bool) -> Iterator[None]:
    """Show the elapsed time on a terminal while a command works that has no steps to count.

    Parameters
    ----------
    verb : name of the command.
    quiet : show nothing.
    """
    if quiet or not _is_terminal():
        yield
        return
    with _spinner(Remaining(())) as bar:
        bar.add_task(verb, total=None)
        yield


@contextmanager
def progress_bar(verb: str, things: str, quiet: bool) -> Iterator[Callable[[int, int, int], None]]:
    """Show a bar with rate and remaining time on stderr; a line now and then where stderr is no terminal.

    Parameters
    ----------
    verb : name of the command.
    things : plural of what is counted.
    quiet : show nothing.
    """
    if quiet or sys.stderr is None:
        yield lambda done, total, failed: None
        return
    if not _is_terminal():
        yield _Lines(verb, things)
        return
    with _bar(things) as bar:
        task = bar.add_task(verb, total=None)

        def advance(done: int, total: int, failed: int) -> None:
            bar.update(
                task, completed=done, total=total, description=f"{verb} ({failed} failed)" if failed else verb
            )

        yield advance


@contextmanager
def announced_compilation(verb: str, quiet: bool) -> Iterator[None]:
    """State once on stderr that numba compiles a kernel, which it does where the cache of kernels is empty.

    Parameters
    ----------
    verb : name of the command.
    quiet : state nothing.
    """
    if quiet or sys.stderr is None:
        yield
        return
    from numba.core import event

    class Announcement(event.Listener):
        stated = False

        def on_start(self, event: object) -> None:
            if not self.stated:
                self.stated = True
                text = "compiles its kernels; later runs read them from the cache"
                print(f"airtruth {verb}: {text}", file=sys.stderr, flush=True)

        def on_end(self, event: object) -> None:
            pass

    with event.install_listener("numba:compile", Announcement()):
        yield


class _Lines:
    """Progress as lines of a log, at most one in `EVERY_S`."""

    def __init__(self, verb: str, things: str) -> None:
        self._verb = verb
        self._things = things
        self._started = self._last = time.monotonic()
        self._before: int | None = None

    def __call__(self, done: int, total: int, failed: int) -> None:
        now = time.monotonic()
        if self._before is None:  # a campaign that resumes reports at once the runs that were flown before
            self._before = done if now - self._started < AT_ONCE_S else 0
        if now - self._last < EVERY_S or done >= total:
            return
        self._last = now
        made = done - self._before
        left = f", about {(now - self._started) * (total - done) / made:.0f} s left" if made else ""
        wrong = f", {failed} failed" if failed else ""
        line = f"airtruth {self._verb}: {done} of {total} {self._things}{wrong}{left}"
        print(line, file=sys.stderr, flush=True)


def _bar(things: str) -> Progress:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:.0f} {things}/s" if task.speed else "")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=Console(stderr=True), redirect_stdout=False)


__all__ = [
    "LOOP_STEPS",
    "TRACE_STEPS",
    "Remaining",
    "announced_compilation",
    "loading",
    "progress_bar",
    "status",
    "steps_of",
    "working",
]
