"""`--verbose` and `--log-file` of every command: what it read, wrote and did, with times."""

from __future__ import annotations

import functools
import inspect
import logging
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, TextIO, TypeVar, get_type_hints

import typer

LOGGER: Final = logging.getLogger("airtruth")
"""Logger of the package; modules write to it what they read and write."""
LOGGER.addHandler(logging.NullHandler())  # without --verbose and --log-file nothing is shown
FIRST_LINE: Final = "# airtruth log"
"""First line of every log file: a file without it is not extended."""


Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        help="Show on stderr which files are read and written, and the times; trace prints every table.",
    ),
]
"""Option of every command."""
LogFile = Annotated[
    Path | None, typer.Option("--log-file", metavar="FILE", help="Append the lines of --verbose to a file.")
]
"""Option of every command."""
Command = TypeVar("Command", bound=Callable[..., object])


class Application(typer.Typer):
    """A Typer application whose commands have the options --verbose and --log-file."""

    def command(self, name: str | None = None, **keywords: Any) -> Callable[[Command], Command]:
        """Register a command; see `typer.Typer.command`."""
        register = super().command(name, **keywords)

        def decorate(function: Command) -> Command:
            register(_journaled(function))
            return function

        return decorate


def _journaled(function: Callable[..., object]) -> Callable[..., object]:
    """The command inside its journal, with the two options at the end of its signature."""
    hints = get_type_hints(function, include_extras=True)
    own = inspect.signature(function)
    added = {"verbose": (Verbose, False), "log_file": (LogFile, None)}

    @functools.wraps(function)
    def run(*, verbose: bool, log_file: Path | None, **arguments: Any) -> object:
        with journal(verbose, log_file):
            return function(**arguments)

    parameters = [
        p.replace(annotation=hints[name], kind=p.KEYWORD_ONLY) for name, p in own.parameters.items()
    ]
    parameters += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint)
        for name, (hint, default) in added.items()
    ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = hints | {name: hint for name, (hint, _) in added.items()}
    return run


@contextmanager
def journal(verbose: bool, file: Path | None) -> Iterator[None]:
    """Write what the package logs in this block to stderr, to a file, or to both.

    Parameters
    ----------
    verbose : write to stderr.
    file : file to extend; it is created with `FIRST_LINE`.

    Raises
    ------
    StoreError
        If the file cannot be written, or is none of this function.
    """
    handlers: list[logging.Handler] = []
    if verbose and sys.stderr is not None:
        shown = _JournalStream(sys.stderr)
        shown.setFormatter(_Elapsed())
        handlers.append(shown)
    if file is not None:
        handlers.append(_opened(file))
    if not handlers:
        yield
        return
    level, propagate = LOGGER.level, LOGGER.propagate
    LOGGER.setLevel(logging.DEBUG)
    LOGGER.propagate = False
    for handler in handlers:
        LOGGER.addHandler(handler)
    started = time.monotonic()
    try:
        _begin()
        yield
    except BaseException as error:
        LOGGER.error("ended by %s after %.2f s", _ending(error), time.monotonic() - started)
        raise
    else:
        LOGGER.info("finished after %.2f s", time.monotonic() - started)
    finally:
        for handler in handlers:
            LOGGER.removeHandler(handler)
            handler.close()
        LOGGER.setLevel(level)
        LOGGER.propagate = propagate


def is_verbose() -> bool:
    """Whether the journal of this command is shown."""
    return any(isinstance(handler, _JournalStream) for handler in LOGGER.handlers)


def _begin() -> None:
    from airtruth import __version__

    LOGGER.info("airtruth %s, Python %s, in %s", __version__, sys.version.split()[0], Path.cwd())
    LOGGER.info("command: %s", shlex.join(["airtruth", *sys.argv[1:]]))


def _ending(error: BaseException) -> str:
    code = getattr(error, "exit_code", None)
    if isinstance(error, typer.Exit) or code is not None:
        return f"exit code {code}" + (f" ({error})" if str(error) not in ("", str(code)) else "")
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


class _Elapsed(logging.Formatter):
    """Lines of --verbose: seconds since the start of the command."""

    def __init__(self) -> None:
        super().__init__()
        self._started = time.time()

    def format(self, record: logging.LogRecord) -> str:
        return f"airtruth: {record.created - self._started:8.2f} s  {record.getMessage()}"


class _JournalStream(logging.StreamHandler[TextIO]):
    """stderr; a closed one must not end a command that only reports."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - name of logging
        """Drop the line."""


class _File(logging.FileHandler):
    """A log file; a full disk must not end a command that only reports."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - name of logging
        """Drop the line."""


def _opened(file: Path) -> logging.FileHandler:
    from airtruth.errors import StoreError
    from airtruth.logs.atomic import make_folder, write_error

    try:
        if file.exists() and not file.is_file():
            raise StoreError(f"{file}: is not a regular file; choose another --log-file")
        make_folder(file.parent)
        with file.open("a+b") as stream:
            stream.seek(0)
            start = stream.read(len(FIRST_LINE))
            if start and start != FIRST_LINE.encode():
                raise StoreError(f"{file}: is not a log file of airtruth; choose another --log-file")
            if not start:
                stream.write(f"{FIRST_LINE}\n".encode())
        kept = _File(file, mode="a", encoding="utf-8", errors="backslashreplace")
        kept.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(message)s"))
        return kept
    except OSError as error:
        raise write_error(file, error) from None


__all__ = ["LOGGER", "Application", "LogFile", "Verbose", "is_verbose", "journal"]
