"""Damaged tables and descriptions of a campaign give a page or one error that states what is wrong.

The suite turns warnings into errors, so that no damage may cause a numerical warning either.
"""

import json
import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import report_synthetic as synthetic
from hypothesis import example, given
from hypothesis import strategies as st
from report_damage import BYTES, EXAMPLES, NUMBERS, VALUES, flipped, page_or_error


@pytest.fixture(scope="module")
def light(tmp_path_factory):
    return synthetic.paper_campaign(
        tmp_path_factory.mktemp("damaged") / "light", "light", "table1", ("ls", "iv-lowpass"), 8, 1
    )


@pytest.mark.slow
@EXAMPLES
@given(damage=BYTES, name=st.sampled_from(["estimates.parquet", "truth.parquet"]), alone=st.booleans())
def test_bytes_of_a_table_are_wrong(tmp_path, light, damage, name, alone):
    for file in ("estimates.parquet", "truth.parquet"):
        (tmp_path / file).write_bytes((light / file).read_bytes())
    (tmp_path / name).write_bytes(flipped((light / name).read_bytes(), damage))
    page_or_error(tmp_path / name if alone else tmp_path, tmp_path)


@EXAMPLES
@given(
    name=st.sampled_from(["estimates.parquet", "truth.parquet"]),
    data=st.data(),
    number=NUMBERS,
    kind=st.sampled_from(["number", "text", "empty", "other type", "without", "twice", "no rows"]),
    alone=st.booleans(),
)
def test_a_cell_or_a_column_of_a_table_is_wrong(tmp_path, light, name, data, number, kind, alone):
    for file in ("estimates.parquet", "truth.parquet"):
        (tmp_path / file).write_bytes((light / file).read_bytes())
    table = pq.read_table(light / name)
    column = data.draw(st.sampled_from(table.column_names))
    row = data.draw(st.integers(0, table.num_rows - 1))
    values = table.column(column).to_pylist()
    j = table.column_names.index(column)
    if kind == "without":
        table = table.drop_columns([column])
    elif kind == "twice":
        table = table.append_column(column, table.column(column))
    elif kind == "no rows":
        table = table.slice(0, 0)
    elif kind == "other type":
        table = table.set_column(j, column, pa.array([[str(v)] for v in values]))
    else:
        values[row] = {"number": float(number), "text": "x", "empty": None}[kind]
        try:
            table = table.set_column(j, column, pa.array(values))
        except (pa.ArrowException, TypeError):
            table = table.set_column(j, column, pa.array([str(v) for v in values]))
    pq.write_table(table, tmp_path / name)
    page_or_error(tmp_path / name if alone else tmp_path, tmp_path)


@pytest.mark.slow
@EXAMPLES
@given(entries=st.one_of(VALUES, st.fixed_dictionaries({}, optional={
    "name": VALUES, "title": VALUES, "runs": VALUES, "gust": VALUES
})))  # fmt: skip
def test_the_description_of_a_campaign_is_wrong(tmp_path, light, entries):
    for file in ("estimates.parquet", "truth.parquet"):
        (tmp_path / file).write_bytes((light / file).read_bytes())
    (tmp_path / "campaign.json").write_text(json.dumps(entries))
    page_or_error(tmp_path, tmp_path)


@pytest.mark.long
@pytest.mark.slow
@EXAMPLES
@given(values=st.lists(NUMBERS, min_size=8, max_size=8), column=st.integers(0, 7))
@example(values=[0.0, 0.0, 0.0, math.nan, math.nan, 1.6e308, 1.6e308, 1.6e308], column=0)
def test_estimates_are_of_any_size(tmp_path, light, values, column):
    """A column of wild numbers: each is used or counted, and no formula overflows into a warning."""
    name = synthetic.ESTIMATED[column]
    table = pq.read_table(light / "estimates.parquet")
    wild = np.array([float(v) for v in values] * (table.num_rows // 8))
    for ending in ("", "_lower", "_upper"):
        j = table.column_names.index(name + ending)
        table = table.set_column(j, name + ending, pa.array(wild))
    for file in ("truth.parquet", "campaign.json"):
        (tmp_path / file).write_bytes((light / file).read_bytes())
    pq.write_table(table, tmp_path / "estimates.parquet")
    assert page_or_error(tmp_path, tmp_path)
    assert page_or_error(tmp_path / "estimates.parquet", tmp_path)
