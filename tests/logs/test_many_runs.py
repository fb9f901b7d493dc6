"""Names and files that hold for ten million runs: order of the names, tables in parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.logs import tables
from airtruth.logs.names import chunk_file, ordered_number


def test_names_of_few_digits_have_no_letter() -> None:
    assert [ordered_number(n, 6) for n in (0, 7, 999_999)] == ["000000", "000007", "999999"]
    assert [ordered_number(n, 6) for n in (1_000_000, 9_999_999, 10_000_000)] == [
        "a1000000",
        "a9999999",
        "b10000000",
    ]
    assert (chunk_file(3), chunk_file(100_000)) == ("00003.parquet", "a100000.parquet")


@given(st.integers(0, 10**12), st.integers(0, 10**12))
def test_names_have_the_order_of_their_numbers(one: int, other: int) -> None:
    assert (ordered_number(one, 5) < ordered_number(other, 5)) == (one < other)
    assert (chunk_file(one) < chunk_file(other)) == (one < other)


def test_a_table_in_parts_does_not_depend_on_the_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "ROWS_PER_GROUP", 10)
    frame = pd.DataFrame({"run_id": [f"r{k:03d}" for k in range(37)], "value": np.arange(37.0)})
    whole = pa.Table.from_pandas(frame, preserve_index=False)
    for name, size in (("one", 37), ("each", 1), ("some", 7)):
        parts = (whole.slice(first, size) for first in range(0, 37, size))
        assert tables.write_parts(tmp_path / name, parts, {"schema": 1}) == 37
    assert (tmp_path / "one").read_bytes() == (tmp_path / "each").read_bytes()
    assert (tmp_path / "one").read_bytes() == (tmp_path / "some").read_bytes()
    stored = pq.ParquetFile(tmp_path / "one").metadata
    assert [stored.row_group(k).num_rows for k in range(stored.num_row_groups)] == [10, 10, 10, 7]
    assert tables.read_table(tmp_path / "one").equals(frame)
    assert tables.read_metadata(tmp_path / "one") == {"schema": 1}


def test_a_table_of_one_group_has_the_bytes_of_write_table(tmp_path: Path) -> None:
    frame = pd.DataFrame({"run_id": ["a", "b", "c"], "value": [1.0, np.nan, 3.0]})
    tables.write_table(tmp_path / "table", frame)
    parts = (pa.Table.from_pandas(frame.iloc[k : k + 1], preserve_index=False) for k in range(3))
    tables.write_parts(tmp_path / "parts", parts)
    assert (tmp_path / "parts").read_bytes() == (tmp_path / "table").read_bytes()
