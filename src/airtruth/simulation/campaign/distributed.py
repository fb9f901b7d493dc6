"""Fly chunks on a cluster: every worker flies in a child process of its own, and the caller alone records.

A task is a chunk with its runs and the plan without its table (10 kB), so that it grows neither with the campaign nor with
the number of workers.
"""

from __future__ import annotations

import atexit
import pickle
from collections.abc import Generator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from airtruth.cluster import Cluster, LostWorkError
from airtruth.errors import StoreError
from airtruth.logs.names import chunk_file
from airtruth.logs.remote import RemotePath
from airtruth.simulation.campaign.chunk import ChunkOrder, FlownChunk
from airtruth.simulation.campaign.plan import Plan
from airtruth.simulation.campaign.workers import ResidentProcess, interrupted, orders_of, without_table

_LOST: Final = (
    "the workers of the cluster that flew this chunk of runs ended each time; the same command flies it again"
)
"""Reason of the runs of a chunk that no worker returned."""
_flying: dict[str, ResidentProcess] = {}
"""Process of the campaign that this worker flies, by the digest of its plan and its folder."""


@dataclass(frozen=True)
class _Errand:
    """A chunk for a worker: the pickled plan without its table, its digest, the folders of the files, and the order."""

    plan: bytes
    digest: str
    logs: Path
    truths: Path
    order: ChunkOrder


def fly_chunks_on(
    cluster: Cluster, plan: Plan, chunks: list[int], logs: Path, truths: Path
) -> Generator[FlownChunk, None, None]:
    """Fly chunks on a cluster; yield each once its files are complete, in the order in which they end.

    Parameters
    ----------
    cluster : whose workers see the folders under the same names.
    plan, chunks, logs, truths : as in `airtruth.simulation.campaign.workers.fly_chunks`.

    Raises
    ------
    StoreError
        If a file cannot be written, a worker's files do not appear here, or the scheduler is lost.
    """
    logs, truths = logs.absolute(), truths.absolute()
    plane = plan.aircraft.model_copy(update={"folder": plan.aircraft.folder.absolute()})
    content = pickle.dumps(without_table(replace(plan, aircraft=plane)))
    errands = (_Errand(content, plan.digest, logs, truths, order) for order in orders_of(plan, chunks))
    for errand, flown in cluster.completed(_fly, errands):
        if isinstance(flown, LostWorkError):
            yield interrupted(errand.order, _LOST)
            continue
        if flown.truth_sha256 is not None and not (truths / chunk_file(flown.chunk)).is_file():
            raise StoreError(
                f"{truths}: a worker of the cluster has written {chunk_file(flown.chunk)}, which does not appear here; "
                "use a folder that all machines share under the same name"
            )
        yield flown


def _fly(errand: _Errand) -> FlownChunk:
    """Fly one chunk on a worker, in the child process of its campaign."""
    key = f"{errand.digest} {errand.logs}"
    if key not in _flying:
        _end()
        plan: Plan = pickle.loads(errand.plan)
        for folder in (errand.logs, plan.aircraft.folder):
            if not isinstance(folder, RemotePath) and not folder.is_dir():
                raise StoreError(
                    f"{folder}: a worker of the cluster does not see this folder; use one that all machines share under the "
                    "same name"
                )
        _flying[key] = ResidentProcess(plan, errand.logs, errand.truths)
    return _flying[key].fly(errand.order)


def _end() -> None:
    while _flying:
        _flying.popitem()[1].close()


atexit.register(_end)

__all__ = ["fly_chunks_on"]
