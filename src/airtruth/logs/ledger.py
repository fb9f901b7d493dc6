"""The ledger of an output folder: name, SHA-256 and command of each file that airtruth wrote there.

An entry is written before its file appears. It keeps the digest of the file that it replaces, so a command that was
killed in between recognises both.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from airtruth.errors import StoreError
from airtruth.logs.atomic import guard, write_error, write_text
from airtruth.logs.digest import sha256_of
from airtruth.logs.remote import RemotePath

LEDGER: Final = ".airtruth.json"
"""Name of the ledger in a folder."""

_held: ContextVar[frozenset[Path]] = ContextVar("held", default=frozenset())
"""Folders of which this command holds the lock."""


@dataclass(frozen=True)
class Entry:
    """A file that airtruth wrote.

    Attributes
    ----------
    command : the command that wrote it.
    sha256 : digest of its content.
    replaced : digest of the file that it replaced, "" if there was none or it had the same content.
    """

    command: str
    sha256: str
    replaced: str = ""


def read(folder: Path) -> dict[str, Entry]:
    """Return the entries of a folder by the names of the files; none without a ledger.

    Raises
    ------
    StoreError
        If the ledger is damaged or cannot be read.
    """
    path = folder / LEDGER
    try:
        content = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return {}
    except OSError as error:
        raise StoreError(
            f"{path}: cannot be read ({error.strerror}); make it readable and run the same command again"
        ) from None
    try:
        entries = {name: Entry(**entry) for name, entry in json.loads(content)["files"].items()}
        whole = _text(entries).encode() == content
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        whole = False
    if not whole:
        raise StoreError(f"{path}: is damaged; remove it, and replace the files that it listed with --force")
    return entries


def add(path: Path, command: str, written: Path, *, force: bool = False) -> None:
    """Record that a command is about to replace ``path`` by the file ``written``.

    Parameters
    ----------
    path : file that appears.
    command : name of the command.
    written : its content.
    force : replace a damaged ledger.

    Raises
    ------
    StoreError
        If the ledger is damaged or cannot be written.
    """
    digest = sha256_of(written)
    assert digest is not None
    before = sha256_of(path)
    with locked(path.parent):
        entries = _entries(path.parent, force)
        there = entries.get(path.name)
        if there is not None and (there.command, there.sha256) == (command, digest) and before == digest:
            return
        entries[path.name] = Entry(command, digest, "" if before in (None, digest) else str(before))
        _write(path.parent, entries)


def add_folder(folder: Path, command: str) -> None:
    """Write the ledger of a folder in which one command wrote every file, subfolders included.

    Raises
    ------
    StoreError
        If the ledger cannot be written.
    """
    files = {p for p in folder.rglob("*") if p.is_file() and p.name != LEDGER}
    digests = {p.relative_to(folder).as_posix(): str(sha256_of(p)) for p in files}
    _write(folder, {name: Entry(command, digest) for name, digest in digests.items()})


def _entries(folder: Path, force: bool) -> dict[str, Entry]:
    try:
        return read(folder)
    except StoreError:
        if force:
            return {}
        raise


def _write(folder: Path, entries: Mapping[str, Entry]) -> None:
    unguarded = guard.set(None)
    try:
        write_text(folder / LEDGER, _text(entries))
    finally:
        guard.reset(unguarded)


def _text(entries: Mapping[str, Entry]) -> str:
    """Content of a ledger, with its own digest."""
    files = {name: {k: v for k, v in asdict(entries[name]).items() if v} for name in sorted(entries)}
    digest = hashlib.sha256(json.dumps(files).encode()).hexdigest()
    return json.dumps({"files": files, "sha256": digest}, indent=1) + "\n"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, so that two commands do not lose each other's entries; it may be held already.

    A folder of a store has none: of two commands that write into it at the same time, one may lose an entry, and its
    next run then asks for --force.

    Raises
    ------
    StoreError
        If the folder does not exist.
    """
    if isinstance(folder, RemotePath) or folder.resolve() in _held.get():
        yield
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise write_error(folder / LEDGER, error) from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        before = _held.set(_held.get() | {folder.resolve()})
        try:
            yield
        finally:
            _held.reset(before)
    finally:
        os.close(descriptor)


__all__ = ["LEDGER", "Entry", "add", "add_folder", "locked", "read"]
