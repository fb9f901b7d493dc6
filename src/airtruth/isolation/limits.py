"""Limits of time and memory that a process imposes on itself before it reads a file of a stranger."""

from __future__ import annotations

import importlib
import signal
from dataclasses import asdict, dataclass
from typing import Any, Final

LEAST_SECONDS: Final = 15.0
"""Time for a small file [s] (judgement: the slowest reader needs 0.2 s for a file of 1 MB, and a user still waits)."""
BYTES_PER_SECOND: Final = 2e6
"""Rate at which the time grows with the size of the file [byte/s] (judgement: a tenth of the rate of the slowest
reader, CSV, on the developers' machine)."""
LEAST_MEMORY_BYTES: Final = 2_500_000_000
"""Address space for a small file [byte]; an interpreter with pandas, scipy, pyarrow and h5py has 1.2 GB of it."""
MEMORY_PER_BYTE: Final = 40.0
"""Address space per byte of the file [-] (judgement: a compressed .mat or Parquet file expands at most twentyfold, and
two copies exist for a moment)."""


@dataclass(frozen=True)
class ProcessLimits:
    """Limits of one call.

    Attributes
    ----------
    seconds : time until the answer [s]; memory_bytes : address space [byte].
    computing_s : computing time [s], which does not grow where other processes are busy; 0 for no limit.
    """

    seconds: float
    memory_bytes: int
    computing_s: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """The limits by name."""
        return asdict(self)


def limits_of(file_bytes: int) -> ProcessLimits:
    """Return the limits for reading a file of a size [byte]."""
    return ProcessLimits(
        seconds=LEAST_SECONDS + file_bytes / BYTES_PER_SECOND,
        memory_bytes=LEAST_MEMORY_BYTES + round(MEMORY_PER_BYTE * file_bytes),
    )


def impose(limits: ProcessLimits) -> None:
    """Limit this process; the system ends it when the time is over, whatever it does.

    Windows has neither limit and macOS does not enforce that of memory: there the caller's own clock is the only limit.
    """
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, limits.seconds)
    impose_cpu_time(limits.computing_s)
    impose_memory(limits.memory_bytes)


def impose_memory(memory_bytes: int) -> bool:
    """Limit the address space of this process [byte]; False if the system has no such limit or already a lower one.

    The process leaves no core file either.
    """
    try:
        resource = importlib.import_module("resource")
    except ImportError:
        return False
    _lower(resource, resource.RLIMIT_CORE, 0)
    return _lower(resource, resource.RLIMIT_AS, memory_bytes)


def impose_cpu_time(seconds: float) -> None:
    """Let the system end this process by SIGPROF once it has computed for a time from now on [s]; 0 for no limit.

    The time of a process that is stopped or waits does not count. Windows has no such limit.
    """
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def _lower(resource: Any, kind: int, value: int) -> bool:
    soft, hard = resource.getrlimit(kind)
    stated = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(kind, (min([value, *stated]), hard))
    return all(value < limit for limit in stated)


__all__ = ["ProcessLimits", "impose", "impose_cpu_time", "impose_memory", "limits_of"]
