"""The manifest of a campaign: one JSON object per line, appended as things happen, for resuming."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from airtruth.errors import StoreError
from airtruth.logs.atomic import sync_folder, write_error


def append(path: Path | str, *records: Mapping[str, object]) -> None:
    """Append records, each as one line, and flush them to the disk.

    One process writes a manifest. A line that a killed writer left unfinished is removed first.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    path = Path(path)
    lines = b"".join(json.dumps(record, allow_nan=False).encode() + b"\n" for record in records)
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
    """Records of a manifest in the order of writing; none if it does not exist.

    A last line without its end, as a killed writer leaves it, is passed over.

    Raises
    ------
    StoreError
        If the file cannot be read, or another line is not a JSON object; lists those lines.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StoreError(f"{path}: cannot be read; {error.strerror}") from error
    records, bad = _parse(content.split(b"\n")[:-1])
    if bad:
        shown = "; ".join(bad[:5]) + (f"; and {len(bad) - 5} more" if len(bad) > 5 else "")
        raise StoreError(
            f"{path}: {shown}. Only the last line of a manifest can be torn, so the file was changed by "
            "something else: restore it, or remove it and fly the campaign again"
        )
    return records


def _parse(lines: Iterable[bytes]) -> tuple[list[dict[str, object]], list[str]]:
    records: list[dict[str, object]] = []
    bad = []
    for number, line in enumerate(lines, start=1):
        try:
            record = json.loads(line)
        except ValueError as error:
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


__all__ = ["append", "read"]
