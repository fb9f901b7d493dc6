"""The lock of a folder in an object store: a key with an owner and an expiry, which its owner renews.

A process writes a key of its own and lists the keys of the others. Of two processes that start together, at least one
sees the other and withdraws, because a store lists what was written before; no conditional request is needed. Ages are
differences of times that the store itself has noted, so clocks need not agree. Should an owner be stopped for longer
than the expiry and then continue, it notices the loss at its next record; what it wrote until then has the bytes that
its successor writes.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Final

from airtruth.errors import ConfigurationError, StoreError
from airtruth.logs.remote import RemotePath
from airtruth.logs.temporary import is_alive, started

LEASES: Final = ".lease"
"""Folder of the leases in the folder that they lock."""
EXPIRY_S: Final = 120.0
"""Age at which a lease ends [s] (judgement: a network that fails for a minute does not end it)."""
RENEWAL_S: Final = 20.0
"""Period of renewal [s]: several attempts fit into `EXPIRY_S`."""


class Lease:
    """A lease that this process holds; made by `leased`."""

    def __init__(self, key: RemotePath, content: bytes) -> None:
        self._key = key
        self._content = content
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._renew, daemon=True)

    def require(self) -> None:
        """Refuse to go on once the lease is lost.

        Raises
        ------
        StoreError
            If another process has taken it over, or the store does not answer.
        """
        if not self._key.is_file():
            raise StoreError(
                f"{self._key.parent.parent}: this process did not answer for {EXPIRY_S:.0f} s, and another one has taken the "
                "campaign over; wait for it, or stop it and run the same command again"
            )

    def start(self) -> None:
        """Renew until `end`."""
        self._thread.start()

    def end(self) -> None:
        """Give the lease back, as far as the store answers."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        try:
            self._key.unlink(missing_ok=True)
        except (StoreError, OSError):
            return

    def _renew(self) -> None:
        while not self._ended.wait(RENEWAL_S):
            try:
                if self._key.is_file():
                    self._key.upload(self._content)
            except (StoreError, OSError):  # the next attempt, or the next record, tells
                continue


@contextmanager
def leased(folder: RemotePath) -> Iterator[Lease]:
    """Hold the lease of a folder.

    Raises
    ------
    ConfigurationError
        If another process holds it.
    StoreError
        If the store refuses or does not answer.
    """
    owner = {"host": socket.gethostname(), "process": os.getpid(), **_machine()}
    content = json.dumps({**owner, "started": started(os.getpid())}).encode()
    lease = Lease(folder / LEASES / f"{secrets.token_hex(8)}.json", content)
    lease._key.upload(content)
    try:
        held = _held(folder, lease._key)
        if held is not None:
            raise ConfigurationError(
                f"{folder}: another process is flying this campaign ({held}); wait for it or stop it, its lease ends "
                f"{EXPIRY_S:.0f} s after it has stopped"
            )
        lease.start()
        yield lease
    finally:
        lease.end()


def _held(folder: RemotePath, own: RemotePath) -> str | None:
    """The owner of another lease that has not ended, in words; leases that have ended are deleted."""
    now = own.modified_s()
    for key in (folder / LEASES).iterdir():
        written = key.modified_s()
        if key == own or written is None:
            continue
        try:
            facts = json.loads(key.read_bytes())
        except (FileNotFoundError, ValueError):
            facts = {}
        if now is None or (now - written < EXPIRY_S and not _ended(facts)):
            return f"{facts.get('host', 'unknown host')}, process {facts.get('process', 'unknown')}"
        key.unlink(missing_ok=True)
    return None


def _ended(facts: dict[str, object]) -> bool:
    """Whether the owner was a process of this machine that has ended."""
    process, start = facts.get("process"), facts.get("started")
    here = {"host": socket.gethostname(), **_machine()}
    if any(facts.get(name) != value for name, value in here.items()) or not isinstance(process, int):
        return False
    return not is_alive(process, start if isinstance(start, int) else 0)


@lru_cache(maxsize=1)
def _machine() -> dict[str, str]:
    """Identity of this start of this machine, and of the process numbers of this container."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return {"boot": boot, "processes": os.readlink("/proc/self/ns/pid")}
    except OSError:  # not Linux: an owner that was killed expires
        return {"boot": secrets.token_hex(8)}


__all__ = ["EXPIRY_S", "LEASES", "RENEWAL_S", "Lease", "leased"]
