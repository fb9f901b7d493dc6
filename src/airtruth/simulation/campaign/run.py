"""Fly a campaign: chunks of runs over processes, each recorded as it completes, resumable after any interruption."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from functools import partial
from pathlib import Path

from airtruth.arguments import require_whole
from airtruth.cluster import Cluster
from airtruth.errors import ConfigurationError
from airtruth.logs.remote import location
from airtruth.simulation.campaign import folder
from airtruth.simulation.campaign.chunk import INTERRUPTED, FlownChunk
from airtruth.simulation.campaign.distributed import fly_chunks_on
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.campaign.plan import Plan, make
from airtruth.simulation.campaign.result import CampaignResult
from airtruth.simulation.campaign.truths import PARTS
from airtruth.simulation.campaign.workers import fly_chunks

Progress = Callable[[int, int, int], None]
"""Called with the numbers of runs done, runs in all and runs failed."""


Engine = Callable[[Plan, list[int], Path, Path], Generator[FlownChunk, None, None]]
"""Flies chunks of a plan into the folders of logs and truths, and yields each once its files are complete."""


def _silent(done: int, total: int, failed: int) -> None:
    """Report no progress."""


def fly(
    campaign: Path | str | Campaign | Plan,
    out: Path | str,
    jobs: int = 1,
    seed: int | None = None,
    runs: int | None = None,
    advance: Progress = _silent,
    cluster: Cluster | None = None,
) -> CampaignResult:
    """Fly the runs of a campaign that its folder lacks: those of an interrupted, damaged or smaller campaign.

    Parameters
    ----------
    campaign : campaign file, or a campaign that was read or planned.
    out : folder of the campaign; the same call resumes an interrupted one.
    jobs : number of child processes that fly. The files do not depend on it.
    seed, runs : instead of the campaign's own; not for a `Plan`, whose runs are drawn already.
    advance : called after each chunk.
    cluster : flies in place of processes on this machine; its workers see ``out`` under the same name.

    Returns
    -------
    CampaignResult
        Its folder holds logs/, plan.parquet, truth.parquet, manifest.jsonl and campaign.json.

    Raises
    ------
    ConfigurationError
        If the campaign cannot be flown as written, the folder holds another campaign or more runs, or another
        process is flying into it.
    AircraftError, TrimError
        If the aircraft cannot be loaded, or cannot be trimmed at the nominal condition.
    StoreError
        If a file cannot be read or written; complete files stay, and the same call resumes.
    KeyboardInterrupt
        On Ctrl-C, after the workers have been stopped; the same call resumes.
    """
    require_whole("jobs", jobs, 1)
    if isinstance(campaign, Plan):
        if seed is not None or runs is not None:
            raise ConfigurationError(
                "fly: a plan already has its seed and runs; state them when the plan is made"
            )
        plan = campaign
    else:
        plan = make(campaign, seed, runs)
    engine = partial(fly_chunks, jobs=jobs) if cluster is None else partial(fly_chunks_on, cluster)
    return _fly(plan, location(out), engine, advance)


def _fly(plan: Plan, out: Path, engine: Engine, advance: Progress) -> CampaignResult:
    folder.claim(plan, out)
    with folder.locked(out) as require_lock:
        folder.clean(out)
        state = folder.inspect(plan, out)
        chunks = {chunk.chunk: chunk for chunk in state.chunks}
        before = done = sum(chunk.runs for chunk in state.chunks)
        failed = sum(chunk.failed for chunk in state.chunks)
        if not state.finished:
            chunks = {chunk.chunk: chunk for chunk in folder.begin(plan, out, state.chunks)}
            missing = [c for c in range(int(plan.table["chunk"].iloc[-1]) + 1) if c not in chunks]
            advance(done, len(plan.table), failed)
            try:
                logs, truths = out / folder.LOGS, out / PARTS
                with closing(engine(plan, missing, logs, truths)) as flown:
                    for chunk in flown:
                        require_lock()
                        folder.record(out, chunk)
                        chunks[chunk.chunk] = chunk
                        done, failed = done + chunk.runs, failed + chunk.failed
                        advance(done, len(plan.table), failed)
                if all(chunk.complete for chunk in chunks.values()):
                    folder.finish(plan, out, chunks.values())
            finally:
                folder.clean(out)  # workers that were stopped may have left files
    unflown = tuple(outcome for _, chunk in sorted(chunks.items()) for outcome in chunk.unflown)
    return CampaignResult(
        folder=out,
        plan=plan,
        unflown=unflown,
        flown_now=len(plan.table) - before - sum(outcome.status == INTERRUPTED for outcome in unflown),
        repaired=state.damaged,
    )
