"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from airtruth.errors import StoreError

_NEXT_STEP = {
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
}


@contextmanager
def atomic_file(path: Path | str) -> Iterator[BinaryIO]:
    """Open a new file that replaces ``path`` when the block ends, or leaves it as it was when it fails.

    The bytes go to a hidden temporary file in the same folder, are flushed to the disk, renamed over
    ``path``, and the folder is flushed; a reader sees the old file or the new one.

    Raises
    ------
    StoreError
        If the file cannot be written; the temporary file is removed.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        try:
            # not tempfile: it would leave the file unreadable for others
            with open(temporary, "xb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        sync_folder(path.parent)
    except OSError as error:
        raise write_error(path, error) from error


def write_text(path: Path | str, text: str) -> None:
    """Write a text file (UTF-8) whole or not at all.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    with atomic_file(path) as file:
        file.write(text.encode())


def make_folder(path: Path) -> None:
    """Make a folder and those above it, where they are not there yet.

    Raises
    ------
    StoreError
        If it cannot be made, or nothing can be written there.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        if not os.access(path, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise write_error(path, error) from None


def sync_folder(folder: Path) -> None:
    """Flush a folder's entries to the disk, where the system can."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_error(path: Path, error: OSError) -> StoreError:
    """The message for a failed write: which file, why, and what to do."""
    reason = error.strerror or str(error)
    step = _NEXT_STEP.get(error.errno or 0, f"{reason}: see that the folder can be written and run again")
    kept = " (the file that was there is unchanged)" if path.is_file() else ""
    return StoreError(f"{path}: not written{kept}; {step}")


__all__ = ["atomic_file", "sync_folder", "write_error", "write_text"]
