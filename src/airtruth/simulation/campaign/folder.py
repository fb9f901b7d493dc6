"""The folder of a campaign: whose it is, which of its chunks are complete, and how it is finished.

The manifest holds a sealed record of the campaign, one of each chunk with the digests of its files and the runs that
have no log, and a last one that closes a finished campaign. An unfinished campaign has its truth in parts, one per chunk.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from airtruth.errors import ConfigurationError, StoreError
from airtruth.logs import manifest
from airtruth.logs.atomic import atomic_file, make_folder, write_error
from airtruth.logs.digest import sha256_of, sha256_of_each
from airtruth.logs.lease import LEASES, leased
from airtruth.logs.manifest import MANIFEST
from airtruth.logs.names import chunk_file
from airtruth.logs.remote import RemotePath
from airtruth.logs.tables import table_bytes
from airtruth.logs.temporary import clear, is_temporary
from airtruth.simulation.campaign import truths
from airtruth.simulation.campaign.chunk import FAILED, INTERRUPTED, FlownChunk, Outcome
from airtruth.simulation.campaign.plan import Plan, settings_json
from airtruth.simulation.campaign.truths import PARTS, TRUTH

SETTINGS: Final = "campaign.json"
"""File that identifies the campaign of a folder by its digest."""
PLAN: Final = "plan.parquet"
"""File of the run table, every random draw in it."""
LOGS: Final = "logs"
"""Folder of the flight logs, one file per chunk."""
LOCK: Final = ".lock"
"""File whose lock the flying process holds."""
FILES: Final = "files"
"""Key of the manifest's records that hold digests: path in the folder -> SHA-256."""


@dataclass(frozen=True)
class State:
    """A campaign's folder before anything is flown.

    Attributes
    ----------
    chunks : chunks whose runs are recorded and whose files have the recorded digests.
    damaged : a sentence for each file that is damaged or missing.
    finished : whether the campaign is complete and every file has the recorded digest.
    """

    chunks: tuple[FlownChunk, ...]
    damaged: tuple[str, ...]
    finished: bool


@dataclass(frozen=True)
class _Recorded:
    """The manifest: head, recorded chunks, digest of the truth, damaged lines, and whether it is that of a finished one."""

    head: Mapping[str, Any]
    chunks: Mapping[int, FlownChunk]
    truth: str | None
    damaged: tuple[int, ...]
    closed: bool


def claim(plan: Plan, out: Path) -> None:
    """Take a new or empty folder for a campaign, or check that a folder is this campaign's.

    Raises
    ------
    ConfigurationError
        If the folder holds something else, another campaign, or more runs of this one.
    StoreError
        If it cannot be read or written.
    """
    try:
        entries = {p.name for p in out.iterdir() if not is_temporary(p.name)} if out.exists() else set()
    except OSError as error:
        raise StoreError(f"{out}: cannot be used as a campaign's folder ({error.strerror})") from None
    stated = _stated(out)
    if not stated and entries - {LOCK, LEASES}:
        held = entries & {SETTINGS, MANIFEST}
        raise ConfigurationError(
            f"{out}: {', '.join(sorted(held))} cannot be read as those of a campaign; restore them, or choose another --out"
            if held
            else f"{out}: is not empty and holds no campaign; choose another --out"
        )
    if stated and all(facts["digest"] != plan.digest for facts in stated):
        there = stated[-1]
        raise ConfigurationError(
            f"{out}: holds another campaign ({there['name']!r}, {there['runs']} runs, seed {there['seed']}; "
            f"asked for {plan.campaign.name!r}, {plan.campaign.runs} runs, seed {plan.seed}), or the campaign file or "
            "the aircraft changed since; choose another --out, or remove the folder"
        )
    if stated and stated[0]["runs"] > plan.campaign.runs:
        raise ConfigurationError(
            f"{out}: holds {stated[0]['runs']} runs of this campaign, more than the {plan.campaign.runs} asked for, and "
            f"a campaign only grows; give --runs {stated[0]['runs']} or more, or choose another --out"
        )
    make_folder(out)


@contextmanager
def locked(out: Path) -> Iterator[Callable[[], None]]:
    """Hold the folder's lock, which the system releases however the process ends; in a store a lease.

    Yields
    ------
    callable
        Raises `StoreError` once a lease is lost; it does nothing for a lock.

    Raises
    ------
    ConfigurationError
        If another process holds it.
    StoreError
        If the folder cannot be written.
    """
    if isinstance(out, RemotePath):
        with leased(out) as lease:
            yield lease.require
        return
    try:
        file = (out / LOCK).open("w")
    except OSError as error:
        raise write_error(out / LOCK, error) from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ConfigurationError(
                f"{out}: another process is flying this campaign; wait for it or stop it"
            ) from None
        yield lambda: None


def clean(out: Path) -> None:
    """Remove temporary files of processes that have ended; a complete file has its final name."""
    for folder in (out, out / LOGS, out / PARTS):
        clear(folder)


def inspect(plan: Plan, out: Path) -> State:
    """Return what a folder holds of a campaign, every file compared with its digest.

    Raises
    ------
    StoreError
        If a file cannot be read.
    """
    recorded = _recorded(out)
    damaged = [f"{MANIFEST}: line {number} is damaged" for number in recorded.damaged]
    if not recorded.head and any((out / LOGS).glob("*.parquet")):
        damaged.append(f"{MANIFEST}: is missing or its first line is damaged")
    elif not damaged and not recorded.closed and (out / TRUTH).exists() and not (out / PARTS).exists():
        damaged.append(f"{MANIFEST}: lacks the last lines of a complete campaign")
    for name, content in _tables(plan).items():
        here = sha256_of(out / name)
        if recorded.head and here not in (_sha256(content), recorded.head[FILES].get(name)):
            damaged.append(_sentence(out / name, name))
    sizes = np.bincount(plan.table["chunk"])
    recorded_now = sorted(recorded.chunks.items())
    own = [
        chunk for n, chunk in recorded_now if n < len(sizes) and chunk.runs == sizes[n]
    ]  # others have grown
    intact = truths.find(plan, out, recorded.chunks, recorded.truth).intact
    present = sha256_of_each([out / LOGS / chunk_file(c.chunk) for c in own if c.log_sha256 is not None])
    logs = dict(zip((c.chunk for c in own if c.log_sha256 is not None), present, strict=True))
    chunks = []
    for chunk in own:
        name = chunk_file(chunk.chunk)
        whole = logs.get(chunk.chunk) == chunk.log_sha256
        if not whole:
            damaged.append(_sentence(out / LOGS / name, f"{LOGS}/{name}"))
        if chunk.chunk not in intact and recorded.truth is None:
            damaged.append(_sentence(out / PARTS / name, f"{PARTS}/{name}"))
        if whole and chunk.chunk in intact:
            chunks.append(chunk)
    if recorded.truth is not None and sha256_of(out / TRUTH) != recorded.truth:
        damaged.append(_sentence(out / TRUTH, TRUTH))
    same = recorded.head.get("runs") == plan.campaign.runs and len(chunks) == len(sizes)
    finished = same and not damaged and recorded.closed and not (out / PARTS).exists()
    return State(tuple(chunks), tuple(damaged), finished)


def begin(plan: Plan, out: Path, chunks: Sequence[FlownChunk]) -> tuple[FlownChunk, ...]:
    """Make the folder that of an unfinished campaign with the given complete chunks, and return these.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    for name, content in _tables(plan).items():  # the identity of the folder first
        if sha256_of(out / name) != _sha256(content):
            _write(out / name, content)
    make_folder(out / LOGS)
    make_folder(out / PARTS)
    recorded = _recorded(out)
    found = truths.find(plan, out, recorded.chunks, recorded.truth)
    kept = []
    for chunk in chunks:
        rows = found.content(chunk) if chunk.chunk in found.merged else None
        if rows is not None:
            _write(out / PARTS / chunk_file(chunk.chunk), rows)
            chunk = replace(chunk, truth_sha256=_sha256(rows))
        kept.append(chunk)
    manifest.rewrite(out / MANIFEST, _records(plan, kept))
    return tuple(kept)


def record(out: Path, chunk: FlownChunk) -> None:
    """Append a chunk that has ended to the manifest.

    Raises
    ------
    StoreError
        If the manifest cannot be written.
    """
    manifest.append(out / MANIFEST, manifest.sealed(_chunk_record(chunk)))


def finish(plan: Plan, out: Path, chunks: Collection[FlownChunk]) -> None:
    """Merge the truth, and write the manifest of a finished campaign: each chunk once, in order.

    Raises
    ------
    StoreError
        If a file cannot be read or written.
    """
    ordered = sorted(chunks, key=lambda chunk: chunk.chunk)
    truths.merge(out, ordered)
    closing = {"complete": True, FILES: {TRUTH: sha256_of(out / TRUTH)}}
    manifest.rewrite(out / MANIFEST, _records(plan, ordered), closing)
    clear(out / PARTS)
    truths.remove_parts(out)


def _stated(out: Path) -> list[dict[str, Any]]:
    """Statements of the manifest and campaign.json about the campaign; the manifest first, and only what is readable."""
    head = _recorded(out).head
    stated = [dict(head)] if head else []
    try:
        settings = json.loads((out / SETTINGS).read_text(encoding="utf-8"))
        facts = {key: settings[key] for key in ("digest", "name", "runs", "seed")}
        if isinstance(facts["runs"], int):
            stated.append(facts)
    except OSError as error:
        if not isinstance(error, FileNotFoundError | NotADirectoryError):
            raise StoreError(f"{out / SETTINGS}: cannot be read ({error.strerror})") from None
    except (ValueError, LookupError, TypeError, RecursionError):
        return stated
    return stated


def _recorded(out: Path) -> _Recorded:
    """The valid records of the manifest."""
    scan = manifest.scan(out / MANIFEST)
    chunks: dict[int, FlownChunk] = {}
    head: dict[str, Any] = {}
    truth = None
    for entry in scan.records:
        values: dict[str, Any] = dict(entry)
        if "digest" in values:
            head = values
        elif "chunk" in values and FILES in values:
            number = values["chunk"]
            failed = tuple(Outcome(run, FAILED, why) for run, why in values.get(FAILED, {}).items())
            log = values[FILES].get(f"{LOGS}/{chunk_file(number)}")
            chunks[number] = FlownChunk(number, values["runs"], failed, log, values["truth"])
        elif "complete" in values:
            truth = values[FILES][TRUTH]
    return _Recorded(head, chunks, truth, scan.damaged, scan.closed)


def _tables(plan: Plan) -> dict[str, bytes]:
    """Files that follow from the plan alone, with their bytes."""
    return {SETTINGS: settings_json(plan).encode(), PLAN: table_bytes(plan.table)}


def _records(plan: Plan, chunks: Sequence[FlownChunk]) -> Iterator[dict[str, object]]:
    yield {
        "digest": plan.digest,
        "name": plan.campaign.name,
        "runs": plan.campaign.runs,
        "seed": plan.seed,
        FILES: {name: _sha256(content) for name, content in _tables(plan).items()},
    }
    yield from map(_chunk_record, chunks)


def _chunk_record(chunk: FlownChunk) -> dict[str, object]:
    """Number of runs, the reasons of those that have no log, and the digests of a complete chunk."""
    record: dict[str, object] = {"chunk": chunk.chunk, "runs": chunk.runs}
    for status in (FAILED, INTERRUPTED):
        reasons = {o.run_id: o.reason for o in chunk.unflown if o.status == status}
        record |= {status: reasons} if reasons else {}
    if not chunk.complete:
        return record
    log = {} if chunk.log_sha256 is None else {f"{LOGS}/{chunk_file(chunk.chunk)}": chunk.log_sha256}
    return {**record, FILES: log, "truth": chunk.truth_sha256}


def _sentence(path: Path, name: str) -> str:
    return f"{name}: its SHA-256 is not that of the manifest" if path.exists() else f"{name}: is missing"


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _write(path: Path, content: bytes) -> None:
    with atomic_file(path) as file:
        file.write(content)
