"""The truth of a campaign: a file for each chunk while it is flown, one file once it is complete."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
import pyarrow as pa

from airtruth.errors import StoreError
from airtruth.logs.digest import sha256_of, sha256_of_each
from airtruth.logs.names import chunk_file
from airtruth.logs.remote import REQUESTS, RemotePath, each
from airtruth.logs.tables import group_ends, opened, read_group, table_bytes, write_parts
from airtruth.simulation.campaign.chunk import FlownChunk
from airtruth.simulation.campaign.numbering import chunk_offsets
from airtruth.simulation.campaign.plan import Plan

TRUTH: Final = "truth.parquet"
"""File of the declared derivatives and the air of each run; see `airtruth.simulation.campaign.chunk.truth_row`."""
PARTS: Final = "truth-parts"
"""Folder of the truth of each chunk until the campaign is complete."""


@dataclass(frozen=True)
class Truths:
    """The truth in a campaign's folder.

    Attributes
    ----------
    plan, out : the campaign and its folder.
    in_parts : chunks with an intact file of their own.
    merged : further chunks whose truth is intact in truth.parquet.
    """

    plan: Plan
    out: Path
    in_parts: frozenset[int]
    merged: frozenset[int]

    @property
    def intact(self) -> frozenset[int]:
        """Chunks whose truth is intact."""
        return self.in_parts | self.merged

    def content(self, chunk: FlownChunk) -> bytes | None:
        """Bytes of a merged chunk's own file; None if truth.parquet does not hold the chunk."""
        first = int(chunk_offsets(self.plan.table, np.array([chunk.chunk]))[0])
        end = first + chunk.runs
        try:
            own = self._merged.rows(first, end)
        except StoreError:
            return None
        if "run_id" not in own or list(own["run_id"]) != list(self.plan.table["run_id"].iloc[first:end]):
            return None
        return table_bytes(own)

    @cached_property
    def _merged(self) -> _Merged:
        return _Merged(self.out / TRUTH)


class _Merged:
    """Rows of truth.parquet by their numbers; the memory holds the row groups of the last ones."""

    def __init__(self, path: Path) -> None:
        self._path, self._ends = path, group_ends(path)
        self._groups: dict[int, pd.DataFrame] = {}

    def rows(self, first: int, end: int) -> pd.DataFrame:
        """Rows from number ``first`` to before ``end``; fewer where the file ends."""
        low, high = np.searchsorted(self._ends, [first, end - 1], side="right").tolist()
        kept = range(low, min(high + 1, len(self._ends)))
        self._groups = {k: self._groups[k] if k in self._groups else read_group(self._path, k) for k in kept}
        if not kept:
            return pd.DataFrame()
        start = int(self._ends[kept[0]]) - len(self._groups[kept[0]])
        return pd.concat(self._groups.values()).iloc[first - start : end - start].reset_index(drop=True)


def find(plan: Plan, out: Path, chunks: Mapping[int, FlownChunk], digest: str | None) -> Truths:
    """Find the chunks whose truth is intact.

    Parameters
    ----------
    plan, out : the campaign and its folder.
    chunks : recorded chunks by their numbers.
    digest : SHA-256 of truth.parquet; None if it is not recorded.

    Raises
    ------
    StoreError
        If a file cannot be read.
    """
    known: frozenset[int] = frozenset()
    if (out / PARTS).exists():
        found = sha256_of_each([out / PARTS / chunk_file(number) for number in chunks])
        known = frozenset(
            number
            for number, sha256 in zip(chunks, found, strict=True)
            if sha256 == chunks[number].truth_sha256
        )
    others = frozenset(chunks) - known
    if not others:
        return Truths(plan, out, known, frozenset())
    if digest is not None and sha256_of(out / TRUTH) == digest:
        return Truths(plan, out, known, others)
    whole = Truths(plan, out, known, others)
    compared = ((number, whole.content(chunks[number])) for number in sorted(others))
    same = {n for n, rows in compared if rows is not None and _sha256(rows) == chunks[n].truth_sha256}
    return Truths(plan, out, known, frozenset(same))


def merge(out: Path, chunks: Sequence[FlownChunk]) -> None:
    """Write truth.parquet from the files of the chunks, in their order; the memory holds a part of it.

    Raises
    ------
    StoreError
        If a file cannot be read or written.
    """
    write_parts(out / TRUTH, _parts([out / PARTS / chunk_file(chunk.chunk) for chunk in chunks]))


def remove_parts(out: Path) -> None:
    """Remove the files of the chunks, and their folder if it holds nothing else.

    Raises
    ------
    StoreError
        If a store refuses.
    """
    parts = list((out / PARTS).glob("*.parquet"))
    if isinstance(out, RemotePath):
        each(lambda part: part.unlink(missing_ok=True), parts)
    else:
        for part in parts:
            part.unlink()
    if not any((out / PARTS).iterdir()):
        (out / PARTS).rmdir()


def _parts(paths: Sequence[Path]) -> Iterator[pa.Table]:
    for first in range(0, len(paths), REQUESTS):
        group = paths[first : first + REQUESTS]
        yield from each(_read, group) if isinstance(group[0], RemotePath) else map(_read, group)


def _read(path: Path) -> pa.Table:
    with opened(path) as file:
        return file.read(use_threads=False)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


__all__ = ["PARTS", "TRUTH", "Truths", "find", "merge", "remove_parts"]
