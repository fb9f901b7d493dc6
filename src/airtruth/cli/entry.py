"""The entry point: every ending of the program is one message on stderr and an exit code."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Final, NoReturn

from airtruth.cli.application import app
from airtruth.cli.failure import lacking_resource, write_failure
from airtruth.cli.output import close_stdout, escape_what_cannot_be_encoded, notice
from airtruth.errors import (
    FAILED_RUNS,
    INTERRUPTED,
    TERMINATED,
    UNEXPECTED,
    USAGE,
    AirtruthError,
    ConfigurationError,
)

ENDINGS: Final = {INTERRUPTED: "interrupted", TERMINATED: "terminated"}
"""Words for an exit code that a signal caused."""
FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Error numbers of a stream that takes no more bytes."""
_AGAIN_S: Final = 0.05
"""Time after which a signal is sent again whose exception a callback swallowed [s] (judgement: longer than the callback)."""


def main() -> None:
    """Run the command line and exit.

    Exit codes: 0 finished, `FAILED_RUNS` finished with failed runs, `AirtruthError.exit_code` wrong usage
    or an error that the user can correct, `UNEXPECTED` any other exception (a report file is written),
    `INTERRUPTED` after Ctrl-C, `TERMINATED` after SIGTERM.
    """
    escape_what_cannot_be_encoded()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads for small matrices wait for each other
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # pyarrow's own pool keeps what it frees
    signals: list[int] = []
    try:
        _refuse_empty(sys.argv[1:])
        with _caught(signals):
            app(prog_name="airtruth")  # also as `python -m airtruth`, for the completion of shells
    except AirtruthError as error:
        notice(str(error))
        sys.exit(error.exit_code)
    except SystemExit as end:  # typer turns Ctrl-C into this
        if end.code in ENDINGS:
            _stopped(int(end.code))
        raise
    except KeyboardInterrupt:
        _stopped(INTERRUPTED)
    except BrokenPipeError:
        close_stdout()
        sys.exit(FAILED_RUNS)
    except Exception as error:
        if signals:  # an import that a signal interrupts may raise anything
            _stopped(signals[0])
        if isinstance(error, MemoryError):
            notice("out of memory; use fewer records or fewer --jobs, or a machine with more memory")
            sys.exit(UNEXPECTED)
        if isinstance(error, OSError) and error.errno in FULL and error.filename is None:
            from airtruth.logs.atomic import write_error

            close_stdout()
            notice(str(write_error(Path("standard output"), error)))
            sys.exit(USAGE)
        lacking = lacking_resource(error)
        if lacking is not None:
            notice(lacking)
            sys.exit(USAGE)
        notice(write_failure(error, sys.argv))
        sys.exit(UNEXPECTED)


def _refuse_empty(arguments: Sequence[str]) -> None:
    """An empty argument would mean the current folder."""
    if "" in arguments:
        before = arguments[arguments.index("") - 1] if arguments.index("") else "airtruth"
        raise ConfigurationError(f"the argument after {before!r} is empty; state it, or leave it out")


def _stopped(code: int) -> NoReturn:
    step = "resumes" if sys.argv[1:2] == ["fly"] else "starts again from the beginning"
    notice(f"{ENDINGS[code]}; the same command {step}")
    sys.exit(code)


@contextmanager
def _caught(signals: list[int]) -> Iterator[None]:
    """Let SIGTERM end the program as Ctrl-C does: workers stop and temporary folders are removed.

    A signal that arrives in a callback from C raises an exception that Python ignores there. It is sent again.

    Parameters
    ----------
    signals : receives the exit code of the first signal.
    """

    def terminate(number: int, frame: FrameType | None) -> NoReturn:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one must not break the clean-up
        signals.append(TERMINATED)
        raise SystemExit(TERMINATED)

    def interrupt(number: int, frame: FrameType | None) -> NoReturn:
        signals.append(INTERRUPTED)
        raise KeyboardInterrupt

    def swallowed(lost: sys.UnraisableHookArgs) -> None:
        if not (signals and issubclass(lost.exc_type, KeyboardInterrupt | SystemExit)):
            hook(lost)
            return
        number = signal.SIGINT if signals[-1] == INTERRUPTED else signal.SIGTERM
        if number == signal.SIGTERM:
            signal.signal(number, terminate)
        again = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), number))
        again.daemon = True
        again.start()

    hook, sys.unraisablehook = sys.unraisablehook, swallowed
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    signal.signal(signal.SIGTERM, terminate)
    if before[signal.SIGINT] is not signal.SIG_IGN:  # a shell's background job ignores it
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)
