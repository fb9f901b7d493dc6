"""Addresses of clusters: local:N, tcp://HOST:PORT, tls://HOST:PORT, or a scheduler file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from airtruth.errors import ConfigurationError

LOCAL: Final = "local:"
"""Start of the address of processes on this machine."""
SCHEMES: Final = ("tcp://", "tls://")
"""Starts of the address of a scheduler."""
ALLOWED: Final = (
    "local:N, tcp://HOST:PORT, tls://HOST:PORT, or the scheduler file that `dask scheduler` wrote"
)
"""Addresses that exist, for messages."""


@dataclass(frozen=True)
class Address:
    """Where the work is done: ``local`` processes on this machine, or a ``scheduler`` at a URL or in a file."""

    text: str
    local: int | None = None
    scheduler: str | None = None
    file: Path | None = None


def parse(text: str) -> Address:
    """Read the address of a cluster.

    Raises
    ------
    ConfigurationError
        If it is none of `ALLOWED`, or its scheduler file cannot be read.

    Examples
    --------
    >>> parse("local:4").local
    4
    """
    if text.startswith(LOCAL):
        count = text.removeprefix(LOCAL)
        if not count.isascii() or not count.isdecimal() or int(count) < 1:
            raise ConfigurationError(
                f"--cluster {text}: local:N needs a number of processes, such as local:2"
            )
        return Address(text, local=int(count))
    if text.startswith(SCHEMES):
        host, _, port = text.split("://", 1)[1].rpartition(":")
        if not host or not port.isdecimal():
            raise ConfigurationError(f"--cluster {text}: state host and port, such as tcp://10.0.0.1:8786")
        return Address(text, scheduler=text)
    path = Path(text)
    if not path.is_file():
        raise ConfigurationError(f"--cluster {text}: no such scheduler file; allowed: {ALLOWED}")
    try:
        stated = json.loads(path.read_text(encoding="utf-8"))["address"]
    except (OSError, ValueError, KeyError, TypeError):
        raise ConfigurationError(
            f"--cluster {text}: not a scheduler file, which holds JSON with the key address; allowed: {ALLOWED}"
        ) from None
    return Address(text, scheduler=str(stated), file=path)


__all__ = ["Address", "parse"]
