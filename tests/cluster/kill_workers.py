"""Kill the worker of each nanny in turn, every three seconds, six times: kill_workers.py NANNY_PID..."""

import os
import signal
import sys
import time
from itertools import cycle, islice
from pathlib import Path


def children(pid: str) -> list[int]:
    """Processes that a process has started."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        found += [int(child) for child in task.read_text().split()]
    return found


for nanny in islice(cycle(sys.argv[1:]), 6):
    time.sleep(3.0)
    for child in children(nanny):
        try:
            command = Path(f"/proc/{child}/cmdline").read_bytes()
            if b"resource_tracker" not in command:
                os.kill(child, signal.SIGKILL)
        except (ProcessLookupError, FileNotFoundError):
            continue
