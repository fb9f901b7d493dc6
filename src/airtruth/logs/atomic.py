"""Atomic writing: a file appears complete or not at all."""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final, Protocol

from airtruth.errors import StoreError
from airtruth.logs.remote import RemotePath, location
from airtruth.logs.temporary import private_folder, remove, temporary_folder, temporary_name

_NEXT_STEP: Final = {
    errno.ENOSPC: "the disk is full: free some space and run again",
    errno.EDQUOT: "the disk quota is used up: free some space and run again",
    errno.EFBIG: "the file would pass the size limit (ulimit -f): raise it and run again",
    errno.EACCES: "permission denied: choose a folder that you may write to",
    errno.EPERM: "permission denied: choose a folder that you may write to",
    errno.EROFS: "the file system is read-only: choose another folder",
    errno.ENOENT: "the folder does not exist: create it or choose another",
    errno.EEXIST: "a file of that name is in the way: choose another name",
    errno.ENOTDIR: "a part of the path is a file, not a folder: choose another path",
    errno.EISDIR: "a folder of that name is in the way: choose another name",
    errno.ENAMETOOLONG: "the name is too long: choose a shorter one",
    errno.EMFILE: "too many files are open: raise the limit (ulimit -n) and run again",
    errno.ENFILE: "too many files are open on this machine: close some and run again",
}
"""Error number -> reason and next step of a failed write."""


class Guard(Protocol):
    """Permits and records every file that a command writes, see `airtruth.logs.outputs`."""

    def before(self, path: Path) -> None:
        """Raise `StoreError` if the file may not be written."""

    def record(self, path: Path, written: Path) -> None:
        """Record the content of ``path``, which ``written`` holds and which appears there next."""


guard: ContextVar[Guard | None] = ContextVar("guard", default=None)
"""The guard of the command that runs; None writes without one."""


@contextmanager
def atomic_file(path: Path | str) -> Iterator[BinaryIO]:
    """Open a new file that replaces ``path`` when the block ends; if the block fails, ``path`` does not change.

    The bytes go to a hidden temporary file in the same folder, which is flushed to the disk and renamed to
    ``path``; the folder is flushed too. A reader sees the old file or the new one. A key of a store is written by one
    upload.

    Raises
    ------
    StoreError
        If the file cannot be written; the temporary file is removed.
    """
    path = location(path)
    active = guard.get()
    if active is not None:
        active.before(path)
    if isinstance(path, RemotePath):
        try:
            with _uploaded(path, partial(_record, active, path)) as file:
                yield file
        except OSError as error:  # of the local file
            raise write_error(path, error) from error
        return
    temporary = path.with_name(temporary_name(path.name))
    try:
        try:
            # tempfile would create a file that other users cannot read
            with open(temporary, "xb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            _record(active, path, temporary)
            os.replace(temporary, path)
            logging.getLogger("airtruth").debug("wrote %s", path)
        except BaseException:
            remove(temporary)
            raise
        sync_folder(path.parent)
    except OSError as error:
        raise write_error(path, error) from error


@contextmanager
def _uploaded(path: RemotePath, recorded: Callable[[Path], None]) -> Iterator[BinaryIO]:
    """A local temporary file that becomes the key when the block ends; if the block fails, nothing is written.

    Parameters
    ----------
    path : the key.
    recorded : receives the file before it is uploaded.
    """
    folder = private_folder()
    try:
        local = folder / "object"
        with local.open("wb") as file:
            yield file
        recorded(local)
        path.upload(local)
    finally:
        remove(folder)


def _record(active: Guard | None, path: Path, written: Path) -> None:
    if active is not None:
        active.record(path, written)


def write_text(path: Path | str, text: str) -> None:
    r"""Write a text file (UTF-8) atomically; a byte of a name that is not UTF-8 is written as \udcXX.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    with atomic_file(path) as file:
        file.write(text.encode("utf-8", "backslashreplace"))


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Create a folder that appears under its name when the block ends, complete, or not at all.

    The block writes into the folder of the same name that it receives. An earlier folder is moved aside and removed.

    Raises
    ------
    StoreError
        If the folder cannot be created or renamed.
    """
    make_folder(path.parent)
    try:
        with temporary_folder(path.parent, path.name) as beside:
            made = beside / path.name
            made.mkdir()
            yield made
            if path.exists():
                path.rename(beside / "earlier")
            made.rename(path)
    except OSError as error:
        raise write_error(path, error) from None


def remove_file(path: Path) -> None:
    """Remove a file if it exists.

    Raises
    ------
    StoreError
        If it cannot be removed.
    """
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise write_error(path, error) from None


def remove_folder(path: Path) -> None:
    """Remove a folder if it exists; whoever looks sees all of it or nothing.

    Raises
    ------
    StoreError
        If it cannot be removed.
    """
    if not path.exists():
        return
    aside = path.with_name(temporary_name(path.name))
    try:
        path.rename(aside)
    except OSError as error:
        raise write_error(path, error) from None
    remove(aside)


def make_folder(path: Path) -> None:
    """Create a folder and its parents, unless they exist.

    Raises
    ------
    StoreError
        If it cannot be created or is not writable.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        if not isinstance(path, RemotePath) and not os.access(path, os.W_OK | os.X_OK):
            read_only = hasattr(os, "ST_RDONLY") and os.statvfs(path).f_flag & os.ST_RDONLY
            raise OSError(errno.EROFS if read_only else errno.EACCES, "")
    except OSError as error:
        raise write_error(path, error) from None


def sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to the disk, if the system supports it."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_error(path: Path, error: OSError) -> StoreError:
    """Return the error for a failed write: the file, the reason and the next step."""
    kept = " (the existing file is unchanged)" if path.is_file() else ""
    return StoreError(f"{path}: not written{kept}; {next_step(error)}")


def next_step(error: OSError) -> str:
    """Return the reason of a failed write and the next step."""
    reason = error.strerror or str(error)
    return _NEXT_STEP.get(error.errno or 0, f"{reason}: make the folder writable and run again")


__all__ = [
    "Guard",
    "atomic_file",
    "guard",
    "make_folder",
    "new_folder",
    "next_step",
    "remove_file",
    "remove_folder",
    "sync_folder",
    "write_error",
    "write_text",
]
