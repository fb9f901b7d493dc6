"""A damaged trace.json or records.parquet gives a page or one error that states what is wrong, never another exception."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from report_damage import BYTES, DELETE, EXAMPLES, NUMBERS, VALUES, changed, flipped, page_or_error, paths
from report_records import trace_folder

from airtruth.logs.histories import FILE

SAMPLE = json.loads((Path(__file__).parent / "trace_sample.json").read_text())
"""A trace of two effects; its candidates are shortened."""

PATHS = sorted(paths(SAMPLE), key=str)


def test_the_sample_is_a_page(tmp_path):
    (tmp_path / "trace.json").write_text(json.dumps(SAMPLE))
    assert page_or_error(tmp_path, tmp_path)


@pytest.mark.slow
@EXAMPLES
@given(at=st.sampled_from(PATHS), value=st.one_of(st.just(DELETE), VALUES))
def test_an_entry_of_the_answer_is_wrong(tmp_path, at, value):
    (tmp_path / "trace.json").write_text(json.dumps(changed(SAMPLE, at, value)))
    page_or_error(tmp_path, tmp_path)


@EXAMPLES
@given(damage=BYTES)
def test_bytes_of_the_answer_are_wrong(tmp_path, damage):
    (tmp_path / "trace.json").write_bytes(flipped(json.dumps(SAMPLE).encode(), damage))
    page_or_error(tmp_path, tmp_path)


@pytest.mark.parametrize(
    "text", ["", "[]", "null", "1" * 5000, "[" * 100_000, '{"verdict": 1}', '{"verdict": "none"}', "\ufeff{}"]
)
def test_the_answer_is_something_else(tmp_path, text):
    (tmp_path / "trace.json").write_text(text)
    assert not page_or_error(tmp_path, tmp_path)


FEWER = settings(EXAMPLES, max_examples=20)
"""A page with records takes longer."""


@pytest.fixture(scope="module")
def traced(tmp_path_factory):
    return trace_folder(tmp_path_factory.mktemp("traced"), records=2, samples=60)


RECORDS = {
    "channels": ["alpha_rad", "q_rad_s", "az_m_s2"],
    "models": ["declared", "before", "after"],
    "shown": "r2",
    "of_records": 2,
    "innovations": True,
    "effect": True,
    "records": {"r1": {"group": "fitted", "floor": {"alpha_rad": 0.1}, "conditions": {"mass_kg": 26.0}}},
    "facts": {
        "effect": {"title": "t", "lines": [{"x": [0.0, 1.0], "y": [0.0, 1.0], "label": ""}], "rows": []},
        "provenance": {"version": "1", "aircraft": "gtm", "options": {"a": "b"}, "digests": {"c": "d"}},
    },
}
"""What records.parquet states about its columns."""


def damaged(traced, folder, change):
    """A copy of the trace whose table of records is changed."""
    (folder / "trace.json").write_bytes((traced / "trace.json").read_bytes())
    pq.write_table(change(pq.read_table(traced / FILE)), folder / FILE)
    return folder


@pytest.mark.slow
@FEWER
@given(at=st.sampled_from(sorted(paths(RECORDS), key=str)), value=st.one_of(st.just(DELETE), VALUES))
def test_an_entry_about_the_records_is_wrong(traced, tmp_path, at, value):
    stated = json.dumps({"histories": changed(RECORDS, at, value)})
    page_or_error(
        damaged(traced, tmp_path, lambda t: t.replace_schema_metadata({"airtruth": stated})), tmp_path
    )


@pytest.mark.slow
@FEWER
@given(values=st.lists(NUMBERS, min_size=8, max_size=8), column=st.integers(1, 24))
def test_records_are_of_any_size(traced, tmp_path, values, column):
    """Numbers that are not finite, and numbers whose squares overflow, still give a page."""

    def change(table):
        wild = np.resize(np.array([float(v) for v in values]), table.num_rows)
        name = table.column_names[column % table.num_columns or 1]
        return table.set_column(table.column_names.index(name), name, pa.array(wild))

    assert page_or_error(damaged(traced, tmp_path, change), tmp_path)


@FEWER
@given(damage=BYTES)
def test_bytes_of_the_records_are_wrong(traced, tmp_path, damage):
    (tmp_path / "trace.json").write_bytes((traced / "trace.json").read_bytes())
    (tmp_path / FILE).write_bytes(flipped((traced / FILE).read_bytes(), damage))
    page_or_error(tmp_path, tmp_path)
