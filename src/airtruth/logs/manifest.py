"""The manifest of a campaign: one JSON object per line, appended when a chunk is complete, for resuming.

A sealed record has its own checksum, so a changed line is detected and the others stay valid.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import time
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from airtruth.errors import StoreError
from airtruth.logs.atomic import atomic_file, sync_folder, write_error
from airtruth.logs.remote import RemotePath, each, location

SHOWN_LINES: Final = 5
"""Damaged lines that an error names [-] (judgement: a message stays readable)."""
MANIFEST: Final = "manifest.jsonl"
"""Name of the manifest in the folder of a campaign."""
MANIFEST_PARTS: Final = "manifest-parts"
"""Folder of appended records in a store, which cannot append to a key; `rewrite` takes them into the manifest."""
ABOVE: Final = "above"
"""Key of the closing record with the SHA-256 of all lines above it."""
CHECKSUM: Final = "crc32"
"""Key of a sealed record with the CRC-32 of its other entries, in hexadecimal digits."""


@dataclass(frozen=True)
class Scan:
    """A manifest of sealed records as it is.

    Attributes
    ----------
    records : valid records in the order of writing, without their checksums.
    damaged : numbers of the lines, from 1, that are not sealed records; an unfinished last line is none.
    closed : whether the file ends with a closing record and has not changed since.
    """

    records: tuple[dict[str, object], ...]
    damaged: tuple[int, ...]
    closed: bool


def sealed(record: Mapping[str, object]) -> dict[str, object]:
    """Return a record with its checksum."""
    return {**record, CHECKSUM: _checksum(record)}


def scan(path: Path | str) -> Scan:
    """Read the valid records of a manifest of sealed records; none if the file does not exist.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    records, damaged = [], []
    *lines, rest = _content(location(path)).split(b"\n")
    for number, line in enumerate(lines, start=1):
        record = _unsealed(line)
        if record is None:
            damaged.append(number)
        else:
            records.append(record)
    above = records[-1].pop(ABOVE, None) if records else None
    closed = not (rest or damaged) and above == _digest(b"".join(line + b"\n" for line in lines[:-1]))
    return Scan(tuple(records), tuple(damaged), closed)


def rewrite(
    path: Path | str,
    records: Iterable[Mapping[str, object]],
    closing: Mapping[str, object] | None = None,
) -> None:
    """Replace a manifest by sealed records, or leave it unchanged if that fails.

    Parameters
    ----------
    path : the manifest.
    records : its records.
    closing : last record of a manifest that is complete; None if others follow.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    content = b"".join(_line(sealed(record)) for record in records)
    if closing is not None:
        content += _line(sealed({**closing, ABOVE: _digest(content)}))
    path = location(path)
    earlier = list(_parts(path).iterdir()) if isinstance(path, RemotePath) else []
    with atomic_file(path) as file:
        file.write(content)
    each(partial(RemotePath.unlink, missing_ok=True), earlier)


def append(path: Path | str, *records: Mapping[str, object]) -> None:
    """Append records, one line each, and flush them to the disk.

    Only one process writes a manifest. In a store the records become a key of their own beside it.
    An unfinished last line of a killed writer is removed first.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    path = location(path)
    lines = b"".join(_line(record) for record in records)
    if isinstance(path, RemotePath):
        (_parts(path) / f"{time.time_ns():020d}-{secrets.token_hex(4)}.jsonl").upload(lines)
        return
    try:
        is_new = not path.exists()
        with open(path, "ab+") as file:
            _cut_torn_line(file.fileno())
            file.write(lines)
            file.flush()
            os.fsync(file.fileno())
        if is_new:
            sync_folder(path.parent)
    except OSError as error:
        raise write_error(path, error) from error


def read(path: Path | str) -> list[dict[str, object]]:
    """Read the records of a manifest in the order of writing; none if the file does not exist.

    An unfinished last line of a killed writer is ignored.

    Raises
    ------
    StoreError
        If the file cannot be read, or any other line is not a JSON object.
    """
    path = location(path)
    records, bad = _parse(_content(path).split(b"\n")[:-1])
    if bad:
        shown = "; ".join(bad[:SHOWN_LINES])
        more = f"; and {len(bad) - SHOWN_LINES} more" if len(bad) > SHOWN_LINES else ""
        raise StoreError(
            f"{path}: {shown}{more}. An interrupted write damages only the last line, so another program changed the "
            "file: restore it, or remove it and fly the campaign again"
        )
    return records


def _content(path: Path) -> bytes:
    parts = list(_parts(path).iterdir()) if isinstance(path, RemotePath) else []
    try:
        return path.read_bytes() + b"".join(each(RemotePath.read_bytes, parts))
    except FileNotFoundError:
        return b"".join(each(RemotePath.read_bytes, parts))
    except OSError as error:
        raise StoreError(
            f"{path}: cannot be read ({error.strerror}); make it readable and run the same command again"
        ) from error


def _parts(path: RemotePath) -> RemotePath:
    """Folder of the records that were appended to the manifest of a store, one key for each call."""
    return path.with_name(MANIFEST_PARTS)


def _line(record: Mapping[str, object]) -> bytes:
    return json.dumps(record, allow_nan=False).encode() + b"\n"


def _unsealed(line: bytes) -> dict[str, object] | None:
    """The record of a line; None unless the line has exactly the bytes of a sealed record."""
    try:
        (record,), _ = _parse([line])
        del record[CHECKSUM]
        whole = _line(sealed(record))
    except (KeyError, ValueError):
        return None
    return record if whole == line + b"\n" else None


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _checksum(record: Mapping[str, object]) -> str:
    return f"{zlib.crc32(_line(record)):08x}"


def _parse(lines: Iterable[bytes]) -> tuple[list[dict[str, object]], list[str]]:
    records: list[dict[str, object]] = []
    bad = []
    for number, line in enumerate(lines, start=1):
        try:
            record = json.loads(line)
        except (ValueError, RecursionError) as error:
            bad.append(f"line {number} is not JSON ({error})")
            continue
        if isinstance(record, dict):
            records.append(record)
        else:
            bad.append(f"line {number} is not a JSON object")
    return records, bad


def _cut_torn_line(descriptor: int) -> None:
    size = os.lseek(descriptor, 0, os.SEEK_END)
    end = size
    while end > 0:
        start = max(0, end - 4096)
        os.lseek(descriptor, start, os.SEEK_SET)
        block = os.read(descriptor, end - start)
        newline = block.rfind(b"\n")
        if newline >= 0:
            end = start + newline + 1
            break
        end = start
    if end < size:
        os.ftruncate(descriptor, end)


__all__ = ["MANIFEST", "MANIFEST_PARTS", "Scan", "append", "read", "rewrite", "scan", "sealed"]
