"""The last resort: an exception that nothing foresaw becomes one sentence and a report file."""

from __future__ import annotations

import errno
import importlib
import math
import platform
import shlex
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import Final

from airtruth.errors import ConfigurationError

RESOURCES: Final = {
    errno.EMFILE: "too many files are open; raise the limit (ulimit -n) and run again",
    errno.ENFILE: "too many files are open on this machine; close some and run again",
    errno.ENOSPC: "the disk is full; free some space and run again",
    errno.EDQUOT: "the disk quota is used up; free some space and run again",
    errno.EROFS: "the file system is read-only; choose another folder",
    errno.ENOMEM: "out of memory; use fewer records or fewer --jobs, or a machine with more memory",
    errno.EAGAIN: "no further process or thread is allowed; raise the limit (ulimit -u) and run again",
}
"""Error number of an exhausted resource -> the sentence; none is a defect of airtruth."""
LEAST_MEMORY: Final = 2e9
"""Limit of the address space below which a failure is attributed to it [byte] (judgement: the libraries reserve about
1 GB)."""
LEAST_TO_START: Final = 1_500_000_000
"""Address space that a command needs [byte]; `fly` takes 0.96 GB, `identify` and `check` 1.2 GB. With 0.8 to 1.1 GB,
libraries crashed, or waited forever for a thread that could not start."""
LONGEST_REASON: Final = 200
"""Characters of an exception's message that the sentence quotes (judgement: two lines of a terminal)."""


def lacking_resource(error: Exception) -> str | None:
    """Return a sentence for an exception that a limit of the system explains; None for any other.

    Parameters
    ----------
    error : the exception.
    """
    if isinstance(error, OSError) and error.errno in RESOURCES:
        return f"{error.filename}: {RESOURCES[error.errno]}" if error.filename else RESOURCES[error.errno]
    limit = _memory_limit()
    if limit < LEAST_MEMORY:
        return (
            f"stopped ({_reason(error)}); the memory of this process is limited to {limit / 1e9:.2g} GB (ulimit -v), and "
            f"airtruth may need {LEAST_MEMORY / 1e9:.2g} GB: raise the limit and run again"
        )
    return None


def require_memory() -> None:
    """Refuse to start where the limit of the address space would end a library without a message.

    Raises
    ------
    ConfigurationError
        Naming the limit and the next step.
    """
    limit = _memory_limit()
    if limit < LEAST_TO_START:
        raise ConfigurationError(
            f"the address space of this process is limited to {limit / 1e9:.2g} GB (ulimit -v), and airtruth needs "
            f"{LEAST_TO_START / 1e9:.2g} GB; raise the limit with `ulimit -v {LEAST_TO_START // 1024}`, or run without it"
        )


def _reason(error: Exception) -> str:
    words = str(error).splitlines()
    return f"{type(error).__name__}: {words[0][:LONGEST_REASON]}" if words else type(error).__name__


def _memory_limit() -> float:
    """Limit of the address space of this process [byte]."""
    try:
        resource = importlib.import_module("resource")
    except ImportError:  # not a POSIX system
        return math.inf
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if soft == resource.RLIM_INFINITY else float(soft)


def write_failure(error: Exception, arguments: Sequence[str]) -> str:
    """Write a report of an unforeseen exception and return the sentence for the user.

    The report goes to the working folder, or to the temporary folder where that cannot be written.

    Parameters
    ----------
    error : the exception, with its traceback.
    arguments : the command, `sys.argv`.
    """
    text = "\n".join(_lines(error, arguments))
    name = f"airtruth-failure-{time.strftime('%Y%m%d-%H%M%S')}.txt"
    reason = _reason(error)
    for folder in (Path.cwd, lambda: Path(tempfile.gettempdir())):
        try:
            path = folder() / name
            path.write_text(text, encoding="utf-8", errors="backslashreplace")
        except OSError:
            continue
        return f"unexpected error ({reason}); this is a defect of airtruth, please send its author {path}"
    return f"unexpected error ({reason}); no report could be written, the traceback follows\n{text}"


def _lines(error: Exception, arguments: Sequence[str]) -> Iterator[str]:
    yield f"command    {shlex.join(['airtruth', *arguments[1:]])}"
    yield f"folder     {_working_folder()}"
    yield f"python     {sys.version}"
    yield f"platform   {platform.platform()}"
    yield from _versions()
    yield ""
    yield from "".join(traceback.format_exception(error)).splitlines()


def _working_folder() -> str:
    try:
        return str(Path.cwd())
    except OSError as error:
        return f"unknown ({error.strerror})"


def _versions() -> Iterator[str]:
    """Versions of airtruth and of its dependencies."""
    from airtruth import __version__

    yield f"airtruth   {__version__}"
    try:
        requirements = metadata.requires("airtruth") or []
    except metadata.PackageNotFoundError:  # run from a source tree
        return
    for requirement in requirements:
        name = requirement.split(";")[0].split("[")[0].rstrip("0123456789.,<>=!~ ")
        try:
            yield f"{name:<10} {metadata.version(name)}"
        except metadata.PackageNotFoundError:  # an optional one
            continue
