"""Temporary files and folders whose names state the process that owns them.

A process removes its own and those of processes that have ended, never those of a process that is alive.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from airtruth.logs.remote import RemotePath

LONGEST_NAME: Final = 180
"""Bytes of a file's name that its temporary name repeats [-] (file systems allow 255, the owner takes up to 50)."""
_PATTERN: Final = re.compile(r"\..+\.(\d+)-(\d+)-[0-9a-f]{8}\.tmp")
"""Temporary name: of the target, then process id, start of the process and random digits."""
_START_FIELD: Final = 19
"""Index of a process's start time in /proc/PID/stat behind the command (proc(5), field 22)."""


def temporary_name(name: str) -> str:
    """Return a hidden name for a temporary file of ``name`` that states this process as its owner."""
    short = name[:LONGEST_NAME]
    while len(os.fsencode(short)) > LONGEST_NAME:  # a cut of the bytes could divide a character
        short = short[:-1]
    pid = os.getpid()
    return f".{short}.{pid}-{started(pid) or 0}-{secrets.token_hex(4)}.tmp"


def is_temporary(name: str) -> bool:
    """Whether a name is one of `temporary_name`."""
    return _PATTERN.fullmatch(name) is not None


def is_abandoned(name: str) -> bool:
    """Whether a name is one of `temporary_name` whose owner has ended."""
    match = _PATTERN.fullmatch(name)
    return match is not None and not is_alive(int(match[1]), int(match[2]))


def clear(folder: Path) -> None:
    """Remove the temporary files and folders in a folder whose owners have ended; nothing if it cannot be read.

    A store has none: a key appears by one upload.
    """
    if isinstance(folder, RemotePath):
        return
    try:
        abandoned = [path for path in folder.iterdir() if is_abandoned(path.name)]
    except OSError:
        return
    for path in abandoned:
        remove(path)


def remove(path: Path) -> None:
    """Remove a temporary file or folder, as far as permissions allow."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return


@contextmanager
def temporary_folder(parent: Path, name: str) -> Iterator[Path]:
    """Create a folder with a temporary name beside ``parent / name``, and remove it when the block ends.

    Raises
    ------
    OSError
        If it cannot be created.
    """
    clear(parent)
    folder = parent / temporary_name(name)
    folder.mkdir()
    try:
        yield folder
    finally:
        remove(folder)


def private_folder() -> Path:
    """Create a folder of this process in the system's folder for temporary files, and remove those of ended processes.

    The caller removes it; where the caller is killed, the next call of any process does.

    Raises
    ------
    OSError
        If it cannot be created.
    """
    parent = Path(tempfile.gettempdir())
    clear(parent)
    folder = parent / temporary_name("airtruth")
    folder.mkdir(mode=0o700)
    return folder


def is_alive(pid: int, start: int) -> bool:
    """Whether the process of this id is alive and, where both starts are known, is the same process."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it is another user's
        return True
    now = started(pid)
    return now is None or start == 0 or now == start


def started(pid: int) -> int | None:
    """Start of a process [clock ticks since boot]; -1 for one that has ended; None if the system does not tell."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="latin-1").rpartition(")")[2].split()
    except OSError:
        return None
    return -1 if fields[0] in "ZX" else int(fields[_START_FIELD])


__all__ = [
    "clear",
    "is_abandoned",
    "is_alive",
    "is_temporary",
    "private_folder",
    "remove",
    "started",
    "temporary_folder",
    "temporary_name",
]
