"""Run many cases in a process that may die, and count how each of them ends."""

from __future__ import annotations

import os
import pickle
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Final

from airtruth.errors import AirtruthError

HANG_S: Final = 20.0
"""Time after which a case counts as a hang [s] (issue 16)."""
MEMORY_BYTES: Final = 8_000_000_000
"""Address space of the process of the cases [byte]: a case that needs more ends in a traceback."""
ENDINGS: Final = ("result", "sentence", "traceback", "crash", "hang")
"""Endings of a case; only the first two are good."""


@dataclass(frozen=True)
class Case:
    """A class of inputs: ``run`` makes one from its random numbers in a folder of its own and uses it."""

    name: str
    count: int
    run: Callable[[Random, Path], Any]
    warm: Callable[[Path], Any] = lambda folder: None


@dataclass
class Tally:
    """Endings of the cases of a class.

    Attributes
    ----------
    endings : ending -> number of cases. bad : reason -> first case that ended so, and their number.
    slowest_s : longest time of a case [s]; warned : number of cases with a numerical warning.
    """

    endings: Counter[str] = field(default_factory=Counter)
    bad: dict[str, tuple[int, int]] = field(default_factory=dict)
    slowest_s: float = 0.0
    slowest: int = -1
    warned: Counter[str] = field(default_factory=Counter)

    def add(self, number: int, ending: str, reason: str, seconds: float, noise: str) -> None:
        """Count one case."""
        self.endings[ending] += 1
        if seconds > self.slowest_s:
            self.slowest_s, self.slowest = seconds, number
        if noise:
            self.warned[noise] += 1
        if ending not in ENDINGS[:2]:
            first, count = self.bad.get(reason, (number, 0))
            self.bad[reason] = first, count + 1


def run_cases(case: Case, numbers: range, seed: int, *, show: bool = False) -> Tally:
    """Run cases of a class one after another; a process that dies is replaced."""
    tally = Tally()
    position = 0
    with tempfile.TemporaryDirectory(prefix="airtruth-fuzz-") as scratch:
        case.warm(Path(scratch))
        while position < len(numbers):
            for number, *ending in _in_process(case, numbers[position:], seed, Path(scratch), show):
                tally.add(number, *ending)
                position += 1
    return tally


def _in_process(
    case: Case, numbers: range, seed: int, scratch: Path, show: bool
) -> Iterator[tuple[int, str, str, float, str]]:
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(reading)
        _child(case, numbers, seed, scratch, writing, show)
    os.close(writing)
    started: tuple[int, float] | None = None
    with os.fdopen(reading, "rb") as pipe:
        while True:
            try:
                message = pickle.load(pipe)
            except (EOFError, pickle.UnpicklingError):
                break
            if len(message) == 1:
                started = message[0], time.monotonic()
            else:
                started = None
                yield message
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    if started is not None:
        seconds = time.monotonic() - started[1]
        ending = "hang" if status == -signal.SIGALRM else "crash"
        yield started[0], ending, f"exit code {status}", seconds, ""
    elif status != 0:
        raise RuntimeError(f"{case.name}: the process of the cases ended with {status} between two of them")


def _child(case: Case, numbers: range, seed: int, scratch: Path, writing: int, show: bool) -> None:
    code = 1
    try:
        with os.fdopen(writing, "wb", buffering=0) as pipe:
            if not show:
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, 1)
                os.dup2(null, 2)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
            for number in numbers:
                pipe.write(pickle.dumps((number,)))
                with tempfile.TemporaryDirectory(dir=scratch) as folder:
                    signal.setitimer(signal.ITIMER_REAL, HANG_S)
                    ending = _run(case, Random(f"{seed} {case.name} {number}"), Path(folder), show)
                    signal.setitimer(signal.ITIMER_REAL, 0.0)
                pipe.write(pickle.dumps((number, *ending)))
        from airtruth.isolation import client

        client.close()
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _run(case: Case, rng: Random, folder: Path, show: bool) -> tuple[str, str, float, str]:
    start = time.monotonic()
    ending, reason = "result", ""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RuntimeWarning)
        try:
            case.run(rng, folder)
        except AirtruthError as error:
            ending, reason = "sentence", str(error)
            if not reason.strip() or "Traceback" in reason:
                ending = "traceback"
            if show:
                print(f"  {type(error).__name__}: {error}", file=sys.stderr)
        except BaseException as error:
            ending, reason = "traceback", _where(error)
            if show:
                traceback.print_exc()
    noise = [
        f"{Path(w.filename).name}:{w.lineno} {w.message}" for w in caught if w.category is RuntimeWarning
    ]
    return ending, reason, time.monotonic() - start, noise[0] if noise else ""


def _where(error: BaseException) -> str:
    """Class, last line inside airtruth, and message."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/airtruth/" in f.filename]
    last = f"{frames[-1].filename.rsplit('/airtruth/', 1)[-1]}:{frames[-1].lineno}" if frames else "?"
    return f"{type(error).__name__} at {last}: {' '.join(str(error).split())[-150:]}"


__all__ = ["ENDINGS", "HANG_S", "Case", "Tally", "run_cases"]
