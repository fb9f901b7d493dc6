"""Functions that the workers of a cluster call."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from airtruth.errors import LogError


def double(number: int) -> int:
    return 2 * number


def refuse(number: int) -> int:
    if number == 3:
        raise LogError("number 3 contradicts physics")
    return number


def die_once(marker: str) -> str:
    """End the worker at the first call with a marker; return at the second."""
    path = Path(marker)
    if not path.exists():
        path.write_text("died")
        os.kill(os.getpid(), signal.SIGKILL)
    return "returned"


def die(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number
