"""Workers of a cluster that write straight into a store: the bytes of a local campaign, also after killed workers."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from campaigns import contents, everything

from airtruth.cluster import connected
from airtruth.logs.remote import location
from airtruth.logs.verify import verify

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("stores")]


def workers() -> list[int]:
    """Processes of the workers of this process's own cluster."""
    found = []
    for task in Path(f"/proc/{os.getpid()}/task").glob("*/children"):
        for pid in task.read_text().split():
            if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes():
                found.append(int(pid))
    return sorted(found)


class Killer:
    """Kills a worker at the first progress that a command reports after some work is done."""

    def __init__(self) -> None:
        self.killed = 0

    def __call__(self, done: int, total: int, failed: int) -> None:
        if 0 < done < total and not self.killed:
            self.killed = workers()[0]
            os.kill(self.killed, signal.SIGKILL)


@pytest.mark.long
def test_workers_write_the_bytes_of_a_local_campaign_into_a_store(
    bucket: str, campaign: Path, local: Path
) -> None:
    out = location(f"{bucket}/results")
    flying, identifying = Killer(), Killer()
    with connected("local:2") as cluster:
        everything(campaign, out, cluster, flying, identifying)
    assert flying.killed
    assert identifying.killed not in (0, flying.killed)
    assert contents(out) == contents(local)
    assert [f.file for f in verify(out / "light").findings] == ["estimates.parquet"]  # of no command
