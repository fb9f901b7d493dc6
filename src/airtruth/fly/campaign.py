"""Fly a campaign: chunks over processes, what is done recorded as it is done, resumable at any moment."""

from __future__ import annotations

import fcntl
import json
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import pandas as pd

from airtruth.errors import ConfigurationError, StoreError
from airtruth.fly.chunk import Outcome, Pilot, truth_row
from airtruth.fly.plan import Plan, rows, settings_json
from airtruth.logs import manifest, store

MANIFEST: Final = "manifest.jsonl"
SETTINGS: Final = "campaign.json"
PLAN: Final = "plan.parquet"
TRUTH: Final = "truth.parquet"
_PARTS: Final = "truth-parts"
_ATTEMPTS: Final = 2
_PARENT_CHECK_S: Final = 0.5

Progress = Callable[[int, int, int], None]
"""Called with runs done, runs in all, runs failed."""


@dataclass(frozen=True)
class Summary:
    """How a campaign ended: numbers of runs, those of this call and the failures with their reasons."""

    runs: int
    flown_now: int
    failures: tuple[Outcome, ...]


def fly(
    plan: Plan, out: Path, jobs: int = 1, progress: Progress = lambda done, total, failed: None
) -> Summary:
    """Fly what is left of a campaign.

    Parameters
    ----------
    plan : the campaign.
    out : its folder: logs/, plan.parquet, truth.parquet, manifest.jsonl, campaign.json.
    jobs : processes; 1 flies in this one. The files do not depend on it.
    progress : called after each chunk.

    Raises
    ------
    ConfigurationError
        If the folder holds another campaign, or another process is flying into it.
    StoreError
        If a file cannot be read or written; what is finished stays, and the same call resumes.
    KeyboardInterrupt
        On Ctrl-C, after the workers have been stopped; the same call resumes.
    """
    _claim(plan, out)
    with _lock(out):
        _clean(out)
        done = _finished_chunks(plan, out)
        chunks = [int(c) for c in sorted(plan.table["chunk"].unique()) if int(c) not in done]
        sizes = plan.table["chunk"].value_counts()
        failures = [o for outcomes in done.values() for o in outcomes if o.status == "failed"]
        flown = sum(len(outcomes) for outcomes in done.values())
        before = flown
        progress(flown, len(plan.table), len(failures))
        for chunk, outcomes in _run(plan, out, chunks, jobs):
            manifest.append(out / MANIFEST, *({"chunk": chunk, **asdict(o)} for o in outcomes))
            failures += [o for o in outcomes if o.status == "failed"]
            flown += int(sizes[chunk])
            progress(flown, len(plan.table), len(failures))
        _merge_truth(out)
        _clean(out)  # what an orphan of a killed process may have left meanwhile
    return Summary(len(plan.table), flown - before, tuple(sorted(failures, key=lambda o: o.run_id)))


def _claim(plan: Plan, out: Path) -> None:
    """Make the folder this campaign's, or see that it is already."""
    settings = out / SETTINGS
    try:
        if settings.exists():
            there = json.loads(settings.read_text(encoding="utf-8"))
            if there.get("digest") != plan.digest:
                raise ConfigurationError(
                    f"{out}: holds another campaign ({there.get('name')!r}, {there.get('runs')} runs, seed {there.get('seed')}; "
                    f"asked for {plan.campaign.name!r}, {plan.campaign.runs} runs, seed {plan.seed}), or the campaign file or "
                    "the aircraft changed since; choose another --out, or remove the folder"
                )
        else:
            if out.is_dir() and any(not _half_claimed(path) for path in out.iterdir()):
                raise ConfigurationError(f"{out}: is not empty and holds no campaign; choose another --out")
            out.mkdir(parents=True, exist_ok=True)
            store.write_text(settings, settings_json(plan))
        (out / "logs").mkdir(exist_ok=True)
        (out / _PARTS).mkdir(exist_ok=True)
    except (OSError, ValueError) as error:
        raise StoreError(f"{out}: cannot be used as a campaign's folder ({error})") from None
    if not _readable(out / PLAN):
        store.write_table(out / PLAN, plan.table)


def _half_claimed(path: Path) -> bool:
    """Whether a process that was killed while it claimed the folder left this."""
    return path.name.startswith(f".{SETTINGS}.") and path.name.endswith(".tmp")


def _readable(table: Path) -> bool:
    try:
        store.read_table(table)
    except StoreError:
        return False
    return True


@contextmanager
def _lock(out: Path) -> Iterator[None]:
    """One process at a time; the lock goes with the process, however it ends."""
    try:
        file = (out / ".lock").open("w")
    except OSError as error:
        raise StoreError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ConfigurationError(
                f"{out}: another process is flying this campaign; wait for it or stop it"
            ) from None
        yield


def _clean(out: Path) -> None:
    """Remove what a killed process left half-written; it was never under its final name."""
    for folder in (out, out / "logs", out / _PARTS):
        for path in folder.glob(".*.tmp"):
            path.unlink(missing_ok=True)


def _finished_chunks(plan: Plan, out: Path) -> dict[int, list[Outcome]]:
    """Chunks whose runs are all in the manifest and whose files are whole."""
    found: dict[int, dict[str, Outcome]] = {}
    for record in manifest.read(out / MANIFEST):
        outcome = Outcome(str(record["run_id"]), str(record["status"]), str(record["reason"]))
        found.setdefault(int(str(record["chunk"])), {})[outcome.run_id] = outcome
    expected = plan.table["chunk"].value_counts()
    truth = _readable(out / TRUTH)
    return {
        chunk: list(outcomes.values())
        for chunk, outcomes in found.items()
        if len(outcomes) == expected.get(chunk, -1) and _whole(out, chunk, outcomes.values(), truth)
    }


def _whole(out: Path, chunk: int, outcomes: Iterable[Outcome], truth: bool) -> bool:
    flown = [o for o in outcomes if o.status == "ok"]
    try:
        if not truth:
            store.read_metadata(out / _PARTS / f"{chunk:05d}.parquet")
        if flown:
            store.read_metadata(out / "logs" / f"{chunk:05d}.parquet")
    except StoreError:
        return False
    return True


def _merge_truth(out: Path) -> None:
    """One truth.parquet of the parts, in the order of the runs."""
    parts = sorted((out / _PARTS).glob("*.parquet"))
    if not parts:
        return
    frames = [store.read_table(part) for part in parts]
    if _readable(out / TRUTH):
        frames.insert(0, store.read_table(out / TRUTH))
    truth = pd.concat(frames).drop_duplicates("run_id", keep="last").sort_values("run_id", kind="stable")
    store.write_table(out / TRUTH, truth.reset_index(drop=True))
    for part in parts:
        part.unlink()


def _run(plan: Plan, out: Path, chunks: list[int], jobs: int) -> Iterator[tuple[int, list[Outcome]]]:
    if not chunks:
        return
    (out / _PARTS).mkdir(exist_ok=True)
    if jobs == 1:
        pilot = Pilot(plan)
        for chunk in chunks:
            yield chunk, pilot.fly_chunk(chunk, out / "logs", out / _PARTS)
        return
    yield from _run_pool(plan, out, chunks, jobs)


def _run_pool(plan: Plan, out: Path, chunks: list[int], jobs: int) -> Iterator[tuple[int, list[Outcome]]]:
    """Processes. When one dies, the chunks that were in flight are flown again, each in a process alone."""
    left = list(chunks)
    while left:
        running: dict[Future[list[Outcome]], int] = {}
        try:
            for chunk, outcomes in _share(plan, out, list(left), jobs, running):
                left.remove(chunk)
                yield chunk, outcomes
        except BrokenProcessPool:
            for chunk in sorted(running.values()):
                outcomes = _alone(plan, out, chunk)
                left.remove(chunk)
                yield chunk, outcomes


def _share(
    plan: Plan, out: Path, chunks: list[int], jobs: int, running: dict[Future[list[Outcome]], int]
) -> Iterator[tuple[int, list[Outcome]]]:
    """Chunks over ``jobs`` processes; ``running`` tells the caller which are in flight."""
    waiting = iter(chunks)
    with _pool(plan, min(jobs, len(chunks))) as pool:
        while True:
            while len(running) < 2 * jobs and (chunk := next(waiting, None)) is not None:
                running[pool.submit(_work, chunk, out / "logs", out / _PARTS)] = chunk
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                outcomes = future.result()
                yield running.pop(future), outcomes


def _alone(plan: Plan, out: Path, chunk: int) -> list[Outcome]:
    for _ in range(_ATTEMPTS):
        try:
            with _pool(plan, 1) as pool:
                return pool.submit(_work, chunk, out / "logs", out / _PARTS).result()
        except BrokenProcessPool:
            continue
    return _given_up(plan, out, chunk)


@contextmanager
def _pool(plan: Plan, processes: int) -> Iterator[ProcessPoolExecutor]:
    pool = ProcessPoolExecutor(
        max_workers=processes,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(plan, os.getpid()),
    )
    try:
        yield pool
    finally:
        workers = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()
        for worker in workers:
            worker.join()


def _given_up(plan: Plan, out: Path, chunk: int) -> list[Outcome]:
    reason = f"the process that flew this chunk of runs died {_ATTEMPTS + 1} times (killed, out of memory, or a crash in JSBSim)"
    given_up = rows(plan, chunk)
    truth = pd.DataFrame([truth_row(row, None) for row in given_up])
    store.write_table(out / _PARTS / f"{chunk:05d}.parquet", truth)
    return [Outcome(row["run_id"], "failed", reason) for row in given_up]


_pilot: Pilot | None = None


def _start_worker(plan: Plan, parent: int) -> None:
    global _pilot
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    threading.Thread(target=_die_with, args=(parent,), daemon=True).start()
    _pilot = Pilot(plan)


def _die_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_PARENT_CHECK_S)
    os._exit(1)


def _work(chunk: int, logs: Path, truths: Path) -> list[Outcome]:
    assert _pilot is not None
    return _pilot.fly_chunk(chunk, logs, truths)
